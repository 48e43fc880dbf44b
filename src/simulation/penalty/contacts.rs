//! Contact of one moving body: which points are near the other surface, and the energy, force and
//! Jacobian of those that are inside it.
//!
//! A contact point is inside by s = −φ − threshold, φ being the interpolated field; where s > 0 it
//! has the energy ½ k s². Derivatives are the exact ones of that energy inside a cell of the field,
//! with respect to a displacement δx of the centre of mass and a turn δ (rotation vector) about it,
//! both in planning axes: x ↦ c + δx + exp(δ) r for a point at r from the centre of mass c.

use std::convert::Infallible;

use std::cell::OnceCell;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};

use crate::geometry::{Pose, SampleTree};
use crate::scene::{Body, Scene, StandingParts};
use crate::sdf::{FieldSample, Grid};

use super::parameters::PenaltyParameters;
use super::points::PointCache;

/// Where the moving body is.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyPlacement {
    /// Its centre of mass in the planning frame.
    pub(super) centre: Point3<f64>,
    /// Its axes: planning_from_shape.
    pub(super) rotation: Matrix3<f64>,
}

/// The contact energy at a placement and its derivatives; translation first.
#[derive(Debug, Clone)]
pub(super) struct ContactEnergy {
    pub(super) energy: f64,
    pub(super) gradient: Vector6<f64>,
    /// The part of the second derivative that is never negative.
    pub(super) gauss: Matrix6<f64>,
    /// The rest: curvature of the field and of turning.
    pub(super) curvature: Matrix6<f64>,
    /// Per pair, whether a point was in contact.
    pub(super) touched: Vec<bool>,
}

impl ContactEnergy {
    pub(super) fn new(pairs: usize) -> Self {
        Self {
            energy: 0.0,
            gradient: Vector6::zeros(),
            gauss: Matrix6::zeros(),
            curvature: Matrix6::zeros(),
            touched: vec![false; pairs],
        }
    }

    pub(super) fn clear(&mut self) {
        self.energy = 0.0;
        self.gradient.fill(0.0);
        self.gauss.fill(0.0);
        self.curvature.fill(0.0);
        self.touched.fill(false);
    }
}

/// Whose surface a point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PointSide {
    Moving,
    Standing,
}

/// The moving body and one that stands.
pub(super) struct PenaltyPair<'a> {
    pub(super) other: usize,
    pub(super) standing: &'a Body,
    /// What tolerances are multiplied with, for thin parts.
    pub(super) scale: f64,
    /// Axes of the standing body: planning_from_shape.
    rotation: Matrix3<f64>,
    met: OnceCell<NearPair>,
}

/// What is only worked out for pairs that come near each other.
struct NearPair {
    points: Arc<SampleTree>,
    threshold: f64,
}

/// The near points of one side of a pair.
struct PointGroup {
    pair: usize,
    side: PointSide,
    points: Range<usize>,
}

#[derive(Debug, Clone, Copy)]
struct NearPoint {
    /// In the frame of the shape that it lies on.
    point: Point3<f64>,
    /// How deep it was at the start of the step; only damping asks.
    before: f64,
}

/// All contact of a moving body.
pub(super) struct Contacts<'a> {
    pub(super) scene: &'a Scene,
    pub(super) part: usize,
    pub(super) body: &'a Body,
    pub(super) pairs: Vec<PenaltyPair<'a>>,
    parameters: &'a PenaltyParameters,
    cache: &'a PointCache,
    mine: Arc<SampleTree>,
    groups: Vec<PointGroup>,
    near: Vec<NearPoint>,
}

