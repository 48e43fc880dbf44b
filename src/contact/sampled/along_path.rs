//! Verification at samples, where bounds fail.
//!
//! No vertex of the moving part travels further than [`PATH_DENSITY`] of the smaller part's longest side between two poses. At each
//! pose, samples of both surfaces are measured exactly against the other's triangles through a bounding-volume
//! hierarchy: all vertices, and points of convex edges and faces, closer together than the engine's samples. On a
//! path that passes, edges are measured again at points four times as close. Known miss: features that penetrate only
//! between two samples or two poses. On long paths each pose measures a half or a quarter of the samples in turn, so
//! each sample is measured at every second or fourth pose.
//!
//! [`path`](super::super::region_cover::path) has no such misses, but looks at every facet that passes another: on a
//! thread of ten turns these are millions.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::budgets::{FIRST_POSES_EVERY, LONG_PATH, LONG_STEPS_PER_POLL, POSES_AT_ONCE, SAMPLE_SHARES};
use crate::geometry::{Bounds, Look, Pose, SampleBall, SampleTree, Shape, Spacing, Surface, interpolate};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::{HELPFUL, PATH_DENSITY};

use super::super::course::turns_far;
use super::super::pair_path::PairPath;

/// A point that gets too deep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Penetration {
    /// The standing part of the pair.
    pub other: usize,
    /// Whether the point is on the moving part.
    pub on_moving: bool,
    /// The point in the frame of the shape that it lies on.
    pub point: Point3<f64>,
    /// Depth beyond the allowed penetration.
    pub over: f64,
}

/// The samples of all parts, computed when they are needed.
#[derive(Debug, Clone)]
pub(crate) struct PathSamples {
    /// Per part, the samples of its shape, which equal parts share.
    parts: Arc<Vec<Arc<PartSamples>>>,
}

#[derive(Debug)]
struct PartSamples {
    shape: Arc<Shape>,
    shares: [OnceLock<[SampleTree; SAMPLE_SHARES]>; Closeness::ALL.len()],
}

/// The density of samples. Most paths that are refused are refused by the coarse ones.
#[derive(Debug, Clone, Copy)]
enum Closeness {
    Sparse,
    Dense,
}

/// How thoroughly a path is looked at early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Thoroughness {
    /// A share of the samples at few poses, and only if these refute the path, all.
    Few,
    /// All that may refute it early.
    All,
}

impl Closeness {
    const ALL: [Self; 2] = [Self::Sparse, Self::Dense];
}

