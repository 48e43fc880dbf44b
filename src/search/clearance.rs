//! Ways on which a part keeps a distance from what it passes.
//!
//! A verified path may touch what it passes: motions end in contact and slide along. Where a clearance is wanted, the path is
//! pushed away from what it comes too near to, as an elastic band, and verified anew. What cannot be pushed far enough is
//! refused like a path that enters a part.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::{Translation3, Vector3};
use rayon::prelude::*;

use crate::budgets::{BAND_ROUNDS, BAND_ROUNDS_PER_WAYPOINT};
use crate::contact::{ClosestApproach, PassedPair, PassingPair, closest_approach};
use crate::geometry::{Pose, interpolate};
use crate::plan::{BandPush, pushed, with_waypoint};
use crate::scene::exit_direction;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{APPROACH_PRECISION, FIT_SHARE, TOUCHED};

use super::outcome::{NearPass, Removal};
use super::problem::{Problem, VerifiedPath};
use super::requirements::Leaving;

impl Leaving<'_, '_> {
    /// A verified path on which the body keeps the wanted clearance: the given one, or one beside it. Where there is none,
    /// the pair that comes the nearest on the given one.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn with_clearance(
        self,
        earlier: &[Removal],
        verified: VerifiedPath,
    ) -> Result<Result<VerifiedPath, NearPass>, Interrupt> {
        let Self { problem, body, around, aside } = self;
        if problem.clearance == 0.0 {
            return Ok(Ok(verified));
        }
        let VerifiedPath { path, depth } = verified;
        let path = if aside { path } else { self.led_out(earlier, path) };
        let Some(nearest) = NearPass::worst(self.near_passes(&path)?) else {
            return Ok(Ok(VerifiedPath { path, depth }));
        };
        let Some(wide) = self.widened(path)? else { return Ok(Err(nearest)) };
        let is_out = |end: &Pose| exit_direction(&problem.scene, around, body, end, None).is_some();
        if !aside && !wide.last().is_some_and(is_out) {
            return Ok(Err(nearest));
        }
        let Ok(verified) = problem.checked_as_given(&around.standing, body, &wide)? else {
            return Ok(Err(nearest));
        };
        let is_kept = self.near_passes(&verified.path)?.is_empty();
        tracing::debug!(body, is_kept, waypoints = verified.path.len(), "widened");
        Ok(if is_kept { Ok(verified) } else { Err(nearest) })
    }
}

/// The clearance that was wanted of a pair, and how far the two are to be apart.
type KeptDistance = (f64, Option<f64>);

/// By moving and standing part.
#[derive(Default)]
struct KeptDistances(Mutex<HashMap<[usize; 2], KeptDistance>>);

