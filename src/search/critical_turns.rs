//! Turns of a part in place, after which it goes where it did not go before.
//!
//! A part that turns freely has nothing to stop it where it could leave: a shaft with two flats leaves its bearing
//! sideways through a slot as wide as the flats, and a lug its groove through a slot in the wall. What it may do changes
//! only at critical angles, where a sharp edge of the part that is parallel to the axis passes one of the others. As
//! along lines ([`cell_decomposition`](super::cell_decomposition)), one angle stands for all between two critical ones,
//! and an angle at which several edges pass is one of its own.
//!
//! Axes are those along which parts are moved, through centres that round edges of the part have in common with round
//! edges of others, and through the centre of mass. A turn counts if the part then goes further along some axis than
//! before. It is a claim, as samples alone were looked at on the way: the path on which it begins is verified as a whole.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::budgets::{CRITICAL_ANGLES, EDGES_CAST_BEFORE_TURNING, TURN_CENTRES, TURNS_PER_AXIS};
use crate::contact::sampled::MovingBody;
use crate::geometry::{Bounds, Pose, edge_centres, sharp_edges};
use crate::scene::{Scene, StandingParts};
use crate::simulation::{Action, Axis, FreeTravel, SweepQuestion, free_travel};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{CRITICAL_ANGLE, ONE_AXIS_COSINE, SAME_CENTRE, TURN_POSE_ANGLE, TURNED};

use super::problem::Problem;
use super::state::least_travel;

/// Turns that are looked at in parallel, enough for 64 threads. The budget of casts is looked at after each batch: at
/// double, a batch exceeds it by twice as much; at half, more than 32 threads wait for each other.
const TURNS_AT_ONCE: usize = 64;

/// A part among others that may be turned in place.
pub(super) struct TurningPart<'a> {
    scene: &'a Scene,
    standing: &'a StandingParts,
    part: usize,
    /// The axes along which it is moved and about which it is turned.
    axes: &'a [Axis],
    /// The depth at which paths are refused.
    limit: f64,
    termination: &'a Termination,
    /// Of the parts around it.
    others: Features,
}

/// A turn about a line through a point.
struct Turn {
    angle: f64,
    axis: Unit<Vector3<f64>>,
    pivot: Point3<f64>,
}

impl Turn {
    /// The pose after a share of the turn.
    fn pose(&self, start: &Pose, share: f64) -> Pose {
        let to_pivot = Translation3::from(self.pivot.coords);
        let rotation = UnitQuaternion::from_axis_angle(&self.axis, self.angle * share);
        to_pivot * rotation * to_pivot.inverse() * start
    }
}

/// How far a part goes along each axis, in both senses; infinitely far where it leaves.
struct Travels {
    lengths: Vec<f64>,
    /// The number of edges that were cast.
    edges: usize,
}

/// The sharp edges and the centres of round edges of some parts, in the planning frame.
#[derive(Default)]
struct Features {
    edges: Vec<[Point3<f64>; 2]>,
    centres: Vec<Point3<f64>>,
}

impl Features {
    fn of(scene: &Scene, part: usize, pose: &Pose) -> Self {
        let surface = &scene.bodies[part].shape.surface;
        let place = |p: &Point3<f64>| pose * p;
        let edges = sharp_edges(surface).map(|ends| ends.map(|v| place(&surface.vertices()[v as usize])));
        Self { edges: edges.collect(), centres: edge_centres(surface).iter().map(place).collect() }
    }

    fn with(mut self, other: Self) -> Self {
        self.edges.extend(other.edges);
        self.centres.extend(other.centres);
        self
    }
}

/// Coordinates across an axis.
struct Across([Vector3<f64>; 2]);

impl Across {
    fn of(axis: &Unit<Vector3<f64>>) -> Self {
        let one = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
        Self([one, axis.cross(&one)])
    }

    fn place(&self, p: &Point3<f64>) -> Point2<f64> {
        Point2::from(self.0.map(|side| side.dot(&p.coords)))
    }
}

impl<'a> TurningPart<'a> {
    /// A part that stands at some poses.
    pub(super) fn new(
        problem: &'a Problem<'_>,
        standing: &'a StandingParts,
        part: usize,
        axes: &'a [Axis],
        starts: &[Pose],
    ) -> Self {
        let Problem { scene, termination, verifier, .. } = problem;
        let shape = &scene.bodies[part].shape;
        let near = |start: &Pose| {
            let around = Bounds::of(&[start * shape.mass.centre]).grown(shape.reach);
            scene.broad_phase.meeting_of(&standing.standing, &around)
        };
        let near: BTreeSet<usize> = starts.iter().flat_map(near).collect();
        let features = |&other: &usize| Features::of(scene, other, &scene.bodies[other].planning_from_shape);
        let others = near.iter().map(features).fold(Features::default(), Features::with);
        Self { scene, standing, part, axes, limit: verifier.limit(), termination, others }
    }

