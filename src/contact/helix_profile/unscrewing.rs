//! Ways off a thread, from the thread alone.
//!
//! A part that shares a thread with others leaves it along the thread's own helix. So its way needs no simulation: the
//! helix is fitted to the flanks of both parts, and the part turns along it in the middle of its play. Such a way is a
//! proposal, verified like any path.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::budgets::HELIX_ROUNDS;
use crate::geometry::{Helix, Pose};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{LEAST_PITCH, RISE_BY_RADIUS, RISE_RANGE};

use super::helix_fit::{FlankPoint, fitted_helices, fitted_rise, spread};
use super::slip::{FlankFacet, slipping};
use super::thread_path::{SharedThread, ThreadPair};

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
    let mut widest: Option<(f64, SharedThread)> = None;
    let mut off = [0.0f64; 2];
    for &other in others.iter().filter(|&&other| scene.allowed.of(part, other) == 0.0) {
        let Some((pair, axes)) = fitted(scene, [part, other], pose, guess, termination)? else { continue };
        let Some((play, thread)) = SharedThread::shared(&pair, axes, termination)? else { continue };
        for (off, own) in off.iter_mut().zip(thread.off) {
            *off = if own.abs() > off.abs() { own } else { *off };
        }
        if widest.as_ref().is_none_or(|(most, _)| *most < play) {
            widest = Some((play, thread));
        }
    }
    let Some((_, thread)) = widest else { return Ok(Vec::new()) };
    let axis = thread.helix.axis_from_frame.inverse() * Vector3::z();
    let mut ways = off.map(|angle| {
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

/// Two parts in the frame of the helix that fits their thread, and both helices in that frame, near another helix; of
/// any rise if that has none.
fn fitted(
    scene: &Scene,
    parts: [usize; 2],
    pose: &Pose,
    guess: &Helix,
    termination: &Termination,
) -> Result<Option<(ThreadPair, [Helix; 2])>, Interrupt> {
    let mut helix = *guess;
    for _ in 0..HELIX_ROUNDS {
        termination.check()?;
        let pair = ThreadPair::new(scene, parts, &helix, &(helix.axis_from_frame * pose));
        let Some(axes) = axes(&pair, helix.rise, termination)? else { return Ok(None) };
        helix =
            Helix { axis_from_frame: axes[1].axis_from_frame * helix.axis_from_frame, rise: axes[1].rise };
    }
    let pair = ThreadPair::new(scene, parts, &helix, &(helix.axis_from_frame * pose));
    Ok(axes(&pair, helix.rise, termination)?.map(|axes| (pair, axes)))
}

/// The helices of the flanks of two parts, in the frame of a helix near both.
fn axes(pair: &ThreadPair, guess: f64, termination: &Termination) -> Result<Option<[Helix; 2]>, Interrupt> {
    let flanks = pair.flanks();
    let [Some(own), Some(others)] = flanks.each_ref().map(|facets| slipping(facets, guess)) else {
        return Ok(None);
    };
    let points = |axis: &Helix, facets: &[FlankFacet]| -> Vec<FlankPoint> {
        let flanks: Vec<&FlankFacet> = facets.iter().filter(|f| f.is_flank()).collect();
        spread(&flanks).iter().map(|p| p.moved(&axis.axis_from_frame)).collect()
    };
    let points = [points(&own, &flanks[0]), points(&others, &flanks[1])];
    let radius = points.iter().flatten().map(FlankPoint::radius).fold(0.0, f64::max);
    let [least, most] = RISE_BY_RADIUS.map(|share| share * radius);
    let least = least.max(LEAST_PITCH / TAU);
    // What hardly rises is a joint that turns, and no thread, or what it touches does not show how it rises.
    let ranges: Vec<[f64; 2]> = if guess.abs() < least {
        vec![[least, most], [-least, -most]]
    } else {
        let [from, to] = RISE_RANGE.map(|share| share * guess.abs());
        vec![[from.max(least), to].map(|rise| rise.copysign(guess))]
    };
    let Some(rise) = fitted_rise(&points, &ranges, termination)? else { return Ok(None) };
    let fits = fitted_helices(&points, rise, termination)?;
    Ok(Some(std::array::from_fn(|i| Helix {
        axis_from_frame: fits[i].axis_from_frame * [&own, &others][i].axis_from_frame,
        rise: fits[i].rise,
    })))
}
