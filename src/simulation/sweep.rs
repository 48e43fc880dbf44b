//! Straight sweeps: whether a part leaves along a straight direction without entering anything, without simulation.
//!
//! The sweep ends where the part's hull is apart from the hull of all others; each part on the way is cast against
//! ([`ShapeCast`], with what that may miss). So "clear" is a claim, verified like every path, and "blocked" leaves
//! the question to simulation.

use nalgebra::{Point3, Translation3, Vector3};

use crate::contact::{CastMargins, ShapeCast};
use crate::geometry::{Pose, Support, separating, transformed};
use crate::scene::{Scene, StandingParts, exit_direction};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    ASSURED_GAP, DEPTH_TOLERANCE, HULL_MARGIN, SWEEP_SUNK, WALL_STEEPNESS, WAY_OUT_FINENESS,
};

/// The result of a straight sweep.
#[derive(Debug, Clone, PartialEq)]
pub enum Sweep {
    /// The part leaves along a line, to where its hull is apart from that of all others.
    Clear {
        /// From the start to there; the start alone if it is there.
        path: Vec<Pose>,
        /// Along this direction the hulls are apart in the end.
        exit: Vector3<f64>,
    },
    /// It enters this part, or only simulation can decide.
    Blocked {
        /// The part.
        by: usize,
    },
}

/// A part that is to leave along a line.
#[derive(Debug, Clone, Copy)]
pub struct SweepQuestion<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// What stands.
    pub standing_parts: &'a StandingParts,
    /// What moves.
    pub part: usize,
    /// From where.
    pub start: &'a Pose,
    /// The unit vector along the line.
    pub direction: &'a Vector3<f64>,
}

/// Sweeps a part along a line out of its surroundings. `None` where no way out along it is found.
///
/// # Errors
/// The termination condition became true.
pub fn straight_sweep(
    question: &SweepQuestion<'_>,
    termination: &Termination,
) -> Result<Option<Sweep>, Interrupt> {
    straight_sweep_past(question, termination, |cast| cast.enters())
}

/// The same, with a function that says of each part on the way whether the sweep enters it.
///
/// # Errors
/// The termination condition became true, or what `enters` returns.
pub fn straight_sweep_past<E: From<Interrupt>>(
    question: &SweepQuestion<'_>,
    termination: &Termination,
    mut enters: impl FnMut(&ShapeCast<'_>) -> Result<bool, E>,
) -> Result<Option<Sweep>, E> {
    let SweepQuestion { scene, standing_parts, part, start, direction } = *question;
    termination.check()?;
    if let Some(exit) = exit_direction(scene, standing_parts, part, start, Some(-direction)) {
        return Ok(Some(Sweep::Clear { path: vec![*start], exit }));
    }
    let Some((travel, exit)) = way_out(scene, standing_parts, part, start, direction) else {
        return Ok(None);
    };
    let end = moved(start, direction, travel);
    for other in on_the_way(question, travel) {
        if enters(&cast_at(question, other, travel, termination))? {
            return Ok(Some(Sweep::Blocked { by: other }));
        }
    }
    Ok(Some(Sweep::Clear { path: vec![*start, end], exit }))
}

/// How far a part goes along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeTravel {
    /// The length, in the planning frame.
    pub length: f64,
    /// The part that it meets there; none if it meets nothing.
    pub met: Option<usize>,
    /// The number of edges and corners that were cast, as a measure of the effort.
    pub edges: usize,
}

/// How far a part goes along a line until it meets a standing part, or is past the hull of all. Like a sweep, this is a
/// claim to be verified.
///
/// # Errors
/// The termination condition became true.
pub fn free_travel(question: &SweepQuestion<'_>, termination: &Termination) -> Result<FreeTravel, Interrupt> {
    let SweepQuestion { scene, standing_parts, part, start, direction } = question;
    let bounds = scene.bodies[*part].shape.bounds().transformed(start);
    let reach = standing_parts.hull.iter().map(|p| direction.dot(&p.coords)).fold(f64::MIN, f64::max);
    let travel = (reach + bounds.support(&-**direction)).max(0.0);
    let mut free = FreeTravel { length: travel, met: None, edges: 0 };
    for other in on_the_way(question, travel) {
        let cast = cast_at(question, other, free.length, termination);
        let (met, count) = cast.counted_way(0.0)?;
        if met < cast.travel {
            (free.length, free.met) = (met.max(0.0), Some(other));
        }
        // A cast that finds nothing leading is work, too.
        free.edges += 1 + count;
    }
    Ok(free)
}

