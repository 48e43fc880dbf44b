//! PDP: physics-based disassembly planning, the baseline (Y. Tian et al. 2022, as the paper's
//! background describes it).
//!
//! Part by part, breadth-first search over motions up to a depth limit, rebuilt from scratch for
//! every part and limit. The limit begins at one and grows when no part could leave. PDP_t has
//! translations only, PDP_r only actions with rotational freedom; PDP* runs PDP_t, and PDP_r from
//! the start if that failed.

use std::time::Instant;

use crate::geometry::Pose;
use crate::plan::PlanStatus;
use crate::simulation::{Action, End, Motion};

use super::deferred_removals::DeferredRemovals;
use super::disassembly::{Disassembly, Proof, Stop, Transition, joined};
use super::inseparable::InseparablePairs;
use super::known_states::{KnownStates, Resolution};
use super::outcome::Outcome;
use super::problem::{Observer, Problem, VerifiedPath};
use super::release::Release;
use super::stopped_actions::StoppedActions;
use super::trace::{PlanningPhase, TraceEvent};

/// The actions of PDP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PdpMode {
    Translation,
    Rotation,
}

/// PDP_t or PDP_r.
pub(super) fn pdp(problem: Problem<'_>, observer: &mut dyn Observer, mode: PdpMode) -> Outcome {
    let (disassembly, actions) = Disassembly::beside(problem, observer, |problem| {
        let (translations, rotations) = problem.action_lists(&problem.directions()?);
        Ok(match mode {
            PdpMode::Translation => translations,
            PdpMode::Rotation => rotations,
        })
    });
    let actions = match actions {
        Ok(actions) => actions,
        Err(interrupt) => {
            return disassembly.outcome(Some(interrupt.into()), InseparablePairs::default(), Vec::new());
        }
    };
    let mut search = Pdp { disassembly, mode, actions, stopped: StoppedActions::default(), states: 0 };
    let stop = search.run().err();
    let blocked = search.stopped.blocked(&search.disassembly, |action| search.actions[action].to_string());
    search.disassembly.counters.states = search.states;
    search.disassembly.outcome(stop, InseparablePairs::default(), blocked)
}

/// PDP*: the counters are those of the run that answers. Removals of the first run reach the observer only once
/// it has succeeded. With a deadline, the first run has half of the time.
pub(super) fn pdp_star(problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let first = Problem { termination: problem.termination.halfway(), ..problem.clone() };
    let outcome = pdp(first, &mut DeferredRemovals::new(observer), PdpMode::Translation);
    let spent = outcome.counters.simulations;
    let nothing_left = problem.max_simulations.is_some_and(|most| spent >= most);
    if matches!(outcome.status, PlanStatus::Complete | PlanStatus::Cancelled) || nothing_left {
        outcome.removals.iter().for_each(|r| observer.removal(r));
        return outcome;
    }
    pdp(Problem { spent, ..problem }, observer, PdpMode::Rotation)
}

/// A configuration in the search tree of one part.
struct TreeNode {
    /// The path from the assembled pose.
    path: Vec<Pose>,
    depth: usize,
}

/// The search tree of one part.
struct SearchTree {
    nodes: Vec<TreeNode>,
    known: KnownStates,
}

impl SearchTree {
    fn add(&mut self, node: TreeNode) {
        self.known.add(self.nodes.len(), node.path[node.path.len() - 1]);
        self.nodes.push(node);
    }
}

/// How the search for one part ended.
enum TreeEnd {
    Out,
    /// Nothing new within the depth limit; `cut` if there may be more beyond it.
    Nothing {
        cut: bool,
    },
}

struct Pdp<'a, 'o> {
    disassembly: Disassembly<'a, 'o>,
    mode: PdpMode,
    actions: Vec<Action>,
    stopped: StoppedActions,
    /// Number of configurations, over all trees.
    states: u64,
}

impl Pdp<'_, '_> {
    fn run(&mut self) -> Result<(), Stop> {
        let mut limit = 1;
        while !self.disassembly.is_done() {
            let phase = self.phase();
            self.disassembly.trace(|| TraceEvent::Pass { phase, depth_limit: Some(limit) });
            let (mut removed, mut cut) = (false, false);
            for part in self.disassembly.everything.standing().to_vec() {
                let stands = self.disassembly.everything.standing().contains(&part);
                if !stands || !self.disassembly.problem.may_move(part) {
                    continue;
                }
                match self.search(part, limit)? {
                    TreeEnd::Nothing { cut: c } => cut |= c,
                    TreeEnd::Out => removed = true,
                }
                if self.disassembly.is_done() {
                    return Ok(());
                }
            }
            match (removed, cut) {
                (true, _) => {}
                (false, true) => limit += 1,
                (false, false) if self.disassembly.release(Release::Kept) => limit = 1,
                (false, false) => return Ok(()),
            }
        }
        Ok(())
    }

