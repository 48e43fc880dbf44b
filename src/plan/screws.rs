//! Depth along screws: what the profiles of two parts along their helix settle, and the rest.
//!
//! Along a helix, surfaces keep their profile (see [`Envelope`]): one comparison settles ten turns.
//! Where it does not, because the part strays too far, or a head meets its seat, it is made on each
//! half of the way, where the part strays less; and what short stretches leave open is left to
//! [`depth`](super::depth), as far as that gets, and to samples. So but for these the answer is the
//! same kind of bound.

use nalgebra::Point3;

use crate::geometry::{Pose, Surface};
use crate::termination::{Interrupt, Termination};

use super::course::{Course, Interval};
use super::depth::{Found, MOST_EFFORT};
use super::screw_envelope::{Envelope, Zone};
use super::screw_path::{Pair, ScrewPath};
use super::verify::{Asked, Way};

/// Stretches that turn by less than this (radians) are not compared any more.
const LEAST_TURN: f64 = 0.25;
/// So many helices are tried.
const ROUNDS: usize = 2;
/// How far a part may stray on a piece of the way that is looked at as one, as a share of the limit.
const FINEST: f64 = 1.0 / 2.0;
/// So much effort is spent on a side before profiles are asked.
const FIRST_EFFORT: usize = 8_000;
/// Stretches that turn further (radians) are bounded in pieces.
const LONGEST: f64 = 4.0;

/// The stretches of the way on which the profiles of two surfaces do not show that they are apart. What
/// one helix leaves open is tried again with the helix that is closest to that.
///
/// # Errors
/// The termination condition became true.
pub(super) fn unsettled(
    course: &Course,
    pair: &Pair<'_>,
    mut open: Vec<Interval>,
    limit: f64,
    termination: &Termination,
) -> Result<Vec<Interval>, Interrupt> {
    for _ in 0..ROUNDS {
        let Some(screw) = ScrewPath::new(course, &open, limit * FINEST) else { break };
        if open.is_empty() || screw.helix.rise == 0.0 {
            break;
        }
        open = left_open(&screw, course, pair, open, termination)?;
    }
    Ok(open)
}

fn left_open(
    screw: &ScrewPath,
    course: &Course,
    pair: &Pair<'_>,
    stretches: Vec<Interval>,
    termination: &Termination,
) -> Result<Vec<Interval>, Interrupt> {
    let axis_from_standing = screw.helix.axis_from_planning * pair.planning_from_standing;
    let triangles = |surface: &Surface, axis_from_shape: &Pose| -> Vec<[Point3<f64>; 3]> {
        let corners = |t: u32| surface.corners(t).map(|p| axis_from_shape * p);
        (0..surface.triangles().len() as u32).map(corners).collect()
    };
    let moving = triangles(pair.moving, &screw.reference);
    let standing = triangles(pair.standing, &axis_from_standing);
    let [one, other] = [&moving, &standing].map(|t| Zone::of(t).everywhere());
    let zone = one.common(&other);
    let envelope = |triangles: Vec<[Point3<f64>; 3]>| {
        Envelope::new(triangles.into_iter(), &screw.helix, &zone)
    };
    let (moving, standing) = rayon::join(|| envelope(moving), || envelope(standing));
    let mut open = Vec::new();
    let mut stack = stretches;
    while let Some(interval) = stack.pop() {
        termination.check()?;
        let Some(stretch) = screw.stretch(interval, pair) else { continue };
        let stray = |radius: f64| stretch.stray(radius);
        let places = [stretch.places_of_standing, stretch.places_of_moving];
        if standing.is_apart(places[0], &moving, places[1], stretch.shift, stray) {
            continue;
        }
        if course.turn(interval) < LEAST_TURN {
            open.push(interval);
        } else {
            let [first, second] = interval.halves();
            stack.extend([second, first]);
        }
    }
    Ok(open)
}

