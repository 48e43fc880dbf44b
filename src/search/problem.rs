//! A planning question in the planning frame, ready to be searched.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::blocking_graph::StaticAnalysis;
use crate::cache::RequestCache;
use crate::contact::sampled::along_path::Penetration;
use crate::contact::{PairPath, is_seen_to_enter};
use crate::geometry::{Pose, SampleTree};
use crate::plan::{Base, KnownVerdicts, Verdict, VerdictQuestion, Verifier, thinned};
use crate::scene::{ScaledShapes, Scene};
use crate::simulation::{Action, TransitionFunction};
use crate::termination::{Interrupt, Termination};

use super::directions::Directions;
use super::outcome::Removal;
use super::preferred::PreferredGroups;
use super::release::Release;
use super::request::{ActionSet, Tried};
use super::trace::TraceEvent;

/// Receives the events of a search.
pub trait Observer {
    /// The number of parts that are out and of simulations so far.
    fn progress(&mut self, removed: usize, simulations: u64);
    /// What is tried from now on; the next progress tells it.
    fn tried(&mut self, _tried: Tried) {}
    /// A part is out; in order.
    fn removal(&mut self, removal: &Removal);
    /// Whether it wants every event.
    fn traces(&self) -> bool {
        false
    }
    /// An event, if it wants them.
    fn traced(&mut self, _event: TraceEvent) {}
}

/// A path that was thinned and verified on the triangles.
#[derive(Debug, Clone)]
pub struct VerifiedPath {
    /// Its poses.
    pub path: Vec<Pose>,
    /// The largest depth beyond the pairs' allowed penetrations.
    pub depth: f64,
}

/// A verified path, or the points that refute it.
pub type Checked = Result<VerifiedPath, Vec<Penetration>>;

/// How far a search goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum Effort {
    /// Pushes, threads, and the cells of places that are reached without turning.
    Pushes,
    /// All that the planner knows.
    #[default]
    All,
}

/// A planning question about one scene.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The bodies. Owned: a search adds samples where verification found some missing.
    pub scene: Scene,
    /// The check on the triangles.
    pub verifier: &'a Verifier,
    /// The transition function.
    pub engine: &'a dyn TransitionFunction,
    /// The parts of the assembly that are present, ascending.
    pub present: Vec<usize>,
    /// Parts that may not move.
    pub fixed: Vec<usize>,
    /// Parts that stay as long as others leave.
    pub base: Base,
    /// Parts that are not asked for, and stay unless others cannot leave otherwise.
    pub keep: Vec<usize>,
    /// Those of the parts that may not move that are only in the way: no base, and no part that is left.
    pub keep_out: Vec<usize>,
    /// Whether this search may take parts off that are to be kept.
    pub releases_kept: bool,
    /// What may leave now beside the parts that are asked for.
    pub released: Release,
    /// Groups that leave as wholes as long as others leave.
    pub preferred: PreferredGroups,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<usize>>,
    /// Whether the only part that may move is the body of a group, or one at its own scale: nothing is proved about it, and it
    /// is in no group.
    pub is_group: bool,
    /// How far the search goes.
    pub effort: Effort,
    /// Which actions are used.
    pub actions: ActionSet,
    /// The rule that fills blocking graphs before anything is simulated.
    pub static_analysis: StaticAnalysis,
    /// Whether parts that leave straight, or are apart already, are taken out without simulation.
    pub sweeps: bool,
    /// The gap between the hulls where a part's way out ends; `None` for the usual share of the part.
    pub end_gap: Option<f64>,
    /// The distance that parts keep from what they pass on their way; 0 for none.
    pub clearance: f64,
    /// The direction up; `None` for the one in which most parts can go at first.
    pub up: Option<Vector3<f64>>,
    /// What random poses depend on.
    pub seed: u64,
    /// The number of simulations after which the search gives up.
    pub max_simulations: Option<u64>,
    /// What has left or moved before, in order: of the search for what remains after parts were moved aside.
    pub earlier: Vec<Removal>,
    /// Simulations that an earlier search of the same question has used up.
    pub spent: u64,
    /// Time after which one motion, or PDP's or RRT's search for one part, is given up.
    pub path_timeout: Option<Duration>,
    /// Ends the search early.
    pub termination: Termination,
    /// Remembered answers.
    pub cache: RequestCache,
    /// The verdicts of this request.
    pub verdicts: Arc<KnownVerdicts>,
    /// The shapes that this request scaled.
    pub scaled: Arc<ScaledShapes>,
    /// Points added so far, per part.
    pub extra_points: HashMap<usize, Vec<Point3<f64>>>,
}