impl Problem<'_> {
    /// How far a pair is to be apart on its way: where it has less as it stands, a share of that. `None` if it may touch: as it
    /// stands it does, or it is a thread with less play than is wanted, which no path of waypoints keeps.
    fn kept_distance(&self, pair: &PassingPair<'_>) -> Result<Option<f64>, Interrupt> {
        let wanted = self.clearance;
        let distances = self.scene.memo.of::<KeptDistances>();
        let known = || distances.0.lock().unwrap_or_else(PoisonError::into_inner);
        let remembered =
            known().get(&pair.parts).filter(|(clearance, _)| *clearance == wanted).map(|(_, kept)| *kept);
        let kept = match remembered {
            Some(kept) => kept,
            None => {
                let kept = pair.kept(wanted, &self.termination.without_planning_time())?;
                known().insert(pair.parts, (wanted, kept));
                kept
            }
        };
        Ok(match kept {
            Some(play) if play < wanted => Some(play * FIT_SHARE).filter(|_| !pair.follows_thread(play)),
            kept => kept,
        })
    }

    /// Whether a body on a path comes nearer to a standing part than the wanted clearance allows.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn passes_too_near(&self, parts: [usize; 2], path: &[Pose]) -> Result<bool, Interrupt> {
        if self.clearance == 0.0 {
            return Ok(false);
        }
        let termination = &self.termination.without_planning_time();
        for pair in PassingPair::of_members(&self.scene, parts, path) {
            if let Some(kept) = self.kept_distance(&pair)?
                && pair.too_near(kept, termination)?.is_some()
            {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl<'p> Leaving<'p, '_> {
    /// The pairs that come near on a path, with the distance that they keep.
    fn passing_pairs(self, path: &[Pose]) -> Result<Vec<(PassingPair<'p>, f64)>, Interrupt> {
        let Self { problem, body, around, .. } = self;
        let near = problem.near(&around.standing, body, path);
        let pairs =
            near.iter().flat_map(|&other| PassingPair::of_members(&problem.scene, [body, other], path));
        let with_kept = |pair: PassingPair<'p>| Ok(problem.kept_distance(&pair)?.map(|kept| (pair, kept)));
        let pairs: Vec<PassingPair<'p>> = pairs.collect();
        let pairs = pairs.into_par_iter().map(with_kept).collect::<Result<Vec<_>, Interrupt>>()?;
        Ok(pairs.into_iter().flatten().collect())
    }

    /// The pairs that come too near on a path.
    fn near_passes(self, path: &[Pose]) -> Result<Vec<NearPass>, Interrupt> {
        let termination = self.problem.termination.without_planning_time();
        let pass = |(pair, kept): &(PassingPair<'_>, f64)| {
            let [part, other] = pair.parts;
            let found = pair.too_near(*kept, &termination)?;
            Ok(found.map(|found| NearPass { part, other, distance: found.distance, kept: *kept }))
        };
        let passes = self.passing_pairs(path)?.par_iter().map(pass).collect::<Result<Vec<_>, Interrupt>>()?;
        Ok(passes.into_iter().flatten().collect())
    }

    /// A path beside a given one on which the body keeps its distances, if pushing finds one.
    fn widened(self, mut path: Vec<Pose>) -> Result<Option<Vec<Pose>>, Interrupt> {
        let Self { problem: Problem { scene, termination, .. }, body, .. } = self;
        let centre = scene.centre_in_shape(body);
        let (mut least, mut least_at) = (f64::INFINITY, 0);
        for round in 1..=BAND_ROUNDS {
            termination.check()?;
            let pushes = self.pushes(&path)?;
            if pushes.is_empty() {
                return Ok(Some(path));
            }
            let most = pushes.iter().map(|push| push.shift.norm()).fold(0.0, f64::max);
            if most < least {
                (least, least_at) = (most, round);
            }
            // There is no room, where all that a waypoint more brought is that others are pushed.
            if round - least_at > 2 * BAND_ROUNDS_PER_WAYPOINT {
                return Ok(None);
            }
            // What is not certified, and near enough, cannot be pushed.
            if pushes.iter().all(|push| push.shift.norm() == 0.0) {
                return Ok(None);
            }
            let longest = |a: &&BandPush, b: &&BandPush| a.shift.norm().total_cmp(&b.shift.norm());
            let astray = pushes.iter().filter(|push| push.needs_waypoint()).max_by(longest);
            let stuck = pushes.iter().max_by(longest).filter(|_| round % BAND_ROUNDS_PER_WAYPOINT == 0);
            path = match astray.or(stuck) {
                Some(place) => with_waypoint(&path, place, &centre),
                None => pushed(&path, &pushes),
            };
        }
        Ok(None)
    }

    /// How a path has to give way, by pair and segment.
    fn pushes(self, path: &[Pose]) -> Result<Vec<BandPush>, Interrupt> {
        let termination = self.problem.termination.without_planning_time();
        let of_pair = |(pair, kept): &(PassingPair<'_>, f64)| {
            let mut pushes = Vec::new();
            if pair.too_near(*kept, &termination)?.is_none() {
                return Ok(pushes);
            }
            for segment in 0..path.len().saturating_sub(1) {
                let part = pair.on_segment(segment);
                let Some(found) = part.too_near(*kept, &termination)? else { continue };
                let shift = shift_away(&part, &found, *kept, &termination)?;
                pushes.push(BandPush { segment, share: found.share, shift });
            }
            Ok(pushes)
        };
        let pushes =
            self.passing_pairs(path)?.par_iter().map(of_pair).collect::<Result<Vec<_>, Interrupt>>()?;
        Ok(pushes.concat())
    }
}

/// The shift (planning frame) after which two parts are as far apart as they should be, where they come too near on a
/// segment.
fn shift_away(
    pair: &PassingPair<'_>,
    found: &ClosestApproach,
    kept: f64,
    termination: &Termination,
) -> Result<Vector3<f64>, Interrupt> {
    let wanted = kept * (1.0 + 2.0 * APPROACH_PRECISION);
    let PassedPair { shapes, path, centre } = &pair.passed;
    let shift = match found.points {
        Some([p, q]) if found.distance > TOUCHED => (p - q).normalize() * (wanted - found.distance).max(0.0),
        // Surfaces that meet have no direction: the one in which the parts come furthest apart.
        _ => {
            let there = interpolate(&path[0], &path[1], centre, found.share);
            let mut best = (0.0, Vector3::zeros());
            for direction in directions() {
                let path = vec![Translation3::from(direction * wanted) * there];
                let away = PassedPair { shapes: *shapes, path, centre: *centre };
                let apart = closest_approach(&[away], wanted, termination)?;
                let apart = apart.map_or(wanted, |found| found.distance);
                if apart > best.0 {
                    best = (apart, direction * wanted);
                }
            }
            best.1
        }
    };
    Ok(pair.standing.rotation * shift)
}

/// Unit vectors along the axes first, then along the diagonals.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let steps = || [-1.0, 0.0, 1.0].into_iter();
    let all =
        steps().flat_map(move |x| steps().flat_map(move |y| steps().map(move |z| Vector3::new(x, y, z))));
    let mut all: Vec<Vector3<f64>> = all.filter(|d| d.norm_squared() > 0.0).collect();
    all.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    all.into_iter().map(|d| d.normalize())
}

