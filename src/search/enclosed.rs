//! Parts that another part encloses: a proof, by a ball, that two parts never come apart.
//!
//! A ball inside one part goes where the part goes, and the surface of the other part never enters it. So the ball's
//! centre, in the other part's frame, stays at least the radius away from that surface. If all places that are so far
//! away and that the centre can reach lie within the other part's box, or if a closed shell lies around the centre, the
//! two parts never come apart, whichever of them moves and whatever else is removed. The radius is reduced by the depth
//! that verification accepts. Guarantees: no verified path separates a pair that is called enclosed. Not found are
//! parts that only a shape other than a ball holds, as a bayonet, and windows that are narrower than the ball by less
//! than a cell of the finest grid.
//!
//! The places are the cells of a grid. The distance to a surface changes no faster than the place, so no point of a
//! cell is farther away than the cell's centre by more than half of the cell's diagonal.

use std::cmp::Reverse;
use std::collections::hash_map::Entry;
use std::collections::{BinaryHeap, HashMap};

use nalgebra::{Point3, Vector3};

use crate::budgets::{ENCLOSURE_CELLS, ENCLOSURE_GRIDS, LONG_STEPS_PER_POLL};
use crate::geometry::{Bounds, Surface, is_within_closed_shell};
use crate::termination::{Interrupt, Poll};
use crate::tolerances::ROUNDED;

use super::deepest_point::deepest_point;
use super::outcome::{Inseparable, SeparationProof};
use super::problem::Problem;

/// A ball inside a shape or at its place, in a frame that the user knows.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: Point3<f64>,
    radius: f64,
}

/// Whether the centre of a ball can get out of the box of a surface that the ball does not meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Passage {
    Closed,
    Open,
    /// Neither is certain on this grid.
    Unclear,
}

/// The pairs of some parts (ascending) of which one encloses the other, but for those that `is_known` holds for. Pairs
/// of which one part is wanted come first: the number of cells is limited.
///
/// # Errors
/// The termination condition became true.
pub(super) fn enclosed_pairs(
    problem: &Problem<'_>,
    parts: &[usize],
    is_known: impl Fn(usize, usize) -> bool,
) -> Result<Vec<Inseparable>, Interrupt> {
    let scene = &problem.scene;
    let poll = Poll::every(LONG_STEPS_PER_POLL, Some(&problem.termination));
    let wanted = problem.wanted(parts);
    let is_wanted = |part: usize| wanted.binary_search(&part).is_ok();
    let mut budget = ENCLOSURE_CELLS;
    let mut inscribed: HashMap<usize, Ball> = HashMap::new();
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for &held in parts {
        let body = &scene.bodies[held];
        // An open surface has no inside that a ball could be in.
        if !body.shape.surface.is_open() {
            let holders = scene.broad_phase.meeting_of(parts, &body.bounds).into_iter();
            pairs.extend(holders.filter(|&h| h != held && !is_known(held, h)).map(|h| (held, h)));
        }
    }
    pairs.sort_by_key(|&(held, holder)| !is_wanted(held) && !is_wanted(holder));
    let mut enclosed = Vec::new();
    for (held, holder) in pairs {
        let (body, other) = (&scene.bodies[held], &scene.bodies[holder]);
        let largest = match inscribed.entry(held) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => *new.insert(inscribed_ball(&body.shape.surface, &poll)?),
        };
        let limit = problem.verifier.limit_past([&body.shape, &other.shape]);
        let accepted = scene.allowed.of(held, holder) + limit;
        let ball = Ball {
            centre: other.planning_from_shape.inverse() * body.planning_from_shape * largest.centre,
            radius: largest.radius - accepted - ROUNDED,
        };
        if let Some(proof) = enclosure(&other.shape.surface, &ball, &mut budget, &poll)? {
            enclosed.push(Inseparable { parts: [held, holder], proof });
        }
    }
    Ok(enclosed)
}

/// A large ball inside a closed surface. Its radius is the measured depth of its centre, and 0 if no place inside was
/// found.
fn inscribed_ball(surface: &Surface, poll: &Poll<'_>) -> Result<Ball, Interrupt> {
    let depth = |p: &Point3<f64>| -surface.signed_distance(p);
    let (centre, radius) = deepest_point(surface.bounds(), depth, poll)?;
    Ok(Ball { centre, radius })
}

