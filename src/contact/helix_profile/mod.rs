//! Depth along screws, bounded by the profiles of two parts along their helix.
//!
//! Along a helix a surface keeps its profile (`envelope`; the helix that a path follows, and how far it strays from
//! it: `path`), so one comparison bounds ten turns. If it does not, because the part strays too far or a head meets
//! its seat, each half of the stretch is compared, where the part strays less. Short stretches that stay open are
//! left to [`path`](super::region_cover::path), as far as its budget goes, and to samples; otherwise the answer is
//! the same kind of bound. A path in the middle of a thread's play (`thread_path`, from the thread that both parts share:
//! `shared_thread`) leaves the room that such a bound needs.

use crate::budgets::{EFFORT_BEFORE_PROFILES, PATH_EFFORT_IN_DOUBT};
use crate::tolerances::{LEAST_PROFILED_TURN, SCREW_TURN, SHORTEST_SCREW_STRETCH, STRAY_SHARE};

mod distances;
mod envelope;
mod helix_fit;
mod path;
mod shared_thread;
mod slip;
#[cfg(test)]
mod tests;
mod thread_path;
mod unscrewing;

use nalgebra::Point3;

use crate::geometry::{Bounds, Pose, Surface};
use crate::termination::{Interrupt, Termination};

pub(crate) use thread_path::{path_on_thread, turn_along_helix};
pub(crate) use unscrewing::{ScrewWay, ways_off};

use super::course::{Course, Interval};
use super::region_cover::cover;
use super::region_cover::path::{PathDepth, PathQuestion};
use envelope::{Envelope, ProfileZone};
use path::{AxisBoxes, ScrewPath, ScrewStretch};

/// The stretches of a path on which the profiles of two surfaces, one screwed past the other, do not prove that they
/// are apart.
///
/// # Errors
/// The termination condition became true.
fn unsettled(
    course: &Course,
    [moving, standing]: [&Surface; 2],
    mut stretches: Vec<Interval>,
    limit: f64,
    termination: &Termination,
) -> Result<Vec<Interval>, Interrupt> {
    let Some(screw) = ScrewPath::new(course, &stretches, limit * STRAY_SHARE) else { return Ok(stretches) };
    if screw.helix.rise == 0.0 {
        return Ok(stretches);
    }
    let triangles = |surface: &Surface, axis_from_shape: &Pose| -> Vec<[Point3<f64>; 3]> {
        let corners = |t: u32| surface.corners(t).map(|p| axis_from_shape * p);
        (0..surface.triangles().len() as u32).map(corners).collect()
    };
    let moving = triangles(moving, &screw.reference);
    let standing = triangles(standing, &screw.helix.axis_from_frame);
    let [of_moving, of_standing] = [&moving, &standing].map(|t| Bounds::of(t.as_flattened()));
    let boxes = AxisBoxes { moving: of_moving, standing: of_standing };
    let [one, other] = [&moving, &standing].map(|t| ProfileZone::of(t));
    let zone = one.common(&other);
    for heights in Envelope::finenesses(screw.helix.pitch()) {
        let met: Vec<ScrewStretch> = stretches.iter().filter_map(|i| screw.stretch(*i, &boxes)).collect();
        let envelope = |triangles: &[[Point3<f64>; 3]], places: fn(&ScrewStretch) -> [f64; 2]| {
            let zone = zone.between(range(met.iter().flat_map(places)));
            Envelope::new(triangles, &screw.helix, &zone, heights, termination)
        };
        let (moving, standing) = rayon::join(
            || envelope(&moving, |stretch| stretch.places_of_moving),
            || envelope(&standing, |stretch| stretch.places_of_standing),
        );
        stretches = uncovered(course, &screw, &boxes, [&moving?, &standing?], stretches, termination)?;
        if stretches.iter().map(|i| course.turn(*i)).sum::<f64>() < LEAST_PROFILED_TURN {
            break;
        }
    }
    Ok(stretches)
}