/// How far a part goes along a line until it meets another one, if it does; and the number of edges and corners that
/// were cast. The parts that stand do not count.
///
/// # Errors
/// The termination condition became true.
pub fn travel_to(
    question: &SweepQuestion<'_>,
    other: usize,
    termination: &Termination,
) -> Result<(Option<f64>, usize), Interrupt> {
    let cast = cast_at(question, other, f64::INFINITY, termination);
    let (met, count) = cast.counted_way(0.0)?;
    Ok(((met < cast.travel).then(|| met.max(0.0)), 1 + count))
}

/// The standing parts whose boxes meet the box that a sweep passes, ascending.
fn on_the_way(question: &SweepQuestion<'_>, travel: f64) -> Vec<usize> {
    let SweepQuestion { scene, standing_parts, part, start, direction } = *question;
    let bounds = scene.bodies[part].shape.bounds();
    let swept = bounds.transformed(start).union(&bounds.transformed(&moved(start, direction, travel)));
    scene.broad_phase.meeting_of(&standing_parts.standing, &swept)
}

/// The cast of a sweep at a standing part, to where it has passed that part for good: so the result does not depend on
/// how far other parts reach.
fn cast_at<'a>(
    question: &SweepQuestion<'a>,
    other: usize,
    travel: f64,
    termination: &'a Termination,
) -> ShapeCast<'a> {
    let SweepQuestion { scene, part, start, direction, .. } = *question;
    let allowed = scene.allowed.of(part, other) + DEPTH_TOLERANCE;
    let here = scene.bodies[part].shape.bounds().transformed(start);
    let passed = here.grown(allowed).way_past(&scene.bodies[other].bounds, direction);
    let margins = CastMargins { allowed, back: allowed, steepness: WALL_STEEPNESS, sunk: SWEEP_SUNK };
    ShapeCast { scene, part, start, direction, travel: travel.min(passed), other, margins, termination }
}

fn moved(pose: &Pose, direction: &Vector3<f64>, travel: f64) -> Pose {
    Translation3::from(direction * travel) * pose
}

