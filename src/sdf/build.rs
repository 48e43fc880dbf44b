//! Building a field: which bricks the band touches, exact distances in them, signs.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::geometry::{Bounds, Surface, area_normal, closest_on_triangle};
use crate::termination::{Interrupt, Termination};

use super::grid::{BAND, BRICK, CELLS, EMPTY, FAR_NODE, Field, NODES};

/// Cells are no larger than this, in units of the planning frame.
const LARGEST_CELL: f64 = 0.05;
/// Cells along the smallest extent of a part.
const CELLS_ACROSS: f64 = 20.0;
/// Bricks a field may hold (48 MB); the cell grows until it is met.
const MOST_BRICKS: usize = 8192;
/// Bricks of the whole box, empty ones included.
const MOST_SLOTS: usize = 1 << 21;

impl Field {
    /// Builds the field of a surface, in parallel on the current rayon pool.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn build(surface: &Surface, termination: &Termination) -> Result<Self, Interrupt> {
        let smallest = surface.bounds().extents().min().max(1e-3);
        let mut cell = 2f64.powf((smallest / CELLS_ACROSS).min(LARGEST_CELL).log2().floor());
        let (mut field, lists) = loop {
            termination.check()?;
            let field = Self::empty(surface.bounds(), cell);
            if let Some(lists) = field.as_ref().and_then(|f| brick_lists(f, surface))
                && let Some(field) = field
            {
                break (field, lists);
            }
            cell *= 2.0;
        };
        let bricks: Vec<_> = lists
            .par_iter()
            .map(|(brick, triangles)| {
                termination.check()?;
                Ok(brick_nodes(&field, surface, *brick, triangles))
            })
            .collect::<Result<_, Interrupt>>()?;
        for ((brick, _), (values, nearest)) in lists.iter().zip(bricks) {
            // The band may pass between the nodes of a brick without reaching any.
            if nearest.iter().all(|&t| t == FAR_NODE) {
                continue;
            }
            field.slots[*brick] = field.bricks() as u32;
            field.values.extend_from_slice(&values);
            field.nearest.extend_from_slice(&nearest);
        }
        field.fill_far(surface);
        Ok(field)
    }

    /// A grid without bricks around `bounds`; `None` if it would be too large.
    fn empty(bounds: &Bounds, cell: f64) -> Option<Self> {
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
            values: Vec::new(),
            nearest: Vec::new(),
            bounds: *bounds,
        })
    }

    pub(super) fn brick_min(&self, brick: usize) -> Point3<f64> {
        let [nx, ny, _] = self.dims;
        let at = Vector3::new((brick % nx) as f64, (brick / nx % ny) as f64, (brick / (nx * ny)) as f64);
        self.origin + at * (self.cell * CELLS as f64)
    }
}

type BrickList = Vec<(usize, Vec<u32>)>;

/// For every brick that the band touches, the triangles that may be nearest in it, both in
/// ascending order. `None` if there are too many bricks.
fn brick_lists(field: &Field, surface: &Surface) -> Option<BrickList> {
    let side = field.cell * CELLS as f64;
    let band = BAND * field.cell;
    let reach = side * 0.5 * 3f64.sqrt() + band;
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut bricks = 0usize;
    let mut known = vec![false; field.slots.len()];
    for t in 0..surface.triangles().len() as u32 {
        let corners = surface.corners(t);
        let b = Bounds::of(&corners).grown(band);
        let lo: [usize; 3] = std::array::from_fn(|a| ((b.min[a] - field.origin[a]) / side).max(0.0) as usize);
        let hi: [usize; 3] =
            std::array::from_fn(|a| (((b.max[a] - field.origin[a]) / side) as usize).min(field.dims[a] - 1));
        let normal = surface.face_normal(t);
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    let centre =
                        field.origin + Vector3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5) * side;
                    if normal.dot(&(centre - corners[0])).abs() > reach {
                        continue;
                    }
                    let (q, _) = closest_on_triangle(&centre, &corners[0], &corners[1], &corners[2]);
                    if (q - centre).norm() > reach {
                        continue;
                    }
                    let brick = (z * field.dims[1] + y) * field.dims[0] + x;
                    if !std::mem::replace(&mut known[brick], true) {
                        bricks += 1;
                        if bricks > MOST_BRICKS {
                            return None;
                        }
                    }
                    pairs.push((brick as u32, t));
                }
            }
        }
    }
    pairs.sort_unstable();
    let groups = pairs.chunk_by(|a, b| a.0 == b.0);
    Some(groups.map(|g| (g[0].0 as usize, g.iter().map(|p| p.1).collect())).collect())
}