impl PathSamples {
    /// For parts whose shapes `shape_of` gives.
    pub(crate) fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>) -> Self {
        let sampled =
            |s: &Arc<Shape>| Arc::new(PartSamples { shape: Arc::clone(s), shares: Default::default() });
        let shapes: Vec<_> = shapes.iter().map(sampled).collect();
        Self { parts: Arc::new(shape_of.into_iter().map(|s| Arc::clone(&shapes[s])).collect()) }
    }

    /// Bytes in memory of the samples so far; equal parts count once.
    pub(crate) fn memory(&self) -> usize {
        let mut shapes: Vec<&Arc<PartSamples>> = self.parts.iter().collect();
        shapes.sort_unstable_by_key(|s| Arc::as_ptr(s));
        shapes.dedup_by_key(|s| Arc::as_ptr(s));
        let taken = shapes.iter().flat_map(|s| &s.shares).filter_map(OnceLock::get).flatten();
        taken.map(SampleTree::memory).sum()
    }

    /// For all parts, followed by all parts again.
    pub(crate) fn twice(&self) -> Self {
        Self { parts: Arc::new([&self.parts[..], &self.parts[..]].concat()) }
    }

    fn of(&self, part: usize, closeness: Closeness) -> &[SampleTree; SAMPLE_SHARES] {
        let PartSamples { shape, shares } = &*self.parts[part];
        shares[closeness as usize].get_or_init(|| dealt(&shape.surface, closeness))
    }

    /// The samples that get deeper than allowed on a stretch of a path past a part: for each pose and side the
    /// deepest one. If the path is refused (beyond `limit`), also all others that are deep enough to help in refining
    /// the motion, at the poses that were measured until then.
    pub(crate) fn penetrations_along(
        &self,
        pair_path: &PairPath<'_>,
        stretch: &[Pose],
        limit: f64,
        termination: &Termination,
    ) -> Result<Vec<Penetration>, Interrupt> {
        let poses = dense(pair_path, stretch);
        let few: Vec<Pose> = poses.iter().step_by(FIRST_POSES_EVERY).copied().collect();
        let mut penetrations = Vec::new();
        // What is refused soon is not measured any further.
        for (poses, closeness) in
            [(&few, Closeness::Sparse), (&poses, Closeness::Sparse), (&poses, Closeness::Dense)]
        {
            penetrations.extend(self.penetrations_at(pair_path, poses, limit, closeness, termination)?);
            if penetrations.iter().any(|e| e.over > limit) {
                break;
            }
        }
        Ok(penetrations)
    }

    /// The same at the coarse samples alone, and at few poses if the whole path turns far.
    pub(crate) fn early_penetrations_along(
        &self,
        pair_path: &PairPath<'_>,
        stretch: &[Pose],
        limit: f64,
        thoroughness: Thoroughness,
        termination: &Termination,
    ) -> Result<Vec<Penetration>, Interrupt> {
        let every = if turns_far(&pair_path.path) { FIRST_POSES_EVERY } else { 1 };
        let poses: Vec<Pose> = dense(pair_path, stretch).into_iter().step_by(every).collect();
        let sparse = |poses: &[Pose], shares| {
            self.penetrations_of(shares, pair_path, poses, limit, Closeness::Sparse, termination)
        };
        if let Thoroughness::Few = thoroughness {
            let few: Vec<Pose> = poses.iter().step_by(FIRST_POSES_EVERY).copied().collect();
            let found = sparse(&few, PoseShares::one)?;
            // If they refute the path, the others help in refining the motion.
            if found.iter().all(|e| e.over <= limit) {
                return Ok(found);
            }
        }
        sparse(&poses, PoseShares::of)
    }

    /// The same at some poses, with samples of one density.
    fn penetrations_at(
        &self,
        pair_path: &PairPath<'_>,
        poses: &[Pose],
        limit: f64,
        closeness: Closeness,
        termination: &Termination,
    ) -> Result<Vec<Penetration>, Interrupt> {
        self.penetrations_of(PoseShares::of, pair_path, poses, limit, closeness, termination)
    }

    /// The same with the shares of the samples that `shares` gives each pose, by its number and that of all.
    fn penetrations_of(
        &self,
        shares: fn(usize, usize) -> PoseShares,
        pair_path: &PairPath<'_>,
        poses: &[Pose],
        limit: f64,
        closeness: Closeness,
        termination: &Termination,
    ) -> Result<Vec<Penetration>, Interrupt> {
        let back: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
        let [moving, standing] = pair_path.surfaces();
        let [part, other] = pair_path.parts.map(|part| self.of(part, closeness));
        let sides = [
            PathSide { samples: part, to_measured: poses, measured: standing, allowed: pair_path.allowed },
            PathSide { samples: other, to_measured: &back, measured: moving, allowed: pair_path.allowed },
        ];
        let mut asked: Vec<SampledStretch> = Vec::new();
        let has_inside = [standing.has_inside_for(moving), moving.has_inside_for(standing)];
        let measured = (0..sides.len()).filter(|&side| has_inside[side]);
        for (side, share) in measured.flat_map(|side| (0..SAMPLE_SHARES).map(move |share| (side, share))) {
            let takes = |i: &usize| shares(*i, poses.len()).takes(share);
            let moments: Vec<usize> = (0..poses.len()).filter(takes).collect();
            let stretches = moments.chunks(POSES_AT_ONCE).map(<[usize]>::to_vec);
            asked.extend(stretches.map(|moments| SampledStretch { side, share, moments }));
        }
        let found = asked
            .par_iter()
            .map(|asked| {
                termination.check()?;
                let poll = Poll::every(LONG_STEPS_PER_POLL, Some(termination));
                sides[asked.side].entered(asked, &poll)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        let mut entered: Vec<DeepSample> = found.into_iter().flatten().collect();
        entered.sort_unstable_by_key(|e| (e.moment, e.side, e.share, e.sample));
        let of_side = entered.chunk_by(|a, b| (a.moment, a.side) == (b.moment, b.side));
        Ok(of_side.flat_map(|entered| worth_telling(entered, limit * HELPFUL, pair_path, &sides)).collect())
    }
}

/// Of the samples of one side that are too deep at one moment, the deepest and all deeper than `deep`.
fn worth_telling(
    entered: &[DeepSample],
    deep: f64,
    pair_path: &PairPath<'_>,
    sides: &[PathSide<'_>; 2],
) -> Vec<Penetration> {
    let worst = entered.iter().map(|e| e.over).fold(0.0, f64::max);
    let entry = |e: &DeepSample| Penetration {
        other: pair_path.parts[1],
        on_moving: e.side == 0,
        point: sides[e.side].samples[e.share].points()[e.sample],
        over: e.over,
    };
    entered.iter().filter(|e| e.over > deep || e.over == worst).map(entry).collect()
}

/// The samples of one part of a pair, and the surface that they are measured against.
struct PathSide<'a> {
    samples: &'a [SampleTree; SAMPLE_SHARES],
    /// From the samples' frame to the measured surface's, at all poses.
    to_measured: &'a [Pose],
    measured: &'a Surface,
    allowed: f64,
}

/// A share of a side's samples, and the poses at which they are measured.
struct SampledStretch {
    side: usize,
    share: usize,
    moments: Vec<usize>,
}

/// A sample that is deeper than allowed.
struct DeepSample {
    moment: usize,
    side: usize,
    share: usize,
    sample: usize,
    /// The depth beyond the allowed penetration.
    over: f64,
}

/// What is known of the place of a ball of samples: a near triangle of the measured surface, a point in its frame,
/// and the signed distance there.
type Known = (u32, Point3<f64>, f64);

impl PathSide<'_> {
    /// The samples that are deeper than allowed. A ball of samples is settled for all poses at which it stays outside
    /// the measured surface: from one pose to the next most samples travel less than their distance.
    fn entered(&self, asked: &SampledStretch, poll: &Poll<'_>) -> Result<Vec<DeepSample>, Interrupt> {
        let Self { measured, allowed, .. } = *self;
        let inner = measured.bounds().grown(-allowed);
        let pose = |moment: usize| &self.to_measured[asked.moments[moment]];
        let mut out = Vec::new();
        let look = |ball: SampleBall<'_>, moments: &Range<usize>, (guess, c, known): Known| {
            let middle = moments.start.midpoint(moments.end);
            let at = pose(middle) * ball.centre;
            let ways = moments.clone().map(|moment| (pose(moment) * ball.centre - at).norm_squared());
            let travel = ways.fold(0.0, f64::max).sqrt();
            let (reach, off) = (ball.radius + travel, (at - c).norm());
            let is_outside = |distance: f64| distance > 0.0 && distance > reach - allowed;
            poll.check()?;
            if measured.bounds().distance(&at) > reach || is_outside(known - off) {
                return Ok(Look::Out);
            }
            let split = if travel > ball.radius { Look::Halve } else { Look::In };
            let is_single = ball.sample.is_some() && travel == 0.0;
            // If all of the ball is certainly too near, its parts are measured instead.
            if !is_single && known.abs() + off <= reach - allowed {
                return Ok(split((guess, c, known)));
            }
            if is_single && !inner.contains(&at) {
                return Ok(Look::Out);
            }
            let closest = measured.closest_from(&at, guess);
            let distance = measured.signed(&at, &closest);
            if is_outside(distance) {
                return Ok(Look::Out);
            }
            if let Some(sample) = ball.sample.filter(|_| is_single && -distance > allowed) {
                let (moment, &SampledStretch { side, share, .. }) = (asked.moments[middle], asked);
                out.push(DeepSample { moment, side, share, sample, over: -distance - allowed });
            }
            Ok(split((closest.triangle, at, distance)))
        };
        let root = (0, Point3::origin(), f64::NEG_INFINITY);
        self.samples[asked.share].walk_through(0..asked.moments.len(), root, look)?;
        Ok(out)
    }
}

