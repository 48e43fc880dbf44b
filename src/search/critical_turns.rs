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

use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::budgets::{TURN_CENTRES, TURNS_PER_AXIS};
use crate::contact::sampled::MovingBody;
use crate::geometry::{Bounds, Pose, edge_centres, sharp_edges};
use crate::scene::{Scene, StandingParts};
use crate::simulation::{Action, Axis, FreeTravel, SweepQuestion, free_travel};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{CRITICAL_ANGLE, ONE_AXIS_COSINE, SAME_CENTRE, TURN_POSE_ANGLE, TURNED};

use super::state::least_travel;

/// A part at a pose, among others.
pub(super) struct TurnQuestion<'a> {
    pub(super) scene: &'a Scene,
    pub(super) standing: &'a StandingParts,
    pub(super) part: usize,
    pub(super) start: Pose,
    /// The axes along which it is moved and about which it is turned.
    pub(super) axes: &'a [Axis],
    /// The depth at which paths are refused.
    pub(super) limit: f64,
    pub(super) termination: &'a Termination,
}

/// The sharp edges and the centres of round edges of some parts, in the planning frame.
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

impl TurnQuestion<'_> {
    /// The ways that begin with such a turn: the poses from the start to where the part goes further, those that turn
    /// least first.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn ways(&self) -> Result<Vec<Vec<Pose>>, Interrupt> {
        let Self { scene, standing, part, start, axes, .. } = *self;
        let shape = &scene.bodies[part].shape;
        let own = Features::of(scene, part, &start);
        let centre = start * shape.mass.centre;
        let around = Bounds::of(&[centre]).grown(shape.reach);
        let near = scene.broad_phase.meeting_of(&standing.standing, &around);
        let others = near
            .iter()
            .map(|&other| Features::of(scene, other, &scene.bodies[other].planning_from_shape))
            .reduce(Features::with);
        let Some(others) = others else { return Ok(Vec::new()) };
        let before = self.travels(&start)?;
        let mut turns = Vec::new();
        for axis in axes.iter().map(|axis| axis.unit()) {
            for pivot in pivots(&axis, &own, &others, centre) {
                let angles = critical_angles(&axis, &pivot, &own.edges, &others.edges);
                turns.extend(stops(angles).into_iter().map(|angle| (angle, axis, pivot)));
            }
        }
        turns.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let ways = turns.par_iter().map(|(angle, axis, pivot)| {
            self.termination.check()?;
            let after = self.travels(&turned(&start, axis, pivot, *angle))?;
            let least = least_travel(scene, part);
            if !after.iter().zip(&before).any(|(after, before)| *after > before + least) {
                return Ok(None);
            }
            // The other way round, it may be free where it is not this way.
            for angle in [*angle, angle - TAU.copysign(*angle)] {
                let count = (angle.abs() / TURN_POSE_ANGLE).ceil() as usize;
                let pose = |k: usize| turned(&start, axis, pivot, angle * k as f64 / count as f64);
                if self.is_free((1..=count).map(pose))? {
                    return Ok(Some((0..=count).map(pose).collect()));
                }
            }
            Ok(None)
        });
        Ok(ways.collect::<Result<Vec<_>, Interrupt>>()?.into_iter().flatten().collect())
    }

    /// How far the part goes along each axis, in both senses; infinitely far where it leaves.
    fn travels(&self, start: &Pose) -> Result<Vec<f64>, Interrupt> {
        let Self { scene, standing, part, axes, termination, .. } = *self;
        let senses =
            axes.iter().flat_map(|axis| [true, false].map(|forward| Action::Push(*axis, forward).force()));
        senses
            .map(|direction| {
                let question =
                    SweepQuestion { scene, standing_parts: standing, part, start, direction: &direction };
                let FreeTravel { length, met, .. } = free_travel(&question, termination)?;
                Ok(met.map_or(f64::INFINITY, |_| length))
            })
            .collect()
    }

    /// Whether the part is seen to enter no other at any of some poses.
    fn is_free(&self, poses: impl Iterator<Item = Pose>) -> Result<bool, Interrupt> {
        for pose in poses {
            let body = MovingBody::new(self.scene, self.part, pose).until(self.termination);
            if body.enters_by(self.limit, &self.standing.standing)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The pose after a turn about a line through a point.
fn turned(start: &Pose, axis: &Unit<Vector3<f64>>, pivot: &Point3<f64>, angle: f64) -> Pose {
    let to_pivot = Translation3::from(pivot.coords);
    to_pivot * UnitQuaternion::from_axis_angle(axis, angle) * to_pivot.inverse() * start
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
    let turns = |&there: &f64| own.iter().map(move |here| (there - here + PI).rem_euclid(TAU) - PI);
    let mut angles: Vec<f64> = others.iter().flat_map(turns).collect();
    angles.sort_by(f64::total_cmp);
    angles
}

/// The angles that stand for all: the middles between critical ones, and those at which several edges pass. Of too many,
/// those of the narrowest ranges are left out.
fn stops(angles: Vec<f64>) -> Vec<f64> {
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
