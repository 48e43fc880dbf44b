//! The state of a disassembly: which parts stand and which are out. All planners use it to simulate a motion,
//! to prove a path, and to take parts out that nothing holds.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::budgets::{REFINEMENTS, REMEMBERED_STANDING_PARTS};
use crate::contact::sampled::along_path::Penetration;
use crate::geometry::{Pose, separating_direction, transformed};
use crate::plan::PlanStatus;
use crate::scene::{HullTree, StandingParts, exit_direction};
use crate::simulation::{
    Action, End, Motion, MotionQuestion, Sweep, SweepQuestion, known_sweep, remembered_sweep,
};
use crate::termination::Interrupt;
use crate::tolerances::HULL_MARGIN;

use super::blocked_actions::{few_of_each_part, of_inseparable};
use super::inseparable::InseparablePairs;
use super::outcome::{BlockedAction, Counters, Inseparable, NearPass, Outcome, Reason, Removal};
use super::problem::{Checked, Observer, Problem, VerifiedPath};
use super::release::Release;
use super::request::Tried;
use super::requirements::Leaving;
use super::support::Supports;
use super::trace::TraceEvent;

/// The reason given for a motion that took too long.
const NO_TIME: &str = "the time for one path is used up";

/// The reason why a search stops before it is done.
pub(super) enum Stop {
    Interrupted(Interrupt),
    Budget(u64),
}

impl From<Interrupt> for Stop {
    fn from(i: Interrupt) -> Self {
        Self::Interrupted(i)
    }
}

/// One use of the transition function: f(s, a, p), with all parts but p as they stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transition {
    pub(super) part: usize,
    pub(super) start: Pose,
    pub(super) action: Action,
}

/// The version of the scene that motions depend on: which parts stand, and where contact is sampled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct SceneVersion {
    pub(super) removals: usize,
    pub(super) extra_points: usize,
}

/// The result of the check on the triangles of a motion that leads out.
pub(super) enum Proof {
    /// Thinned and verified.
    Path(VerifiedPath),
    /// Already the way to the motion's start does not hold.
    PrefixRefuted,
    /// It enters these parts, however often it is refined.
    Refuted { by: Vec<usize> },
    /// With the refuting points as samples, the motion ends otherwise.
    Otherwise(Motion),
}

/// What refutes a way out.
pub(super) enum RefutedWay {
    /// Points that get too deep.
    Enters(Vec<Penetration>),
    /// A part that it passes too near.
    TooNear(NearPass),
}

impl RefutedWay {
    /// The parts that are in the way, ascending.
    pub(super) fn parts(&self) -> Vec<usize> {
        match self {
            Self::Enters(penetrations) => entered(penetrations),
            Self::TooNear(near) => vec![near.other],
        }
    }
}

/// A verified way out with the clearance that is wanted, or what refutes it.
pub(super) type CheckedWay = Result<VerifiedPath, RefutedWay>;

/// A sweep's claim that did not hold.
pub(super) struct Refuted {
    /// Already the way to the sweep's start does not hold.
    pub(super) prefix: bool,
}

/// The part of a search that all planners share.
pub(super) struct Disassembly<'a, 'o> {
    pub(super) problem: Problem<'a>,
    pub(super) observer: &'o mut dyn Observer,
    /// All present parts that have not been taken out.
    pub(super) everything: HullTree,
    /// The surroundings of some parts, until the next removal.
    around: HashMap<usize, Arc<StandingParts>>,
    /// Per part: another part whose hull meets this part's, both assembled: a proof that it is not free.
    entangled: Vec<Option<usize>>,
    /// What carries what: unknown for planners other than SBDP*.
    pub(super) supports: Supports,
    /// Per part that does not shape the hull: the number of hull changes when it was found not to be free.
    held_since: Vec<Option<usize>>,
    hull_changes: usize,
    pub(super) removals: Vec<Removal>,
    pub(super) counters: Counters,
    /// The ways out that were refused because they come too near to others.
    near_passes: Vec<NearPass>,
    /// Whether some path was given up for lack of time: a search that finds nothing then proves nothing.
    pub(super) path_time_ran_out: bool,
}

