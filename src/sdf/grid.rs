//! The sparse grid and its look-ups.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::brick::Brick;
use super::nodes::{BAND, CELLS, FAR_NODE, Lattice, NODES, Nodes};
use super::stored::{StoredBricks, StoredNodes};
use crate::geometry::{Bounds, Surface};

/// Marks a brick without nodes in `slots`.
pub(super) const EMPTY: u32 = u32::MAX;
/// The most bricks of the whole box, empty ones included (16 MB with their bounds); the cell grows until it is met.
pub(super) const MOST_SLOTS: usize = 1 << 21;

/// A built [`Field`](super::Field).
#[derive(Debug)]
pub struct Grid {
    pub(super) origin: Point3<f64>,
    pub(super) cell: f64,
    pub(super) dims: [usize; 3],
    /// Per brick: where its nodes are, or [`EMPTY`].
    pub(super) slots: Vec<u32>,
    /// Per brick without nodes: bound, |bound| ≤ distance anywhere in the brick; signed, unless the
    /// surface is open.
    pub(super) far: Vec<f32>,
    /// Per brick, if the surface is open: whether its middle is inside, computed when it is first used.
    pub(super) far_inside: Vec<OnceLock<bool>>,
    /// Bricks with nodes.
    pub(super) near: Vec<NearBrick>,
    /// The triangles of all bricks, brick by brick.
    pub(super) triangles: Vec<u32>,
    pub(super) surface: Arc<Surface>,
    pub(super) bounds: Bounds,
    /// The file that the grid was read from, if there is one.
    pub(super) file: Option<Arc<StoredBricks>>,
}

/// A brick that the band touches.
#[derive(Debug)]
pub(super) struct NearBrick {
    /// Its place in the grid.
    pub(super) brick: u32,
    /// Which of the field's triangles may be nearest in it, as a range.
    pub(super) triangles: [u32; 2],
    /// Its place in the file, or [`NOT_STORED`](super::stored::NOT_STORED).
    pub(super) stored: u32,
    /// Measured when they are first used. The result does not depend on when that is, nor on the thread.
    pub(super) nodes: OnceLock<BrickNodes>,
}

/// Where the nodes of a brick are.
#[derive(Debug)]
pub(super) enum BrickNodes {
    /// Measured here.
    Filled(Box<Nodes>),
    /// In the file.
    Stored(StoredNodes),
}

impl Deref for BrickNodes {
    type Target = Nodes;

    #[inline]
    fn deref(&self) -> &Nodes {
        match self {
            Self::Filled(nodes) => nodes,
            Self::Stored(nodes) => nodes,
        }
    }
}

/// What a field knows about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldEstimate {
    /// No surface point is nearer than this where it is positive; negative means "maybe inside".
    pub lower_bound: f64,
    /// Interpolated signed distance (in far bricks: the bound).
    pub value: f64,
}

/// The interpolated field at a point, with its derivatives inside the cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldSample {
    /// Interpolated signed distance; where there are no nodes, the bound (see [`FieldEstimate`]).
    pub value: f64,
    /// Its gradient; zero where there are no nodes.
    pub gradient: Vector3<f64>,
    /// Second derivatives ∂²/∂y∂z, ∂²/∂z∂x, ∂²/∂x∂y: all that trilinear interpolation has.
    pub mixed: Vector3<f64>,
}

impl FieldSample {
    /// The matrix of second derivatives.
    #[must_use]
    pub fn hessian(&self) -> Matrix3<f64> {
        let [yz, zx, xy] = self.mixed.into();
        Matrix3::new(0.0, xy, zx, xy, 0.0, yz, zx, yz, 0.0)
    }

    fn flat(value: f64) -> Self {
        Self { value, gradient: Vector3::zeros(), mixed: Vector3::zeros() }
    }
}

impl Grid {
    /// A grid without bricks around a surface; `None` if it would be too large.
    pub(super) fn empty(surface: &Arc<Surface>, cell: f64) -> Option<Self> {
        let bounds = surface.bounds();
        let side = cell * CELLS as f64;
        // A brick of margin on every side, so that "outside" is connected.
        let origin = bounds.min.map(|x| ((x / side).floor() - 1.0) * side);
        let dims = std::array::from_fn(|a| ((bounds.max[a] - origin[a]) / side).ceil() as usize + 1);
        let slots = dims.iter().product::<usize>();
        (slots <= MOST_SLOTS).then(|| Self {
            origin,
            cell,
            dims,
            slots: vec![EMPTY; slots],
            far: Vec::new(),
            far_inside: Vec::new(),
            near: Vec::new(),
            triangles: Vec::new(),
            surface: Arc::clone(surface),
            bounds: *bounds,
            file: None,
        })
    }

