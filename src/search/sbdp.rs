//! SBDP*: State-Based Disassembly Planning guided by directional blocking graphs.
//!
//! Source: the paper, Algorithm 1 with the evaluation functions (f_c, f_a) and the constraints of
//! its section on blocking graphs. Departures, each for a reason given in DESIGN 6: a collision is
//! about a set of parts; translational passes repeat while they find new states, since turning
//! costs more; the search ends when nothing new can be found. Simulations run ahead in parallel,
//! but their results are taken in the order of the serial algorithm and thrown away where an
//! earlier one changed the question, so the plan does not depend on the number of threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::{Blockage, Evaluation, blocked_from, initial_blockages};
use crate::geometry::Pose;
use crate::simulation::{Action, End, Motion, Surroundings};
use crate::termination::{Interrupt, Termination};

use super::outcome::{Counters, Outcome, Removal};
use super::problem::{Observer, Problem};
use super::state::{Node, Phase, coarseness, least_travel, same_state};

/// Translational passes in a row before turning is tried, if they only find new states.
const TRANSLATION_PASSES: usize = 6;
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

/// What a pass brought.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gain {
    pub(super) removed: bool,
    pub(super) new_states: bool,
}

impl Gain {
    fn any(self) -> bool {
        self.removed || self.new_states
    }
}

/// One simulation to run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job {
    pub(super) node: usize,
    pub(super) action: usize,
}

pub(super) struct Search<'a, 'o> {
    pub(super) problem: Problem<'a>,
    pub(super) observer: &'o mut dyn Observer,
    /// All present parts that have not been taken out.
    pub(super) everything: Surroundings,
    pub(super) around: Vec<Option<Surroundings>>,
    /// A part whose hull meets this part's, both assembled: proof that it is not free.
    pub(super) entangled: Vec<Option<usize>>,
    pub(super) nodes: Vec<Node>,
    pub(super) states_of: Vec<usize>,
    pub(super) translations: Vec<Action>,
    pub(super) rotations: Vec<Action>,
    /// The last resort: actions that static analysis excluded are simulated, too.
    pub(super) distrust_static: bool,
    pub(super) removals: Vec<Removal>,
    pub(super) counters: Counters,
}

/// Searches until everything asked for is out, nothing more can be found, or a limit is met.
pub(super) fn sbdp_star(problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let mut search = Search::new(problem, observer);
    let stop = search.run().err();
    search.outcome(stop)
}

impl<'a, 'o> Search<'a, 'o> {
    fn new(problem: Problem<'a>, observer: &'o mut dyn Observer) -> Self {
        let count = problem.scene.bodies.len();
        let everything = Surroundings::new(&problem.scene, problem.present.clone());
        let (translations, rotations) = problem.action_lists();
        Self {
            observer,
            everything,
            around: vec![None; count],
            entangled: vec![None; count],
            nodes: Vec::new(),
            states_of: vec![0; count],
            translations,
            rotations,
            distrust_static: false,
            removals: Vec::new(),
            counters: Counters::default(),
            problem,
        }
    }

    fn run(&mut self) -> Result<(), Stop> {
        self.make_roots()?;
        self.take_free_parts()?;
        loop {
            let mut gain = Gain::default();
            for _ in 0..TRANSLATION_PASSES {
                let pass = self.pass(Phase::Translation)?;
                if self.is_done() {
                    return Ok(());
                }
                gain.removed |= pass.removed;
                gain.new_states |= pass.new_states;
                if !pass.new_states {
                    break;
                }
            }
            let turned = self.pass(Phase::Rotation)?;
            if self.is_done() {
                return Ok(());
            }
            if gain.any() || turned.any() {
                continue;
            }
            self.distrust_static = true;
            let last = self.pass(Phase::Translation);
            self.distrust_static = false;
            if self.is_done() || !last?.any() {
                return Ok(());
            }
        }
    }

    fn make_roots(&mut self) -> Result<(), Stop> {
        let started = Instant::now();
        let Problem { scene, present, termination, .. } = &self.problem;
        let least = |part| least_travel(scene, part);
        let blockages = initial_blockages(scene, present, &self.translations, &least, termination)?;
        self.counters.static_analysis += started.elapsed();
        for (part, blockage) in blockages.into_iter().enumerate() {
            if self.problem.may_move(part) {
                self.add_node(Node {
                    part,
                    path: vec![self.problem.scene.bodies[part].planning_from_shape],
                    translation: Some(blockage),
                    rotation: Blockage::open(self.rotations.len()),
                    origin: None,
                    alive: true,
                });
            }
        }
        Ok(())
    }

    fn add_node(&mut self, node: Node) {
        self.states_of[node.part] += 1;
        self.counters.states += 1;
        self.nodes.push(node);
    }

    pub(super) fn actions(&self, phase: Phase) -> &[Action] {
        match phase {
            Phase::Translation => &self.translations,
            Phase::Rotation => &self.rotations,
        }
    }

