//! Verification of a path on the triangles, independent of distance fields and engines.
//!
//! Both surfaces of the moving part and of each standing part near its path ([`PairPath`]) are bounded against each
//! other all along the path ([`path`](crate::contact::region_cover::path) describes how, and with which guarantees).
//! Only depth beyond that of the pair at the assembled pose counts, which is measured by the same search.
//! Screws of many turns are bounded by their profiles, too ([`helix_profile`](crate::contact::helix_profile)), and what
//! neither settles is checked at samples ([`along_path`](crate::contact::sampled::along_path)).

use std::collections::BTreeMap;
use std::collections::btree_map::Entry::{Occupied, Vacant};
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::budgets::EFFORT_BEFORE_SAMPLES;
use crate::contact::PairPath;
use crate::contact::course::{Course, Interval, turns_far};
use crate::contact::helix_profile::{
    open_after_profiles, path_on_thread, screw_depth, screw_depth_soon, surfaces_cross,
};
use crate::contact::region_cover::path::{DepthPrecision, PathDepth, PathQuestion};
use crate::contact::sampled::along_path::{PathSamples, Penetration, Thoroughness};
use crate::geometry::{Pose, Shape};
use crate::scene::{AllowedPenetrations, CongruentPair, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    COARSE_SHARE, FINEST_SHARE, HELPFUL, IGNORED_SHARE, IGNORED_SHARE_IN_OVERLAP, OVERLAP_FINEST,
    OVERLAP_IGNORED, OVERLAP_MARGIN, PAIR_LIMIT, THIN_LIMIT,
};

use super::common_depth::common_depth;

/// What the check of a path found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Nothing gets deeper than this beyond the allowed penetrations along a good path; 0 if nothing does. Of a
    /// refused one, the deepest that was found before it was given up: it may get deeper.
    pub depth: f64,
    /// Points that got deep along a path that exceeds the limit; empty if the path is good.
    pub penetrations: Vec<Penetration>,
    /// The depth at which the path is refused, in the planning frame.
    pub limit: f64,
}

impl Verdict {
    /// On a path where nothing but these points gets deeper than `bound` into one part.
    fn past(bound: f64, penetrations: Vec<Penetration>, limit: f64) -> Self {
        Self { depth: deepest(bound, &penetrations), penetrations, limit }
    }

    /// Whether the path is refused.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.depth > self.limit
    }

    /// Joins the results past each standing part. If none exceeds its limit, the path is good, penetrations are dropped,
    /// and the limit is the largest; of a refused path, penetrations that are too shallow to help are dropped, and the
    /// limit is the smallest.
    #[must_use]
    pub fn of_all(past: Vec<Self>) -> Self {
        let depth = past.iter().map(|v| v.depth).fold(0.0, f64::max);
        let limits = past.iter().map(|v| v.limit);
        if !past.iter().any(Self::is_refused) {
            return Self { depth, penetrations: Vec::new(), limit: limits.fold(0.0, f64::max) };
        }
        let limit = limits.fold(f64::INFINITY, f64::min);
        let helpful = |v: Self| v.penetrations.into_iter().filter(move |e| e.over > v.limit * HELPFUL);
        Self { depth, penetrations: past.into_iter().flat_map(helpful).collect(), limit }
    }
}

/// How deep two parts overlap as assembled, in the planning frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairOverlap {
    /// The depth of the deepest point of either surface in the other part: what the pair is allowed.
    pub surface: f64,
    /// The depth of the deepest point inside both, where they have a body in common: then the surfaces coincide, and
    /// neither is deep in the other part.
    pub common: f64,
}

impl PairOverlap {
    /// The deepest point of either part in the other.
    #[must_use]
    pub fn depth(&self) -> f64 {
        self.surface.max(self.common)
    }
}

/// The largest of a depth and those of some points.
fn deepest(depth: f64, penetrations: &[Penetration]) -> f64 {
    penetrations.iter().map(|e| e.over).fold(depth, f64::max)
}

/// The check, prepared for all shapes.
#[derive(Debug, Clone)]
pub struct Verifier {
    /// The samples for paths that turn far.
    samples: PathSamples,
    /// Depth beyond the allowed penetration that is still accepted, in the planning frame.
    limit: f64,
    /// Whether small and thin parts have lower limits.
    is_by_pair: bool,
}