/// Distances and nearest triangles at the nodes of one brick.
fn brick_nodes(field: &Field, surface: &Surface, brick: usize, triangles: &[u32]) -> (Vec<f32>, Vec<u32>) {
    let origin = field.brick_min(brick);
    let band = BAND * field.cell;
    let mut squared = vec![band * band; BRICK];
    let mut nearest = vec![FAR_NODE; BRICK];
    for &t in triangles {
        scatter(field.cell, &origin, surface, t, &mut squared, &mut nearest);
    }
    let mut values = vec![f32::NAN; BRICK];
    for i in 0..BRICK {
        if nearest[i] != FAR_NODE {
            let p = node_at(&origin, field.cell, i);
            values[i] = surface.signed(&p, &surface.closest_on(nearest[i], &p)) as f32;
        }
    }
    fill_untouched(&mut values, band as f32, |i| surface.winding(&node_at(&origin, field.cell, i)));
    (values, nearest)
}

fn node_at(origin: &Point3<f64>, cell: f64, i: usize) -> Point3<f64> {
    let at = Vector3::new((i % NODES) as f64, (i / NODES % NODES) as f64, (i / (NODES * NODES)) as f64);
    origin + at * cell
}

/// Lowers the distances of the nodes within the band of one triangle.
fn scatter(
    cell: f64,
    origin: &Point3<f64>,
    surface: &Surface,
    t: u32,
    squared: &mut [f64],
    nearest: &mut [u32],
) {
    let [a, b, c] = surface.corners(t);
    let bounds = Bounds::of(&[a, b, c]).grown(BAND * cell);
    let lo: [usize; 3] =
        std::array::from_fn(|k| (((bounds.min[k] - origin[k]) / cell).ceil().max(0.0)) as usize);
    let hi: [i64; 3] =
        std::array::from_fn(|k| (((bounds.max[k] - origin[k]) / cell).floor() as i64).min(CELLS as i64));
    let normal = area_normal(&a, &b, &c).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    for z in lo[2] as i64..=hi[2] {
        for y in lo[1] as i64..=hi[1] {
            for x in lo[0] as i64..=hi[0] {
                let i = (z as usize * NODES + y as usize) * NODES + x as usize;
                let p = origin + Vector3::new(x as f64, y as f64, z as f64) * cell;
                let off = normal.dot(&(p - a));
                if off * off >= squared[i] {
                    continue;
                }
                let (q, _) = closest_on_triangle(&p, &a, &b, &c);
                let d = (p - q).norm_squared();
                if d < squared[i] {
                    squared[i] = d;
                    nearest[i] = t;
                }
            }
        }
    }
}

/// Gives nodes outside the band the band's half-width with the sign of the nodes beside them: no
/// surface passes between neighbours of which one is outside the band. Open surfaces are signed
/// node by node, for their sign may change where no triangle is near.
fn fill_untouched(values: &mut [f32], band: f32, winding: impl Fn(usize) -> Option<f64>) {
    const STRIDES: [usize; 3] = [1, NODES, NODES * NODES];
    let mut queue: Vec<usize> = (0..BRICK).filter(|&i| !values[i].is_nan()).collect();
    let unset: Vec<usize> = (0..BRICK).filter(|&i| values[i].is_nan()).collect();
    if let Some(&first) = unset.first()
        && winding(first).is_some()
    {
        for i in unset {
            values[i] = if winding(i).is_some_and(|w| w > 0.5) { -band } else { band };
        }
        return;
    }
    let mut head = 0;
    while head < queue.len() {
        let i = queue[head];
        head += 1;
        let at = [i % NODES, i / NODES % NODES, i / (NODES * NODES)];
        for a in 0..3 {
            for (possible, j) in
                [(at[a] > 0, i.wrapping_sub(STRIDES[a])), (at[a] + 1 < NODES, i + STRIDES[a])]
            {
                if possible && values[j].is_nan() {
                    values[j] = band.copysign(values[i]);
                    queue.push(j);
                }
            }
        }
    }
}