/// The shares of samples that a pose measures.
#[derive(Debug, Clone, Copy)]
struct PoseShares {
    index: usize,
    of: usize,
}

impl PoseShares {
    const ALL: Self = Self { index: 0, of: 1 };

    /// The shares of pose `index` of `poses`; both ends of a path measure all.
    fn of(index: usize, poses: usize) -> Self {
        match poses {
            _ if index == 0 || index + 1 == poses => Self::ALL,
            0..=LONG_PATH => Self::ALL,
            _ if poses <= 2 * LONG_PATH => Self { index, of: 2 },
            _ => Self { index, of: SAMPLE_SHARES },
        }
    }

    /// One share at every pose.
    fn one(index: usize, _: usize) -> Self {
        Self { index, of: SAMPLE_SHARES }
    }

    fn takes(self, share: usize) -> bool {
        share % self.of == self.index % self.of
    }
}

/// The samples of a surface, dealt out in the order of a tree, so that each share covers all of the surface.
fn dealt(surface: &Surface, closeness: Closeness) -> [SampleTree; SAMPLE_SHARES] {
    let all = SampleTree::new(surface, &spacing(surface.bounds(), closeness));
    std::array::from_fn(|i| {
        SampleTree::over(all.points().iter().skip(i).step_by(SAMPLE_SHARES).copied().collect())
    })
}

