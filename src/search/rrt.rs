//! RRT and BK-RRT: the sampling-based planners that the paper compares with, as baselines.
//!
//! Part by part, a tree of poses grows from the assembled pose towards random poses until it is out. RRT (S. LaValle
//! 1998) adds straight ways. BK-RRT (S. Zickler and M. Veloso, "Efficient physics-based planning: sampling search via
//! non-deterministic tactics and skills", 2009) adds motions of the transition function under a random action, up to
//! the pose nearest to the random one. Each part gets some samples, and twice as many when no part could leave. Trees
//! are kept when parts leave: there is only more room.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::time::Instant;

use nalgebra::{Translation3, Vector3};

use crate::budgets::{RRT_BATCH, RRT_FIRST_SAMPLES, RRT_SAMPLES};
use crate::contact::sampled::MovingBody;
use crate::geometry::{Bounds, Pose};
use crate::rrt::{PoseSampler, Space, Tree};
use crate::scene::{PartMetric, Scene, StandingParts, exit_direction};
use crate::simulation::{Action, End, Motion};
use crate::termination::Interrupt;
use crate::tolerances::GOAL_BIAS;

use super::blocked_actions::ANY;
use super::disassembly::{Disassembly, Proof, Stop, Transition, joined};
use super::inseparable::InseparablePairs;
use super::outcome::Outcome;
use super::problem::{Observer, Problem, VerifiedPath};
use super::release::Release;
use super::stopped_actions::StoppedActions;
use super::trace::{PlanningPhase, TraceEvent};

/// How a tree grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extension {
    /// By straight ways (RRT).
    Straight,
    /// By motions of the transition function (BK-RRT).
    Simulated,
}

/// RRT or BK-RRT.
pub(super) fn rrt(problem: Problem<'_>, observer: &mut dyn Observer, extension: Extension) -> Outcome {
    let (disassembly, actions) =
        Disassembly::beside(problem, observer, |problem| Ok(problem.action_lists(&problem.directions()?)));
    let (translations, rotations) = match actions {
        Ok(lists) => lists,
        Err(interrupt) => {
            return disassembly.outcome(Some(interrupt.into()), InseparablePairs::default(), Vec::new());
        }
    };
    let outwards = translations.iter().map(|action| action.force()).collect();
    let actions = [translations, rotations].concat();
    let trees = disassembly.problem.scene.bodies.iter().map(|_| None).collect();
    let stopped = StoppedActions::default();
    let mut search = RrtSearch { disassembly, extension, actions, outwards, trees, stopped };
    let stop = search.run().err();
    let name = |action: usize| match extension {
        Extension::Straight => ANY.to_owned(),
        Extension::Simulated => search.actions[action].to_string(),
    };
    let blocked = search.stopped.blocked(&search.disassembly, name);
    search.disassembly.outcome(stop, InseparablePairs::default(), blocked)
}

struct RrtSearch<'a, 'o> {
    disassembly: Disassembly<'a, 'o>,
    extension: Extension,
    /// Those of BK-RRT.
    actions: Vec<Action>,
    /// The directions of the translations.
    outwards: Vec<Vector3<f64>>,
    /// By part, once it was tried.
    trees: Vec<Option<PartTree>>,
    stopped: StoppedActions,
}

/// The tree of one part.
struct PartTree {
    tree: Tree,
    /// By node: the poses from its parent to it.
    pieces: Vec<Vec<Pose>>,
    sampler: PartSampler,
    samples: usize,
}

impl PartTree {
    fn new(disassembly: &Disassembly<'_, '_>, part: usize, outwards: &[Vector3<f64>]) -> Self {
        let start = disassembly.assembled(part);
        Self {
            tree: Tree::from(&start),
            pieces: vec![vec![start]],
            sampler: PartSampler::new(disassembly, part, outwards),
            samples: 0,
        }
    }

    fn add(&mut self, parent: usize, piece: Vec<Pose>) {
        self.tree.add(piece[piece.len() - 1], parent);
        self.pieces.push(piece);
    }

    fn path_to(&self, node: usize) -> Vec<Pose> {
        let pieces = self.tree.nodes_to(node).into_iter().map(|node| &self.pieces[node]);
        pieces.fold(
            Vec::new(),
            |path, piece| if path.is_empty() { piece.clone() } else { joined(&path, piece) },
        )
    }

    /// Grows anew from the assembled pose, with other samples.
    fn restart(&mut self) {
        let start = self.tree.poses()[0];
        (self.tree, self.pieces) = (Tree::from(&start), vec![vec![start]]);
    }
}