/// The stretches on which the profiles of a moving and a standing surface do not prove that they are apart.
fn uncovered(
    course: &Course,
    screw: &ScrewPath,
    boxes: &AxisBoxes,
    [moving, standing]: [&Envelope; 2],
    stretches: Vec<Interval>,
    termination: &Termination,
) -> Result<Vec<Interval>, Interrupt> {
    let mut open = Vec::new();
    cover(stretches, |interval, rest| {
        termination.check()?;
        let Some(stretch) = screw.stretch(interval, boxes) else { return Ok(()) };
        let stray = |radius: f64| stretch.stray(radius);
        let places = [stretch.places_of_standing, stretch.places_of_moving];
        if standing.is_apart(places[0], moving, places[1], stretch.shift, stray) {
            return Ok(());
        }
        if course.turn(interval) < SHORTEST_SCREW_STRETCH {
            open.push(interval);
        } else {
            let [first, second] = interval.halves();
            rest.extend([second, first]);
        }
        Ok(())
    })?;
    Ok(open)
}

/// How deep two parts get into each other along a screw, as far as little effort bounds it: the moving one into the
/// standing one, and the other way round. Stretches without a bound are in [`PathDepth::open`]. A part that shares no
/// thread with the moving one is soon bounded.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn screw_depth_soon(way: &PathQuestion<'_>) -> Result<[PathDepth; 2], Interrupt> {
    // Only where there are holes, depth changes its sign in mid-air.
    if has_holes(way) {
        let unknown = || PathDepth { open: vec![Interval::WHOLE], ..PathDepth::default() };
        return Ok([unknown(), unknown()]);
    }
    bounded(way, vec![Interval::WHOLE], EFFORT_BEFORE_PROFILES)
}

/// Whether surfaces cross along a screw, as they do if one part lies in the other: neither profiles nor more effort bound
/// then what [`screw_depth_soon`] left open.
pub(crate) fn surfaces_cross(way: &PathQuestion<'_>) -> bool {
    way.pair_path.allowed > 0.0 || has_holes(way)
}

/// Of the stretches that [`screw_depth_soon`] left open (and that are taken out of what it found), those that profiles
/// along the helix do not settle.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn open_after_profiles(
    way: &PathQuestion<'_>,
    soon: &mut [PathDepth; 2],
    limit: f64,
) -> Result<Vec<Interval>, Interrupt> {
    // They do not overlap at the start: where neither surface meets the other, they stay apart.
    unsettled(way.course, way.pair_path.surfaces(), taken_open(soon), limit, way.termination)
}

/// What [`screw_depth_soon`] found, and the depth on the stretches that were open after profiles, as far as more effort
/// bounds it.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn screw_depth(
    way: &PathQuestion<'_>,
    [mut one, mut other]: [PathDepth; 2],
    open: Vec<Interval>,
) -> Result<[PathDepth; 2], Interrupt> {
    let [more, others] = bounded(way, open, PATH_EFFORT_IN_DOUBT)?;
    one.add(more);
    other.add(others);
    Ok([one, other])
}

fn has_holes(way: &PathQuestion<'_>) -> bool {
    way.pair_path.surfaces().iter().any(|surface| surface.rim().is_some())
}

/// The deepest points of both surfaces on some stretches, with no more than some effort on each side. Long stretches
/// are halved first.
fn bounded(
    way: &PathQuestion<'_>,
    stretches: Vec<Interval>,
    most_effort: usize,
) -> Result<[PathDepth; 2], Interrupt> {
    let side = |on_moving| {
        let mut all = PathDepth::default();
        cover(stretches.clone(), |interval, rest| {
            let left = most_effort.saturating_sub(all.effort);
            if left == 0 || all.is_enough() {
                all.open.push(interval);
            } else if way.course.turn(interval) > SCREW_TURN {
                rest.extend(interval.halves());
            } else {
                all.add(way.depth_of_side(on_moving, interval, left)?);
            }
            Ok(())
        })?;
        Ok(all)
    };
    let (one, other) = rayon::join(|| side(true), || side(false));
    Ok([one?, other?])
}

/// Takes out the stretches that are open on either side.
fn taken_open(found: &mut [PathDepth; 2]) -> Vec<Interval> {
    let open: Vec<Interval> = found.iter_mut().flat_map(|f| std::mem::take(&mut f.open)).collect();
    let mut apart: Vec<Interval> =
        open.iter().filter(|i| !open.iter().any(|o| o != *i && o.holds(**i))).copied().collect();
    apart.sort_unstable();
    apart.dedup();
    apart
}

/// The least and the largest of some numbers.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}