impl Verifier {
    /// Bytes in memory so far.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.samples.memory()
    }

    /// Prepares the check for shapes; `shape_of` gives each part's shape.
    #[must_use]
    pub fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>, limit: f64) -> Self {
        Self { samples: PathSamples::new(shapes, shape_of), limit, is_by_pair: true }
    }

    /// The same check for an engine that declares another depth, for all pairs.
    #[must_use]
    pub fn with_limit(&self, limit: f64) -> Self {
        Self { limit, samples: self.samples.clone(), is_by_pair: self.is_by_pair && limit == self.limit }
    }

    /// The same check for a scene that has every part twice: all of them, and then all of them again.
    #[must_use]
    pub fn twice(&self) -> Self {
        Self { samples: self.samples.twice(), ..*self }
    }

    /// The same check for the bodies of a scene whose longest side is `factor` times that of this one's.
    #[must_use]
    pub(crate) fn at_scale(&self, scene: &Scene, factor: f64) -> Self {
        let shapes: Vec<Arc<Shape>> = scene.bodies.iter().map(|body| Arc::clone(&body.shape)).collect();
        let shape_of = (0..shapes.len()).collect();
        Self { samples: PathSamples::new(&shapes, shape_of), limit: self.limit * factor, ..*self }
    }

    /// Whether small and thin parts have lower limits.
    pub(crate) fn is_by_pair(&self) -> bool {
        self.is_by_pair
    }

    /// The largest depth at which a path is refused, in the planning frame.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// The depth at which a path of one of two shapes past the other is refused: it depends on the two alone, not on what
    /// else is in the assembly.
    #[must_use]
    pub fn limit_past(&self, shapes: [&Shape; 2]) -> f64 {
        if !self.is_by_pair {
            return self.limit;
        }
        let least = |of: fn(&Shape) -> f64| of(shapes[0]).min(of(shapes[1]));
        let (size, thickness) = (least(|shape| shape.bounds().extents().max()), least(Shape::thickness));
        self.limit.min(PAIR_LIMIT * size).min(THIN_LIMIT * thickness)
    }

    /// How deep the surface of one of two parts gets into the other as they stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn assembled_depth(
        &self,
        scene: &Scene,
        pair: &CongruentPair,
        termination: &Termination,
    ) -> Result<f64, Interrupt> {
        let pair_path = PairPath::standing(scene, pair);
        let limit = self.limit_past(pair_path.shapes);
        let precision = DepthPrecision {
            ignored: OVERLAP_IGNORED * limit,
            deep: f64::INFINITY,
            margin: OVERLAP_MARGIN * limit,
            finest: OVERLAP_FINEST * limit,
            coarse: COARSE_SHARE * pair_path.sizes()[1],
        };
        let course = Course::new(&pair_path.path, pair_path.centre, 0.0);
        let way = PathQuestion { pair_path: &pair_path, course: &course, precision, termination };
        let [one, other] = way.depth()?;
        let depth = one.depth.max(other.depth);
        let effort = [one.effort, other.effort];
        tracing::debug!(parts = ?pair.parts, depth, ?effort, "overlap measured");
        if !one.open.is_empty() || !other.open.is_empty() {
            let penetrations =
                self.samples.penetrations_along(&pair_path, &pair_path.path, limit, termination)?;
            return Ok(deepest(depth, &penetrations));
        }
        Ok(depth)
    }

    /// The same, and how deep the inside is that they have in common.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn overlap(
        &self,
        scene: &Scene,
        pair: &CongruentPair,
        termination: &Termination,
    ) -> Result<PairOverlap, Interrupt> {
        let surface = self.assembled_depth(scene, pair, termination)?;
        let common = common_depth(&PairPath::standing(scene, pair), termination)?;
        Ok(PairOverlap { surface, common })
    }

    /// A path from where a given one begins to where it ends that turns in the middle of the play of a
    /// thread, if the given one follows a thread. It is no better verified than any.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn path_on_thread(
        &self,
        scene: &Scene,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Option<Vec<Pose>>, Interrupt> {
        path_on_thread(scene, standing, part, path, self.limit, termination)
    }

    /// Checks a path of a part (poses of its shape) among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn check(
        &self,
        scene: &Scene,
        allowed: &AllowedPenetrations,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Verdict, Interrupt> {
        let swept = scene.swept_bounds(part, path);
        let near = standing.iter().filter(|&&other| scene.bodies[other].bounds.meets(&swept));
        let pair_path = |&other: &usize| PairPath::new(scene, allowed, [part, other], path);
        let pair_path: Vec<_> = near.map(pair_path).collect();
        let past: Vec<_> =
            pair_path.par_iter().map(|p| self.past(p, termination)).collect::<Result<_, _>>()?;
        Ok(Verdict::of_all(past))
    }

    /// What is found of a path past one part that stands: it depends on no other.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn past(&self, pair_path: &PairPath<'_>, termination: &Termination) -> Result<Verdict, Interrupt> {
        let (samples, limit) = (&self.samples, &self.limit_past(pair_path.shapes));
        let course = &Course::new(&pair_path.path, pair_path.centre, pair_path.reach());
        let question = self.question(pair_path, course, termination);
        let early = |thoroughness, stretch: &[Pose]| {
            let seen =
                samples.early_penetrations_along(pair_path, stretch, *limit, thoroughness, termination)?;
            let is_refused = seen.iter().any(|e| e.over > *limit);
            Ok(is_refused.then(|| Verdict::past(0.0, seen, *limit)))
        };
        let found = match bounded(&question, early)? {
            Ok(found) => found,
            Err(refused) => return Ok(refused),
        };
        let bound = found.iter().map(|f| f.bound).fold(0.0, f64::max);
        let [part, other] = pair_path.parts;
        let effort = found.each_ref().map(|f| f.effort);
        tracing::debug!(part, other, allowed = pair_path.allowed, bound, ?effort, "verified");
        let mut penetrations = deepest_penetrations(pair_path, &found);
        if bound <= *limit {
            for stretch in joined(course, found.iter().flat_map(|f| &f.open)) {
                let path = course.path_between(stretch);
                penetrations.extend(samples.penetrations_along(pair_path, &path, *limit, termination)?);
            }
        }
        Ok(Verdict::past(bound, penetrations, *limit))
    }

    /// How deep the moving part gets into the standing one, and the other way round, as far as that can be bounded.
    #[cfg(test)]
    pub(crate) fn bounds(&self, pair_path: &PairPath<'_>) -> [PathDepth; 2] {
        let course = Course::new(&pair_path.path, pair_path.centre, pair_path.reach());
        let termination = Termination::default();
        let question = self.question(pair_path, &course, &termination);
        bounded(&question, |_, _| Ok(None::<()>)).unwrap().unwrap()
    }

    /// The question of how deep each of two parts gets into the other along a path.
    fn question<'a>(
        &self,
        pair_path: &'a PairPath<'a>,
        course: &'a Course,
        termination: &'a Termination,
    ) -> PathQuestion<'a> {
        let limit = self.limit_past(pair_path.shapes);
        let share = if pair_path.allowed > 0.0 { IGNORED_SHARE_IN_OVERLAP } else { IGNORED_SHARE };
        let precision = DepthPrecision {
            ignored: limit * share,
            deep: limit,
            margin: limit,
            finest: limit * FINEST_SHARE,
            coarse: COARSE_SHARE * pair_path.sizes()[1],
        };
        PathQuestion { pair_path, course, precision, termination }
    }
}