/// What proves that a ball, in the surface's frame, cannot get out of the surface's box without meeting the surface.
/// The number of distances that may still be measured is taken from `budget`.
fn enclosure(
    surface: &Surface,
    ball: &Ball,
    budget: &mut usize,
    poll: &Poll<'_>,
) -> Result<Option<SeparationProof>, Interrupt> {
    if ball.radius <= 0.0 || !surface.bounds().contains(&ball.centre) {
        return Ok(None);
    }
    // Parts of which one stands in the solid of the other, as two copies in one place, are a fault of the model, and
    // how deep they may be is doubtful. Of a ball that meets the surface already, nothing is proved. A wall has no
    // inside.
    let Some(nearest) = surface.closest(&ball.centre, f64::INFINITY) else { return Ok(None) };
    let is_inside = !surface.is_wall() && surface.signed(&ball.centre, &nearest) < 0.0;
    if is_inside || nearest.distance < ball.radius {
        return Ok(None);
    }
    if is_within_closed_shell(surface, &ball.centre) {
        return Ok(Some(SeparationProof::Void));
    }
    for across in ENCLOSURE_GRIDS {
        match passage(surface, ball, across, budget, poll)? {
            Passage::Closed => return Ok(Some(SeparationProof::Ball)),
            Passage::Open => return Ok(None),
            Passage::Unclear => {}
        }
    }
    Ok(None)
}

/// The cells of a box.
struct Cells {
    origin: Point3<f64>,
    edge: f64,
    counts: [usize; 3],
}

impl Cells {
    /// Cubes that cover a box, `across` of them along its longest side.
    fn over(bounds: &Bounds, across: usize) -> Self {
        let extents = bounds.extents();
        let edge = extents.max() / across as f64;
        let counts = std::array::from_fn(|axis| ((extents[axis] / edge).ceil() as usize).clamp(1, across));
        Self { origin: bounds.min, edge, counts }
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.counts[0] * (y + self.counts[1] * z)
    }

    fn place(&self, number: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [number % nx, number / nx % ny, number / (nx * ny)]
    }

    fn holding(&self, p: &Point3<f64>) -> [usize; 3] {
        let at = (p - self.origin) / self.edge;
        std::array::from_fn(|axis| (at[axis].max(0.0) as usize).min(self.counts[axis] - 1))
    }

    fn centre(&self, place: [usize; 3]) -> Point3<f64> {
        self.origin + Vector3::from_fn(|axis, _| (place[axis] as f64 + 0.5) * self.edge)
    }

    fn is_at_the_end(&self, place: [usize; 3]) -> bool {
        (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == self.counts[axis])
    }

    /// The cells that share a face with one that is not at the end.
    fn beside(&self, place: [usize; 3]) -> [[usize; 3]; 6] {
        std::array::from_fn(|side| {
            let mut beside = place;
            let along = &mut beside[side / 2];
            *along = if side % 2 == 0 { *along - 1 } else { *along + 1 };
            beside
        })
    }
}

