//! Verification by samples, for what bounds do not settle.
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
use crate::termination::{Interrupt, Poll, Termination};

use super::passing::Passing;
use super::verify::{Entry, HELPFUL};

/// Largest travel of a vertex between two checked poses, as a share of the longest side.
const DENSITY: f64 = 0.004;
/// Samples and nodes between two looks at the termination condition: on open surfaces each takes long.
const SAMPLES_POLL: u32 = 1;
/// A path that turns further than this (radians) is a screw.
const FAR: f64 = 4.0;

/// Whether a path turns so far that it may be a screw of many turns.
pub(super) fn turns_far(path: &[Pose]) -> bool {
    let turns = path.iter().zip(path.iter().skip(1)).map(|(a, b)| a.rotation.angle_to(&b.rotation));
    turns.sum::<f64>() > FAR
}

/// The samples of all parts, taken when they are needed.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    /// Per part: those of its shape, which equal parts share.
    parts: Arc<Vec<Arc<Sampled>>>,
}

#[derive(Debug)]
struct Sampled {
    shape: Arc<Shape>,
    shares: OnceLock<[SampleTree; SHARES]>,
}

/// A moment of a path: which samples are looked at there, and of these which count.
struct Moment<'a> {
    pose: &'a Pose,
    turn: Turn,
    /// Deeper than this beyond what is granted, a sample helps in refining a motion.
    deep: f64,
}

impl Samples {
    /// For parts of which `shape_of` gives each one's shape.
    pub(super) fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>) -> Self {
        let sampled = |s: &Arc<Shape>| Arc::new(Sampled { shape: Arc::clone(s), shares: OnceLock::new() });
        let shapes: Vec<_> = shapes.iter().map(sampled).collect();
        Self { parts: Arc::new(shape_of.into_iter().map(|s| Arc::clone(&shapes[s])).collect()) }
    }

    /// Bytes in memory, of what was sampled so far; equal parts count once.
    pub(super) fn memory(&self) -> usize {
        let mut shapes: Vec<&Arc<Sampled>> = self.parts.iter().collect();
        shapes.sort_unstable_by_key(|s| Arc::as_ptr(s));
        shapes.dedup_by_key(|s| Arc::as_ptr(s));
        let taken = shapes.iter().filter_map(|s| s.shares.get()).flatten();
        taken.map(SampleTree::memory).sum()
    }

    /// Those of all parts, and of all parts again.
    pub(super) fn twice(&self) -> Self {
        Self { parts: Arc::new([&self.parts[..], &self.parts[..]].concat()) }
    }

    fn of(&self, part: usize) -> &[SampleTree; SHARES] {
        let Sampled { shape, shares } = &*self.parts[part];
        shares.get_or_init(|| dealt(&shape.surface))
    }

    /// The samples that get deeper than granted along a stretch of a way past a part: of every pose and side
    /// the deepest, and all that are deep enough, for a path that is refused beyond `limit`, to help in
    /// refining a motion.
    pub(super) fn entries_along(
        &self,
        passing: &Passing<'_>,
        stretch: &[Pose],
        limit: f64,
        termination: &Termination,
    ) -> Result<Vec<Entry>, Interrupt> {
        let poses = dense(passing, stretch);
        let found = poses
            .par_iter()
            .enumerate()
            .map(|(i, pose)| {
                termination.check()?;
                let moment = Moment { pose, turn: Turn::of(i, poses.len()), deep: limit * HELPFUL };
                let entries = self.entries(passing, &moment, termination);
                // What was found of samples that were cut short is not to be believed.
                termination.check().map(|()| entries)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        Ok(found.into_iter().flatten().collect())
    }

    /// The samples deeper than granted, on either side: the deepest of each side, and all that are deep
    /// enough to help in refining a motion.
    fn entries(&self, passing: &Passing<'_>, moment: &Moment<'_>, termination: &Termination) -> Vec<Entry> {
        let [moving, standing] = passing.surfaces();
        let (to_standing, mut out) = (moment.pose, Vec::new());
        if !standing.bounds().meets(&moving.bounds().transformed(to_standing)) {
            return out;
        }
        let poll = Poll::every(SAMPLES_POLL, Some(termination));
        let Passing { parts: [part, other], granted, .. } = *passing;
        for (on_moving, sampled, to_measured, measured) in
            [(true, part, to_standing, standing), (false, other, &to_standing.inverse(), moving)]
        {
            let mut worst: Option<Entry> = None;
            let trees = self.of(sampled).iter().enumerate();
            for tree in trees.filter(|(i, _)| moment.turn.takes(*i)).map(|(_, t)| t) {
                entered(tree, to_measured, measured, granted, &poll, |point, over| {
                    let entry = Entry { other, on_moving, point, over };
                    if over > moment.deep {
                        out.push(entry.clone());
                    }
                    if worst.as_ref().is_none_or(|w| over > w.over) {
                        worst = Some(entry);
                    }
                });
            }
            out.extend(worst.filter(|w| w.over <= moment.deep));
        }
        out
    }
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
    poll: &Poll<'_>,
    mut visit: impl FnMut(Point3<f64>, f64),
) {
    let inner = surface.bounds().grown(-granted);
    // What is known about a sphere: a triangle near it, its centre, how far outside that lies.
    let root = (0, Point3::origin(), f64::NEG_INFINITY);
    samples.walk(
        root,
        |node, (guess, _, _)| {
            if poll.is_over() {
                return None;
            }
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
            if poll.is_over() || outside || !inner.contains(&p) {
                return;
            }
            let over = -surface.signed(&p, &surface.closest_from(&p, guess)) - granted;
            if over > 0.0 {
                visit(*sample, over);
            }
        },
    );
}

/// The poses of a stretch of the way and as many between them as the density asks for.
fn dense(passing: &Passing<'_>, path: &[Pose]) -> Vec<Pose> {
    let Passing { shapes: [shape, _], centre, longest_side, .. } = passing;
    let step = DENSITY * longest_side;
    let mut out = Vec::new();
    for (a, b) in path.iter().zip(path.iter().skip(1)) {
        let turn = (a.rotation.inverse() * b.rotation).scaled_axis();
        let radius = turn.try_normalize(1e-12).map_or(0.0, |axis| shape.radius_about(centre, &axis));
        let travel = (b * centre - a * centre).norm() + radius * turn.norm();
        let n = (travel / step).ceil().max(1.0) as usize;
        out.extend((0..n).map(|k| interpolate(a, b, centre, k as f64 / n as f64)));
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
        let passing = Passing::new(&scene, &scene.allowances, [1, 0], &path);
        let path = &passing.path;
        let poses = dense(&passing, path);
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