impl<'a> Contacts<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        surroundings: &StandingParts,
        part: usize,
        parameters: &'a PenaltyParameters,
        cache: &'a PointCache,
    ) -> Self {
        let body = &scene.bodies[part];
        let extent = |body: &Body| body.shape.bounds().extents().min();
        let pair = |&other: &usize| {
            let standing = &scene.bodies[other];
            PenaltyPair {
                other,
                standing,
                scale: parameters.scale_for(extent(body).min(extent(standing))),
                rotation: matrix(&standing.planning_from_shape),
                met: OnceCell::new(),
            }
        };
        let pairs = surroundings.standing.iter().map(pair).collect();
        let mine = cache.of(&body.shape, parameters.longest_edge);
        Self { scene, part, body, pairs, parameters, cache, mine, groups: Vec::new(), near: Vec::new() }
    }

    /// Whether no point is near.
    pub(super) fn is_empty(&self) -> bool {
        self.near.is_empty()
    }

    /// Finds all points that could come in contact before a point of the body has travelled `reach`
    /// from `pose`.
    pub(super) fn gather(&mut self, pose: &Pose, reach: f64) {
        let (mut groups, mut near) = (std::mem::take(&mut self.groups), std::mem::take(&mut self.near));
        groups.clear();
        near.clear();
        let bounds = self.body.shape.bounds().transformed(pose).grown(reach);
        for (i, pair) in self.pairs.iter().enumerate().filter(|(_, p)| p.standing.bounds.meets(&bounds)) {
            let to_standing = pair.standing.planning_from_shape.inverse() * pose;
            for side in [PointSide::Moving, PointSide::Standing] {
                let start = near.len();
                let (trees, measured, to_measured) = self.side(pair, side, &to_standing);
                if !measured.shape.surface.has_inside_for(&self.sampled(pair, side).shape.surface) {
                    continue;
                }
                let found = |point| near.push(NearPoint { point, before: 0.0 });
                points_near(&trees, &measured.field, &to_measured, reach, found);
                if near.len() > start {
                    groups.push(PointGroup { pair: i, side, points: start..near.len() });
                }
            }
        }
        (self.groups, self.near) = (groups, near);
    }

    /// The points of one side of a pair, the body they are measured against, and the way there.
    fn side<'b>(
        &'b self,
        pair: &'b PenaltyPair<'a>,
        side: PointSide,
        to_standing: &Pose,
    ) -> ([&'b SampleTree; 2], &'a Body, Pose) {
        match side {
            PointSide::Moving => ([&self.mine, &self.body.extra_samples], pair.standing, *to_standing),
            PointSide::Standing => {
                let theirs: &SampleTree = &self.met(pair).points;
                ([theirs, &pair.standing.extra_samples], self.body, to_standing.inverse())
            }
        }
    }

    /// The body on whose surface the points of one side of a pair are.
    fn sampled(&self, pair: &PenaltyPair<'a>, side: PointSide) -> &'a Body {
        match side {
            PointSide::Moving => self.body,
            PointSide::Standing => pair.standing,
        }
    }

    fn met<'b>(&self, pair: &'b PenaltyPair<'a>) -> &'b NearPair {
        if let Some(met) = pair.met.get() {
            return met;
        }
        let points = self.cache.of(&pair.standing.shape, self.parameters.longest_edge);
        let assembled = self.assembled_penetration(pair, &points);
        // Deeper than its band the field shows no depth, and far inside no way out either.
        let allowed = assembled.max(self.scene.allowed.of(self.part, pair.other));
        let threshold = allowed + self.parameters.penetration_threshold * pair.scale;
        pair.met.get_or_init(|| NearPair { points, threshold })
    }

    /// The depth of a pair's contact points at the assembled pose, as the fields show it.
    fn assembled_penetration(&self, pair: &PenaltyPair<'a>, theirs: &SampleTree) -> f64 {
        if !self.body.bounds.meets(&pair.standing.bounds) {
            return 0.0;
        }
        let to_standing = pair.standing.planning_from_shape.inverse() * self.body.planning_from_shape;
        let mut depth = 0.0f64;
        for (side, trees, measured, to_measured) in [
            (PointSide::Moving, [&self.mine, &self.body.extra_samples], pair.standing, to_standing),
            (PointSide::Standing, [theirs, &pair.standing.extra_samples], self.body, to_standing.inverse()),
        ] {
            if !measured.shape.surface.has_inside_for(&self.sampled(pair, side).shape.surface) {
                continue;
            }
            let field: &Grid = &measured.field;
            points_near(&trees, field, &to_measured, 0.0, |p| {
                depth = depth.max(-field.value(&(to_measured * p)));
            });
        }
        depth
    }

    /// The depth, by the field, from which contact with a pair acts.
    pub(super) fn threshold(&self, pair: &PenaltyPair<'a>) -> f64 {
        self.met(pair).threshold
    }

    /// Notes how deep all near points are at the start of a step. Needed where there is damping.
    pub(super) fn start_step(&mut self, at: &BodyPlacement) {
        if self.parameters.damping == 0.0 {
            return;
        }
        let mut near = std::mem::take(&mut self.near);
        for group in &self.groups {
            let (view, threshold) = (self.view(group, at), self.threshold(&self.pairs[group.pair]));
            for n in &mut near[group.points.clone()] {
                n.before = -view.field.value(&view.measured(&n.point)) - threshold;
            }
        }
        self.near = near;
    }

    /// Energy and derivatives of all near points; those for turns only if the body `turns`.
    pub(super) fn evaluate(&self, at: &BodyPlacement, turns: bool, out: &mut ContactEnergy) {
        out.clear();
        for group in &self.groups {
            self.add_group(group, at, turns, out);
        }
    }

    /// The same for the points of one side alone.
    #[cfg(test)]
    pub(super) fn evaluate_side(&self, at: &BodyPlacement, side: PointSide, out: &mut ContactEnergy) {
        out.clear();
        for group in self.groups.iter().filter(|g| g.side == side) {
            self.add_group(group, at, true, out);
        }
    }

    fn add_group(&self, group: &PointGroup, at: &BodyPlacement, turns: bool, out: &mut ContactEnergy) {
        let (view, threshold) = (self.view(group, at), self.threshold(&self.pairs[group.pair]));
        for near in &self.near[group.points.clone()] {
            let at = view.measured(&near.point);
            let depth = -view.field.value(&at) - threshold;
            if depth > 0.0 {
                let sample = view.field.sample(&at);
                out.touched[group.pair] = true;
                let law = self.law(depth, near.before);
                view.add(&near.point, &sample, &law, turns, out);
            }
        }
    }

    /// Energy, force and slope at a depth. Damping acts on the rate at which the depth grew over
    /// the step, and in proportion to the depth, so that no force jumps where contact begins.
    fn law(&self, depth: f64, before: f64) -> ContactLaw {
        let (k, d) = (self.parameters.stiffness, self.parameters.damping / self.parameters.time_step);
        ContactLaw {
            energy: depth * depth * (0.5 * k + d * (depth / 3.0 - before / 2.0)),
            force: depth * (k + d * (depth - before)),
            slope: k + d * (2.0 * depth - before),
        }
    }

    fn view(&self, group: &PointGroup, at: &BodyPlacement) -> PointView<'a> {
        let pair = &self.pairs[group.pair];
        let mass_centre = self.body.shape.mass.centre.coords;
        let origin = pair.standing.planning_from_shape.translation.vector;
        // From the centre of mass to the standing shape's origin.
        let offset = origin - at.centre.coords;
        match group.side {
            PointSide::Moving => {
                let to_measured = pair.rotation.transpose() * at.rotation;
                PointView {
                    field: &pair.standing.field,
                    to_measured,
                    measured_offset: -pair.rotation.transpose() * offset - to_measured * mass_centre,
                    axes: pair.rotation,
                    to_arm: at.rotation,
                    arm_offset: -(at.rotation * mass_centre),
                    side: PointSide::Moving,
                }
            }
            PointSide::Standing => PointView {
                field: &self.body.field,
                to_measured: at.rotation.transpose() * pair.rotation,
                measured_offset: at.rotation.transpose() * offset + mass_centre,
                axes: at.rotation,
                to_arm: pair.rotation,
                arm_offset: offset,
                side: PointSide::Standing,
            },
        }
    }
}