impl Problem<'_> {
    /// The axes of the actions: the paper's are the world's, ours the assembly's own.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn directions(&self) -> Result<Directions, Interrupt> {
        match self.actions {
            ActionSet::Paper => Ok(Directions::of_world(&self.scene)),
            ActionSet::Extended => Directions::of(&self.scene, &self.present, &self.termination),
        }
    }

    /// The translations, and the actions with rotational freedom in the order of trial.
    pub(super) fn action_lists(&self, directions: &Directions) -> (Vec<Action>, Vec<Action>) {
        let axes = &directions.axes;
        let rotations = match self.actions {
            ActionSet::Paper => Action::rotations_about(axes),
            // Where turning helps, pulling while turning mostly leads out in one motion.
            ActionSet::Extended => {
                Action::screws_along(axes).into_iter().chain(Action::rotations_about(axes)).collect()
            }
        };
        (Action::translations_along(axes), rotations)
    }

    /// Whether a part is present and not fixed.
    #[must_use]
    pub fn is_movable(&self, part: usize) -> bool {
        self.is_present(part) && !self.fixed.contains(&part)
    }

    fn is_present(&self, part: usize) -> bool {
        self.present.binary_search(&part).is_ok()
    }

    /// Whether it may leave now by itself: a base, what is to be kept, and what is in a preferred group, stay as long as
    /// others leave.
    #[must_use]
    pub fn may_move(&self, part: usize) -> bool {
        self.may_join(part) && !self.preferred.keeps(part)
    }

    /// Whether it may leave now, by itself or in a group.
    pub(super) fn may_join(&self, part: usize) -> bool {
        self.is_movable(part) && !self.keeps(part)
    }

    /// Whether all parts of a group may leave now.
    pub(super) fn may_all_join(&self, group: &[usize]) -> bool {
        group.iter().all(|&part| self.may_join(part))
    }

    /// Whether a part stays as long as others leave, and may not leave yet.
    fn keeps(&self, part: usize) -> bool {
        self.release_of(part) > self.released
    }

    /// From when on a part may leave.
    pub(super) fn release_of(&self, part: usize) -> Release {
        match (self.base.parts.contains(&part), &self.base.reason) {
            (true, None) => Release::GivenBase,
            _ if self.keep.contains(&part) => Release::Kept,
            (true, Some(_)) => Release::ChosenBase,
            (false, _) => Release::Nothing,
        }
    }

    /// What this search may release at most.
    pub(super) fn last_release(&self) -> Release {
        if self.keep.is_empty() || self.releases_kept { Release::GivenBase } else { Release::ChosenBase }
    }

    /// Lets the next of the parts that stand and stay so far leave, up to some; false if there are none.
    pub(super) fn release(&mut self, standing: &[usize], most: Release) -> bool {
        let most = most.min(self.last_release());
        let all = standing.iter().map(|&part| self.release_of(part));
        let Some(next) = all.filter(|&r| self.released < r && r <= most).min() else { return false };
        self.released = next;
        true
    }

    /// Lets the base leave, unless parts stand that leave before it and are to be kept.
    pub(super) fn release_base(&mut self, standing: &[usize]) -> bool {
        let are_kept = standing.iter().any(|part| self.keep.contains(part));
        self.release(standing, if are_kept { Release::ChosenBase } else { Release::GivenBase })
    }

    /// Of the parts that remain, those that should come out.
    #[must_use]
    pub fn wanted(&self, remaining: &[usize]) -> Vec<usize> {
        let asked = |p: &usize| self.targets.as_ref().is_none_or(|t| t.contains(p)) && !self.keep.contains(p);
        remaining
            .iter()
            .copied()
            .filter(|&p| !self.fixed.contains(&p) && !self.keeps(p) && asked(&p))
            .collect()
    }

    /// The parts that are to be kept and are not among those that remain.
    pub(super) fn kept_off(&self, remaining: &[usize]) -> Vec<usize> {
        let is_off = |part: &usize| self.is_present(*part) && remaining.binary_search(part).is_err();
        self.keep.iter().copied().filter(is_off).collect()
    }

    /// Whether nothing more has to come out: a last part alone is apart from all others. It may stay among what is only in the
    /// way, unless it is asked for.
    #[must_use]
    pub fn is_goal(&self, remaining: &[usize]) -> bool {
        let left = remaining.iter().filter(|part| self.targets.is_some() || !self.keep_out.contains(part));
        left.count() <= 1 || self.wanted(remaining).is_empty()
    }

    /// Thins a path and verifies it on the triangles. A path off a thread is tried in the middle of the
    /// thread's play first: it has room there. Takes nothing of the planning time.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn checked_path(&self, standing: &[usize], part: usize, path: &[Pose]) -> Result<Checked, Interrupt> {
        let thin = self.thinned(part, path);
        let near = self.near(standing, part, &thin);
        let termination = &self.termination.without_planning_time();
        let centred = self.verifier.path_on_thread(&self.scene, &near, part, &thin, termination)?;
        if let Some(centred) = centred
            && let Ok(verified) = self.checked_as_given(standing, part, &centred)?
        {
            return Ok(Ok(verified));
        }
        self.checked_thin(&near, part, thin)
    }

    /// Thins a path and verifies it on the triangles.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn checked_as_given(
        &self,
        standing: &[usize],
        part: usize,
        path: &[Pose],
    ) -> Result<Checked, Interrupt> {
        let thin = self.thinned(part, path);
        self.checked_thin(&self.near(standing, part, &thin), part, thin)
    }

    fn checked_thin(&self, near: &[usize], part: usize, path: Vec<Pose>) -> Result<Checked, Interrupt> {
        let Verdict { penetrations, depth, .. } = self.verdict(near, part, &path)?;
        Ok(if penetrations.is_empty() { Ok(VerifiedPath { path, depth }) } else { Err(penetrations) })
    }

    fn thinned(&self, part: usize, path: &[Pose]) -> Vec<Pose> {
        thinned(path, self.scene.bodies[part].shape.bounds(), &self.scene.centre_in_shape(part))
    }

    /// Those of the standing parts that a path may meet.
    pub(super) fn near(&self, standing: &[usize], part: usize, path: &[Pose]) -> Vec<usize> {
        let swept = self.scene.swept_bounds(part, path).grown(self.verifier.limit().max(self.clearance));
        self.scene.broad_phase.meeting_of(standing, &swept)
    }

    /// Verifies a path against all parts that it may meet.
    fn verdict(&self, near: &[usize], part: usize, path: &[Pose]) -> Result<Verdict, Interrupt> {
        let Scene { allowed, .. } = &self.scene;
        let past = near.par_iter().flat_map_iter(|&other| {
            PairPath::of_members(&self.scene, allowed, [part, other], path).map(
                |(pair_path, body_from_part)| {
                    let mut verdict = self.verdict_past(&pair_path)?;
                    let on_moving = verdict.penetrations.iter_mut().filter(|e| e.on_moving);
                    on_moving.for_each(|e| e.point = body_from_part * e.point);
                    Ok(verdict)
                },
            )
        });
        Ok(Verdict::of_all(past.collect::<Result<_, _>>()?))
    }

    /// How deep a path gets past each of some parts that it may meet; `None` where it is refused, or comes too near.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn depths_past(
        &self,
        others: &[usize],
        part: usize,
        path: &[Pose],
    ) -> Result<Vec<(usize, Option<f64>)>, Interrupt> {
        let depth = |&other: &usize| {
            let mut deepest = 0.0f64;
            for (pair_path, _) in PairPath::of_members(&self.scene, &self.scene.allowed, [part, other], path)
            {
                if is_seen_to_enter(&pair_path, self.verifier.limit_past(pair_path.shapes)) {
                    return Ok((other, None));
                }
                let verdict = self.verdict_past(&pair_path)?;
                if verdict.is_refused() {
                    return Ok((other, None));
                }
                deepest = deepest.max(verdict.depth);
            }
            let is_near = self.passes_too_near([part, other], path)?;
            Ok((other, (!is_near).then_some(deepest)))
        };
        self.near(others, part, path).par_iter().map(depth).collect()
    }

    fn verdict_past(&self, pair_path: &PairPath<'_>) -> Result<Verdict, Interrupt> {
        let Self { verifier, cache, verdicts, .. } = self;
        let termination = &self.termination.without_planning_time();
        let question = &VerdictQuestion { pair_path, limit: verifier.limit_past(pair_path.shapes) };
        verdicts.verdict(question, cache, || verifier.past(pair_path, termination))
    }

    /// Adds the points that refuted a path to the contact samples of their bodies.
    pub fn add_samples(&mut self, part: usize, penetrations: &[Penetration]) {
        let key = |p: &Point3<f64>| p.coords.map(f64::to_bits);
        let mut known: HashSet<_> = self
            .extra_points
            .iter()
            .flat_map(|(body, list)| list.iter().map(move |p| (*body, key(p))))
            .collect();
        for penetration in penetrations {
            let body = if penetration.on_moving { part } else { penetration.other };
            if known.insert((body, key(&penetration.point))) {
                self.extra_points.entry(body).or_default().push(penetration.point);
            }
        }
        for (body, points) in &self.extra_points {
            Arc::make_mut(&mut self.scene.bodies)[*body].extra_samples = SampleTree::over(points.clone());
        }
    }
}
