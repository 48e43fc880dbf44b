//! The disassembly under way: what stands, what is out, and what every planner does with it:
//! simulate, prove a path, take parts out that nothing holds.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use crate::geometry::Pose;
use crate::plan::{Entry, PlanStatus};
use crate::simulation::{Action, End, Motion, Surroundings, Sweep, exit_direction, straight_sweep};
use crate::termination::Interrupt;

use super::outcome::{BlockedAction, Counters, Outcome, Removal};
use super::problem::{Observer, Problem};
use super::trace::TraceEvent;

/// How often a motion is simulated again with the points at which verification refuted it.
const REFINEMENTS: usize = 4;

/// Why a motion is given up that took too long.
const NO_TIME: &str = "the time for one path is used up";

/// Why a search stops before it is done.
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
pub(super) struct Run {
    pub(super) part: usize,
    pub(super) start: Pose,
    pub(super) action: Action,
}

/// What became of a motion that leads out, once it was checked on the triangles.
pub(super) enum Proof {
    /// Thinned and verified.
    Path { path: Vec<Pose>, depth: f64 },
    /// Already the way to the motion's start does not hold.
    PrefixRefuted,
    /// It enters these parts, however often it is refined.
    Refuted { by: Vec<usize> },
    /// With the refuting points as samples, the motion ends otherwise.
    Otherwise(Motion),
}

/// A sweep's claim that did not hold.
pub(super) struct Refuted {
    /// Already the way to the sweep's start does not hold.
    pub(super) prefix: bool,
}

/// What every planner shares.
pub(super) struct Disassembly<'a, 'o> {
    pub(super) problem: Problem<'a>,
    pub(super) observer: &'o mut dyn Observer,
    /// All present parts that have not been taken out.
    pub(super) everything: Surroundings,
    around: Vec<Option<Surroundings>>,
    /// A part whose hull meets this part's, both assembled: proof that it is not free.
    entangled: Vec<Option<usize>>,
    pub(super) removals: Vec<Removal>,
    pub(super) counters: Counters,
    /// Whether some path was given up for want of time: nothing found is then no proof.
    pub(super) path_time_ran_out: bool,
}

impl<'a, 'o> Disassembly<'a, 'o> {
    pub(super) fn new(problem: Problem<'a>, observer: &'o mut dyn Observer) -> Self {
        let count = problem.scene.bodies.len();
        Self {
            observer,
            everything: Surroundings::new(&problem.scene, problem.present.clone()),
            around: vec![None; count],
            entangled: vec![None; count],
            removals: Vec::new(),
            counters: Counters::default(),
            path_time_ran_out: false,
            problem,
        }
    }

    pub(super) fn is_done(&self) -> bool {
        self.problem.is_goal(&self.everything.standing)
    }

    /// Where a part stands assembled.
    pub(super) fn assembled(&self, part: usize) -> Pose {
        self.problem.scene.bodies[part].planning_from_shape
    }

    /// All that stands but one part.
    pub(super) fn surroundings(&mut self, part: usize) -> &Surroundings {
        let (everything, scene) = (&self.everything, &self.problem.scene);
        self.around[part].get_or_insert_with(|| everything.without(scene, part))
    }

    pub(super) fn standing(&self, part: usize) -> Vec<usize> {
        self.everything.standing.iter().copied().filter(|&i| i != part).collect()
    }

    /// Tells the observer, if it listens.
    pub(super) fn trace(&mut self, event: impl FnOnce() -> TraceEvent) {
        if self.observer.traces() {
            self.observer.traced(event());
        }
    }