    /// Breadth-first search for a way out of one part.
    fn search(&mut self, part: usize, limit: usize) -> Result<TreeEnd, Stop> {
        let phase = self.phase();
        let known = KnownStates::new(&self.disassembly.problem.scene, part, Resolution::Fixed);
        let mut tree = SearchTree { nodes: Vec::new(), known };
        tree.add(TreeNode { path: vec![self.disassembly.assembled(part)], depth: 0 });
        let (mut next, mut cut) = (0, false);
        let (started, verified) = (Instant::now(), self.disassembly.counters.verification);
        while next < tree.nodes.len() {
            // The paper's planners do not verify.
            let verification = self.disassembly.counters.verification - verified;
            let took = started.elapsed().saturating_sub(verification);
            if self.disassembly.problem.path_timeout.is_some_and(|limit| took >= limit) {
                self.disassembly.path_time_ran_out = true;
                break;
            }
            if tree.nodes[next].depth == limit {
                cut = true;
                break;
            }
            self.disassembly.trace(|| TraceEvent::Expanded {
                phase,
                state: next,
                part,
                evaluation: None,
                excluded: Vec::new(),
            });
            if self.expand(part, &mut tree, next)? {
                return Ok(TreeEnd::Out);
            }
            next += 1;
        }
        Ok(TreeEnd::Nothing { cut })
    }

    /// Tries all actions from a node; true if one of them led out.
    fn expand(&mut self, part: usize, tree: &mut SearchTree, at: usize) -> Result<bool, Stop> {
        let prefix = tree.nodes[at].path.clone();
        let start = prefix[prefix.len() - 1];
        let window = rayon::current_num_threads();
        let mut action = 0;
        while action < self.actions.len() {
            let runs: Vec<Transition> = self.actions[action..]
                .iter()
                .take(window)
                .map(|&action| Transition { part, start, action })
                .collect();
            let motions = self.disassembly.simulate(&runs)?;
            for (run, motion) in runs.into_iter().zip(motions) {
                self.disassembly.charge()?;
                self.disassembly.used(&motion);
                let motion = match motion {
                    Motion { path, end: End::Disassembled(_), .. } => {
                        self.disassembly.trace_simulation(at, &run, "disassembled", &[], path.len(), None);
                        match self.disassembly.prove(run, &prefix, path)? {
                            Proof::Path(VerifiedPath { path, depth }) => {
                                self.disassembly.remove(part, path, depth)?;
                                return Ok(true);
                            }
                            Proof::Otherwise(motion) => Some(motion),
                            // No action from here can hold.
                            Proof::PrefixRefuted => return Ok(false),
                            // The tree is rebuilt with the refuting points as samples.
                            Proof::Refuted { .. } => None,
                        }
                    }
                    motion => Some(motion),
                };
                if let Some(motion) = motion {
                    self.grow(tree, at, &run, action, motion);
                }
                action += 1;
            }
        }
        Ok(false)
    }

    /// Adds the end of a motion to the tree, unless it is there.
    fn grow(&mut self, tree: &mut SearchTree, at: usize, run: &Transition, action: usize, motion: Motion) {
        let Motion { path, end, .. } = motion;
        let (word, with) = end.described();
        let is_new = !tree.known.has_like(&path[path.len() - 1], |_| true);
        let leads_to = is_new.then_some(tree.nodes.len());
        self.disassembly.trace_simulation(at, run, word, &with, path.len(), leads_to);
        if tree.nodes[at].depth == 0 {
            self.stopped.keep(run.part, action, with);
        }
        if is_new {
            self.states += 1;
            let from = &tree.nodes[at];
            let (path, depth) = (joined(&from.path, &path), from.depth + 1);
            tree.add(TreeNode { path, depth });
        }
    }

    fn phase(&self) -> PlanningPhase {
        match self.mode {
            PdpMode::Translation => PlanningPhase::Translation,
            PdpMode::Rotation => PlanningPhase::Rotation,
        }
    }
}
