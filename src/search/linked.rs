//! Parts that are linked, as two links of a chain: a proof that neither leaves while both are there.
//!
//! If a closed curve on one body and one on another have a linking number other than 0, no motion
//! that keeps the bodies from entering each other separates them. Guarantees: a part that could leave is
//! never called linked. Not found are links of open or crossing meshes, of parts that overlap, of more than
//! `SURFACE_LOOPS` curves, of curves closer than `LINK_CLEARANCE`, and parts that are held without being linked, as a
//! ball in a cage.

use std::cell::OnceCell;

use nalgebra::Point3;

use crate::budgets::{LONG_STEPS_PER_POLL, SEGMENT_PAIRS, SURFACE_LOOPS};
use crate::geometry::{linking_number, surface_loops};
use crate::scene::Scene;
use crate::termination::{Interrupt, Poll, Termination, try_all};
use crate::tolerances::LINK_CLEARANCE;

/// A closed polygon in the planning frame.
type Loop = Vec<Point3<f64>>;

/// The linked pairs among some parts (ascending), at their assembled poses; each pair ascending.
///
/// # Errors
/// The termination condition became true.
pub(super) fn linked_pairs(
    scene: &Scene,
    parts: &[usize],
    termination: &Termination,
) -> Result<Vec<[usize; 2]>, Interrupt> {
    let poll = Poll::every(LONG_STEPS_PER_POLL, Some(termination));
    // Many parts have no other near that they could be linked with: their curves are never computed.
    let known = vec![OnceCell::new(); scene.bodies.len()];
    let loops = |part: usize| known[part].get_or_init(|| loops(scene, part));
    let mut linked = Vec::new();
    for &a in parts {
        let near = scene.broad_phase.meeting_of(parts, &scene.bodies[a].bounds);
        for b in near.into_iter().filter(|&b| b > a && scene.allowed.of(a, b) == 0.0) {
            if are_linked(loops(a), loops(b), &poll)? {
                linked.push([a, b]);
            }
        }
    }
    Ok(linked)
}

/// Curves on a part's surface that generate its first homology, as assembled.
fn loops(scene: &Scene, part: usize) -> Vec<Loop> {
    let body = &scene.bodies[part];
    let mut loops = surface_loops(&body.shape.surface, SURFACE_LOOPS).unwrap_or_default();
    for p in loops.iter_mut().flatten() {
        *p = body.planning_from_shape * *p;
    }
    loops
}

fn are_linked(a: &[Loop], b: &[Loop], poll: &Poll<'_>) -> Result<bool, Interrupt> {
    let segments = |loops: &[Loop]| loops.iter().map(Vec::len).sum::<usize>();
    if segments(a) * segments(b) > SEGMENT_PAIRS {
        return Ok(false);
    }
    let are_apart =
        |(a, b): (&Loop, &Loop)| Ok(linking_number(a, b, LINK_CLEARANCE, poll)?.is_none_or(|n| n == 0));
    Ok(!try_all(a.iter().flat_map(|a| b.iter().map(move |b| (a, b))), are_apart)?)
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::fixtures::{cuboid, moved, scene, tube};
    use crate::geometry::{Pose, SourceMesh};

    /// Links of a chain along x, every other one turned by a right angle, and a block in the first.
    fn chain(count: usize) -> Vec<SourceMesh> {
        let link = |i: usize| {
            let turn = if i % 2 == 1 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn);
            let at = nalgebra::Translation3::new(0.7 * i as f64 - 3.0, 0.0, 0.0);
            moved(tube(0.6, 0.8, [-0.1, 0.1], 20), &Pose::from_parts(at, turn))
        };
        let mut meshes: Vec<_> = (0..count).map(link).collect();
        meshes.push(cuboid([-3.6, -0.2, -0.2], [-3.4, 0.2, 0.2]));
        meshes
    }

    #[test]
    fn each_link_of_a_chain_is_linked_with_its_neighbours_alone() {
        let (scene, _) = scene(chain(8));
        let all: Vec<usize> = (0..9).collect();
        let linked = |parts: &[usize]| linked_pairs(&scene, parts, &Termination::default()).unwrap();
        // The block, the last part, has no hole.
        let neighbours: Vec<[usize; 2]> = (0..7).map(|i| [i, i + 1]).collect();
        assert_eq!(linked(&all), neighbours);
        assert_eq!(linked(&[0, 2, 3]), [[2, 3]]);
    }

    #[test]
    fn a_cancelled_look_ends_with_the_reason() {
        let (scene, _) = scene(chain(8));
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let ended = linked_pairs(&scene, &[0, 1], &termination);
        assert_eq!(ended.err(), Some(Interrupt::Cancelled));
    }
}
