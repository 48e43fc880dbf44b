//! Verification by samples, for paths that turn far: screws of many turns.
//!
//! At poses so dense that no vertex of the moving part travels further than [`DENSITY`] of the
//! longest side between two of them, samples of both surfaces (denser ones than the engine's)
//! are measured exactly against the other's triangles through a bounding-volume hierarchy. Known
//! miss: features that enter only between two samples or two poses. On long paths the poses take
//! turns in checking a half or a quarter of the samples each, so that a sample is still checked
//! every other or every fourth pose.
//!
//! [`depth`](super::depth) has no such misses, but looks at every facet that passes every other: on
//! a thread of ten turns, millions.

use std::sync::{Arc, OnceLock};

use nalgebra::Point3;
use rayon::prelude::*;

use crate::geometry::{Bounds, Pose, SampleTree, Shape, Spacing, Surface, interpolate};
use crate::simulation::{Allowances, Scene};
use crate::termination::{Interrupt, Termination};

use super::verify::Entry;

/// Largest travel of a vertex between two checked poses, as a share of the longest side.
const DENSITY: f64 = 0.004;
/// A path that turns further than this (radians) is sampled.
const FAR: f64 = 4.0;

/// Whether a path turns so far that it is sampled.
pub(super) fn turns_far(path: &[Pose]) -> bool {
    let turns = path.iter().zip(path.iter().skip(1)).map(|(a, b)| a.rotation.angle_to(&b.rotation));
    turns.sum::<f64>() > FAR
}

/// The samples of all shapes, taken when they are needed.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    shapes: Arc<Vec<Sampled>>,
    /// Per part: index of its shape.
    shape_of: Vec<usize>,
    limit: f64,
}

#[derive(Debug)]
struct Sampled {
    shape: Arc<Shape>,
    shares: OnceLock<[SampleTree; SHARES]>,
}

