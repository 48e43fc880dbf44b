//! Parts whose neck is in an opening of another part: a proof, by two discs, that two parts never come apart.
//!
//! A closed contour on one part (the holder), in a plane, surrounds an opening. Two flat discs inside the other part
//! are wider than the opening is anywhere, and an arc inside that part from one disc's centre to the other's passes the
//! opening an odd number of times. While nothing of the arc or the discs meets the contour, this number stays odd unless
//! a disc's centre passes the opening. But then the plane of the opening cuts that disc in a chord through its centre
//! (or holds all of it), and all of this chord is in the opening: it is narrower. So the arc always passes the
//! opening, and the hulls of the parts always meet. Arc and discs are everywhere deeper inside their part than
//! verification accepts: no verified path brings them to the contour. Guarantees: no verified path separates a pair
//! that is called necked. Found are necks along the axes of the assembly's own frame, as of rivets, nuts between two
//! heads and beads on a bar, with openings that are as wide as the discs but for [`DISC_SHARE`].

use std::cell::OnceCell;

use nalgebra::{Point3, Unit, Vector3};

use crate::budgets::{CROSS_SECTIONS, DISC_CELLS, LONG_STEPS_PER_POLL};
use crate::geometry::{Bounds, Contour, Surface, across, critical_coordinates, cross_section, is_surrounded};
use crate::scene::Body;
use crate::termination::{Interrupt, Poll};
use crate::tolerances::{DISC_SHARE, ROUNDED};

use super::deepest_point::{deepest_point, octants};
use super::outcome::{Inseparable, SeparationProof};
use super::problem::Problem;

/// A flat disc inside a part, in the planning frame, at right angles to an axis.
#[derive(Debug, Clone, Copy)]
struct Disc {
    height: f64,
    centre: Point3<f64>,
    radius: f64,
}

/// A contour of a part, in the planning frame, at right angles to an axis.
struct Opening {
    height: f64,
    contour: Contour,
    diameter: f64,
}

/// What a part has along one axis, once it is needed.
#[derive(Default)]
struct AlongAxis {
    /// Ascending.
    discs: OnceCell<Vec<Disc>>,
    openings: OnceCell<Vec<Opening>>,
}

/// The pairs of some parts (ascending) of which one has its neck in an opening of the other, but for those that
/// `is_known` holds for.
///
/// # Errors
/// The termination condition became true.
pub(super) fn necked_pairs(
    problem: &Problem<'_>,
    parts: &[usize],
    is_known: impl Fn(usize, usize) -> bool,
) -> Result<Vec<Inseparable>, Interrupt> {
    let Problem { scene, termination, verifier, .. } = problem;
    let poll = Poll::every(LONG_STEPS_PER_POLL, Some(termination));
    let axes: Vec<_> = problem.directions()?.axes.iter().map(|axis| axis.unit()).collect();
    let mut along: Vec<Vec<AlongAxis>> = Vec::new();
    along.resize_with(scene.bodies.len(), || axes.iter().map(|_| AlongAxis::default()).collect());
    let mut found = Vec::new();
    for &necked in parts {
        let body = &scene.bodies[necked];
        // An open surface has no inside.
        if body.shape.surface.is_open() {
            continue;
        }
        for holder in scene.broad_phase.meeting_of(parts, &body.bounds) {
            if holder == necked || is_known(necked, holder) {
                continue;
            }
            let other = &scene.bodies[holder];
            let limit = verifier.limit_past([&body.shape, &other.shape]);
            let least_depth = scene.allowed.of(necked, holder) + limit + ROUNDED;
            for (number, axis) in axes.iter().enumerate() {
                poll.check()?;
                if !reaches_past(&body.bounds, &other.bounds, axis) {
                    continue;
                }
                let discs = known(&along[necked][number].discs, || discs(body, axis, &poll))?;
                let openings = known(&along[holder][number].openings, || Ok(openings(other, axis)))?;
                let neck = Neck { body, axis, least_depth, discs };
                if openings.iter().try_fold(false, |any, o| Ok(any || neck.is_held_by(o, &poll)?))? {
                    found.push(Inseparable { parts: [necked, holder], proof: SeparationProof::Neck });
                    break;
                }
            }
        }
    }
    Ok(found)
}

fn known<T>(cell: &OnceCell<T>, find: impl FnOnce() -> Result<T, Interrupt>) -> Result<&T, Interrupt> {
    if let Some(known) = cell.get() {
        return Ok(known);
    }
    let found = find()?;
    Ok(cell.get_or_init(|| found))
}

/// Whether a part is on both sides of some plane that another part is cut by.
fn reaches_past(part: &Bounds, other: &Bounds, axis: &Unit<Vector3<f64>>) -> bool {
    let [low, high] = [-part.support(&-axis.into_inner()), part.support(axis)];
    low < other.support(axis) && high > -other.support(&-axis.into_inner())
}