/// How deep each of two parts gets into the other, as far as that can be bounded. Where little effort leaves stretches
/// open, `early` looks at samples: most paths that are refused are refused there, and what refuses them is the answer.
fn bounded<R>(
    question: &PathQuestion<'_>,
    early: impl Fn(Thoroughness, &[Pose]) -> Result<Option<R>, Interrupt>,
) -> Result<Result<[PathDepth; 2], R>, Interrupt> {
    let is_open = |found: &[PathDepth; 2]| found.iter().any(|side| !side.open.is_empty());
    let path = &question.pair_path.path;
    if !turns_far(path) {
        let soon = question.depth_within(EFFORT_BEFORE_SAMPLES)?;
        if !is_open(&soon) {
            return Ok(Ok(soon));
        }
        let refused = early(Thoroughness::All, path)?;
        return refused.map_or_else(|| question.depth().map(Ok), |refused| Ok(Err(refused)));
    }
    let mut soon = screw_depth_soon(question)?;
    // Where surfaces cross, samples alone decide.
    if !is_open(&soon) || surfaces_cross(question) {
        return Ok(Ok(soon));
    }
    // Profiles take less time than all samples.
    if let Some(refused) = early(Thoroughness::Few, path)? {
        return Ok(Err(refused));
    }
    let open = open_after_profiles(question, &mut soon, question.precision.deep)?;
    for stretch in joined(question.course, open.iter()) {
        if let Some(refused) = early(Thoroughness::All, &question.course.path_between(stretch))? {
            return Ok(Err(refused));
        }
    }
    screw_depth(question, soon, open).map(Ok)
}

/// Stretches of the path; those that touch each other become one.
fn joined<'i>(course: &Course, intervals: impl Iterator<Item = &'i Interval>) -> Vec<[f64; 2]> {
    let mut stretches: Vec<[f64; 2]> = intervals.map(|i| i.of(course.length)).collect();
    stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    stretches.dedup_by(|next, last| {
        let touch = next[0] <= last[1];
        last[1] = if touch { last[1].max(next[1]) } else { last[1] };
        touch
    });
    stretches
}

/// The points that help in refining a motion: the deepest of those near each other.
fn deepest_penetrations(pair_path: &PairPath<'_>, [moving, standing]: &[PathDepth; 2]) -> Vec<Penetration> {
    let [_, other] = pair_path.parts;
    let cell = COARSE_SHARE * pair_path.sizes()[1];
    let mut taken: BTreeMap<(bool, [i64; 3]), Penetration> = BTreeMap::new();
    for (on_moving, side) in [(true, moving), (false, standing)] {
        for &(point, over) in &side.deep {
            let key = (on_moving, point.coords.map(|x| (x / cell).floor() as i64).into());
            let entry = Penetration { other, on_moving, point, over };
            match taken.entry(key) {
                Occupied(mut known) if known.get().over < over => {
                    known.insert(entry);
                }
                Occupied(_) => {}
                Vacant(free) => {
                    free.insert(entry);
                }
            }
        }
    }
    taken.into_values().collect()
}

#[cfg(test)]
mod tests;
