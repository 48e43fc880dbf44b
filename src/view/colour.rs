//! Colours that tell neighbours apart, also to the colour-blind.

use std::collections::{HashMap, HashSet};

/// Red, green and blue as on screens (sRGB).
pub type Rgb = [u8; 3];

/// The palette of Okabe and Ito 2008 ("Color Universal Design") without black, and a light grey.
pub const PALETTE: [Rgb; 8] = [
    [0x56, 0xB4, 0xE9],
    [0xE6, 0x9F, 0x00],
    [0x00, 0x9E, 0x73],
    [0xF0, 0xE4, 0x42],
    [0xBB, 0xBB, 0xBB],
    [0xCC, 0x79, 0xA7],
    [0x00, 0x72, 0xB2],
    [0xD5, 0x5E, 0x00],
];

/// A place in the palette for every part. Equal parts (of one class) have the same; of two classes whose parts touch, one
/// that no other of them has if there is one, the largest parts first; else one that the fewest classes have.
#[must_use]
pub(super) fn colours(classes: &[usize], sizes: &[f64], neighbours: &[Vec<usize>]) -> Vec<usize> {
    let size = |class: usize| {
        (0..classes.len()).filter(|&p| classes[p] == class).map(|p| sizes[p]).fold(0.0, f64::max)
    };
    let mut order: Vec<usize> = classes.to_vec();
    order.sort_unstable();
    order.dedup();
    // Stable: of classes of one size the first.
    order.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
    let mut colours: HashMap<usize, usize> = HashMap::new();
    for &class in &order {
        let own = (0..classes.len()).filter(|&p| classes[p] == class);
        let around: HashSet<usize> =
            own.flat_map(|p| &neighbours[p]).map(|&n| classes[n]).filter(|&other| other != class).collect();
        let count = |colour: usize, is_near: bool| {
            let is_counted =
                |(other, own): &(&usize, &usize)| **own == colour && (!is_near || around.contains(*other));
            colours.iter().filter(is_counted).count()
        };
        let best =
            (0..PALETTE.len()).min_by_key(|&colour| (count(colour, true), count(colour, false), colour));
        // There is always a least one: the palette is not empty.
        colours.insert(class, best.unwrap_or(0));
    }
    classes.iter().map(|class| colours[class]).collect()
}

#[cfg(test)]
mod tests {
    use super::colours;

    #[test]
    fn equal_parts_agree_and_neighbours_differ() {
        // A plate, four bolts in it, of which the last two touch each other, and a pin in the plate.
        let neighbours = [vec![1, 2, 3, 4, 5], vec![0], vec![0], vec![0, 4], vec![0, 3], vec![0]];
        let c = colours(&[0, 1, 1, 1, 1, 2], &[9.0, 1.0, 1.0, 1.0, 1.0, 2.0], &neighbours);
        assert!(c[1..5].iter().all(|&colour| colour == c[1]), "{c:?}");
        assert!(c[0] != c[1] && c[5] != c[0] && c[5] != c[1], "{c:?}");
    }

    #[test]
    fn large_neighbours_differ_even_where_colours_run_out() {
        let count = 20;
        let all: Vec<Vec<usize>> = (0..count).map(|p| (0..count).filter(|&q| q != p).collect()).collect();
        let sizes: Vec<f64> = (0..count).map(|p| p as f64).collect();
        let c = colours(&(0..count).collect::<Vec<_>>(), &sizes, &all);
        let large: std::collections::HashSet<usize> =
            c[count - super::PALETTE.len()..].iter().copied().collect();
        assert_eq!(large.len(), super::PALETTE.len(), "{c:?}");
        assert!((0..super::PALETTE.len()).all(|k| (2..=3).contains(&c.iter().filter(|&&x| x == k).count())));
    }
}