    /// The ways that begin with such a turn: the poses from a start to where the part goes further, those that turn
    /// least first; as many as a budget of casts finds.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn ways_from(&self, start: &Pose) -> Result<Vec<Vec<Pose>>, Interrupt> {
        let own = Features::of(self.scene, self.part, start);
        let centre = start * self.scene.bodies[self.part].shape.mass.centre;
        let before = self.travels(start)?;
        let mut turns = Vec::new();
        for axis in self.axes.iter().map(|axis| axis.unit()) {
            for pivot in pivots(&axis, &own, &self.others, centre) {
                let angles = critical_angles(&axis, &pivot, &own.edges, &self.others.edges);
                turns.extend(stops(&angles).into_iter().map(|angle| Turn { angle, axis, pivot }));
            }
        }
        turns.sort_by(|a, b| a.angle.abs().total_cmp(&b.angle.abs()));
        let (mut ways, mut edges) = (Vec::new(), before.edges);
        for turns in turns.chunks(TURNS_AT_ONCE) {
            let found = turns.par_iter().map(|turn| self.way(start, turn, &before));
            for (way, cast) in found.collect::<Result<Vec<_>, Interrupt>>()? {
                ways.extend(way);
                edges += cast;
            }
            if edges > EDGES_CAST_BEFORE_TURNING {
                break;
            }
        }
        Ok(ways)
    }

    /// The poses of a turn, if the part then goes further than before and is not seen to enter others, and the number of
    /// edges that were cast.
    fn way(
        &self,
        start: &Pose,
        turn: &Turn,
        before: &Travels,
    ) -> Result<(Option<Vec<Pose>>, usize), Interrupt> {
        let end = turn.pose(start, 1.0);
        let Travels { lengths, edges } = self.travels(&end)?;
        let least = least_travel(self.scene, self.part);
        let is_further = lengths.iter().zip(&before.lengths).any(|(after, before)| *after > before + least);
        if !is_further || !self.is_free([end])? {
            return Ok((None, edges));
        }
        // The other way round, it may be free where it is not this way.
        for angle in [turn.angle, turn.angle - TAU.copysign(turn.angle)] {
            let turn = Turn { angle, ..*turn };
            let count = (angle.abs() / TURN_POSE_ANGLE).ceil();
            let poses: Vec<Pose> = (0..=count as usize).map(|k| turn.pose(start, k as f64 / count)).collect();
            if self.is_free(poses[1..].iter().copied())? {
                return Ok((Some(poses), edges));
            }
        }
        Ok((None, edges))
    }

    fn travels(&self, start: &Pose) -> Result<Travels, Interrupt> {
        let Self { scene, standing, part, axes, termination, .. } = *self;
        let mut travels = Travels { lengths: Vec::new(), edges: 0 };
        for (axis, forward) in axes.iter().flat_map(|axis| [(*axis, true), (*axis, false)]) {
            let direction = Action::Push(axis, forward).force();
            let question =
                SweepQuestion { scene, standing_parts: standing, part, start, direction: &direction };
            let FreeTravel { length, met, edges } = free_travel(&question, termination)?;
            travels.lengths.push(met.map_or(f64::INFINITY, |_| length));
            travels.edges += edges;
        }
        Ok(travels)
    }

    /// Whether the part is seen to enter no other at any of some poses.
    fn is_free(&self, poses: impl IntoIterator<Item = Pose>) -> Result<bool, Interrupt> {
        for pose in poses {
            let body = MovingBody::new(self.scene, self.part, pose).until(self.termination);
            if body.enters_by(self.limit, &self.standing.standing)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The points about which a part may turn: centres that it has in common with others across the axis, those of the most
/// round edges first, and the centre of mass.
fn pivots(
    axis: &Unit<Vector3<f64>>,
    own: &Features,
    others: &Features,
    mass: Point3<f64>,
) -> Vec<Point3<f64>> {
    let across = Across::of(axis);
    let there: Vec<Point2<f64>> = others.centres.iter().map(|p| across.place(p)).collect();
    let mut found: Vec<(usize, Point3<f64>)> = Vec::new();
    let is_at = |a: &Point2<f64>, b: &Point2<f64>| (a - b).norm() < SAME_CENTRE;
    for centre in &own.centres {
        let here = across.place(centre);
        match found.iter_mut().find(|(_, known)| is_at(&across.place(known), &here)) {
            Some((count, _)) => *count += 1,
            None if there.iter().any(|other| is_at(other, &here)) => found.push((1, *centre)),
            None => {}
        }
    }
    found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    found.truncate(TURN_CENTRES);
    let mut pivots: Vec<Point3<f64>> = found.into_iter().map(|(_, pivot)| pivot).collect();
    if !pivots.iter().any(|pivot| is_at(&across.place(pivot), &across.place(&mass))) {
        pivots.push(mass);
    }
    pivots
}

/// The angles by which the part turns about a pivot until an edge of it along the axis has the direction of one of the
/// others', ascending; of those that others' edges can meet.
fn critical_angles(
    axis: &Unit<Vector3<f64>>,
    pivot: &Point3<f64>,
    own: &[[Point3<f64>; 2]],
    others: &[[Point3<f64>; 2]],
) -> Vec<f64> {
    let across = Across::of(axis);
    let middle = across.place(pivot);
    let reach = own.iter().flatten().map(|p| (across.place(p) - middle).norm()).fold(0.0, f64::max);
    // The direction of each edge along the axis.
    let directions = |edges: &[[Point3<f64>; 2]]| -> Vec<f64> {
        let along = |[a, b]: &&[Point3<f64>; 2]| {
            (b - a).try_normalize(0.0).is_some_and(|side| side.dot(axis).abs() > ONE_AXIS_COSINE)
        };
        let places = edges.iter().filter(along).map(|[a, _]| across.place(a) - middle);
        let within = places.filter(|p| (SAME_CENTRE..=reach).contains(&p.norm()));
        let mut found: Vec<f64> = within.map(|p| p.y.atan2(p.x)).collect();
        found.sort_by(f64::total_cmp);
        found.dedup_by(|a, b| *a - *b < CRITICAL_ANGLE);
        found
    };
    let (own, others) = (directions(own), directions(others));
    if own.len() * others.len() > CRITICAL_ANGLES {
        return Vec::new();
    }
    let turns = |&there: &f64| own.iter().map(move |here| (there - here + PI).rem_euclid(TAU) - PI);
    let mut angles: Vec<f64> = others.iter().flat_map(turns).collect();
    angles.sort_by(f64::total_cmp);
    angles
}

/// The angles that stand for all: the middles between critical ones, and those at which several edges pass. Of too many,
/// those of the narrowest ranges are left out.
fn stops(angles: &[f64]) -> Vec<f64> {
    let groups: Vec<&[f64]> = angles.chunk_by(|a, b| b - a < CRITICAL_ANGLE).collect();
    let Some(last) = groups.last() else { return Vec::new() };
    let mut before = last[0] - TAU;
    let mut stops = Vec::new();
    for group in &groups {
        let at = group[0];
        stops.push((at - before, f64::midpoint(before, at)));
        if group.len() > 1 {
            stops.push((f64::INFINITY, at));
        }
        before = at;
    }
    stops.retain(|(_, angle)| angle.abs() > TURNED);
    stops.sort_by(|a, b| b.0.total_cmp(&a.0));
    stops.truncate(TURNS_PER_AXIS);
    stops.into_iter().map(|(_, angle)| angle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_angle_stands_for_all_between_two_critical_ones() {
        // Two edges pass at 1 at once; the range across the half turn is one.
        let found = stops(&[-2.0, 1.0, 1.0, 2.0]);
        let mut sorted = found.clone();
        sorted.sort_by(f64::total_cmp);
        let across = f64::midpoint(2.0 - TAU, -2.0);
        assert_eq!(sorted, [across, -0.5, 1.0, 1.5]);
        assert_eq!(found[0], 1.0, "a fit without play comes first");
        assert!(stops(&[]).is_empty());
    }

    #[test]
    fn edges_along_the_axis_give_angles_and_others_do_not() {
        let post = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            [Point3::new(cos, sin, 0.0), Point3::new(cos, sin, 1.0)]
        };
        let flat = [Point3::new(1.0, 0.0, 0.0), Point3::new(2.0, 0.0, 0.0)];
        let far = post(0.7).map(|p| Point3::from(5.0 * p.coords));
        let (own, others) = ([post(0.0), flat], [post(0.3), post(-1.0), flat, far]);
        let found = critical_angles(&Vector3::z_axis(), &Point3::origin(), &own, &others);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] + 1.0).abs() < 1e-9 && (found[1] - 0.3).abs() < 1e-9, "{found:?}");
    }
}