    /// One run of Algorithm 1's `disassembly` over the open list.
    fn pass(&mut self, phase: Phase) -> Result<Gain, Stop> {
        let mut gain = Gain::default();
        let mut open: Vec<usize> = self.expandable(phase);
        while !open.is_empty() && !self.is_done() {
            self.analyse(phase, &open)?;
            let batch = self.extract(phase, &mut open);
            let result = self.expand(phase, &batch)?;
            gain.new_states |= result.new_states;
            if result.removed {
                gain.removed = true;
                self.take_free_parts()?;
                if phase == Phase::Rotation {
                    return Ok(gain);
                }
                open = self.expandable(phase);
            }
        }
        Ok(gain)
    }

    /// The states to expand, the initial one included. Of two last parts it is the same which one
    /// moves against the other: beyond the first push, only the smaller one does.
    fn expandable(&self, phase: Phase) -> Vec<usize> {
        let standing = &self.everything.standing;
        let still = match standing[..] {
            [a, b] if self.problem.may_move(a) && self.problem.may_move(b) => {
                let reach = |p: usize| self.problem.scene.bodies[p].shape.reach;
                Some(if reach(a) < reach(b) { b } else { a })
            }
            _ => None,
        };
        let skipped = |n: &Node| Some(n.part) == still && (phase == Phase::Rotation || !n.is_root());
        (0..self.nodes.len()).filter(|&i| self.nodes[i].alive && !skipped(&self.nodes[i])).collect()
    }

