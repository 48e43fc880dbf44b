//! Building a field: which bricks the band touches, and which triangles may be nearest in each.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::geometry::{Bounds, Surface, closest_on_triangle};
use crate::termination::{Interrupt, Poll, Termination};

use super::grid::{Grid, NearBrick};
use super::nodes::{BAND, CELLS};
use super::stored::NOT_STORED;

/// Cells are no larger than this, in units of the planning frame.
const LARGEST_CELL: f64 = 0.05;
/// Cells along the smallest extent of a part.
const CELLS_ACROSS: f64 = 20.0;
/// Bricks a field may hold (48 MB); the cell grows until it is met.
const MOST_BRICKS: usize = 8192;

/// The threads that build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Threads {
    /// Those of the current rayon pool.
    All,
    /// The caller's.
    This,
}

impl Grid {
    /// Builds the grid of a surface. Its bricks are measured when they are first used: contact uses only a small
    /// share of most parts' bricks.
    pub(super) fn build(
        surface: &Arc<Surface>,
        threads: Threads,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let smallest = surface.bounds().extents().min().max(1e-3);
        let mut cell = 2f64.powf((smallest / CELLS_ACROSS).min(LARGEST_CELL).log2().floor());
        let (mut field, pairs) = loop {
            termination.check()?;
            if let Some(field) = Self::empty(surface, cell)
                && let Some(pairs) = brick_triangles(&field, surface, threads, termination)?
            {
                break (field, pairs);
            }
            cell *= 2.0;
        };
        let mut start = 0;
        for group in pairs.chunk_by(|a, b| a.0 == b.0) {
            let brick = group[0].0;
            let end = start + group.len() as u32;
            field.slots[brick as usize] = field.near.len() as u32;
            let (triangles, stored, nodes) = ([start, end], NOT_STORED, OnceLock::new());
            field.near.push(NearBrick { brick, triangles, stored, nodes });
            start = end;
        }
        field.triangles = pairs.into_iter().map(|(_, t)| t).collect();
        // The field is kept for long.
        field.triangles.shrink_to_fit();
        field.near.shrink_to_fit();
        field.fill_far();
        Ok(field)
    }
}

/// For every brick that the band touches, the triangles that may be nearest in it, both in
/// ascending order. `None` if there are too many bricks.
fn brick_triangles(
    field: &Grid,
    surface: &Surface,
    threads: Threads,
    termination: &Termination,
) -> Result<Option<Vec<(u32, u32)>>, Interrupt> {
    /// Triangles that one task looks at.
    const SHARE: u32 = 64;
    /// The same between two looks at the termination condition: a large one touches many bricks.
    const BAND_POLL: u32 = 8;
    let count = surface.triangles().len() as u32;
    let known: Vec<AtomicBool> = field.slots.iter().map(|_| AtomicBool::new(false)).collect();
    let bricks = AtomicUsize::new(0);
    let share = |task: u32| {
        let poll = Poll::every(BAND_POLL, Some(termination));
        let mut pairs = Vec::new();
        for t in task * SHARE..count.min((task + 1) * SHARE) {
            poll.check()?;
            let fits = bricks_near(field, surface, t, |brick| {
                pairs.push((brick, t));
                let is_new = !known[brick as usize].swap(true, Ordering::Relaxed);
                !is_new || bricks.fetch_add(1, Ordering::Relaxed) < MOST_BRICKS
            });
            if !fits {
                break;
            }
        }
        Ok(pairs)
    };
    let tasks = 0..count.div_ceil(SHARE);
    let shares: Vec<Vec<(u32, u32)>> = match threads {
        Threads::All => tasks.into_par_iter().map(share).collect::<Result<_, _>>()?,
        Threads::This => tasks.map(share).collect::<Result<_, _>>()?,
    };
    if bricks.into_inner() > MOST_BRICKS {
        return Ok(None);
    }
    let mut pairs = shares.concat();
    termination.check()?;
    match threads {
        Threads::All => pairs.par_sort_unstable(),
        Threads::This => pairs.sort_unstable(),
    }
    termination.check()?;
    Ok(Some(pairs))
}

/// Visits the bricks that the band of one triangle touches, until a visit says to stop; whether none
/// did.
fn bricks_near(field: &Grid, surface: &Surface, t: u32, mut visit: impl FnMut(u32) -> bool) -> bool {
    let side = field.cell * CELLS as f64;
    let band = BAND * field.cell;
    let reach = side * 0.5 * 3f64.sqrt() + band;
    let corners = surface.corners(t);
    let b = Bounds::of(&corners).grown(band);
    let lo: [usize; 3] = std::array::from_fn(|a| ((b.min[a] - field.origin[a]) / side).max(0.0) as usize);
    let hi: [usize; 3] =
        std::array::from_fn(|a| (((b.max[a] - field.origin[a]) / side) as usize).min(field.dims[a] - 1));
    let normal = surface.face_normal(t);
    for z in lo[2]..=hi[2] {
        for y in lo[1]..=hi[1] {
            for x in lo[0]..=hi[0] {
                let middle = Vector3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5);
                let centre = field.origin + middle * side;
                if normal.dot(&(centre - corners[0])).abs() > reach {
                    continue;
                }
                let (q, _) = closest_on_triangle(&centre, &corners[0], &corners[1], &corners[2]);
                if (q - centre).norm() > reach {
                    continue;
                }
                if !visit(((z * field.dims[1] + y) * field.dims[0] + x) as u32) {
                    return false;
                }
            }
        }
    }
    true
}
