//! Where a surface faces: the directions that most of it is parallel or at right angles to.

use hashbrown::HashMap;
use nalgebra::{Matrix3, Unit, Vector3};

use super::Surface;

/// cos of the angle within which two directions are one (a quarter of a degree).
const ALIKE: f64 = 0.999_99;
/// |cos| below which two directions are at right angles.
pub const SQUARE: f64 = 0.005;
/// The directions of a part's surfaces that are looked at: those with the most area.
const MOST_NORMALS: usize = 32;
/// Normals are first put into buckets of this many to the unit, and those with the most area looked
/// at: a free form has as many normals as triangles.
const BUCKETS: f64 = 500.0;
const MOST_BUCKETS: usize = 512;
/// The share of a part's surface that must agree on an axis.
const LEAST_SHARE: f64 = 0.5;
/// cos of the angle within which an axis stands for a part's own (3 degrees).
pub const NEAR_AXIS: f64 = 0.9986;
/// Eigenvalues of a turned part, as shares of their sum: two differ by less than this …
const TURNED_ALIKE: f64 = 0.03;
/// … and the third by more than that.
const TURNED_APART: f64 = 0.06;

/// A direction and the surface that speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedDirection {
    /// The direction; its opposite is the same one.
    pub direction: Unit<Vector3<f64>>,
    /// Area that is parallel or at right angles to it.
    pub weight: f64,
}

impl WeightedDirection {
    /// Whether a direction, or its opposite, is this one.
    #[must_use]
    pub fn is_like(&self, direction: &Unit<Vector3<f64>>) -> bool {
        self.direction.dot(direction).abs() > ALIKE
    }

    /// Adds its weight to that of the same direction among some, or itself to them.
    pub fn count_among(self, all: &mut Vec<Self>) {
        match all.iter_mut().find(|known| known.is_like(&self.direction)) {
            Some(known) => known.weight += self.weight,
            None => all.push(self),
        }
    }
}

/// Where a shape's surface faces, in its frame.
#[derive(Debug, Clone)]
pub struct Faces {
    /// The normals with the most area, opposite ones as one.
    normals: Vec<WeightedDirection>,
    /// The area of the whole surface.
    area: f64,
    /// Directions that enough of the surface agrees on, best first.
    pub candidates: Vec<WeightedDirection>,
    /// The axis that the shape is turned about, or else the best candidate.
    pub own: Option<WeightedDirection>,
    /// Of a shape whose surface agrees on none, the principal axes that stand apart: an open ring has them
    /// along and across its gap.
    pub principal: Vec<WeightedDirection>,
}

impl Faces {
    pub(super) fn of(surface: &Surface) -> Self {
        let (normals, area) = normals(surface);
        let mut faces = Self { normals, area, candidates: Vec::new(), own: None, principal: Vec::new() };
        faces.candidates = faces.agreed();
        let spread = NormalSpread::of(surface);
        if faces.candidates.is_empty() {
            let principal = (0..3).filter(|&i| spread.apart(i) > TURNED_APART).filter_map(|i| spread.axis(i));
            faces.principal =
                principal.map(|direction| WeightedDirection { direction, weight: area }).collect();
        }
        let turned = spread.turning_axis().map(|axis| {
            let mut known = faces.candidates.iter().chain(&faces.normals).map(|c| c.direction);
            let direction = known.find(|d| d.dot(&axis).abs() > NEAR_AXIS).unwrap_or(axis);
            WeightedDirection { direction, weight: faces.speaking_for(&direction) }
        });
        faces.own = turned.or_else(|| faces.candidates.first().copied());
        faces
    }

    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        let Self { normals, candidates, principal, .. } = self;
        [normals, candidates, principal].map(|list| size_of_val(&**list)).iter().sum()
    }

    /// The area that is parallel or at right angles to a direction.
    #[must_use]
    pub fn speaking_for(&self, direction: &Unit<Vector3<f64>>) -> f64 {
        let speaks = |n: &&WeightedDirection| {
            let cos = n.direction.dot(direction).abs();
            !(SQUARE..=ALIKE).contains(&cos)
        };
        self.normals.iter().filter(speaks).map(|n| n.weight).sum()
    }

    fn agreed(&self) -> Vec<WeightedDirection> {
        let Some(largest) = self.normals.first() else { return Vec::new() };
        let mut out: Vec<WeightedDirection> = Vec::new();
        // A turned part without flat ends shows its axis as what two of its sides have in common.
        let sides = self.normals[1..]
            .iter()
            .filter_map(|n| Unit::try_new(largest.direction.cross(&n.direction), 0.1).map(oriented))
            .take(MOST_NORMALS);
        for direction in self.normals.iter().take(MOST_NORMALS).map(|n| n.direction).chain(sides) {
            if out.iter().any(|c| c.is_like(&direction)) {
                continue;
            }
            let weight = self.speaking_for(&direction);
            if weight > LEAST_SHARE * self.area {
                out.push(WeightedDirection { direction, weight });
            }
        }
        out.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        out
    }
}