impl RrtSearch<'_, '_> {
    fn run(&mut self) -> Result<(), Stop> {
        let mut samples = RRT_FIRST_SAMPLES;
        while !self.disassembly.is_done() {
            self.disassembly
                .trace(|| TraceEvent::Pass { phase: PlanningPhase::Rotation, depth_limit: Some(samples) });
            let mut removed = false;
            for part in self.disassembly.everything.standing().to_vec() {
                if self.disassembly.problem.may_move(part) && self.leaves(part, samples)? {
                    removed = true;
                    if self.disassembly.is_done() {
                        return Ok(());
                    }
                }
            }
            match removed {
                true => {}
                false if samples < RRT_SAMPLES => samples *= 2,
                false if self.disassembly.release(Release::Kept) => {}
                false => return Ok(()),
            }
        }
        Ok(())
    }

    /// Grows the tree of a part to some number of samples, until it is out.
    fn leaves(&mut self, part: usize, samples: usize) -> Result<bool, Stop> {
        let around = self.disassembly.surroundings(part);
        let mut tree =
            self.trees[part].take().unwrap_or_else(|| PartTree::new(&self.disassembly, part, &self.outwards));
        // Parts that left since may have been what the tree was not out of.
        let mut out = first_out(&self.disassembly.problem.scene, &around, part, tree.tree.poses());
        let (started, verified) = (Instant::now(), self.disassembly.counters.verification);
        while out.is_none() && tree.samples < samples {
            let verification = self.disassembly.counters.verification - verified;
            let took = started.elapsed().saturating_sub(verification);
            if self.disassembly.problem.path_timeout.is_some_and(|limit| took >= limit) {
                self.disassembly.path_time_ran_out = true;
                break;
            }
            let nodes = tree.pieces.len();
            match self.extension {
                Extension::Straight => self.extend_straight(part, &mut tree)?,
                Extension::Simulated => {
                    if let Some(VerifiedPath { path, depth }) = self.extend_by_motions(part, &mut tree)? {
                        self.disassembly.remove(part, path, depth)?;
                        return Ok(true);
                    }
                }
            }
            let new = tree.tree.poses().get(nodes..).unwrap_or_default();
            self.disassembly.counters.states += new.len() as u64;
            out = first_out(&self.disassembly.problem.scene, &around, part, new).map(|node| nodes + node);
        }
        if let Some(node) = out {
            if let Ok(VerifiedPath { path, depth }) =
                self.disassembly.checked_way_as_given(part, &tree.path_to(node))?
            {
                self.disassembly.remove(part, path, depth)?;
                return Ok(true);
            }
            tree.restart();
        }
        self.trees[part] = Some(tree);
        Ok(false)
    }

    /// One step towards a random pose.
    fn extend_straight(&mut self, part: usize, tree: &mut PartTree) -> Result<(), Stop> {
        self.disassembly.charge()?;
        let started = Instant::now();
        let standing = &self.disassembly.standing(part);
        let PartTree { tree: poses, pieces, sampler, samples } = tree;
        let mut space = FreeSpace {
            problem: &self.disassembly.problem,
            standing,
            part,
            sampler,
            met: RefCell::new(self.stopped.of(part)),
        };
        let target = space.sample();
        let metric = space.metric();
        let from = poses.nearest(&metric, &target);
        if let Some(node) = poses.extended(&space, from, &target)? {
            pieces.push(metric.way(&poses.poses()[from], &poses.poses()[node]));
        }
        *samples += 1;
        // All straight ways count as one action.
        self.stopped.keep(part, 0, space.met.into_inner().into_iter().collect());
        self.disassembly.counters.simulation += started.elapsed();
        Ok(())
    }

    /// Motions from the nodes nearest to some random poses; a verified path if one leads out.
    fn extend_by_motions(&mut self, part: usize, tree: &mut PartTree) -> Result<Option<VerifiedPath>, Stop> {
        let metric = tree.sampler.metric;
        let drawn: Vec<_> = (0..RRT_BATCH)
            .map(|_| {
                let target = tree.sampler.pose();
                let node = tree.tree.nearest(&metric, &target);
                let action = tree.sampler.poses.uniform.below(self.actions.len());
                let start = tree.tree.poses()[node];
                (target, node, action, Transition { part, start, action: self.actions[action] })
            })
            .collect();
        tree.samples += drawn.len();
        let runs: Vec<Transition> = drawn.iter().map(|(.., run)| *run).collect();
        let motions = self.disassembly.simulate(&runs)?;
        for ((target, node, action, run), motion) in drawn.into_iter().zip(motions) {
            self.disassembly.charge()?;
            self.disassembly.used(&motion);
            let motion = if matches!(motion.end, End::Disassembled(_)) {
                match self.disassembly.prove(run, &tree.path_to(node), motion.path)? {
                    Proof::Path(verified) => return Ok(Some(verified)),
                    Proof::Otherwise(motion) => motion,
                    // Samples that were added may refute other nodes, too.
                    Proof::PrefixRefuted | Proof::Refuted { .. } => {
                        tree.restart();
                        return Ok(None);
                    }
                }
            } else {
                motion
            };
            self.grow(tree, [node, action], &run, &target, motion);
        }
        Ok(None)
    }