#[cfg(test)]
mod tests {
    use super::super::outcome::{Outcome, Reason};
    use super::super::request::{ActionSet, Planner};
    use super::super::search;
    use super::super::tests::{Recorder, problem};
    use super::*;
    use crate::fixtures::{cells, cuboid, moved, scene};
    use crate::geometry::{SourceMesh, hull_distance};
    use crate::plan::PlanStatus;
    use crate::scene::Scene;

    const SIZE: f64 = 0.7;

    /// A closed room (part 0) with an opening in its roof beside one of its walls, and a cube (part 1) at the other wall.
    fn room(opening: f64) -> Vec<SourceMesh> {
        let housing = cells(
            [&[0.0, 1.0, 8.0 - opening, 8.0, 9.0], &[0.0, 1.0, 4.0, 5.0], &[0.0, 1.0, 3.0, 4.0]],
            |[x, y, z]| !((1..=2).contains(&x) && y == 1 && z == 1 || x == 2 && y == 1 && z == 2),
        );
        vec![housing, cuboid([1.3, 2.0, 1.2], [2.3, 3.0, 2.2])].into_iter().map(smaller).collect()
    }

    /// What is turned must not be longer than the planning frame allows.
    fn smaller(mut mesh: SourceMesh) -> SourceMesh {
        mesh.vertices.iter_mut().flatten().for_each(|x| *x *= SIZE);
        mesh
    }

    fn planned(parts: Vec<SourceMesh>, clearance: f64) -> (Scene, Outcome) {
        let (scene, verifier) = scene(parts);
        let kept = scene.clone();
        let actions = ActionSet::Extended;
        let problem =
            Problem { actions, sweeps: true, clearance, fixed: vec![0], ..problem(scene, &verifier) };
        (kept, search(Planner::SbdpStar, problem, &mut Recorder::default()))
    }