    /// Static analysis of displaced states that have none yet.
    fn analyse(&mut self, phase: Phase, open: &[usize]) -> Result<(), Stop> {
        if phase == Phase::Rotation {
            return Ok(());
        }
        let started = Instant::now();
        let todo: Vec<_> = open.iter().copied().filter(|&i| self.nodes[i].translation.is_none()).collect();
        for &i in &todo {
            let part = self.nodes[i].part;
            self.surroundings(part);
        }
        let (scene, around, nodes) = (&self.problem.scene, &self.around, &self.nodes);
        let translations = &self.translations;
        let termination = &self.problem.termination;
        let found = todo
            .par_iter()
            .map(|&i| {
                termination.check()?;
                let node = &nodes[i];
                let standing = around[node.part].as_ref().map_or(&[][..], |s| &s.standing);
                let least = least_travel(scene, node.part);
                Ok(blocked_from(scene, standing, node.part, node.pose(), translations, least))
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        for (i, blockage) in todo.into_iter().zip(found) {
            self.nodes[i].translation = Some(blockage);
        }
        self.counters.static_analysis += started.elapsed();
        Ok(())
    }

    /// Takes the best displaced state off the open list, or else the initial state, which comes
    /// last (its f_c and f_a count as infinite) and stands for all its parts in their order.
    fn extract(&self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        let evaluation = |i: usize| {
            let zero = Evaluation { colliding_parts: 0, open_actions: 0 };
            self.nodes[i].blockage(phase).map_or(zero, Blockage::evaluation)
        };
        let displaced = open.iter().copied().filter(|&i| !self.nodes[i].is_root());
        if let Some(best) = displaced.min_by_key(|&i| (evaluation(i), i)) {
            open.retain(|&i| i != best);
            return vec![best];
        }
        let mut roots = std::mem::take(open);
        // Before anything was turned, what stops pushes tells which part is least held; among
        // equals the smallest is the likeliest fastener and the cheapest to simulate.
        let other = |i: usize| self.nodes[i].blockage(Phase::Translation).map(Blockage::evaluation);
        let reach = |i: usize| self.problem.scene.bodies[self.nodes[i].part].shape.reach.to_bits();
        roots.sort_by_key(|&i| match phase {
            Phase::Translation => (evaluation(i), None, 0, i),
            Phase::Rotation => (evaluation(i), other(i), reach(i), i),
        });
        roots
    }

    /// Simulates the open actions of some states of one priority, in order.
    fn expand(&mut self, phase: Phase, batch: &[usize]) -> Result<Gain, Stop> {
        let count = self.actions(phase).len();
        let jobs: Vec<Job> =
            batch.iter().flat_map(|&node| (0..count).map(move |action| Job { node, action })).collect();
        let mut gain = Gain::default();
        let mut next = 0;
        while next < jobs.len() {
            let (window, end) = self.window(phase, &jobs, next);
            next = end;
            let motions = self.simulate_all(phase, &window)?;
            for (job, motion) in window.into_iter().zip(motions) {
                self.charge()?;
                if self.take(phase, job, motion, &mut gain)? {
                    // Later results of this window answer a question that has changed.
                    next = jobs
                        .iter()
                        .position(|j| (j.node, j.action) == (job.node, job.action))
                        .map_or(end, |i| i + 1);
                    break;
                }
            }
            if self.is_done() {
                break;
            }
        }
        Ok(gain)
    }

    /// The next jobs worth running: as many as there are threads.
    fn window(&self, phase: Phase, jobs: &[Job], from: usize) -> (Vec<Job>, usize) {
        let threads = rayon::current_num_threads();
        // Pushes from the assembled pose often succeed, which voids what was run ahead; others
        // seldom do, and long and short ones share the threads better in a longer window.
        let likely = phase == Phase::Translation && self.nodes[jobs[from].node].is_root();
        let size = if likely || threads == 1 { threads } else { 4 * threads };
        let mut window = Vec::new();
        let mut at = from;
        while at < jobs.len() && window.len() < size {
            if self.is_open(phase, jobs[at]) {
                window.push(jobs[at]);
            }
            at += 1;
        }
        (window, at)
    }

    fn is_open(&self, phase: Phase, job: Job) -> bool {
        let node = &self.nodes[job.node];
        node.alive
            && node.blockage(phase).is_some_and(|b| {
                if self.distrust_static { b.is_untried(job.action) } else { b.is_open(job.action) }
            })
    }

    /// The motions of a window up to the first that leads out: that one changes the question to
    /// which later ones were answers, so they are stopped.
    fn simulate_all(&mut self, phase: Phase, window: &[Job]) -> Result<Vec<Motion>, Stop> {
        let started = Instant::now();
        for job in window {
            let part = self.nodes[job.node].part;
            self.surroundings(part);
        }
        let (problem, nodes, around) = (&self.problem, &self.nodes, &self.around);
        let actions = self.actions(phase);
        let winner = Arc::new(AtomicUsize::new(usize::MAX));
        let run = |(rank, job): (usize, &Job)| {
            let termination = problem.termination.unless_won(&winner, rank);
            let motion = simulate(problem, &nodes[job.node], around, actions[job.action], &termination);
            if matches!(&motion, Ok(Motion { end: End::Disassembled(_), .. })) {
                winner.fetch_min(rank, Ordering::Relaxed);
            }
            motion
        };
        let motions: Vec<_> = if window.len() > 1 {
            window.par_iter().enumerate().map(run).collect()
        } else {
            window.iter().enumerate().map(run).collect()
        };
        self.counters.simulation += started.elapsed();
        let wanted = winner.load(Ordering::Relaxed).saturating_add(1);
        Ok(motions.into_iter().take(wanted).collect::<Result<_, Interrupt>>()?)
    }

    pub(super) fn charge(&mut self) -> Result<(), Stop> {
        if let Some(most) = self.problem.max_simulations
            && self.counters.simulations >= most
        {
            return Err(Stop::Budget(most));
        }
        self.counters.simulations += 1;
        self.observer.progress(self.removals.len(), self.counters.simulations);
        Ok(())
    }

    /// Takes in a motion; true if the scene changed by it.
    pub(super) fn take(
        &mut self,
        phase: Phase,
        job: Job,
        motion: Motion,
        gain: &mut Gain,
    ) -> Result<bool, Stop> {
        let Motion { path, end } = motion;
        let (part, action) = (self.nodes[job.node].part, self.actions(phase)[job.action]);
        tracing::debug!(part, node = job.node, %action, steps = path.len(), ?end, "simulated");
        let by = match end {
            End::Disassembled(_) => {
                let taken = self.take_out(phase, job, path)?;
                gain.removed |= taken;
                return Ok(true);
            }
            End::Collision { with } => with,
            End::Undecided { touched, .. } => touched,
        };
        self.block(phase, job, by);
        let node = &self.nodes[job.node];
        let Some(end) = path.last() else { return Ok(false) };
        let coarse = coarseness(self.states_of[part]);
        let known = |n: &Node| {
            n.alive && n.part == part && same_state(&self.problem.scene, part, n.pose(), end, coarse)
        };
        if !self.nodes.iter().any(known) {
            gain.new_states = true;
            let path = joined(&node.path, &path);
            let rotation = Blockage::open(self.rotations.len());
            let origin = Some((job.node, phase, job.action));
            self.add_node(Node { part, path, translation: None, rotation, origin, alive: true });
        }
        Ok(false)
    }

    pub(super) fn block(&mut self, phase: Phase, job: Job, by: Vec<usize>) {
        if let Some(b) = self.nodes[job.node].blockage_mut(phase) {
            b.block_jointly(job.action, by);
        }
    }

    pub(super) fn is_done(&self) -> bool {
        self.problem.is_goal(&self.everything.standing)
    }
}

/// A path continued by a motion that starts at its end.
pub(super) fn joined(path: &[Pose], motion: &[Pose]) -> Vec<Pose> {
    path.iter().chain(motion.iter().skip(1)).copied().collect()
}

pub(super) fn simulate(
    problem: &Problem<'_>,
    node: &Node,
    around: &[Option<Surroundings>],
    action: Action,
    termination: &Termination,
) -> Result<Motion, Interrupt> {
    let Problem { scene, engine, .. } = problem;
    match &around[node.part] {
        Some(around) => engine.simulate(scene, around, node.part, node.pose(), action, termination),
        None => Ok(Motion { path: vec![*node.pose()], end: End::Collision { with: Vec::new() } }),
    }
}
