//! Ways off a thread, from the thread alone.
//!
//! A part that shares a thread with others leaves it along the thread's own helix. So its way needs no simulation: the
//! helix is fitted to the flanks of both parts, and the part turns along it in the middle of its play. Such a way is a
//! proposal, verified like any path.

use nalgebra::Vector3;

use crate::geometry::{Helix, Pose};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};

use super::shared_thread::SharedThread;

/// A way off a thread.
#[derive(Debug, Clone)]
pub(crate) struct ScrewWay {
    /// The poses of the part's shape, the given one first.
    pub(crate) path: Vec<Pose>,
    /// The unit vector along which the part goes, in the planning frame.
    pub(crate) along: Vector3<f64>,
    pub(crate) is_right_handed: bool,
}

/// The ways of a part from a pose off the threads that it shares with some others, near a helix (in the planning
/// frame; without a rise, it gives the axis alone); the shorter one first. None where it shares none with play.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn ways_off(
    scene: &Scene,
    others: &[usize],
    part: usize,
    pose: &Pose,
    guess: &Helix,
    termination: &Termination,
) -> Result<Vec<ScrewWay>, Interrupt> {
    let Some(thread) = SharedThread::widest(scene, others, part, pose, guess, termination)? else {
        return Ok(Vec::new());
    };
    let axis = thread.helix.axis_from_frame.inverse() * Vector3::z();
    let mut ways = thread.off.map(|angle| {
        (
            angle.abs(),
            ScrewWay {
                path: std::iter::once(*pose).chain(thread.poses_to(angle)).collect(),
                along: axis * (angle * thread.helix.rise).signum(),
                is_right_handed: thread.helix.rise > 0.0,
            },
        )
    });
    ways.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(ways.into_iter().map(|(_, way)| way).collect())
}