impl<'a, 'o> Disassembly<'a, 'o> {
    /// A disassembly, and the result of `other`, which runs while hulls are joined. If either is interrupted, the
    /// disassembly has no hulls: it can only give its [outcome](Self::outcome).
    pub(super) fn beside<T: Send>(
        problem: Problem<'a>,
        observer: &'o mut dyn Observer,
        other: impl FnOnce(&Problem<'a>) -> Result<T, Interrupt> + Send,
    ) -> (Self, Result<T, Interrupt>) {
        let Problem { scene, present, termination, .. } = &problem;
        let (everything, other) =
            rayon::join(|| HullTree::new(scene, present.clone(), termination), || other(&problem));
        let (everything, other) = match everything {
            Ok(tree) => (tree, other),
            Err(interrupt) => (HullTree::without_hulls(scene, present.clone()), Err(interrupt)),
        };
        let count = scene.bodies.len();
        let disassembly = Self {
            observer,
            everything,
            around: HashMap::new(),
            entangled: vec![None; count],
            held_since: vec![None; count],
            supports: Supports::default(),
            hull_changes: 0,
            removals: problem.earlier.clone(),
            counters: Counters::default(),
            near_passes: Vec::new(),
            path_time_ran_out: false,
            problem,
        };
        (disassembly, other)
    }

    pub(super) fn is_done(&self) -> bool {
        self.problem.is_goal(self.everything.standing())
    }

    /// Lets the next of the parts leave that stay so far, up to some; false if there are none.
    pub(super) fn release(&mut self, most: Release) -> bool {
        self.problem.release(self.everything.standing(), most)
    }

    /// Where a part stands assembled.
    pub(super) fn assembled(&self, part: usize) -> Pose {
        self.problem.scene.bodies[part].planning_from_shape
    }

    /// All parts that stand but one. Only some are kept: all would take the square of their number in memory.
    pub(super) fn surroundings(&mut self, part: usize) -> Arc<StandingParts> {
        // Number of surroundings kept. No plan depends on it; fewer are computed more often.
        if self.around.len() >= REMEMBERED_STANDING_PARTS && !self.around.contains_key(&part) {
            self.around.clear();
        }
        let (everything, scene) = (&self.everything, &self.problem.scene);
        Arc::clone(self.around.entry(part).or_insert_with(|| Arc::new(everything.without(scene, part))))
    }

    /// The surroundings of all runs. Polls the termination condition, since hulls of many parts take long.
    fn all_surroundings(&mut self, runs: &[Transition]) -> Result<Vec<Arc<StandingParts>>, Stop> {
        let around = |run: &Transition| {
            self.problem.termination.check()?;
            Ok(self.surroundings(run.part))
        };
        runs.iter().map(around).collect()
    }

    pub(super) fn standing(&self, part: usize) -> Vec<usize> {
        self.everything.standing().iter().copied().filter(|&i| i != part).collect()
    }

    /// Passes an event to the observer, if it traces.
    pub(super) fn trace(&mut self, event: impl FnOnce() -> TraceEvent) {
        if self.observer.traces() {
            self.observer.traced(event());
        }
    }

    /// Traces how a simulation ended, and the number of the new state that it led to.
    pub(super) fn trace_simulation(
        &mut self,
        state: usize,
        run: &Transition,
        end: &str,
        with: &[usize],
        poses: usize,
        leads_to: Option<usize>,
    ) {
        let Transition { part, action, .. } = *run;
        self.trace(|| TraceEvent::Simulated {
            state,
            part,
            action: action.to_string(),
            end: end.to_owned(),
            with: with.to_vec(),
            poses,
            leads_to,
        });
    }

    pub(super) fn version(&self) -> SceneVersion {
        let extra_points = self.problem.extra_points.values().map(Vec::len).sum();
        SceneVersion { removals: self.removals.len(), extra_points }
    }

    /// Counts one simulation against the budget. A remembered motion counts, too.
    pub(super) fn charge(&mut self) -> Result<(), Stop> {
        if let Some(most) = self.problem.max_simulations
            && self.problem.spent + self.counters.simulations >= most
        {
            return Err(Stop::Budget(most));
        }
        self.counters.simulations += 1;
        self.observer.progress(self.removals.len(), self.counters.simulations);
        Ok(())
    }

    /// Tells the observer what is tried now: of motions side by side, the first.
    fn announce(&mut self, runs: &[Transition]) {
        let Some(Transition { part, action, .. }) = runs.first() else { return };
        self.observer.tried(Tried { part: *part, turns: action.torque() != Vector3::zeros() });
        self.observer.progress(self.removals.len(), self.counters.simulations);
    }

    /// Counts a motion that the search uses: whether it was remembered, and its time. What was simulated ahead and is
    /// thrown away has no time.
    pub(super) fn used(&mut self, motion: &Motion) {
        self.counters.recalled += u64::from(motion.recalled);
        self.counters.simulation += motion.time;
    }

    /// The motions of some runs, in order, up to the first that leads out. It changes the scene of the later ones,
    /// so they are stopped.
    pub(super) fn simulate(&mut self, runs: &[Transition]) -> Result<Vec<Motion>, Stop> {
        self.announce(runs);
        let around = self.all_surroundings(runs)?;
        let problem = &self.problem;
        let winner = Arc::new(AtomicUsize::new(usize::MAX));
        let simulated = |(rank, run): (usize, &Transition)| {
            let started = Instant::now();
            let around = &around[rank];
            let Transition { part, start, action } = run;
            let termination = problem.termination.unless_won(&winner, rank);
            let limited = problem.path_timeout.map(|limit| termination.within(limit));
            let poll = limited.as_ref().unwrap_or(&termination);
            let question = MotionQuestion {
                engine: problem.engine,
                scene: &problem.scene,
                surroundings: around,
                part: *part,
                start: *start,
                action: *action,
            };
            let mut motion = question.answer(&problem.cache, poll);
            if motion.is_err() && termination.check().is_ok() {
                let touched = around.standing.clone();
                let end = End::Undecided { reason: NO_TIME.into(), touched };
                motion = Ok(Motion::simulated(vec![*start], Vec::new(), end));
            }
            if matches!(&motion, Ok(Motion { end: End::Disassembled(_), .. })) {
                winner.fetch_min(rank, Ordering::Relaxed);
            }
            motion.map(|motion| Motion { time: started.elapsed(), ..motion })
        };
        let motions: Vec<_> = if runs.len() > 1 {
            runs.par_iter().enumerate().map(simulated).collect()
        } else {
            runs.iter().enumerate().map(simulated).collect()
        };
        let no_time = |m: &Motion| matches!(&m.end, End::Undecided { reason, .. } if reason == NO_TIME);
        self.path_time_ran_out |= motions.iter().flatten().any(no_time);
        let wanted = winner.load(Ordering::Relaxed).saturating_add(1);
        Ok(motions.into_iter().take(wanted).collect::<Result<_, Interrupt>>()?)
    }

    /// The results of straight sweeps along the forces of some runs, in order, up to the first that is clear.
    pub(super) fn sweep(&mut self, runs: &[Transition]) -> Result<Vec<Option<Sweep>>, Stop> {
        self.problem.termination.check()?;
        self.announce(runs);
        let started = Instant::now();
        let around = self.all_surroundings(runs)?;
        let Problem { scene, termination, cache, .. } = &self.problem;
        let clear = |s: &Option<Sweep>| matches!(s, Some(Sweep::Clear { .. }));
        let forces: Vec<_> = runs.iter().map(|run| run.action.force()).collect();
        let question = |i: usize| {
            let Transition { part, start, .. } = &runs[i];
            SweepQuestion { scene, standing_parts: &around[i], part: *part, start, direction: &forces[i] }
        };
        // Remembered sweeps are read one after the other: sharing them with other threads would take longer.
        let mut results = Vec::new();
        while results.len() < runs.len() && !results.last().is_some_and(clear) {
            let Some(known) = known_sweep(cache, &question(results.len()), termination)? else { break };
            results.push(known);
        }
        if !results.last().is_some_and(clear) {
            let swept = |i: usize| remembered_sweep(cache, &question(i), termination);
            let new = (results.len()..runs.len()).into_par_iter().map(swept);
            results.extend(new.collect::<Result<Vec<_>, Interrupt>>()?);
        }
        if let Some(first) = results.iter().position(clear) {
            results.truncate(first + 1);
        }
        self.counters.simulation += started.elapsed();
        Ok(results)
    }

    /// Verifies a path that a sweep claims to be clear, from the end of `prefix`. Refuting points become samples
    /// for the simulation that must answer instead.
    pub(super) fn prove_sweep(
        &mut self,
        run: &Transition,
        prefix: &[Pose],
        motion: &[Pose],
    ) -> Result<Result<VerifiedPath, Refuted>, Stop> {
        let part = run.part;
        let refuted = match self.checked_way(part, &joined(prefix, motion))? {
            Ok(proof) => return Ok(Ok(proof)),
            Err(RefutedWay::TooNear(near)) => {
                self.trace_refutation(run, vec![near.other]);
                return Ok(Err(Refuted { prefix: false }));
            }
            Err(RefutedWay::Enters(penetrations)) => penetrations,
        };
        tracing::debug!(part, action = %run.action, over = refuted.first().map(|e| e.over), "sweep refuted");
        self.trace_refutation(run, entered(&refuted));
        self.problem.add_samples(part, &refuted);
        let prefix = prefix.len() > 1 && !self.holds(part, prefix)?;
        Ok(Err(Refuted { prefix }))
    }

    /// Traces a path that some parts refute.
    fn trace_refutation(&mut self, run: &Transition, by: Vec<usize>) {
        let (part, action) = (run.part, run.action.to_string());
        self.trace(|| TraceEvent::Refuted { part, action, by });
    }

    /// Thins and verifies a motion that leads out from the end of `prefix`. A refuted one is
    /// simulated again with the refuting points as samples, and given up after some tries.
    pub(super) fn prove(
        &mut self,
        run: Transition,
        prefix: &[Pose],
        motion: Vec<Pose>,
    ) -> Result<Proof, Stop> {
        let part = run.part;
        let mut motion = motion;
        for refinement in 0..=REFINEMENTS {
            let refuted = match self.checked_way(part, &joined(prefix, &motion))? {
                Ok(verified) => return Ok(Proof::Path(verified)),
                Err(RefutedWay::TooNear(near)) => {
                    self.trace_refutation(&run, vec![near.other]);
                    return Ok(Proof::Refuted { by: vec![near.other] });
                }
                Err(RefutedWay::Enters(penetrations)) => penetrations,
            };
            tracing::debug!(part, refinement, over = refuted.first().map(|e| e.over), "path refuted");
            self.problem.add_samples(part, &refuted);
            if prefix.len() > 1 && !self.holds(part, prefix)? {
                return Ok(Proof::PrefixRefuted);
            }
            let by = entered(&refuted);
            self.trace_refutation(&run, by.clone());
            if refinement == REFINEMENTS {
                return Ok(Proof::Refuted { by });
            }
            self.charge()?;
            let Some(again) = self.simulate(&[run])?.pop() else { break };
            self.used(&again);
            if !matches!(again.end, End::Disassembled(_)) {
                return Ok(Proof::Otherwise(again));
            }
            motion = again.path;
        }
        Ok(Proof::Refuted { by: Vec::new() })
    }

    /// Whether a path of a part, with all others as they stand, is verified.
    pub(super) fn holds(&mut self, part: usize, path: &[Pose]) -> Result<bool, Stop> {
        Ok(self.checked(part, path)?.is_ok())
    }

    fn checked(&mut self, part: usize, path: &[Pose]) -> Result<Checked, Stop> {
        let standing = self.standing(part);
        self.timed(|problem| problem.checked_path(&standing, part, path))
    }

    /// A check of a way out.
    fn checked_way(&mut self, part: usize, path: &[Pose]) -> Result<CheckedWay, Stop> {
        let checked = self.checked(part, path)?;
        self.with_clearance(part, checked)
    }

    /// The same for a path that is to be taken as it is.
    pub(super) fn checked_way_as_given(&mut self, part: usize, path: &[Pose]) -> Result<CheckedWay, Stop> {
        let standing = self.standing(part);
        let checked = self.timed(|problem| problem.checked_as_given(&standing, part, path))?;
        self.with_clearance(part, checked)
    }

    fn with_clearance(&mut self, part: usize, checked: Checked) -> Result<CheckedWay, Stop> {
        let verified = match checked {
            Ok(verified) if self.problem.clearance > 0.0 => verified,
            checked => return Ok(checked.map_err(RefutedWay::Enters)),
        };
        let (started, around) = (Instant::now(), self.surroundings(part));
        let leaving = Leaving { problem: &self.problem, body: part, around: &around, aside: false };
        let checked = leaving.with_clearance(&self.removals, verified);
        self.count_verification(started);
        let checked = checked?;
        self.near_passes.extend(checked.as_ref().err());
        Ok(checked.map_err(RefutedWay::TooNear))
    }

    /// A check of a path; its time is verification.
    pub(super) fn timed<T>(
        &mut self,
        check: impl FnOnce(&Problem<'a>) -> Result<T, Interrupt>,
    ) -> Result<T, Stop> {
        let started = Instant::now();
        let checked = check(&self.problem);
        self.count_verification(started);
        Ok(checked?)
    }

    fn count_verification(&mut self, started: Instant) {
        let took = started.elapsed();
        self.counters.verification += took;
        self.problem.termination.leave_out(took);
    }

    /// Takes a part out along a path past all that stands.
    pub(super) fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64) -> Result<(), Stop> {
        let (started, around) = (Instant::now(), self.surroundings(part));
        let leaving = Leaving { problem: &self.problem, body: part, around: &around, aside: false };
        let removal = leaving.removal(&self.removals, path, depth);
        self.count_verification(started);
        self.note(removal?);
        Ok(())
    }

    /// Takes a group out along a verified path of its body.
    pub(super) fn remove_group(
        &mut self,
        group: Leaving<'_, '_>,
        VerifiedPath { path, depth }: VerifiedPath,
    ) -> Result<(), Stop> {
        let started = Instant::now();
        let removal = group.removal(&self.removals, path, depth);
        self.count_verification(started);
        self.note(removal?);
        Ok(())
    }

    fn note(&mut self, removal: Removal) {
        for &part in &removal.parts {
            self.hull_changes += usize::from(self.everything.remove(&self.problem.scene, part));
        }
        self.around.clear();
        // What else left may have freed others.
        self.problem.released = Release::Nothing;
        self.observer.removal(&removal);
        if self.observer.traces() {
            self.observer.traced(TraceEvent::of(&removal, &self.removals));
        }
        self.removals.push(removal);
    }

    /// The parts that alone carry another one, as they stand.
    pub(super) fn carriers(&self) -> BTreeSet<usize> {
        self.carriers_by_depth().into_keys().collect()
    }

    fn carriers_by_depth(&self) -> BTreeMap<usize, usize> {
        self.supports.carriers(self.everything.standing(), |part| self.stays(part))
    }

    /// The parts that nothing carries any more when some have left, and that were carried before.
    pub(super) fn left_in_air(&self, leaving: &[usize]) -> Vec<usize> {
        self.supports.left_in_air(self.everything.standing(), leaving, |part| self.stays(part))
    }

    /// Whether a part is one that others stand on in the end.
    fn stays(&self, part: usize) -> bool {
        self.problem.base.parts.contains(&part) || !self.problem.is_movable(part)
    }

    /// By part, when it leaves where several can: the smallest value first. Parts that carry nothing come before those that
    /// carry others; of the latter, a part comes before those that carry it. What stays as long as others leave comes last.
    pub(super) fn leaving_late(&self) -> impl Fn(usize) -> (Release, Option<Reverse<usize>>) + use<> {
        let carriers = self.carriers_by_depth();
        let releases: Vec<Release> =
            (0..self.problem.scene.bodies.len()).map(|part| self.problem.release_of(part)).collect();
        move |part| (releases[part], carriers.get(&part).copied().map(Reverse))
    }

    /// A part that may move and whose hull is apart from all others': it needs no motion. Without sweeps it is
    /// simulated like all.
    pub(super) fn free_part(&mut self) -> Result<Option<usize>, Stop> {
        if self.is_done() || !self.problem.sweeps {
            return Ok(None);
        }
        let mut parts = self.everything.standing().to_vec();
        let late = self.leaving_late();
        parts.sort_by_key(|&part| late(part));
        for part in parts {
            self.problem.termination.check()?;
            if self.problem.may_move(part) && self.is_free(part) {
                return Ok(Some(part));
            }
        }
        Ok(None)
    }

    fn is_free(&mut self, part: usize) -> bool {
        let standing = self.everything.standing();
        let stands = |other: usize| standing.binary_search(&other).is_ok();
        // The last answer mostly still holds.
        let held = self.held_since[part] == Some(self.hull_changes);
        if standing.len() < 2 || held || self.entangled[part].is_some_and(stands) {
            return false;
        }
        let scene = &self.problem.scene;
        let pose = scene.bodies[part].planning_from_shape;
        let mine = transformed(&scene.bodies[part].shape.hull, &pose);
        let meets = |&other: &usize| {
            let body = &scene.bodies[other];
            let theirs = transformed(&body.shape.hull, &body.planning_from_shape);
            other != part && separating_direction(&mine, &theirs, HULL_MARGIN, None).is_none()
        };
        let near = scene.broad_phase.meeting_of(standing, &scene.bodies[part].bounds);
        self.entangled[part] = near.into_iter().find(meets);
        if self.entangled[part].is_some() {
            return false;
        }
        let around = self.surroundings(part);
        let free = exit_direction(&self.problem.scene, &around, part, &pose, None).is_some();
        if !free && !self.everything.shapes_hull(&self.problem.scene, part) {
            self.held_since[part] = Some(self.hull_changes);
        }
        free
    }

    /// The outcome of the search. If it came to its end, it is infeasible where some pair is proved never to come
    /// apart, and exhausted otherwise. `inseparable` are the pairs that were found so far; `blocked` lists which parts
    /// block those that remain.
    pub(super) fn outcome(
        mut self,
        stop: Option<Stop>,
        mut inseparable: InseparablePairs,
        blocked: Vec<BlockedAction>,
    ) -> Outcome {
        let remaining = self.everything.standing().to_vec();
        let mut blocked = blocked;
        let ended = match stop {
            _ if self.is_done() => Ok((PlanStatus::Complete, None)),
            None if self.path_time_ran_out => Ok(limit(PlanStatus::Timeout, NO_TIME)),
            None => self.first_inseparable(&remaining, &mut inseparable).map(|pair| match pair {
                Some(pair) => {
                    let wanted = self.problem.wanted(&remaining);
                    // What is blocked for ever needs no further words.
                    let proved = of_inseparable(&pair, &wanted);
                    blocked.retain(|b| proved.iter().all(|p| p.part != b.part));
                    blocked.extend(proved);
                    (PlanStatus::Infeasible, Some(Reason::Inseparable(pair)))
                }
                None => (PlanStatus::Exhausted, Some(self.nothing_found(&remaining))),
            }),
            Some(Stop::Interrupted(interrupt)) => Err(interrupt),
            Some(Stop::Budget(n)) => {
                Ok(limit(PlanStatus::Partial, &format!("the budget of {n} simulations is used up")))
            }
        };
        let (status, reason) = ended.unwrap_or_else(interrupted);
        let base = self.problem.base.among(&remaining);
        let Counters { simulations, sweeps, .. } = self.counters;
        self.trace(|| TraceEvent::End {
            status: status.name().to_owned(),
            reason: reason.clone(),
            remaining: remaining.clone(),
            simulations,
            sweeps,
        });
        Outcome {
            status,
            reason,
            unfinished: if status == PlanStatus::Complete { Vec::new() } else { remaining.clone() },
            remaining,
            blocked: if status == PlanStatus::Complete { Vec::new() } else { few_of_each_part(blocked) },
            free_together: Vec::new(),
            removals: self.removals,
            base,
            counters: self.counters,
        }
    }

    /// Why a search is exhausted.
    fn nothing_found(&self, remaining: &[usize]) -> Reason {
        let wanted = self.problem.wanted(remaining);
        let here = |near: &&NearPass| wanted.contains(&near.part) && remaining.contains(&near.other);
        let nearest = NearPass::best(self.near_passes.iter().filter(here).copied());
        nearest.map_or(Reason::Exhausted, Reason::TooNear)
    }

    /// A pair that never comes apart and of which one is wanted. What was not looked for yet is, the cheaper proof
    /// first.
    fn first_inseparable(
        &self,
        remaining: &[usize],
        known: &mut InseparablePairs,
    ) -> Result<Option<Inseparable>, Interrupt> {
        if self.problem.is_group {
            return Ok(None);
        }
        let wanted = self.problem.wanted(remaining);
        for find in InseparablePairs::PROOFS {
            if known.first(remaining, &wanted).is_none() {
                find(known, &self.problem, remaining)?;
            }
        }
        Ok(known.first(remaining, &wanted))
    }
}

fn limit(status: PlanStatus, words: &str) -> (PlanStatus, Option<Reason>) {
    (status, Some(Reason::Limit(words.to_owned())))
}

/// How a search ends that is interrupted, and why.
pub(super) fn interrupted(interrupt: Interrupt) -> (PlanStatus, Option<Reason>) {
    match interrupt {
        Interrupt::Cancelled => limit(PlanStatus::Cancelled, "cancelled"),
        Interrupt::DeadlinePassed => limit(PlanStatus::Timeout, "the deadline passed"),
    }
}

/// The parts that refute a path, ascending.
fn entered(penetrations: &[Penetration]) -> Vec<usize> {
    let by: BTreeSet<usize> = penetrations.iter().map(|e| e.other).collect();
    by.into_iter().collect()
}

/// A path continued by a motion that starts at its end.
pub(super) fn joined(path: &[Pose], motion: &[Pose]) -> Vec<Pose> {
    path.iter().chain(motion.iter().skip(1)).copied().collect()
}