/// The heights at which a part is cut: amid the longest stretches between its critical coordinates, ascending.
fn cuts(body: &Body, axis: &Unit<Vector3<f64>>) -> (Unit<Vector3<f64>>, f64, Vec<f64>) {
    let pose = &body.planning_from_shape;
    let in_shape = pose.rotation.inverse() * *axis;
    let shift = axis.dot(&pose.translation.vector);
    let mut critical = critical_coordinates(&body.shape.surface, &in_shape);
    critical.sort_by(f64::total_cmp);
    let mut stretches: Vec<[f64; 2]> = critical.windows(2).map(|w| [w[0], w[1]]).collect();
    stretches.retain(|[low, high]| high - low > ROUNDED);
    stretches.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
    stretches.truncate(CROSS_SECTIONS);
    let mut heights: Vec<f64> = stretches.into_iter().map(|[low, high]| f64::midpoint(low, high)).collect();
    heights.sort_by(f64::total_cmp);
    (in_shape, shift, heights)
}

/// The largest disc in each cross-section of a part.
fn discs(body: &Body, axis: &Unit<Vector3<f64>>, poll: &Poll<'_>) -> Result<Vec<Disc>, Interrupt> {
    let (in_shape, shift, heights) = cuts(body, axis);
    let [u, v] = across(&in_shape);
    let disc = |height: f64| {
        let contours = cross_section(&body.shape.surface, &in_shape, height);
        let flat = |p: &Point3<f64>| Point3::new(u.dot(&p.coords), v.dot(&p.coords), 0.0);
        let place = |p: &Point3<f64>| Point3::from(u * p.x + v * p.y + in_shape.into_inner() * height);
        let bounds = Bounds::of(contours.iter().flat_map(|c| &c.points).map(flat).collect::<Vec<_>>().iter());
        let depth = |p: &Point3<f64>| {
            let p = place(p);
            let nearest = contours.iter().flat_map(Contour::segments).map(|s| distance(&p, s));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            if is_surrounded(&contours, &p, &in_shape) { nearest } else { -nearest }
        };
        if contours.is_empty() {
            return Ok(None);
        }
        let (centre, radius) = deepest_point(&bounds, depth, poll)?;
        let centre = body.planning_from_shape * place(&centre);
        Ok((radius > 0.0).then_some(Disc { height: height + shift, centre, radius }))
    };
    heights.into_iter().filter_map(|height| disc(height).transpose()).collect()
}