    /// Tells how a simulation ended, and the number of the new state that it led to.
    pub(super) fn trace_simulation(
        &mut self,
        state: usize,
        run: &Run,
        end: &str,
        with: &[usize],
        poses: usize,
        leads_to: Option<usize>,
    ) {
        let Run { part, action, .. } = *run;
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

    /// Counts one simulation against the budget.
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

    /// The motions of some runs, in order, up to the first that leads out: that one changes the
    /// question to which later ones were answers, so they are stopped.
    pub(super) fn simulate(&mut self, runs: &[Run]) -> Result<Vec<Motion>, Stop> {
        let started = Instant::now();
        for run in runs {
            self.surroundings(run.part);
        }
        let (problem, around) = (&self.problem, &self.around);
        let winner = Arc::new(AtomicUsize::new(usize::MAX));
        let simulated = |(rank, run): (usize, &Run)| {
            let Some(around) = &around[run.part] else {
                return Ok(Motion { path: vec![run.start], end: End::Collision { with: Vec::new() } });
            };
            let Run { part, start, action } = run;
            let termination = problem.termination.unless_won(&winner, rank);
            let limited = problem.path_timeout.map(|limit| termination.within(limit));
            let poll = limited.as_ref().unwrap_or(&termination);
            let mut motion = problem.engine.simulate(&problem.scene, around, *part, start, *action, poll);
            if motion.is_err() && termination.check().is_ok() {
                let touched = around.standing.clone();
                motion = Ok(Motion { path: vec![*start], end: End::Undecided { reason: NO_TIME, touched } });
            }
            if matches!(&motion, Ok(Motion { end: End::Disassembled(_), .. })) {
                winner.fetch_min(rank, Ordering::Relaxed);
            }
            motion
        };
        let motions: Vec<_> = if runs.len() > 1 {
            runs.par_iter().enumerate().map(simulated).collect()
        } else {
            runs.iter().enumerate().map(simulated).collect()
        };
        self.counters.simulation += started.elapsed();
        let no_time = |m: &Motion| matches!(m.end, End::Undecided { reason: NO_TIME, .. });
        self.path_time_ran_out |= motions.iter().flatten().any(no_time);
        let wanted = winner.load(Ordering::Relaxed).saturating_add(1);
        Ok(motions.into_iter().take(wanted).collect::<Result<_, Interrupt>>()?)
    }

    /// What straight sweeps along the forces of some runs tell, in order, up to the first that is
    /// clear.
    pub(super) fn sweep(&mut self, runs: &[Run]) -> Result<Vec<Option<Sweep>>, Stop> {
        self.problem.termination.check()?;
        let started = Instant::now();
        for run in runs {
            self.surroundings(run.part);
        }
        let (scene, around) = (&self.problem.scene, &self.around);
        let swept = |run: &Run| {
            let around = around[run.part].as_ref()?;
            straight_sweep(scene, around, run.part, &run.start, &run.action.force())
        };
        let mut results: Vec<_> = runs.par_iter().map(swept).collect();
        let clear = |s: &Option<Sweep>| matches!(s, Some(Sweep::Clear { .. }));
        if let Some(first) = results.iter().position(clear) {
            results.truncate(first + 1);
        }
        self.counters.simulation += started.elapsed();
        Ok(results)
    }

    /// Verifies a path that a sweep claims to be clear, from the end of `prefix`. What refutes it
    /// becomes samples, for the simulation that must answer instead.
    pub(super) fn prove_sweep(
        &mut self,
        run: &Run,
        prefix: &[Pose],
        motion: &[Pose],
    ) -> Result<Result<(Vec<Pose>, f64), Refuted>, Stop> {
        let part = run.part;
        let refuted = match self.checked(part, &joined(prefix, motion))? {
            Ok(proof) => return Ok(Ok(proof)),
            Err(entries) => entries,
        };
        tracing::debug!(part, action = %run.action, over = refuted.first().map(|e| e.over), "sweep refuted");
        self.trace_refutation(run, &refuted);
        self.problem.add_samples(part, &refuted);
        let prefix = prefix.len() > 1 && self.checked(part, prefix)?.is_err();
        Ok(Err(Refuted { prefix }))
    }

    /// Tells of a refuted path; the parts that it enters.
    fn trace_refutation(&mut self, run: &Run, entries: &[Entry]) -> Vec<usize> {
        let mut by: Vec<_> = entries.iter().map(|e| e.other).collect();
        by.sort_unstable();
        by.dedup();
        let (part, action) = (run.part, run.action.to_string());
        self.trace(|| TraceEvent::Refuted { part, action, by: by.clone() });
        by
    }

    /// Thins and verifies a motion that leads out from the end of `prefix`. A refuted one is
    /// simulated again with the refuting points as samples, and given up after some tries.
    pub(super) fn prove(&mut self, run: Run, prefix: &[Pose], motion: Vec<Pose>) -> Result<Proof, Stop> {
        let part = run.part;
        let mut motion = motion;
        for refinement in 0..=REFINEMENTS {
            let refuted = match self.checked(part, &joined(prefix, &motion))? {
                Ok((path, depth)) => return Ok(Proof::Path { path, depth }),
                Err(entries) => entries,
            };
            tracing::debug!(part, refinement, over = refuted.first().map(|e| e.over), "path refuted");
            self.problem.add_samples(part, &refuted);
            if prefix.len() > 1 && self.checked(part, prefix)?.is_err() {
                return Ok(Proof::PrefixRefuted);
            }
            let by = self.trace_refutation(&run, &refuted);
            if refinement == REFINEMENTS {
                return Ok(Proof::Refuted { by });
            }
            self.charge()?;
            let Some(again) = self.simulate(&[run])?.pop() else { break };
            if !matches!(again.end, End::Disassembled(_)) {
                return Ok(Proof::Otherwise(again));
            }
            motion = again.path;
        }
        Ok(Proof::Refuted { by: Vec::new() })
    }

    fn checked(&mut self, part: usize, path: &[Pose]) -> Result<super::Checked, Stop> {
        let started = Instant::now();
        let checked = self.problem.checked_path(self.standing(part), part, path);
        self.counters.verification += started.elapsed();
        Ok(checked?)
    }

    /// Takes a part out; `waited_for` are those that had blocked it and left before.
    pub(super) fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64, waited_for: Vec<usize>) {
        self.everything = self.everything.without(&self.problem.scene, part);
        self.around.fill(None);
        let removal = Removal { part, path, depth, waited_for };
        self.observer.removal(&removal);
        self.trace(|| TraceEvent::Removed { part, waited_for: removal.waited_for.clone() });
        self.removals.push(removal);
    }