    /// The least distance of all triangles at many poses of a path.
    fn sampled(scene: &Scene, path: &[Pose]) -> f64 {
        let corners = |part: usize, pose: &Pose| {
            let surface = &scene.bodies[part].shape.surface;
            let all = 0..surface.triangles().len() as u32;
            all.map(|t| surface.corners(t).map(|p| pose * p)).collect::<Vec<_>>()
        };
        let standing = corners(0, &scene.bodies[0].planning_from_shape);
        let centre = scene.centre_in_shape(1);
        let poses = path.windows(2).flat_map(|leg| {
            (0..=40).map(|i| interpolate(&leg[0], &leg[1], &centre, f64::from(i) / 40.0)).collect::<Vec<_>>()
        });
        let apart = |a: &[nalgebra::Point3<f64>; 3], b: &[nalgebra::Point3<f64>; 3]| {
            hull_distance(a, b).points.map_or(0.0, |[p, q]| (p - q).norm())
        };
        let of_pose = |pose: Pose| {
            let moving = corners(1, &pose);
            let pairs = moving.iter().flat_map(|a| standing.iter().map(move |b| (a, b)));
            pairs.map(|(a, b)| apart(a, b)).fold(f64::INFINITY, f64::min)
        };
        poses.map(of_pose).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_cube_leaves_through_an_opening_without_touching_the_wall_beside_it() {
        for turn in [Vector3::zeros(), Vector3::new(0.4, -0.7, 0.3)] {
            let pose = Pose::rotation(turn);
            let parts = || room(3.0).into_iter().map(|mesh| moved(mesh, &pose)).collect();
            let (scene, outcome) = planned(parts(), 0.0);
            assert_eq!(outcome.status, PlanStatus::Complete);
            assert!(
                sampled(&scene, &outcome.removals[0].path) < 0.01,
                "without a clearance it touches the wall"
            );
            // It stands 0.2 above the floor.
            for clearance in [0.08, 0.6].map(|clearance| clearance * SIZE) {
                let (scene, outcome) = planned(parts(), clearance);
                assert_eq!(outcome.status, PlanStatus::Complete, "{clearance}: {:?}", outcome.reason);
                let [removal] = &outcome.removals[..] else { panic!("{:?}", outcome.removals) };
                let least = sampled(&scene, &removal.path);
                let kept = clearance.min(0.2 * SIZE * FIT_SHARE);
                assert!(least >= kept * (1.0 - APPROACH_PRECISION), "{least} at {clearance}");
            }
        }
    }

    #[test]
    fn an_opening_that_leaves_no_clearance_is_named() {
        // Of the 1.15, the cube has 1. It stands 0.2 above the floor, so it keeps 0.1 from its housing, however much is wanted.
        assert_eq!(planned(room(1.15), 0.05 * SIZE).1.status, PlanStatus::Complete);
        let (_, outcome) = planned(room(1.15), 0.3 * SIZE);
        assert_eq!(outcome.status, PlanStatus::Exhausted);
        let Some(Reason::TooNear(near)) = outcome.reason else { panic!("{:?}", outcome.reason) };
        assert_eq!((near.part, near.other), (1, 0));
        assert!(near.distance < near.kept && (near.kept - 0.2 * SIZE * FIT_SHARE).abs() < 0.01, "{near:?}");
    }

    #[test]
    fn what_is_near_as_it_stands_keeps_a_share_of_what_it_has() {
        // A peg with a play of 0.05 in a hole.
        let plate =
            cells([&[0.0, 2.0, 3.1, 6.0], &[0.0, 2.0, 3.1, 6.0], &[0.0, 2.0]], |[x, y, _]| x != 1 || y != 1);
        let peg = cuboid([2.05, 2.05, 0.5], [3.05, 3.05, 3.0]);
        let (scene, outcome) = planned(vec![plate, peg], 1.0);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        assert!(sampled(&scene, &outcome.removals[0].path) >= 0.05 * FIT_SHARE * (1.0 - APPROACH_PRECISION));
    }
}
