//! Verification of a path on the triangles, independent of distance fields and engines.
//!
//! At poses so dense that no vertex of the moving part travels further than [`DENSITY`] of the
//! longest side between two of them, samples of both surfaces (denser ones than the engine's)
//! are measured exactly against the other's triangles through a bounding-volume hierarchy. What
//! counts is depth beyond the depth of the same samples at the assembled pose. Known miss:
//! features that enter only between two samples or two poses. On long paths (screws of many
//! turns) the poses take turns in checking a half or a quarter of the samples each, so that a
//! sample is still checked every other or every fourth pose.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::geometry::{Bounds, Pose, SampleTree, Shape, Spacing, Surface, area_normal, interpolate};
use crate::simulation::{Allowances, Scene};
use crate::termination::{Interrupt, Termination};

/// Largest travel of a vertex between two checked poses, as a share of the longest side.
const DENSITY: f64 = 0.004;

/// A point that got too deep.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The standing part of the pair.
    pub other: usize,
    /// Whether the point is one of the moving part.
    pub on_moving: bool,
    /// The point in the frame of the shape that it lies on.
    pub point: Point3<f64>,
    /// Depth beyond the allowance.
    pub over: f64,
}

/// What the check of a path found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Largest depth beyond the allowances along the path; 0 if there is none.
    pub depth: f64,
    /// The points that got deep along a path that exceeds the limit; empty if the path is good.
    pub entries: Vec<Entry>,
}

/// The verification samples of all shapes.
#[derive(Debug, Clone)]
pub struct Verifier {
    /// Per shape: its samples, dealt out evenly.
    samples: Arc<Vec<[SampleTree; SHARES]>>,
    /// Per part: index of its shape.
    shape_of: Vec<usize>,
    /// Depth beyond the allowance that is still accepted, in the planning frame.
    limit: f64,
}