    /// Adds a motion up to the pose nearest to a random one.
    fn grow(
        &mut self,
        tree: &mut PartTree,
        [node, action]: [usize; 2],
        run: &Transition,
        target: &Pose,
        motion: Motion,
    ) {
        let Motion { mut path, end, .. } = motion;
        let (word, with) = end.described();
        path.truncate(1 + tree.sampler.metric.nearest(&path, target));
        let leads_to = (path.len() > 1).then_some(tree.pieces.len());
        self.disassembly.trace_simulation(node, run, word, &with, path.len(), leads_to);
        if node == 0 {
            self.stopped.keep(run.part, action, with);
        }
        if path.len() > 1 {
            tree.add(node, path);
        }
    }
}

/// Random poses of a part, some of them out.
struct PartSampler {
    poses: PoseSampler,
    metric: PartMetric,
    assembled: Pose,
    /// The directions of the translations: along others, no part leaves a place where it fits without play.
    outwards: Vec<Vector3<f64>>,
    /// Of all that stood when the part was first tried.
    bounds: Bounds,
}

impl PartSampler {
    fn new(disassembly: &Disassembly<'_, '_>, part: usize, outwards: &[Vector3<f64>]) -> Self {
        let Problem { scene, seed, .. } = &disassembly.problem;
        let metric = PartMetric::of(scene, part);
        let standing = disassembly.everything.standing();
        let bounds = standing.iter().fold(Bounds::EMPTY, |all, &i| all.union(&scene.bodies[i].bounds));
        let assembled = disassembly.assembled(part);
        let seed = [seed.to_le_bytes(), (part as u64).to_le_bytes()].concat();
        let near = bounds.grown(metric.reach);
        let poses = PoseSampler::new(&seed, metric, near, [assembled.rotation; 2]);
        Self { poses, metric, assembled, outwards: outwards.to_vec(), bounds }
    }

    fn pose(&mut self) -> Pose {
        if self.poses.uniform.number() >= GOAL_BIAS {
            return self.poses.pose(true);
        }
        let direction = self.outwards[self.poses.uniform.below(self.outwards.len())];
        let at = (self.assembled * self.metric.centre).coords;
        let far = self.bounds.support(&direction) + 2.0 * self.metric.reach;
        Translation3::from(direction * (far - at.dot(&direction)).max(0.0)) * self.assembled
    }
}

/// Where a part may be among others.
struct FreeSpace<'a, 'p> {
    problem: &'a Problem<'p>,
    standing: &'a [usize],
    part: usize,
    sampler: &'a mut PartSampler,
    /// The parts that were in the way.
    met: RefCell<BTreeSet<usize>>,
}

impl Space for FreeSpace<'_, '_> {
    fn metric(&self) -> PartMetric {
        self.sampler.metric
    }

    fn is_free(&self, from: &Pose, to: &Pose) -> Result<bool, Interrupt> {
        let Problem { scene, termination, verifier, .. } = self.problem;
        // Mostly the end tells, and takes less time than the way.
        let end = MovingBody::new(scene, self.part, *to).until(termination);
        let bounds = scene.bodies[self.part].shape.bounds().transformed(to);
        for other in scene.broad_phase.meeting_of(self.standing, &bounds) {
            if end.enters_by(verifier.limit(), &[other])? {
                self.met.borrow_mut().insert(other);
                return Ok(false);
            }
        }
        let way = self.sampler.metric.way(from, to);
        let checked = self.problem.checked_as_given(self.standing, self.part, &way)?;
        let Err(penetrations) = checked else { return Ok(true) };
        self.met.borrow_mut().extend(penetrations.iter().map(|p| p.other));
        Ok(false)
    }

    fn sample(&mut self) -> Pose {
        self.sampler.pose()
    }

    fn extent(&self) -> f64 {
        self.sampler.bounds.extents().norm()
    }
}

/// The first of some poses at which a part is apart from all others.
fn first_out(scene: &Scene, around: &StandingParts, part: usize, poses: &[Pose]) -> Option<usize> {
    poses.iter().position(|pose| exit_direction(scene, around, part, pose, None).is_some())
}