    /// Cell size, in the shape's units.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// How far an interpolated value in the band can be from the true distance: distances are
    /// 1-Lipschitz, so the weighted mean over a cell's corners is off by at most the distance from
    /// its centre to a corner.
    #[must_use]
    pub fn error_bound(&self) -> f64 {
        self.cell * 0.87
    }

    /// Bytes in memory, without the bricks in a file.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.slots.len() * 8
            + self.far_inside.len() * size_of::<OnceLock<bool>>()
            + self.triangles.len() * 4
            + self.near.len() * size_of::<NearBrick>()
            + self.filled() * size_of::<Nodes>()
    }

    /// Bricks that were measured by this process, and so are in no file.
    #[must_use]
    pub fn filled(&self) -> usize {
        self.near.iter().filter(|near| matches!(near.nodes.get(), Some(BrickNodes::Filled(_)))).count()
    }

    /// Bricks in the file that the grid was read from, and whether one of them was found damaged.
    #[must_use]
    pub fn in_its_file(&self) -> (usize, bool) {
        self.file.as_ref().map_or((0, false), |file| (file.count(), file.is_damaged()))
    }

    /// Bricks that the band touches.
    #[must_use]
    pub fn bricks(&self) -> usize {
        self.near.len()
    }

    /// Fills all bricks, in parallel on the current rayon pool.
    pub fn fill(&self) {
        (0..self.near.len() as u32).into_par_iter().for_each(|slot| {
            self.nodes(slot);
        });
    }

    /// A bound and an estimate of the signed distance at `p`.
    #[must_use]
    pub fn estimate(&self, p: &Point3<f64>) -> FieldEstimate {
        let Some((brick, local)) = self.locate(p) else {
            let d = self.bounds.distance(p);
            return FieldEstimate { lower_bound: d, value: d };
        };
        let slot = self.slots[brick];
        if slot == EMPTY {
            let d = self.far(brick);
            return FieldEstimate { lower_bound: d, value: d };
        }
        let (base, f) = corner(&local);
        let value = trilinear(around(self.nodes(slot), base), &f);
        let boxed = self.bounds.distance(p);
        FieldEstimate { lower_bound: (value - self.error_bound()).max(boxed), value }
    }

    /// The value of [`Grid::sample`], to the bit.
    #[must_use]
    pub fn value(&self, p: &Point3<f64>) -> f64 {
        let Some((brick, local)) = self.locate(p) else { return self.bounds.distance(p) };
        let slot = self.slots[brick];
        if slot == EMPTY {
            return self.far(brick);
        }
        let (base, f) = corner(&local);
        trilinear(around(self.nodes(slot), base), &f)
    }

    /// The interpolated value at `p` and its exact derivatives. They jump at the faces of cells.
    #[must_use]
    pub fn sample(&self, p: &Point3<f64>) -> FieldSample {
        let Some((brick, local)) = self.locate(p) else {
            return FieldSample::flat(self.bounds.distance(p));
        };
        let slot = self.slots[brick];
        if slot == EMPTY {
            return FieldSample::flat(self.far(brick));
        }
        let (base, f) = corner(&local);
        let mut sample = trilinear_derivatives(around(self.nodes(slot), base), &f);
        sample.gradient /= self.cell;
        sample.mixed /= self.cell * self.cell;
        sample
    }

    /// `p` is no deeper inside than this; infinite where the field does not know. On open surfaces
    /// only a guess: their sign may change where there is no triangle.
    #[must_use]
    pub fn deepest(&self, p: &Point3<f64>) -> f64 {
        let Some((brick, local)) = self.locate(p) else { return 0.0 };
        let slot = self.slots[brick];
        if slot == EMPTY {
            return if self.far(brick) < 0.0 { f64::INFINITY } else { 0.0 };
        }
        let (base, f) = corner(&local);
        // Values stand at the band's half-width beyond it; cut off so, distances are still
        // 1-Lipschitz, and the error bound holds for them.
        let depth = self.error_bound() - trilinear(around(self.nodes(slot), base), &f);
        if depth < BAND * self.cell { depth.max(0.0) } else { f64::INFINITY }
    }

    /// A triangle that is likely to be the nearest to `p`, or nearly: that of a node around it;
    /// `None` outside the band.
    #[must_use]
    pub fn likely_nearest(&self, p: &Point3<f64>) -> Option<u32> {
        let (brick, local) = self.locate(p)?;
        let slot = self.slots[brick];
        if slot == EMPTY {
            return None;
        }
        let (base, f) = corner(&local);
        let closest = usize::from(f.x > 0.5) | usize::from(f.y > 0.5) << 1 | usize::from(f.z > 0.5) << 2;
        // All corners, the closest first: a cell at the band's edge has nodes beyond it.
        let nodes = self.nodes(slot);
        let known = |k: usize| Some(nodes.nearest[base + CORNERS[closest ^ k]]).filter(|t| *t != FAR_NODE);
        (0..8).find_map(known)
    }

    /// The nodes of a brick, taken from the file or measured when they are first used.
    #[inline]
    pub(super) fn nodes(&self, slot: u32) -> &Nodes {
        let near = &self.near[slot as usize];
        near.nodes.get_or_init(|| {
            self.in_file(near)
                .map_or_else(|| BrickNodes::Filled(Box::new(self.measured(near))), BrickNodes::Stored)
        })
    }

    fn measured(&self, near: &NearBrick) -> Nodes {
        let [start, end] = near.triangles.map(|i| i as usize);
        let lattice = Lattice { origin: self.brick_min(near.brick as usize), cell: self.cell };
        let brick = Brick { surface: &self.surface, lattice };
        brick.nodes(&self.triangles[start..end])
    }

    pub(super) fn brick_min(&self, brick: usize) -> Point3<f64> {
        let [nx, ny, _] = self.dims;
        let at = Vector3::new((brick % nx) as f64, (brick / nx % ny) as f64, (brick / (nx * ny)) as f64);
        self.origin + at * (self.cell * CELLS as f64)
    }

    /// The nodes of a brick in the file, if it has them.
    pub(super) fn in_file(&self, near: &NearBrick) -> Option<StoredNodes> {
        StoredNodes::of(self.file.as_ref()?, near.stored)
    }

    /// Brick index and position inside the brick in cells.
    #[inline]
    fn locate(&self, p: &Point3<f64>) -> Option<(usize, Vector3<f64>)> {
        let g = (p - self.origin) / (self.cell * CELLS as f64);
        let mut at = [0usize; 3];
        let mut local = Vector3::zeros();
        for a in 0..3 {
            if !(g[a] >= 0.0 && g[a] < self.dims[a] as f64) {
                return None;
            }
            at[a] = g[a] as usize;
            local[a] = (g[a] - at[a] as f64) * CELLS as f64;
        }
        Some(((at[2] * self.dims[1] + at[1]) * self.dims[0] + at[0], local))
    }
}