/// How far the part has to go until its hull is apart, and the direction that shows it. Two convex bodies, one moving
/// along a line, meet during one interval, whose end is sought from beyond. A direction along which they are apart
/// shows how much further back they are apart at least, as the gap along it changes linearly with the travel; further
/// back it is computed again, in steps that double, and that are halved once the bodies meet.
fn way_out(
    scene: &Scene,
    standing_parts: &StandingParts,
    part: usize,
    start: &Pose,
    direction: &Vector3<f64>,
) -> Option<(f64, Vector3<f64>)> {
    let hull = transformed(&scene.bodies[part].shape.hull, start);
    let along = |points: &[Point3<f64>], sign: f64| {
        points.iter().map(|p| p.coords.dot(direction) * sign).fold(f64::NEG_INFINITY, f64::max)
    };
    let beyond = along(&standing_parts.hull, 1.0) + along(&hull, -1.0) + 1.5 * HULL_MARGIN;
    let (mine, around) = (Support::of(&hull), Support::of(&standing_parts.hull));
    let margin = HULL_MARGIN * (1.0 + ASSURED_GAP);
    // From where on they are apart along a direction, if they are where it was found.
    let since = |d: &Vector3<f64>| {
        let speed = -d.dot(direction);
        (speed > 0.0).then(|| (margin - mine.gap_along(d, &around)) / speed)
    };
    let finest = WAY_OUT_FINENESS * beyond;
    let (mut near, mut far, mut exit, mut step) = (0.0, beyond, -direction, finest);
    while far - near > finest {
        let at = (far - step).max(0.5 * (near + far));
        let there: Vec<_> = hull.iter().map(|p| p + direction * at).collect();
        if let Some(d) = separating(&Support::of(&there), &around, HULL_MARGIN) {
            (far, exit, step) = (since(&d).map_or(at, |t| t.clamp(near, at)), d, 2.0 * step);
        } else {
            near = at;
        }
    }
    let certified = |travel: f64, hint| {
        let pose = moved(start, direction, travel);
        exit_direction(scene, standing_parts, part, &pose, hint).map(|d| (travel, d))
    };
    certified(far, Some(exit)).or_else(|| certified(beyond, Some(-direction)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, cells, cuboid, moved as placed, peg_in_hole, rod, scene, tube};

    fn swept(scene: &Scene, part: usize, direction: Vector3<f64>) -> Option<Sweep> {
        let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != part).collect();
        let around = StandingParts::new(scene, standing);
        let start = &scene.bodies[part].planning_from_shape;
        let question = SweepQuestion { scene, standing_parts: &around, part, start, direction: &direction };
        straight_sweep(&question, &Termination::default()).unwrap()
    }

    #[test]
    fn a_cancelled_sweep_claims_nothing() {
        let (scene, _) = scene(peg_in_hole(0.0));
        let around = StandingParts::new(&scene, vec![0]);
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let start = &scene.bodies[1].planning_from_shape;
        let (scene, direction) = (&scene, &Vector3::z());
        let question = SweepQuestion { scene, standing_parts: &around, part: 1, start, direction };
        assert_eq!(straight_sweep(&question, &termination), Err(Interrupt::Cancelled));
        let termination = Termination::default();
        let swept = straight_sweep_past(&question, &termination, |cast| {
            termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
            cast.enters()
        });
        assert_eq!(swept, Err(Interrupt::Cancelled), "a cast that was cut short");
    }

    fn is_clear(scene: &Scene, part: usize, direction: Vector3<f64>) -> bool {
        matches!(swept(scene, part, direction), Some(Sweep::Clear { .. }))
    }

    #[test]
    fn a_block_on_a_plate_slides_off_to_all_sides_but_down() {
        let turn = Pose::rotation(Vector3::new(0.2, -0.15, 0.1));
        for pose in [Pose::identity(), turn] {
            let (scene, _) = scene(block_on_plate().map(|m| placed(m, &pose)));
            for axis in [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z()] {
                assert!(is_clear(&scene, 1, pose * axis), "{axis}");
            }
            assert_eq!(swept(&scene, 1, pose * -Vector3::z()), Some(Sweep::Blocked { by: 0 }));
        }
    }

    #[test]
    fn a_flush_peg_leaves_its_blind_hole_upwards_only() {
        let (scene, _) = scene(peg_in_hole(0.0));
        assert!(is_clear(&scene, 1, Vector3::z()));
        for axis in [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), -Vector3::z()] {
            assert_eq!(swept(&scene, 1, axis), Some(Sweep::Blocked { by: 0 }), "{axis}");
        }
    }

    #[test]
    fn what_is_too_wide_for_a_bore_passes_by_what_is_granted() {
        let excess = 0.02;
        for (lead, up) in [(-1.5, Vector3::z()), (1.5, -Vector3::z())] {
            let z = if lead < 0.0 { [lead - 2.0, lead] } else { [lead, lead + 2.0] };
            // So tall that the rod is not apart from the hull of both.
            let wall = cuboid([-3.0, 3.5, -4.0], [3.0, 4.0, 4.0]);
            let (mut scene, _) = scene([tube(1.0, 3.0, [-1.0, 1.0], 24), rod(1.0 + excess, z, 24), wall]);
            assert_eq!(swept(&scene, 1, up), Some(Sweep::Blocked { by: 0 }));
            scene.allowed.allow(0, 1, excess);
            assert!(is_clear(&scene, 1, up));
        }
    }

    #[test]
    fn a_press_fit_leaves_its_hole_but_not_through_its_walls() {
        let excess = 0.02;
        let (mut scene, _) = scene(peg_in_hole(excess));
        scene.allowed.allow(0, 1, excess);
        assert!(is_clear(&scene, 1, Vector3::z()));
        assert!(!is_clear(&scene, 1, -Vector3::z()) && !is_clear(&scene, 1, Vector3::x()));
    }

    #[test]
    fn what_is_apart_already_stays_where_it_is() {
        let (scene, _) = scene([cuboid([0.0; 3], [1.0; 3]), cuboid([5.0, 0.0, 0.0], [6.0, 1.0, 1.0])]);
        let Some(Sweep::Clear { path, .. }) = swept(&scene, 1, -Vector3::x()) else { panic!("not clear") };
        assert_eq!(path, [scene.bodies[1].planning_from_shape]);
    }

    #[test]
    fn a_wall_on_the_way_is_found_however_thin_or_small() {
        // The post, beside the way, makes the way out lead past the wall.
        let post = cuboid([5.0, -4.0, -1.0], [5.5, -3.0, 2.0]);
        for wall in [
            cuboid([4.2, -3.0, 0.0], [4.21, 3.0, 3.0]),
            cuboid([4.2, -0.005, 1.0], [4.21, 0.005, 1.01]),
            cuboid([4.2, -3.0, 1.99], [4.5, 3.0, 9.0]),
        ] {
            let [plate, block] = block_on_plate();
            let (scene, _) = scene([plate, block, wall, post.clone()]);
            assert_eq!(swept(&scene, 1, Vector3::x()), Some(Sweep::Blocked { by: 2 }));
            assert!(is_clear(&scene, 1, -Vector3::x()));
        }
    }

    #[test]
    fn a_pin_leaves_its_bore_and_the_bore_its_pin() {
        let pin = rod(1.0, [-1.0, 1.5], 24);
        for bore in [1.0, 1.01] {
            let (scene, _) = scene([tube(bore, 3.0, [-1.0, 1.0], 24), pin.clone()]);
            assert!(is_clear(&scene, 1, Vector3::z()) && is_clear(&scene, 1, -Vector3::z()));
            assert!(!is_clear(&scene, 1, Vector3::x()));
            assert!(is_clear(&scene, 0, Vector3::z()) && is_clear(&scene, 0, -Vector3::z()));
        }
    }

    #[test]
    fn the_path_ends_where_hulls_are_apart_and_not_much_later() {
        let (scene, _) = scene(peg_in_hole(0.0));
        let Some(Sweep::Clear { path, exit }) = swept(&scene, 1, Vector3::z()) else { panic!("not clear") };
        let around = StandingParts::new(&scene, vec![0]);
        assert_eq!(path[0], scene.bodies[1].planning_from_shape);
        assert!(exit_direction(&scene, &around, 1, &path[1], Some(exit)).is_some());
        let short = Pose::translation(0.0, 0.0, -0.6 * HULL_MARGIN) * path[1];
        assert!(exit_direction(&scene, &around, 1, &short, None).is_none());
    }

    #[test]
    fn an_undercut_holds_what_stands_in_it() {
        // A T-slot along x: the T leaves along x only.
        let across: &[f64] = &[-3.0, -2.0, -1.0, 1.0, 2.0, 3.0];
        let rail = cells([&[-3.0, 3.0], across, &[-2.0, -1.0, 0.0, 1.0]], |[_, y, z]| match z {
            0 => true,
            1 => y == 0 || y == 4,
            _ => y != 2,
        });
        let tee =
            cells([&[-3.0, 3.0], &[-2.0, -1.0, 1.0, 2.0], &[-1.0, 0.0, 2.0]], |[_, y, z]| z == 0 || y == 1);
        let (scene, _) = scene([rail, tee]);
        assert!(is_clear(&scene, 1, Vector3::x()) && is_clear(&scene, 1, -Vector3::x()));
        assert_eq!(swept(&scene, 1, Vector3::z()), Some(Sweep::Blocked { by: 0 }));
    }
}