    /// A part that may move and whose hull is apart from all others': it needs no motion.
    pub(super) fn free_part(&mut self) -> Result<Option<usize>, Stop> {
        for part in self.everything.standing.clone() {
            self.problem.termination.check()?;
            if !self.is_done() && self.problem.may_move(part) && self.is_free(part) {
                return Ok(Some(part));
            }
        }
        Ok(None)
    }

    fn is_free(&mut self, part: usize) -> bool {
        if self.everything.standing.len() < 2 {
            return false;
        }
        if let Some(other) = self.entangled[part]
            && self.everything.standing.binary_search(&other).is_ok()
        {
            return false;
        }
        let scene = &self.problem.scene;
        let pose = scene.bodies[part].planning_from_shape;
        let meets = |&&other: &&usize| {
            other != part
                && scene.bodies[other].bounds.meets(&scene.bodies[part].bounds)
                && exit_direction(scene, &Surroundings::new(scene, vec![other]), part, &pose, None).is_none()
        };
        self.entangled[part] = self.everything.standing.iter().find(meets).copied();
        if self.entangled[part].is_some() {
            return false;
        }
        self.surroundings(part);
        let around = self.around[part].as_ref();
        around.is_some_and(|a| exit_direction(&self.problem.scene, a, part, &pose, None).is_some())
    }

    /// What the search answers. `evidence` says what was tried before nothing more was found;
    /// `blocked` who stands in the way of what remains.
    pub(super) fn outcome(
        mut self,
        stop: Option<Stop>,
        evidence: String,
        blocked: Vec<BlockedAction>,
    ) -> Outcome {
        let (status, reason) = match stop {
            _ if self.is_done() => (PlanStatus::Complete, None),
            None if self.path_time_ran_out => (PlanStatus::Timeout, Some(NO_TIME.to_owned())),
            None => (PlanStatus::Infeasible, Some(evidence)),
            Some(Stop::Interrupted(Interrupt::Cancelled)) => {
                (PlanStatus::Cancelled, Some("cancelled".to_owned()))
            }
            Some(Stop::Interrupted(Interrupt::DeadlinePassed)) => {
                (PlanStatus::Timeout, Some("the deadline passed".to_owned()))
            }
            Some(Stop::Budget(n)) => {
                (PlanStatus::Partial, Some(format!("the budget of {n} simulations is used up")))
            }
        };
        let Counters { simulations, sweeps, .. } = self.counters;
        self.trace(|| TraceEvent::End {
            status: status.name().to_owned(),
            reason: reason.clone(),
            simulations,
            sweeps,
        });
        Outcome {
            status,
            reason,
            remaining: self.everything.standing,
            blocked: if status == PlanStatus::Complete { Vec::new() } else { blocked },
            removals: self.removals,
            counters: self.counters,
        }
    }
}

/// A path continued by a motion that starts at its end.
pub(super) fn joined(path: &[Pose], motion: &[Pose]) -> Vec<Pose> {
    path.iter().chain(motion.iter().skip(1)).copied().collect()
}