impl Samples {
    pub(super) fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>, limit: f64) -> Self {
        let shapes =
            shapes.iter().map(|s| Sampled { shape: Arc::clone(s), shares: OnceLock::new() }).collect();
        Self { shapes: Arc::new(shapes), shape_of, limit }
    }

    pub(super) fn with_limit(&self, limit: f64) -> Self {
        Self { limit, ..self.clone() }
    }

    fn of(&self, part: usize) -> &[SampleTree; SHARES] {
        let Sampled { shape, shares } = &self.shapes[self.shape_of[part]];
        shares.get_or_init(|| dealt(&shape.surface))
    }

    /// The samples that get deeper than granted along a path: of every pose and pair the deepest,
    /// and all that are deep enough to help in refining a motion.
    pub(super) fn entries_along(
        &self,
        scene: &Scene,
        allowances: &Allowances,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Vec<Entry>, Interrupt> {
        let poses = dense(scene, part, path);
        let found = poses
            .par_iter()
            .enumerate()
            .map(|(i, pose)| {
                termination.check()?;
                let turn = Turn::of(i, poses.len());
                Ok(self.entries_at(scene, allowances, standing, part, pose, turn))
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        Ok(found.into_iter().flatten().collect())
    }

    fn entries_at(
        &self,
        scene: &Scene,
        allowances: &Allowances,
        standing: &[usize],
        part: usize,
        pose: &Pose,
        turn: Turn,
    ) -> Vec<Entry> {
        let bounds = scene.bodies[part].shape.bounds().transformed(pose);
        let mut out = Vec::new();
        for &other in standing.iter().filter(|&&o| scene.bodies[o].bounds.meets(&bounds)) {
            let pair = Pair { part, pose, other, granted: allowances.of(part, other) };
            self.entries(scene, &pair, turn, &mut out);
        }
        out
    }

    /// The samples of a pair deeper than `granted`, on either side: the deepest of each side, and
    /// all that are deep enough to help in refining a motion.
    fn entries(&self, scene: &Scene, pair: &Pair<'_>, turn: Turn, out: &mut Vec<Entry>) {
        let Pair { part, pose, other, granted } = *pair;
        let (moving, standing) = (&scene.bodies[part], &scene.bodies[other]);
        let to_standing = standing.planning_from_shape.inverse() * pose;
        let samples = |i: usize| self.of(i);
        let deep = self.limit / 2.0;
        for (on_moving, trees, to_measured, surface) in [
            (true, samples(part), &to_standing, &standing.shape.surface),
            (false, samples(other), &to_standing.inverse(), &moving.shape.surface),
        ] {
            let mut worst: Option<Entry> = None;
            for tree in trees.iter().enumerate().filter(|(i, _)| turn.takes(*i)).map(|(_, t)| t) {
                entered(tree, to_measured, surface, granted, |point, over| {
                    let entry = Entry { other, on_moving, point, over };
                    if over > deep {
                        out.push(entry.clone());
                    }
                    if worst.as_ref().is_none_or(|w| over > w.over) {
                        worst = Some(entry);
                    }
                });
            }
            out.extend(worst.filter(|w| w.over <= deep));
        }
    }
}

/// A moving part at a pose, a standing one, and the depth that is granted to the two.
struct Pair<'a> {
    part: usize,
    pose: &'a Pose,
    other: usize,
    granted: f64,
}

/// Into so many shares the samples of a shape are dealt.
const SHARES: usize = 4;
/// Paths of more poses than this are long.
const LONG: usize = 400;

/// Which shares a pose checks.
#[derive(Debug, Clone, Copy)]
struct Turn {
    index: usize,
    of: usize,
}

impl Turn {
    const ALL: Self = Self { index: 0, of: 1 };

    /// The turn of pose `index` of `poses`; both ends of a path check all.
    fn of(index: usize, poses: usize) -> Self {
        match poses {
            _ if index == 0 || index + 1 == poses => Self::ALL,
            0..=LONG => Self::ALL,
            _ if poses <= 2 * LONG => Self { index, of: 2 },
            _ => Self { index, of: SHARES },
        }
    }

    fn takes(self, share: usize) -> bool {
        share % self.of == self.index % self.of
    }
}

/// The samples of a surface, dealt out in the order of a tree, so that each share covers all of it.
fn dealt(surface: &Surface) -> [SampleTree; SHARES] {
    let all = SampleTree::new(surface, &spacing(surface.bounds()));
    std::array::from_fn(|i| SampleTree::over(all.points().iter().skip(i).step_by(SHARES).copied().collect()))
}

/// Denser than the engine's samples, and not a multiple of their spacing.
fn spacing(bounds: &Bounds) -> Spacing {
    let size = bounds.extents().max();
    let edge = (size / 63.0).clamp(0.015, 0.07);
    Spacing { edge, blunt_edge: edge * 3.0, face: edge * 4.0 }
}

/// Visits the samples inside `surface` by more than `granted`: the sample in its own shape's frame,
/// and its depth beyond.
fn entered(
    samples: &SampleTree,
    to_measured: &Pose,
    surface: &Surface,
    granted: f64,
    mut visit: impl FnMut(Point3<f64>, f64),
) {
    let inner = surface.bounds().grown(-granted);
    // What is known about a sphere: a triangle near it, its centre, how far outside that lies.
    let root = (0, Point3::origin(), f64::NEG_INFINITY);
    samples.walk(
        root,
        |node, (guess, _, _)| {
            let c = to_measured * node.centre;
            if surface.bounds().distance(&c) > node.radius {
                return None;
            }
            let closest = surface.closest_from(&c, guess);
            let distance = surface.signed(&c, &closest);
            let outside = distance > 0.0 && distance > node.radius - granted;
            (!outside).then_some((closest.triangle, c, distance))
        },
        |sample, (guess, centre, distance)| {
            let p = to_measured * sample;
            let outside = distance > 0.0 && distance > (p - centre).norm() - granted;
            if outside || !inner.contains(&p) {
                return;
            }
            let over = -surface.signed(&p, &surface.closest_from(&p, guess)) - granted;
            if over > 0.0 {
                visit(*sample, over);
            }
        },
    );
}

/// The path's poses and as many between them as the density asks for.
fn dense(scene: &Scene, part: usize, path: &[Pose]) -> Vec<Pose> {
    let shape = &scene.bodies[part].shape;
    // The point that moves on a line: fixed to the shape, the middle of the assembled part's box.
    let centre = scene.centre_in_shape(part);
    let step = DENSITY * scene.longest_side;
    let mut out = Vec::new();
    for (a, b) in path.iter().zip(path.iter().skip(1)) {
        let turn = (a.rotation.inverse() * b.rotation).scaled_axis();
        let radius = turn.try_normalize(1e-12).map_or(0.0, |axis| shape.radius_about(&centre, &axis));
        let travel = (b * centre - a * centre).norm() + radius * turn.norm();
        let n = (travel / step).ceil().max(1.0) as usize;
        out.extend((0..n).map(|k| interpolate(a, b, &centre, k as f64 / n as f64)));
    }
    out.extend(path.last());
    out
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{block_on_plate, scene};

    #[test]
    fn checked_poses_are_dense_and_keep_the_waypoints() {
        let (scene, _) = scene(block_on_plate());
        let from = scene.bodies[1].planning_from_shape;
        let turn = Pose::rotation(Vector3::new(0.0, 0.0, 1.0));
        let path =
            [from, Pose::translation(1.0, 0.0, 0.0) * from, Pose::translation(1.0, 0.0, 0.0) * turn * from];
        let poses = dense(&scene, 1, &path);
        assert_eq!((poses[0], poses[poses.len() - 1]), (path[0], path[2]));
        assert!(poses.iter().any(|p| (p.to_matrix() - path[1].to_matrix()).norm() < 1e-12));
        for w in poses.windows(2) {
            for v in scene.bodies[1].shape.surface.vertices() {
                let travel = (w[1] * v - w[0] * v).norm();
                assert!(travel <= DENSITY * scene.longest_side + 1e-9, "{travel}");
            }
        }
    }
}