const CORNERS: [usize; 8] = [
    0,
    1,
    NODES,
    NODES + 1,
    NODES * NODES,
    NODES * NODES + 1,
    NODES * NODES + NODES,
    NODES * NODES + NODES + 1,
];

/// The values from the lowest to the highest corner of the cell whose lowest one is at `base`: one
/// check of bounds for all eight.
#[inline]
fn around(nodes: &Nodes, base: usize) -> &[f32] {
    &nodes.values[base..=base + CORNERS[7]]
}

/// Index of the lowest corner of the cell, and the position inside it in 0..=1.
#[inline]
fn corner(local: &Vector3<f64>) -> (usize, Vector3<f64>) {
    let i = local.map(|x| (x as usize).min(CELLS - 1));
    let f = Vector3::new(local.x - i.x as f64, local.y - i.y as f64, local.z - i.z as f64);
    ((i.z * NODES + i.y) * NODES + i.x, f)
}

#[inline]
fn trilinear(v: &[f32], f: &Vector3<f64>) -> f64 {
    let c = |k: usize| f64::from(v[CORNERS[k]]);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let x0 = lerp(c(0), c(1), f.x);
    let x1 = lerp(c(2), c(3), f.x);
    let x2 = lerp(c(4), c(5), f.x);
    let x3 = lerp(c(6), c(7), f.x);
    lerp(lerp(x0, x1, f.y), lerp(x2, x3, f.y), f.z)
}