/// How the normals of a shape are spread: ∫nnᵀdA, and its eigenvalues as shares of their sum.
struct NormalSpread {
    axes: Matrix3<f64>,
    shares: Vector3<f64>,
}

impl NormalSpread {
    fn of(surface: &Surface) -> Self {
        let mut spread = Matrix3::zeros();
        for t in 0..surface.triangles().len() as u32 {
            let [a, b, c] = surface.corners(t);
            let twice = (b - a).cross(&(c - a));
            let area = twice.norm();
            if area > 0.0 {
                spread += twice * twice.transpose() / area;
            }
        }
        let eigen = spread.symmetric_eigen();
        Self { axes: eigen.eigenvectors, shares: eigen.eigenvalues / spread.trace() }
    }

    /// How far an eigenvalue is from the nearer of the two others.
    fn apart(&self, i: usize) -> f64 {
        let from = |j: usize| (self.shares[i] - self.shares[j]).abs();
        from((i + 1) % 3).min(from((i + 2) % 3))
    }

    fn axis(&self, i: usize) -> Option<Unit<Vector3<f64>>> {
        Unit::try_new(self.axes.column(i).into_owned(), 0.5).map(oriented)
    }

    /// The axis of a shape whose normals are spread alike all around it, as those of a bolt or a nut are,
    /// threads included: an eigenvalue stands apart from two others that are equal.
    fn turning_axis(&self) -> Option<Unit<Vector3<f64>>> {
        let alike = |i: usize| (self.shares[(i + 1) % 3] - self.shares[(i + 2) % 3]).abs() < TURNED_ALIKE;
        self.axis((0..3).find(|&i| alike(i) && self.apart(i) > TURNED_APART)?)
    }
}

/// The directions in which most of a shape's surface faces, with their areas, largest first;
/// opposite ones are one. Also the area of the whole surface.
fn normals(surface: &Surface) -> (Vec<WeightedDirection>, f64) {
    let mut buckets: HashMap<[i16; 3], WeightedDirection> = HashMap::new();
    let mut area = 0.0;
    for t in 0..surface.triangles().len() as u32 {
        let [a, b, c] = surface.corners(t);
        let twice = (b - a).cross(&(c - a));
        let Some(direction) = Unit::try_new(twice, 1e-12).map(oriented) else { continue };
        let weight = twice.norm() / 2.0;
        area += weight;
        let key = direction.map(|x| (x * BUCKETS).round() as i16).into();
        buckets.entry(key).or_insert(WeightedDirection { direction, weight: 0.0 }).weight += weight;
    }
    let mut largest: Vec<_> = buckets.into_iter().collect();
    // The keys decide among equals, so that the order of the map does not.
    type Bucket = ([i16; 3], WeightedDirection);
    let order = |(k, a): &Bucket, (l, b): &Bucket| b.weight.total_cmp(&a.weight).then(k.cmp(l));
    if largest.len() > MOST_BUCKETS {
        largest.select_nth_unstable_by(MOST_BUCKETS, order);
        largest.truncate(MOST_BUCKETS);
    }
    largest.sort_by(order);
    let mut out = Vec::new();
    for (_, c) in largest {
        c.count_among(&mut out);
    }
    out.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    (out, area)
}

/// The same axis, its largest component positive.
#[must_use]
pub fn oriented(d: Unit<Vector3<f64>>) -> Unit<Vector3<f64>> {
    if d[d.iamax()] < 0.0 { -d } else { d }
}
