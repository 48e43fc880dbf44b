//! How near the parts that move in a step pass those that stand.

use nalgebra::Point3;
use rayon::prelude::*;

use crate::contact::{ClosestApproach, PassedPair, PassingPair, closest_approach};
use crate::geometry::{Assembly, Bounds, Pose, scaled_pose};
use crate::termination::{Interrupt, Termination};

/// A step whose clearance is asked for. All motions are rigid and in the input's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PassingStep {
    /// The parts that move as one, and the motion of each from its assembled pose to where it stands as the step begins (of
    /// an assembly plan: as it ends).
    pub moving: Vec<(usize, Pose)>,
    /// The parts that stand meanwhile, likewise.
    pub standing: Vec<(usize, Pose)>,
    /// The way: motions of the moving parts from where they stand. Between two, the centre of their common box moves on a
    /// line and the rotation slerps.
    pub path: Vec<Pose>,
}

/// Steps whose clearance is asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClearanceQuery {
    /// The steps.
    pub steps: Vec<PassingStep>,
    /// The distance (input units) that parts are to keep on their way; such as are nearer to each other as they stand keep
    /// what they have.
    pub wanted: Option<f64>,
}

/// How near one part passes another. Lengths in the input's units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartClearance {
    /// The part that moves.
    pub moving: usize,
    /// The part that stands.
    pub standing: usize,
    /// The least distance of their surfaces on the way.
    pub distance: f64,
    /// What is certified: they come no nearer than this.
    pub at_least: f64,
    /// How far the two are apart as they stand.
    pub assembled: f64,
    /// The segment of the path, 0 for that from its first waypoint to its second.
    pub segment: usize,
    /// How far along the segment, from 0 to 1.
    pub share: f64,
    /// A point of the moving and one of the standing surface there (input frame); `None` where they meet.
    pub points: Option<[Point3<f64>; 2]>,
}

/// The clearance of a step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepClearance {
    /// The standing parts that touch moving ones as the step begins, ascending: they count for nothing else here.
    pub touching: Vec<usize>,
    /// Where the step passes other parts the nearest; its bound is one for all of these. `None` if there are no others.
    pub closest: Option<PartClearance>,
    /// The pairs of parts that do not keep the distance that is wanted, or for which that is not certain.
    pub short: Vec<PartClearance>,
}

/// The clearance of some steps.
pub(super) fn answer(
    assembly: &Assembly,
    query: &ClearanceQuery,
    termination: &Termination,
) -> Result<Vec<StepClearance>, Interrupt> {
    let of_step = |step| step_clearance(assembly, step, query.wanted, termination);
    query.steps.par_iter().map(of_step).collect()
}

/// A pair that comes near, in the input's units.
fn described(pair: &PassingPair<'_>, found: &ClosestApproach, assembled: f64, scale: f64) -> PartClearance {
    let [moving, standing] = pair.parts;
    PartClearance {
        moving,
        standing,
        distance: found.distance / scale,
        at_least: found.at_least / scale,
        assembled: assembled / scale,
        segment: found.segment,
        share: found.share,
        points: found.points.map(|points| points.map(|p| pair.in_planning_frame(&p) / scale)),
    }
}

fn step_clearance(
    assembly: &Assembly,
    step: &PassingStep,
    wanted: Option<f64>,
    termination: &Termination,
) -> Result<StepClearance, Interrupt> {
    let scale = assembly.scale;
    let mut free = Vec::new();
    let mut touching = Vec::new();
    for pair in pairs(assembly, step) {
        if pair.touches(termination)? {
            touching.push(pair.parts[1]);
        } else {
            free.push(pair);
        }
    }
    touching.sort_unstable();
    touching.dedup();
    let passed: Vec<PassedPair<'_>> = free.iter().map(|pair| pair.passed.clone()).collect();
    let assembled =
        |pair: &PassingPair<'_>| Ok(pair.assembled(f64::INFINITY, termination)?.unwrap_or(f64::INFINITY));
    let closest = closest_approach(&passed, f64::INFINITY, termination)?;
    let closest = closest.map(|found| (&free[found.pair], found));
    let closest = closest.map(|(pair, found)| Ok(described(pair, &found, assembled(pair)?, scale)));
    let mut short = Vec::new();
    for (pair, wanted) in free.iter().filter_map(|pair| Some((pair, wanted? * scale))) {
        let Some(kept) = pair.kept(wanted, termination)? else { continue };
        if let Some(found) = pair.too_near(kept, termination)? {
            short.push(described(pair, &found, assembled(pair)?, scale));
        }
    }
    short.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    Ok(StepClearance { touching, closest: closest.transpose()?, short })
}

/// Each moving part with each standing one.
fn pairs<'a>(assembly: &'a Assembly, step: &PassingStep) -> Vec<PassingPair<'a>> {
    let scale = assembly.scale;
    let placed = |&(part, motion): &(usize, Pose)| {
        (part, scaled_pose(&motion, scale) * assembly.parts[part].planning_from_shape)
    };
    let moving: Vec<(usize, Pose)> = step.moving.iter().map(placed).collect();
    let standing: Vec<(usize, Pose)> = step.standing.iter().map(placed).collect();
    let path: Vec<Pose> = step.path.iter().map(|motion| scaled_pose(motion, scale)).collect();
    let bounds = |(part, pose): &(usize, Pose)| {
        let hull: Vec<Point3<f64>> = assembly.shape(*part).hull.iter().map(|p| pose * p).collect();
        Bounds::of(&hull)
    };
    let centre = moving.iter().map(bounds).fold(Bounds::EMPTY, |a, b| a.union(&b)).centre();
    let pair = |(m, from_m): (usize, Pose), (s, from_s): (usize, Pose)| {
        let into = from_s.inverse();
        let shapes = [m, s].map(|part| &**assembly.shape(part));
        let centre = from_m.inverse() * centre;
        PassingPair {
            parts: [m, s],
            standing: from_s,
            passed: PassedPair {
                shapes,
                path: path.iter().map(|motion| into * motion * from_m).collect(),
                centre,
            },
            stand: PassedPair { shapes, path: vec![into * from_m], centre },
        }
    };
    moving.iter().flat_map(|m| standing.iter().map(|s| pair(*m, *s))).collect()
}