/// Value and derivatives in units of the cell.
fn trilinear_derivatives(v: &[f32], f: &Vector3<f64>) -> FieldSample {
    let c = |k: usize| f64::from(v[CORNERS[k]]);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    // Differences along x on the four edges, then values on them.
    let d = [c(1) - c(0), c(3) - c(2), c(5) - c(4), c(7) - c(6)];
    let x = [c(0) + d[0] * f.x, c(2) + d[1] * f.x, c(4) + d[2] * f.x, c(6) + d[3] * f.x];
    let (below, above) = (lerp(x[0], x[1], f.y), lerp(x[2], x[3], f.y));
    let (d_below, d_above) = (lerp(d[0], d[1], f.y), lerp(d[2], d[3], f.y));
    let (y_below, y_above) = (x[1] - x[0], x[3] - x[2]);
    FieldSample {
        value: lerp(below, above, f.z),
        gradient: Vector3::new(lerp(d_below, d_above, f.z), lerp(y_below, y_above, f.z), above - below),
        mixed: Vector3::new(y_above - y_below, d_above - d_below, lerp(d[1] - d[0], d[3] - d[2], f.z)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::build::Threads;
    use super::*;
    use crate::fixtures::{ball, l_shape, spread, surface};
    use crate::termination::Termination;

    /// Solids with their fields and points in and around the band, none within 1e-6 of a face of a
    /// cell, where derivatives jump.
    fn cases() -> Vec<(Arc<Surface>, Grid, Vec<Point3<f64>>)> {
        let case = |mesh| {
            let s = Arc::new(surface(mesh));
            let field = Grid::build(&s, Threads::All, &Termination::default()).unwrap();
            let b = s.bounds().grown(0.05);
            let inside_a_cell = |p: &Point3<f64>| {
                let at = (p - field.origin) / field.cell;
                at.iter().all(|x| (0.01..0.99).contains(&x.fract()))
            };
            let points = spread(b.min.into(), b.max.into(), 40_000).filter(inside_a_cell);
            let near = points.filter(|p| s.signed_distance(p).abs() < 2.0 * field.cell).collect();
            (s, field, near)
        };
        vec![case(ball(3)), case(l_shape())]
    }

    #[test]
    fn derivatives_are_those_of_the_interpolated_value() {
        for (_, field, points) in cases() {
            let e = 1e-3 * field.cell;
            assert!(points.len() > 500);
            for p in points {
                let sample = field.sample(&p);
                assert_eq!((sample.value, sample.value), (field.value(&p), field.estimate(&p).value));
                let hessian = sample.hessian();
                for a in 0..3 {
                    let mut h = Vector3::zeros();
                    h[a] = e;
                    let (below, above) = (field.sample(&(p - h)), field.sample(&(p + h)));
                    let slope = (above.value - below.value) / (2.0 * e);
                    assert!((sample.gradient[a] - slope).abs() < 1e-8, "{sample:?} for {slope} at {p}");
                    let bend = (above.gradient - below.gradient) / (2.0 * e);
                    let off = (hessian.column(a) - bend).norm() * field.cell;
                    assert!(off < 1e-8, "{hessian} for {bend} at {p}");
                }
            }
        }
    }

    #[test]
    fn far_from_the_surface_a_sample_is_flat() {
        let (_, field, _) = cases().swap_remove(0);
        for p in [Point3::origin(), Point3::new(1e3, 0.0, 0.0)] {
            assert_eq!(field.sample(&p), FieldSample::flat(field.estimate(&p).value));
        }
    }

    #[test]
    fn no_point_is_deeper_than_the_bound_on_its_depth() {
        for (s, field, near) in cases() {
            let b = s.bounds().grown(0.2);
            let mut known = 0;
            for p in spread(b.min.into(), b.max.into(), 4000).chain(near) {
                let (bound, depth) = (field.deepest(&p), -s.signed_distance(&p));
                assert!(depth <= bound + 1e-9, "{depth} deep for {bound} at {p}");
                known += usize::from(bound.is_finite());
            }
            assert!(known > 1000, "{known} bounds");
        }
    }
}