fn distance(p: &Point3<f64>, [a, b]: [&Point3<f64>; 2]) -> f64 {
    let along = b - a;
    let share = ((p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (p - (a + along * share)).norm()
}

/// The contours of a part.
fn openings(body: &Body, axis: &Unit<Vector3<f64>>) -> Vec<Opening> {
    let (in_shape, shift, heights) = cuts(body, axis);
    let at = |height: f64| {
        cross_section(&body.shape.surface, &in_shape, height).into_iter().map(move |mut contour| {
            contour.points.iter_mut().for_each(|p| *p = body.planning_from_shape * *p);
            Opening { height: height + shift, diameter: contour.diameter(), contour }
        })
    };
    heights.into_iter().flat_map(at).collect()
}

/// A part that may be held by its neck.
struct Neck<'a> {
    body: &'a Body,
    axis: &'a Unit<Vector3<f64>>,
    /// How deep inside the part its discs and arcs have to be.
    least_depth: f64,
    discs: &'a [Disc],
}

impl Neck<'_> {
    /// Whether an opening holds it.
    fn is_held_by(&self, opening: &Opening, poll: &Poll<'_>) -> Result<bool, Interrupt> {
        let at = self.discs.partition_point(|disc| disc.height < opening.height);
        let (below, above) = self.discs.split_at(at);
        let is_wider = |disc: &Disc| 2.0 * disc.radius * DISC_SHARE > opening.diameter;
        // The nearest ones: what is between them is most likely straight.
        let ends = (below.iter().rposition(is_wider), above.iter().position(is_wider));
        let (Some(first), Some(last)) = ends else { return Ok(false) };
        let through: Vec<Point3<f64>> =
            self.discs[first..=at + last].iter().map(|disc| disc.centre).collect();
        let straight = vec![through[0], through[through.len() - 1]];
        for arc in [straight, through] {
            if self.passes_oddly(&arc, opening)
                && self.is_inside(&arc, poll)?
                && self.holds(&below[first], poll)?
                && self.holds(&above[last], poll)?
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether an arc passes an opening an odd number of times.
    fn passes_oddly(&self, arc: &[Point3<f64>], opening: &Opening) -> bool {
        let over = |p: &Point3<f64>| self.axis.dot(&p.coords) - opening.height;
        let passes = |piece: &&[Point3<f64>]| {
            let [from, to] = [over(&piece[0]), over(&piece[1])];
            (from > 0.0) != (to > 0.0) && {
                let at = piece[0] + (piece[1] - piece[0]) * (from / (from - to));
                is_surrounded([&opening.contour], &at, self.axis)
            }
        };
        arc.windows(2).filter(passes).count() % 2 == 1
    }

    fn depth(&self, p: &Point3<f64>) -> f64 {
        -self.surface().signed_distance(&self.body.planning_from_shape.inverse_transform_point(p))
    }

    fn surface(&self) -> &Surface {
        &self.body.shape.surface
    }

    /// Whether all of an arc is deep enough inside the part: from each place on, as far as its depth allows.
    fn is_inside(&self, arc: &[Point3<f64>], poll: &Poll<'_>) -> Result<bool, Interrupt> {
        for piece in arc.windows(2) {
            let (length, mut at) = ((piece[1] - piece[0]).norm(), 0.0);
            while at < length {
                poll.check()?;
                let p = piece[0] + (piece[1] - piece[0]) * (at / length);
                let room = self.depth(&p) - self.least_depth;
                if room < self.least_depth {
                    return Ok(false);
                }
                at += room;
            }
        }
        Ok(true)
    }

    /// Whether all of a disc, but for a share, is deep enough inside the part.
    fn holds(&self, disc: &Disc, poll: &Poll<'_>) -> Result<bool, Interrupt> {
        let [u, v] = across(self.axis);
        let radius = disc.radius * DISC_SHARE;
        let mut open = vec![(Point3::origin(), Vector3::new(radius, radius, 0.0))];
        for _ in 0..DISC_CELLS {
            poll.check()?;
            let Some((centre, half)) = open.pop() else { return Ok(true) };
            // The nearest point of the cell is off the disc.
            if (centre.coords.abs() - half).map(|x: f64| x.max(0.0)).norm() >= radius {
                continue;
            }
            let depth = self.depth(&(disc.centre + u * centre.x + v * centre.y));
            if depth < self.least_depth && centre.coords.norm() <= radius {
                return Ok(false);
            }
            if depth < self.least_depth + half.norm() {
                open.extend(octants(&centre, &half));
            }
        }
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cells, moved, scene};
    use crate::geometry::{Pose, SourceMesh};
    use crate::search::tests::problem;
    use crate::termination::Termination;

    /// A plate with a square hole of half width 1.1, or one with a slot from the hole to its edge.
    fn plate(has_slot: bool) -> SourceMesh {
        let lines: &[f64] = &[-3.2, -1.1, 1.1, 3.2];
        cells([lines, lines, &[0.0, 1.0]], |[x, y, _]| !(y == 1 && (x == 1 || has_slot && x == 2)))
    }

    /// A square bar of half width 1 along z with heads of some half widths below and above the plate.
    fn rivet(below: f64, above: f64) -> SourceMesh {
        let [near, far] = [below.min(above), below.max(above)];
        let mut lines = vec![-far, -near, -1.0, 1.0, near, far];
        lines.dedup();
        let half = |x: usize| lines[x].abs().max(lines[x + 1].abs());
        let widths = [below, 1.0, above];
        cells([&lines, &lines, &[-0.5, -0.1, 1.1, 1.5]], |[x, y, z]| half(x).max(half(y)) <= widths[z] + 1e-9)
    }

    fn proof(meshes: [SourceMesh; 2]) -> Option<Inseparable> {
        let (scene, verifier) = scene(meshes);
        let problem = Problem { present: vec![0, 1], ..problem(scene, &verifier) };
        necked_pairs(&problem, &[0, 1], |_, _| false).unwrap().first().copied()
    }

    #[test]
    fn a_rivet_is_held_by_its_neck_if_both_heads_are_wider_than_the_hole_is_across() {
        let found = proof([plate(false), rivet(2.0, 1.8)]).expect("1.8 does not fit through 1.1");
        assert_eq!((found.parts, found.proof), ([1, 0], SeparationProof::Neck));
        assert!(proof([plate(false), rivet(2.0, 1.0)]).is_none(), "one head");
        assert!(proof([plate(false), rivet(2.0, 1.5)]).is_none(), "narrower than the diagonal of the hole");
    }

    #[test]
    fn what_is_beside_a_hole_is_not_held() {
        assert!(proof([plate(true), rivet(2.0, 1.8)]).is_none(), "it leaves through the slot");
        let aside = moved(rivet(2.0, 1.8), &Pose::translation(4.3, 0.0, 0.0));
        assert!(proof([plate(false), aside]).is_none(), "its neck is beside the plate");
    }

    #[test]
    fn a_cancelled_proof_ends_with_the_reason() {
        let (scene, verifier) = scene([plate(false), rivet(2.0, 1.8)]);
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let problem = Problem { present: vec![0, 1], termination, ..problem(scene, &verifier) };
        let ended = necked_pairs(&problem, &[0, 1], |_, _| false);
        assert_eq!(ended.err(), Some(Interrupt::Cancelled));
    }
}