/// Searches a grid over a surface's box for the widest way of a ball out of it. `across` is the number of cells along
/// the box's longest side.
fn passage(
    surface: &Surface,
    ball: &Ball,
    across: usize,
    budget: &mut usize,
    poll: &Poll<'_>,
) -> Result<Passage, Interrupt> {
    let cells = Cells::over(&surface.bounds().grown(ball.radius), across);
    let half_diagonal = cells.edge * 3f64.sqrt() / 2.0;
    // In a cell whose centre is nearer, the ball's centre cannot be. Two cells that share but an edge or a corner are
    // joined by others that hold the same points: steps across faces reach all that the centre can reach.
    let blocked = ball.radius - half_diagonal;
    let Some(nearest) = surface.closest(&ball.centre, f64::INFINITY) else { return Ok(Passage::Open) };
    let start = cells.holding(&ball.centre);
    let mut seen = vec![false; cells.counts.iter().product()];
    seen[cells.number(start)] = true;
    let mut open =
        BinaryHeap::from([(nearest.distance.to_bits(), Reverse(cells.number(start)), nearest.triangle)]);
    let mut narrowest = f64::INFINITY;
    // The widest cell comes first: the first way out is the widest one.
    while let Some((distance, Reverse(number), near)) = open.pop() {
        narrowest = narrowest.min(f64::from_bits(distance));
        let place = cells.place(number);
        if cells.is_at_the_end(place) {
            let is_certain = narrowest >= ball.radius + half_diagonal;
            return Ok(if is_certain { Passage::Open } else { Passage::Unclear });
        }
        for beside in cells.beside(place) {
            let number = cells.number(beside);
            if std::mem::replace(&mut seen[number], true) {
                continue;
            }
            poll.check()?;
            if *budget == 0 {
                return Ok(Passage::Unclear);
            }
            *budget -= 1;
            let closest = surface.closest_from(&cells.centre(beside), near);
            if closest.distance >= blocked {
                open.push((closest.distance.to_bits(), Reverse(number), closest.triangle));
            }
        }
    }
    Ok(Passage::Closed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cells, cuboid, joined, open_box, peg_in_hole, scene, tube};
    use crate::geometry::SourceMesh;
    use crate::search::tests::problem;
    use crate::termination::Termination;

    fn proof(meshes: [SourceMesh; 2]) -> Option<Inseparable> {
        let (scene, verifier) = scene(meshes);
        let problem = Problem { present: vec![0, 1], ..problem(scene, &verifier) };
        enclosed_pairs(&problem, &[0, 1], |_, _| false).unwrap().first().copied()
    }

    /// The twelve bars of a cube's edges, with a square window of half the width `window` on each side.
    fn cage(window: f64) -> SourceMesh {
        let lines: &[f64] = &[-3.0, -window, window, 3.0];
        cells([lines, lines, lines], |c| c.iter().filter(|&&i| i == 1).count() < 2)
    }

    fn sized(mut mesh: SourceMesh, factor: f64) -> SourceMesh {
        mesh.vertices.iter_mut().flatten().for_each(|x| *x *= factor);
        mesh
    }

    #[test]
    fn a_ball_in_a_cage_is_enclosed_if_the_windows_are_narrower() {
        // A ball of radius 1 in the fixture; its facets lie a little deeper.
        let enclosed = |window: f64, size: f64| proof([cage(window), sized(ball(3), size)]);
        let found = enclosed(1.0, 1.15).expect("1.15 does not fit through 1");
        assert_eq!((found.parts, found.proof), ([1, 0], SeparationProof::Ball));
        assert!(enclosed(1.0, 0.95).is_none(), "it fits");
        assert!(enclosed(1.5, 1.0).is_none(), "it fits easily");
    }

    #[test]
    fn a_cube_in_a_closed_box_is_enclosed_however_small() {
        let lines: &[f64] = &[-3.0, -2.0, 2.0, 3.0];
        let hollow = || cells([lines, lines, lines], |c| c != [1, 1, 1]);
        for half in [1.5, 0.02] {
            let found = proof([hollow(), cuboid([-half; 3], [half; 3])]).unwrap();
            assert_eq!((found.parts, found.proof), ([1, 0], SeparationProof::Void));
        }
        let small = cuboid([-0.02; 3], [0.02; 3]);
        assert!(proof([open_box([-3.0; 3], [3.0; 3]), small]).is_none(), "the box is open");
    }

    #[test]
    fn what_leaves_is_not_enclosed() {
        assert!(proof(peg_in_hole(-0.01)).is_none(), "a peg with play");
        assert!(proof(peg_in_hole(0.01)).is_none(), "a peg with excess, which is allowed to overlap");
        assert!(proof([tube(1.0, 2.0, [-3.0, 3.0], 24), sized(ball(2), 0.9)]).is_none(), "a ball in a tube");
        let blocks = [cuboid([-3.0; 3], [-1.0; 3]), cuboid([1.0; 3], [3.0; 3])];
        assert!(proof([joined(blocks), cuboid([-0.9; 3], [0.9; 3])]).is_none(), "between two blocks");
    }

    #[test]
    fn nothing_is_proved_of_parts_in_one_place() {
        let block = |half: f64| cuboid([-half; 3], [half; 3]);
        assert!(proof([block(3.0), block(3.0)]).is_none());
        assert!(proof([block(3.0), block(1.0)]).is_none());
    }

    #[test]
    fn known_pairs_are_left_out() {
        let (scene, verifier) = scene([cage(1.0), sized(ball(3), 1.15)]);
        let problem = Problem { present: vec![0, 1], ..problem(scene, &verifier) };
        let found = |known: [usize; 2]| enclosed_pairs(&problem, &[0, 1], |a, b| [a, b] == known).unwrap();
        assert_eq!(found([0, 1]).len(), 1);
        assert_eq!(found([1, 0]), []);
    }

    #[test]
    fn a_cancelled_proof_ends_with_the_reason() {
        let (scene, verifier) = scene([cage(1.0), sized(ball(3), 1.15)]);
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let problem = Problem { present: vec![0, 1], termination, ..problem(scene, &verifier) };
        let ended = enclosed_pairs(&problem, &[0, 1], |_, _| false);
        assert_eq!(ended.err(), Some(Interrupt::Cancelled));
    }
}