struct ContactLaw {
    energy: f64,
    force: f64,
    slope: f64,
}

/// How the points of one side of a pair are seen at a placement.
struct PointView<'a> {
    field: &'a Grid,
    /// From the frame of the points to that of the field.
    to_measured: Matrix3<f64>,
    measured_offset: Vector3<f64>,
    /// Axes of the field: planning_from_measured.
    axes: Matrix3<f64>,
    /// From the frame of the points to their arm: planning axes, from the centre of mass.
    to_arm: Matrix3<f64>,
    arm_offset: Vector3<f64>,
    side: PointSide,
}

impl PointView<'_> {
    fn measured(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.to_measured * point.coords + self.measured_offset)
    }

    fn add(
        &self,
        point: &Point3<f64>,
        sample: &FieldSample,
        law: &ContactLaw,
        turns: bool,
        out: &mut ContactEnergy,
    ) {
        let n = self.axes * sample.gradient;
        let arm = self.to_arm * point.coords + self.arm_offset;
        let moment = arm.cross(&n);
        // dφ: a point of the moving body goes with it, one that stands goes the other way against it.
        let sense = if self.side == PointSide::Moving { 1.0 } else { -1.0 };
        let mut a = Vector6::zeros();
        a.fixed_rows_mut::<3>(0).copy_from(&(n * sense));
        if turns {
            a.fixed_rows_mut::<3>(3).copy_from(&(moment * sense));
        }
        out.energy += law.energy;
        out.gradient -= a * law.force;
        let outer = a * a.transpose();
        let positive = law.slope.max(0.0);
        out.gauss += outer * positive;
        out.curvature += outer * (law.slope - positive);
        self.add_curvature(&n, &arm, sample, law.force, turns, &mut out.curvature);
    }

    /// Adds −force times the second derivative of φ.
    fn add_curvature(
        &self,
        n: &Vector3<f64>,
        arm: &Vector3<f64>,
        sample: &FieldSample,
        force: f64,
        turns: bool,
        out: &mut Matrix6<f64>,
    ) {
        let bend = self.axes * sample.hessian() * self.axes.transpose();
        let mut block = out.fixed_view_mut::<3, 3>(0, 0);
        block -= bend * force;
        if !turns {
            return;
        }
        // dx = δx − arm × δ.
        let lever = -arm.cross_matrix();
        let mut mixed = bend * lever;
        if self.side == PointSide::Standing {
            // exp(−δ)(r − δx) has the term δ × δx.
            mixed += n.cross_matrix();
        }
        // n·½ δ×(δ×r), the same on either side.
        let swing =
            (arm * n.transpose() + n * arm.transpose()) * 0.5 - Matrix3::from_diagonal_element(n.dot(arm));
        let turned = lever.transpose() * bend * lever + swing;
        let mut block = out.fixed_view_mut::<3, 3>(0, 3);
        block -= mixed * force;
        let mut block = out.fixed_view_mut::<3, 3>(3, 0);
        block -= mixed.transpose() * force;
        let mut block = out.fixed_view_mut::<3, 3>(3, 3);
        block -= turned * force;
    }
}

/// Visits the points whose distance from the surface may be `reach` or less, or that may be inside.
fn points_near(
    trees: &[&SampleTree; 2],
    field: &Grid,
    to_measured: &Pose,
    reach: f64,
    mut visit: impl FnMut(Point3<f64>),
) {
    let bound = |p: &Point3<f64>| field.estimate(&(to_measured * p)).lower_bound;
    for tree in trees {
        let Ok::<(), Infallible>(()) = tree.walk(
            (),
            |node, ()| Ok((bound(&node.centre) - node.radius <= reach).then_some(())),
            |point, ()| {
                if bound(point) <= reach {
                    visit(*point);
                }
                Ok(())
            },
        );
    }
}

/// The rotation of a pose as a matrix.
pub(super) fn matrix(pose: &Pose) -> Matrix3<f64> {
    pose.rotation.to_rotation_matrix().into_inner()
}
