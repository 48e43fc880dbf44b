//! Where the triangles of a node are split in two.

use crate::geometry::Bounds;

/// Boxes are split at one of so many places along each axis.
const BINS: usize = 16;
/// The smaller side of a split holds at least this share: bounds the depth.
const LEAST_SHARE: usize = 16;

/// A triangle's box. Its corners fill vector registers: the last place of one has the triangle's number, that of the other
/// is padding. Boxes are moved, and not their numbers: what costs is to fetch boxes from all over.
#[derive(Clone, Copy)]
pub(super) struct BoxedTriangle {
    min: [f64; 4],
    max: [f64; 4],
}

/// How many items there are, and the box of them all.
type Counted = (usize, BoxedTriangle);

impl BoxedTriangle {
    const EMPTY: Self = Self { min: [f64::INFINITY; 4], max: [f64::NEG_INFINITY; 4] };

    pub(super) fn new(triangle: u32, bounds: &Bounds) -> Self {
        let padded = |p: [f64; 3], last: f64| [p[0], p[1], p[2], last];
        Self { min: padded(bounds.min.into(), f64::from(triangle)), max: padded(bounds.max.into(), 0.0) }
    }

    pub(super) fn triangle(&self) -> u32 {
        self.min[3] as u32
    }

    pub(super) fn bounds(&self) -> Bounds {
        let point = |[x, y, z, _]: [f64; 4]| [x, y, z].into();
        Bounds { min: point(self.min), max: point(self.max) }
    }

    /// The box of some items.
    pub(super) fn around(items: &[Self]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| all.union(item))
    }

    #[inline]
    fn union(&self, other: &Self) -> Self {
        let (mut min, mut max) = (self.min, self.max);
        for a in 0..4 {
            min[a] = if other.min[a] < min[a] { other.min[a] } else { min[a] };
            max[a] = if other.max[a] > max[a] { other.max[a] } else { max[a] };
        }
        Self { min, max }
    }

    /// Twice the middle.
    #[inline]
    fn middle(&self) -> [f64; 4] {
        std::array::from_fn(|a| self.min[a] + self.max[a])
    }

    fn extent(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }

    fn area(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|a| self.extent(a));
        x * y + y * z + z * x
    }
}

/// Splits items in two where the boxes' areas times their counts get smallest (surface area
/// heuristic), or in the middle if all centres coincide.
pub(super) fn split(items: &mut [BoxedTriangle]) -> (&mut [BoxedTriangle], &mut [BoxedTriangle]) {
    let least = items.len().div_ceil(LEAST_SHARE).max(1);
    let (mut low, mut high) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
    for item in items.iter() {
        let middle = item.middle();
        for a in 0..4 {
            low[a] = if middle[a] < low[a] { middle[a] } else { low[a] };
            high[a] = if middle[a] > high[a] { middle[a] } else { high[a] };
        }
    }
    let scale: [f64; 4] = std::array::from_fn(|a| BINS as f64 / (high[a] - low[a]));
    let is_split = |a: usize| scale[a].is_finite() && high[a] > low[a];
    // All axes in one pass. Along an axis that is not split, anything will do.
    let mut bins = [[(0usize, BoxedTriangle::EMPTY); BINS]; 3];
    for item in items.iter() {
        let middle = item.middle();
        for (a, bins) in bins.iter_mut().enumerate() {
            let bin = &mut bins[(((middle[a] - low[a]) * scale[a]) as usize).min(BINS - 1)];
            *bin = (bin.0 + 1, bin.1.union(item));
        }
    }
    let mut best: Option<(f64, usize, f64)> = None;
    for (a, bins) in bins.iter().enumerate().filter(|(a, _)| is_split(*a)) {
        if let Some((cost, bin)) = cheapest(bins, least, best.map(|(cost, ..)| cost)) {
            best = Some((cost, a, low[a] + bin as f64 / scale[a]));
        }
    }
    let middle = match best {
        Some((_, axis, at)) => {
            parted(items, |item| item.middle()[axis] < at).clamp(least, items.len() - least)
        }
        None => {
            let longest = BoxedTriangle::around(items).bounds().extents().imax();
            items.sort_by(|a, b| a.middle()[longest].total_cmp(&b.middle()[longest]));
            items.len() / 2
        }
    };
    items.split_at_mut(middle)
}

/// The first bin beyond the cheapest split along an axis, and its cost, if that is less than a known one.
fn cheapest(bins: &[Counted; BINS], least: usize, known: Option<f64>) -> Option<(f64, usize)> {
    // Of small groups most bins are empty.
    let mut full = [0usize; BINS];
    let mut count = 0;
    for (k, _) in bins.iter().enumerate().filter(|(_, bin)| bin.0 > 0) {
        full[count] = k;
        count += 1;
    }
    let full = &full[..count];
    let mut above = [(0usize, BoxedTriangle::EMPTY); BINS];
    let mut rest = (0usize, BoxedTriangle::EMPTY);
    for &k in full.iter().rev() {
        above[k] = rest;
        rest = joined(&rest, &bins[k]);
    }
    let mut below = (0usize, BoxedTriangle::EMPTY);
    let (mut known, mut best) = (known, None);
    for &k in full {
        below = joined(&below, &bins[k]);
        let (left, right) = (below.0, above[k].0);
        if left < least || right < least {
            continue;
        }
        let cost = below.1.area() * left as f64 + above[k].1.area() * right as f64;
        if known.is_none_or(|known| cost < known) {
            (known, best) = (Some(cost), Some((cost, k + 1)));
        }
    }
    best
}

/// The items of two bins, and the box of them all.
#[inline]
fn joined(a: &Counted, b: &Counted) -> Counted {
    (a.0 + b.0, a.1.union(&b.1))
}

/// Brings items that pass a test before those that do not, each in the order that they had; how many pass.
fn parted(items: &mut [BoxedTriangle], passes: impl Fn(&BoxedTriangle) -> bool) -> usize {
    let mut rest = Vec::new();
    let mut count = 0;
    for at in 0..items.len() {
        let item = items[at];
        if passes(&item) {
            items[count] = item;
            count += 1;
        } else {
            rest.push(item);
        }
    }
    items[count..].copy_from_slice(&rest);
    count
}
