//! Paths off a thread in the middle of its play.
//!
//! It answers which screw motion keeps the surfaces of two parts furthest apart, from both surfaces and for a whole
//! path. Which displacement of one pose gives its contacts room, before all standing parts, the simulation computes:
//! `simulation/sliding/drive/clearance.rs`.
//!
//! An engine that pushes a part off a thread presses it against the flanks: such a path leaves no room, and its
//! wobble makes many waypoints. The two threads themselves determine a better one
//! ([`shared_thread`](super::shared_thread)): in the middle of the play, and no motion but turning along the helix. It
//! is a proposal, verified like any path.

use nalgebra::Point3;

use crate::budgets::CENTRING_PIECES;
use crate::geometry::{Pose, interpolate};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{OFF_HELIX, STRAY_SHARE, UNSCREWING_ANGLE};

use super::super::course::turns_far;
use super::super::course::{Course, Interval};
use super::path::ScrewPath;
use super::shared_thread::SharedThread;

/// A path with the start and end of a given one that turns along the thread which a part shares with a standing part;
/// `None` if there is no such thread, or no play in it. `limit` is the depth at which paths are refused.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn path_on_thread(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    path: &[Pose],
    limit: f64,
    termination: &Termination,
) -> Result<Option<Vec<Pose>>, Interrupt> {
    if !turns_far(path) {
        return Ok(None);
    }
    let course = Course::new(path, scene.centre_in_shape(part), scene.bodies[part].shape.reach);
    let followed = ScrewPath::new(&course, &[Interval::WHOLE], limit * STRAY_SHARE);
    let Some(followed) = followed.filter(|followed| followed.helix.rise != 0.0) else { return Ok(None) };
    let Some((left, way)) = followed.leaves(followed.helix.pitch().abs() * OFF_HELIX) else {
        return Ok(None);
    };
    let Some(start) = path.first() else { return Ok(None) };
    let thread = SharedThread::widest(scene, standing, part, start, &followed.helix, termination)?;
    Ok(thread.and_then(|thread| along(&thread, (left, way), path, &course)))
}

/// The angle (radians) by which a path turns along a helix that rises, from its start on, no further than a play from it. `centre`
/// and `reach` are those of the moving shape.
pub(crate) fn turn_along_helix(path: &[Pose], centre: &Point3<f64>, reach: f64, play: f64) -> f64 {
    let course = Course::new(path, *centre, reach);
    let followed = ScrewPath::new(&course, &[Interval::WHOLE], play);
    let followed = followed.filter(|followed| followed.helix.rise != 0.0);
    followed.map_or(0.0, |followed| followed.angle_within(play).abs())
}

/// The path that turns along a thread up to where the given one leaves it (angle, and place on the path), and from
/// there on beside the given one to its end.
fn along(
    thread: &SharedThread,
    (left, way): (f64, f64),
    path: &[Pose],
    course: &Course,
) -> Option<Vec<Pose>> {
    // A part that is nearly off the thread is turned off it.
    let off = thread.off[usize::from(thread.helix.rise * left <= 0.0)];
    let is_near = (off - left).abs() < UNSCREWING_ANGLE;
    let angle = if is_near { off.abs().max(left.abs()).copysign(left) } else { left };
    let on_thread = thread.poses_to(angle);
    let rest = course.path_between([way, course.length]);
    // From there on like the given path, at the same distance from it, and on it at the end.
    let aside = rest.first()?.inverse() * thread.pose(angle);
    let rest: Vec<Pose> = if is_near { Vec::new() } else { rest.iter().map(|p| p * aside).collect() };
    let mut poses: Vec<Pose> = path.first().copied().into_iter().chain(on_thread).chain(rest).collect();
    // In pieces so small that their sense of rotation is unique.
    let (from, to) = (*poses.last()?, *path.last()?);
    let share = |k: u32| f64::from(k) / f64::from(CENTRING_PIECES);
    poses.extend((1..CENTRING_PIECES).map(|k| interpolate(&from, &to, &course.centre, share(k))));
    poses.push(to);
    Some(poses)
}