impl Verifier {
    /// Prepares the check for shapes; `shape_of` gives each part's shape.
    #[must_use]
    pub fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>, limit: f64) -> Self {
        let samples = shapes.par_iter().map(|s| shares(&s.surface)).collect();
        Self { samples: Arc::new(samples), shape_of, limit }
    }

    /// The same check for an engine that declares another depth.
    #[must_use]
    pub fn with_limit(&self, limit: f64) -> Self {
        Self { limit, ..self.clone() }
    }

    /// The depth at which a path is refused, in the planning frame.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// How deep two parts overlap at the assembled pose.
    #[must_use]
    pub fn assembled_depth(&self, scene: &Scene, a: usize, b: usize) -> f64 {
        let pose = scene.bodies[a].planning_from_shape;
        let mut entries = Vec::new();
        let pair = Pair { part: a, pose: &pose, other: b, granted: 0.0 };
        self.entries(scene, &pair, Turn::ALL, &mut entries);
        entries.iter().map(|e| e.over).fold(0.0, f64::max)
    }

    /// How deep a point in the middle of one part lies in both, where surfaces show no overlap: two
    /// parts that coincide have none of their surface inside the other.
    #[must_use]
    pub fn coincident_depth(&self, scene: &Scene, a: usize, b: usize) -> f64 {
        let (one, other) = (&scene.bodies[a], &scene.bodies[b]);
        let to_other = other.planning_from_shape.inverse() * one.planning_from_shape;
        let depth = |surface: &Surface, p: &Point3<f64>| -surface.signed_distance(p);
        interior_points(&one.shape.surface)
            .map(|p| depth(&one.shape.surface, &p).min(depth(&other.shape.surface, &(to_other * p))))
            .fold(0.0, f64::max)
    }

    /// Checks a path of a part (poses of its shape) among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn check(
        &self,
        scene: &Scene,
        allowances: &Allowances,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Verdict, Interrupt> {
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
        let mut entries: Vec<Entry> = found.into_iter().flatten().collect();
        let depth = entries.iter().map(|e| e.over).fold(0.0, f64::max);
        if depth <= self.limit {
            entries.clear();
        }
        Ok(Verdict { depth, entries })
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
        let samples = |i: usize| &self.samples[self.shape_of[i]];
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

/// A few points below the largest faces, by a tenth of the smallest extent.
fn interior_points(surface: &Surface) -> impl Iterator<Item = Point3<f64>> + '_ {
    const PROBES: usize = 8;
    let area = |t: u32| {
        let [a, b, c] = surface.corners(t);
        area_normal(&a, &b, &c).norm()
    };
    let mut faces: Vec<u32> = (0..surface.triangles().len() as u32).collect();
    faces.sort_by(|&s, &t| area(t).total_cmp(&area(s)).then(s.cmp(&t)));
    let below = surface.bounds().extents().min() / 10.0;
    faces.into_iter().take(PROBES).map(move |t| {
        let [a, b, c] = surface.corners(t);
        Point3::from((a.coords + b.coords + c.coords) / 3.0) - surface.face_normal(t) * below
    })
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
fn shares(surface: &Surface) -> [SampleTree; SHARES] {
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
    use crate::fixtures::{LIMIT, block_on_plate, cells, cuboid, moved, peg_in_hole, scene};

    /// The path of part 1 by steps from its assembled pose, checked against all others.
    fn checked(scene: &Scene, verifier: &Verifier, steps: &[Vector3<f64>]) -> Verdict {
        let mut path = vec![scene.bodies[1].planning_from_shape];
        for s in steps {
            path.push(nalgebra::Translation3::from(*s) * path[path.len() - 1]);
        }
        checked_path(scene, verifier, &path)
    }

    fn checked_path(scene: &Scene, verifier: &Verifier, path: &[Pose]) -> Verdict {
        let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
        verifier.check(scene, &scene.allowances, &standing, 1, path, &Termination::default()).unwrap()
    }

    #[test]
    fn a_path_through_a_wall_is_refused_and_the_wall_named() {
        let [plate, block] = block_on_plate();
        let wall = cuboid([2.5, -4.0, 0.0], [3.0, 4.0, 3.0]);
        let (scene, verifier) = scene([plate, block, wall]);
        let verdict = checked(&scene, &verifier, &[Vector3::x() * 6.0]);
        // The block gets no deeper into the wall than half its width, the wall into the block likewise.
        assert!(verdict.depth > 0.25 && verdict.depth <= 1.0, "{}", verdict.depth);
        let by_block = verdict.entries.iter().filter(|e| e.on_moving).map(|e| e.over).fold(0.0, f64::max);
        assert!((by_block - 0.25).abs() < 0.03, "{by_block}");
        assert!(verdict.entries.len() > 10);
        for e in &verdict.entries {
            assert!(e.other == 2 || e.over < 1e-9, "{e:?}");
        }
        let deepest = verdict.entries.iter().map(|e| e.over).fold(0.0, f64::max);
        assert_eq!(deepest, verdict.depth);
    }

    #[test]
    fn entries_are_points_of_the_surface_that_they_name() {
        let (scene, verifier) = scene(block_on_plate());
        let verdict = checked(&scene, &verifier, &[Vector3::new(0.3, 0.2, -0.1)]);
        assert!((verdict.depth - 0.1).abs() < 1e-9, "{}", verdict.depth);
        for e in &verdict.entries {
            let shape = &scene.bodies[if e.on_moving { 1 } else { e.other }].shape;
            assert!(shape.surface.signed_distance(&e.point).abs() < 1e-9, "{e:?}");
        }
    }

    #[test]
    fn a_thin_wall_between_two_waypoints_is_found() {
        let wall = cuboid([1.5, -3.0, -3.0], [1.6, 3.0, 3.0]);
        let (scene, verifier) = scene([wall, cuboid([0.0; 3], [1.0; 3])]);
        let verdict = checked(&scene, &verifier, &[Vector3::x() * 4.0]);
        assert!(verdict.depth > 0.05 && verdict.depth <= 0.5, "{}", verdict.depth);
    }

    #[test]
    fn flush_sliding_is_not_deep() {
        let turn = Pose::rotation(Vector3::new(0.2, -0.15, 0.1));
        for pose in [Pose::identity(), turn] {
            let (scene, verifier) = scene(block_on_plate().map(|m| moved(m, &pose)));
            let steps =
                [Vector3::new(2.0, 1.0, 0.0), Vector3::new(-4.0, 0.5, 0.0), Vector3::new(8.0, 0.0, 0.0)];
            let verdict = checked(&scene, &verifier, &steps.map(|s| pose * s));
            assert!(verdict.depth < 1e-9 && verdict.entries.is_empty(), "{}", verdict.depth);
        }
    }

    #[test]
    fn a_flush_peg_leaves_its_hole_unhindered() {
        let (scene, verifier) = scene(peg_in_hole(0.0));
        assert!(checked(&scene, &verifier, &[Vector3::z() * 4.0]).depth < 1e-9);
        let askew = checked(&scene, &verifier, &[Vector3::z(), Vector3::x() * 0.05]);
        assert!((askew.depth - 0.05).abs() < 1e-3, "{}", askew.depth);
    }

    #[test]
    fn what_a_turn_sweeps_over_is_found() {
        // A bar that points up turns half-way about y, through a ridge it is clear of at both ends.
        let base =
            cells([&[-4.0, 1.5, 1.8, 4.0], &[-1.0, 1.0], &[-1.0, 0.0, 2.0]], |c| c[2] == 0 || c[0] == 1);
        let (scene, verifier) = scene([base, cuboid([-0.2, -0.2, 0.5], [0.2, 0.2, 4.5])]);
        let from = scene.bodies[1].planning_from_shape;
        let about = |angle: f64| {
            let foot = Pose::translation(0.0, 0.0, 2.5);
            foot * Pose::rotation(Vector3::y() * angle) * foot.inverse() * from
        };
        assert!(checked_path(&scene, &verifier, &[from, about(-0.5)]).depth < 1e-9);
        let path = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| about(k * std::f64::consts::FRAC_PI_4));
        assert!(checked_path(&scene, &verifier, &[path[0]]).depth < 1e-9);
        assert!(checked_path(&scene, &verifier, &[path[4]]).depth < 1e-9);
        assert!(checked_path(&scene, &verifier, &path).depth > 0.05);
    }

    #[test]
    fn an_overlap_is_measured_and_granted() {
        let low = cuboid([-3.0, -3.0, -2.0], [3.0, 3.0, 0.0]);
        let (scene, verifier) = scene([low, cuboid([-1.0, -1.0, -0.3], [1.0, 1.0, 3.0])]);
        let depth = verifier.assembled_depth(&scene, 0, 1);
        assert!((depth - 0.3).abs() < 1e-9, "{depth}");
        assert!((verifier.assembled_depth(&scene, 1, 0) - depth).abs() < 1e-9);
        assert!(checked(&scene, &verifier, &[Vector3::z() * 0.1, Vector3::x()]).depth < 1e-9);
        let deeper = checked(&scene, &verifier, &[Vector3::z() * -0.1]);
        assert!((deeper.depth - 0.1).abs() < 1e-9, "{}", deeper.depth);
    }

    #[test]
    fn parts_that_touch_or_are_apart_do_not_overlap() {
        let (scene, verifier) = scene(block_on_plate());
        assert!(verifier.assembled_depth(&scene, 0, 1) < 1e-12);
        assert_eq!(verifier.coincident_depth(&scene, 0, 1), 0.0);
        assert_eq!(verifier.coincident_depth(&scene, 1, 0), 0.0);
    }

    #[test]
    fn coincident_parts_share_their_inside() {
        let block = || cuboid([-3.0, -2.0, -1.0], [3.0, 2.0, 1.0]);
        let (scene, verifier) = scene([block(), block()]);
        assert!(verifier.assembled_depth(&scene, 0, 1) < 1e-9, "no surface is inside the other");
        let depth = verifier.coincident_depth(&scene, 0, 1);
        assert!(depth > 0.1 && depth <= 1.0, "{depth}");
    }

    #[test]
    fn a_depth_up_to_the_limit_is_told_but_not_refused() {
        let (scene, verifier) = scene(block_on_plate());
        let slight = checked(&scene, &verifier, &[Vector3::z() * (-0.9 * LIMIT)]);
        assert!((slight.depth - 0.9 * LIMIT).abs() < 1e-9 && slight.entries.is_empty());
        assert!(!checked(&scene, &verifier, &[Vector3::z() * (-1.1 * LIMIT)]).entries.is_empty());
        assert_eq!(verifier.limit(), LIMIT);
    }

    #[test]
    fn a_cancelled_check_ends_with_the_reason() {
        let (scene, verifier) = scene(block_on_plate());
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let path = [scene.bodies[1].planning_from_shape];
        let ended = verifier.check(&scene, &scene.allowances, &[0], 1, &path, &termination);
        assert_eq!(ended, Err(Interrupt::Cancelled));
    }

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
