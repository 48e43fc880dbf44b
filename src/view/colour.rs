//! Colours that tell neighbours apart, also to the colour-blind.

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

/// A place in the palette for every part, greedily in the parts' order: none of its neighbours' if there is
/// one, and of these the one of parts with the same shape, else the one that the fewest parts have.
#[must_use]
pub(super) fn colours(shapes: &[usize], neighbours: &[Vec<usize>]) -> Vec<usize> {
    let mut colours: Vec<usize> = Vec::with_capacity(shapes.len());
    let mut used = [0usize; PALETTE.len()];
    for (part, shape) in shapes.iter().enumerate() {
        let mut near = [0usize; PALETTE.len()];
        for &n in neighbours[part].iter().filter(|&&n| n < part) {
            near[colours[n]] += 1;
        }
        let of_equals = |c: usize| (0..part).any(|p| shapes[p] == *shape && colours[p] == c);
        // There is always a least one: the palette is not empty.
        let best = (0..PALETTE.len()).min_by_key(|&c| (near[c], !of_equals(c), used[c], c)).unwrap_or(0);
        used[best] += 1;
        colours.push(best);
    }
    colours
}

#[cfg(test)]
mod tests {
    use super::colours;

    #[test]
    fn neighbours_differ_and_equals_agree_where_they_can() {
        // A plate, four bolts in it, of which the last two touch each other.
        let neighbours = [vec![1, 2, 3, 4], vec![0], vec![0], vec![0, 4], vec![0, 3]];
        let c = colours(&[0, 1, 1, 1, 1], &neighbours);
        assert!(neighbours.iter().enumerate().all(|(p, near)| near.iter().all(|&n| c[n] != c[p])));
        assert!(c[1] == c[2] && c[2] == c[3] && c[4] != c[3]);
    }

    #[test]
    fn more_neighbours_than_colours_share_them_evenly() {
        let all: Vec<Vec<usize>> = (0..20).map(|p| (0..20).filter(|&q| q != p).collect()).collect();
        let c = colours(&(0..20).collect::<Vec<_>>(), &all);
        assert!((0..super::PALETTE.len()).all(|k| (2..=3).contains(&c.iter().filter(|&&x| x == k).count())));
    }
}