/// How deep two parts get into each other along a screw: the moving one into the standing one, and the
/// other way round. Stretches that could not be bounded are told as open.
///
/// # Errors
/// The termination condition became true.
pub(super) fn depth_on_screw(way: &Way<'_>, limit: f64) -> Result<[Found; 2], Interrupt> {
    let Asked { scene, allowances, part, termination, .. } = *way.asked;
    let (moving, standing) = (&scene.bodies[part], &scene.bodies[way.other]);
    let [one, other] = [moving, standing].map(|body| &body.shape.surface);
    if one.is_open() || other.is_open() {
        let unknown = || Found { open: vec![Interval::WHOLE], ..Found::default() };
        return Ok([unknown(), unknown()]);
    }
    // A part that shares no thread with the moving one is soon told to be apart.
    let t0 = std::time::Instant::now();
    let mut found = bounded(way, vec![Interval::WHOLE], FIRST_EFFORT)?;
    let t1 = std::time::Instant::now();
    // Where the one surface does not touch the other, the parts are apart, unless one lay in the
    // other from the start: that is a granted overlap.
    let mut open = taken_open(&mut found);
    if !open.is_empty() && allowances.of(part, way.other) == 0.0 {
        let pair =
            Pair { moving: one, standing: other, planning_from_standing: standing.planning_from_shape };
        open = unsettled(way.course, &pair, open, limit, termination)?;
    }
    let t2 = std::time::Instant::now();
    let [mut one, mut other] = found;
    let turn = |v: &[Interval]| v.iter().map(|i| way.course.turn(*i)).sum::<f64>();
    let left = turn(&open);
    let list = format!("{:?}", open.iter().map(|i| i.of(1.0).map(|x| (x * 1000.0).round())).collect::<Vec<_>>());
    let [more, others] = bounded(way, open, MOST_EFFORT)?;
    eprintln!("pair {} {} turn {:.1} segs {} first {:.4} (effort {} {}), profiles {:.4} leave {left:.2} {list}, bound {:.4} (effort {} {}) leaves {:.2} {:.2}; deep {} {} granted {:.5}", part, way.other, way.course.turn(Interval::WHOLE), way.course.segments.len(),
      (t1-t0).as_secs_f64(), one.effort, other.effort, (t2-t1).as_secs_f64(), t2.elapsed().as_secs_f64(), more.effort, others.effort, turn(&more.open), turn(&others.open), one.deep.len()+more.deep.len(), other.deep.len()+others.deep.len(), allowances.of(part, way.other));
    one.add(more);
    other.add(others);
    Ok([one, other])
}

/// Looks for the deepest points of both surfaces on some stretches of the way, with no more than some
/// effort on each side. Long ones are halved first.
fn bounded(way: &Way<'_>, stretches: Vec<Interval>, most_effort: usize) -> Result<[Found; 2], Interrupt> {
    let side = |on_moving| {
        let mut all = Found::default();
        let mut stack = stretches.clone();
        while let Some(interval) = stack.pop() {
            let left = most_effort.saturating_sub(all.effort);
            if left == 0 || all.is_enough() {
                all.open.push(interval);
            } else if way.course.turn(interval) > LONGEST {
                stack.extend(interval.halves());
            } else {
                all.add(way.depth_of_side(on_moving, interval, left)?);
            }
        }
        Ok(all)
    };
    let (one, other) = rayon::join(|| side(true), || side(false));
    Ok([one?, other?])
}

/// The stretches that are open on either side, which are none then.
fn taken_open(found: &mut [Found; 2]) -> Vec<Interval> {
    let open: Vec<Interval> = found.iter_mut().flat_map(|f| std::mem::take(&mut f.open)).collect();
    let mut apart: Vec<Interval> =
        open.iter().filter(|i| !open.iter().any(|o| o != *i && o.holds(**i))).copied().collect();
    apart.sort_unstable();
    apart.dedup();
    apart
}