/// Denser than the engine's samples, and not a multiple of their spacing. Every vertex is a sample: the crest of a
/// small rounded thread has its vertices at blunt edges, closer together than any spacing.
fn spacing(bounds: &Bounds, closeness: Closeness) -> Spacing {
    let face = (bounds.extents().max() / 16.0).min(0.28);
    match closeness {
        Closeness::Sparse => Spacing { vertex: None, edge: face / 4.0, blunt_edge: face, face },
        // Crests of overlapping threads are deepest between vertices.
        Closeness::Dense => Spacing { vertex: None, edge: face / 16.0, blunt_edge: face / 16.0, face },
    }
}

/// The poses of a stretch of the path, and as many between them as the density demands.
fn dense(pair_path: &PairPath<'_>, path: &[Pose]) -> Vec<Pose> {
    let PairPath { shapes: [shape, _], centre, .. } = pair_path;
    let step = PATH_DENSITY * pair_path.sizes()[0];
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
    use std::collections::HashSet;
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{ball, block_on_plate, cuboid, moved, rod, scene, surface};
    use crate::scene::CongruentPair;

    fn bits(p: &Point3<f64>) -> [u64; 3] {
        p.coords.map(f64::to_bits).into()
    }

    #[test]
    fn every_vertex_is_checked_however_blunt_and_close_to_others() {
        let surface = surface(ball(6));
        let samples = dealt(&surface, Closeness::Sparse);
        let taken: HashSet<_> = samples.iter().flat_map(|s| s.points().iter().map(bits)).collect();
        let close = spacing(surface.bounds(), Closeness::Sparse).edge;
        let [a, b, _] = surface.corners(0);
        assert!((b - a).norm() < close, "vertices that would be thinned");
        assert!(surface.vertices().iter().all(|v| taken.contains(&bits(v))));
    }

    #[test]
    fn edges_that_cross_between_sparse_samples_are_seen_by_dense_ones() {
        // Two rods of three sides, the edge of one across the edge of the other.
        let long = [-4.0, 4.0];
        let closest =
            spacing(&Bounds::of(&surface(rod(1.0, long, 3)).vertices().to_vec()), Closeness::Sparse);
        let apart = 8.0 / (8.0 / closest.edge).ceil();
        // Half-way between samples of both.
        let at = -4.0 + 60.5 * apart;
        let lying = Pose::rotation(Vector3::x() * FRAC_PI_2) * Pose::rotation(Vector3::z() * PI);
        let across = |depth: f64| {
            let place = Pose::translation(2.0 - depth, at, at) * lying;
            scene([rod(1.0, long, 3), moved(rod(1.0, long, 3), &place)])
        };
        let t = Termination::default();
        let penetrations = |depth: f64| {
            let (scene, _) = across(depth);
            let pair_path = PairPath::standing(&scene, &CongruentPair::turned(&scene, 1, 0));
            let assembled: Vec<Arc<Shape>> = scene.bodies.iter().map(|b| Arc::clone(&b.shape)).collect();
            let samples = PathSamples::new(&assembled, vec![0, 1]);
            let sparse =
                samples.penetrations_at(&pair_path, &pair_path.path, 1.0, Closeness::Sparse, &t).unwrap();
            (sparse.len(), samples.penetrations_along(&pair_path, &pair_path.path, 1.0, &t).unwrap().len())
        };
        assert_eq!(penetrations(-0.01), (0, 0));
        let (sparse, all) = penetrations(0.02);
        assert!(sparse == 0 && all > 0, "{sparse} of {all}");
    }

    #[test]
    fn a_small_part_beside_a_long_one_does_not_pass_a_wall_between_two_poses() {
        let half = 0.006;
        let wall = cuboid([-0.001, -half, -half], [0.001, half, half]);
        let block = cuboid([-half - 0.02, -half, -half], [half - 0.02, half, half]);
        let rail = cuboid([-4.5, 1.0, 0.0], [4.5, 1.1, 0.1]);
        let (scene, _) = scene([wall, block, rail]);
        let from = scene.bodies[1].planning_from_shape;
        let path = [from, Pose::translation(0.04, 0.0, 0.0) * from];
        let pair_path = PairPath::new(&scene, &scene.allowed, [1, 0], &path);
        let shapes: Vec<Arc<Shape>> = scene.bodies.iter().map(|b| Arc::clone(&b.shape)).collect();
        let samples = PathSamples::new(&shapes, vec![0, 1, 2]);
        let termination = Termination::default();
        let found = samples.penetrations_along(&pair_path, &pair_path.path, 1e-5, &termination).unwrap();
        assert!(found.iter().any(|p| p.over > 1e-4), "{found:?}");
    }

    #[test]
    fn checked_poses_are_dense_and_keep_the_waypoints() {
        let (scene, _) = scene(block_on_plate());
        let from = scene.bodies[1].planning_from_shape;
        let turn = Pose::rotation(Vector3::new(0.0, 0.0, 1.0));
        let path =
            [from, Pose::translation(1.0, 0.0, 0.0) * from, Pose::translation(1.0, 0.0, 0.0) * turn * from];
        let pair_path = PairPath::new(&scene, &scene.allowed, [1, 0], &path);
        let path = &pair_path.path;
        let poses = dense(&pair_path, path);
        assert_eq!((poses[0], poses[poses.len() - 1]), (path[0], path[2]));
        assert!(poses.iter().any(|p| (p.to_matrix() - path[1].to_matrix()).norm() < 1e-12));
        for w in poses.windows(2) {
            for v in scene.bodies[1].shape.surface.vertices() {
                let travel = (w[1] * v - w[0] * v).norm();
                assert!(travel <= PATH_DENSITY * pair_path.sizes()[0] + 1e-9, "{travel}");
            }
        }
    }
}
