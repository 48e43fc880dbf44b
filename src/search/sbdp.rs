//! SBDP and SBDP*: State-Based Disassembly Planning, without and with the guidance of
//! directional blocking graphs.
//!
//! Source: the paper, Algorithm 1; for SBDP* with the evaluation functions (f_c, f_a) and the
//! constraints of its section on blocking graphs. Departures, each for a reason given in DESIGN 6:
//! a collision is about a set of parts; the search ends when nothing new can be found. Beyond the
//! paper's action set, translational passes repeat while they find new states, since turning costs
//! more, and both kinds of planning share their states, since a bayonet needs both. Simulations run
//! ahead in parallel, but their results are taken in the order of the serial algorithm and thrown
//! away where an earlier one changed the question: plans do not depend on the number of threads.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::{Analysis, Blockage};
use crate::geometry::Pose;
use crate::simulation::{Action, End, Motion};
use crate::termination::Interrupt;

use super::ahead::Ahead;
use super::begun::Begun;
use super::directions::Directions;
use super::disassembly::{Disassembly, Proof, Run, Stop, joined};
use super::known_states::KnownStates;
use super::linked::Links;
use super::outcome::Outcome;
use super::problem::{Observer, Problem};
use super::rays::Rays;
use super::request::ActionSet;
use super::retraction::Origin;
use super::round::is_ball;
use super::state::{Node, Phase, least_travel};
use super::straight::Swept;
use super::trace::TraceEvent;
use super::twists::Twists;

/// Translational passes in a row before turning is tried, if they only find new states.
const TRANSLATION_PASSES: usize = 6;

/// What a pass brought.
#[derive(Debug, Clone, Copy, Default)]
struct Gain {
    removed: bool,
    new_states: bool,
}

impl Gain {
    fn any(self) -> bool {
        self.removed || self.new_states
    }
}

/// One simulation or sweep to run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job {
    pub(super) node: usize,
    pub(super) action: usize,
}

pub(super) struct Search<'a, 'o> {
    pub(super) disassembly: Disassembly<'a, 'o>,
    /// Whether blocking graphs order and constrain the search (SBDP*).
    pub(super) guided: bool,
    pub(super) nodes: Vec<Node>,
    /// Nodes at the assembled pose: the first ones.
    pub(super) roots: usize,
    /// Of each part.
    pub(super) known: Vec<KnownStates>,
    pub(super) directions: Directions,
    pub(super) translations: Vec<Action>,
    pub(super) rotations: Vec<Action>,
    pub(super) swept: Swept,
    pub(super) rays: Rays,
    pub(super) twists: Twists,
    ahead: Ahead,
    /// How often what an action led to was refuted.
    pub(super) retracted: HashMap<Origin, usize>,
    /// Of a node and a push: how long a stretch of others is in its way (powers of two), and as of when.
    pub(super) in_the_way: HashMap<(usize, usize), ((usize, usize), i32)>,
    /// How coarsely two states were taken for one, at most.
    pub(super) coarsest: f64,
    /// Which parts are balls, which no action has to turn.
    pub(super) balls: Vec<bool>,
    /// Once it was looked which parts are linked.
    pub(super) links: Option<Links>,
    /// As the paper has it: one open list for translational planning and one for rotational.
    pub(super) separate_lists: bool,
    translation_passes: usize,
    /// The last resort: actions that static analysis excluded are simulated, too.
    pub(super) distrust_static: bool,
}

/// Searches until everything asked for is out, nothing more can be found, or a limit is met.
pub(super) fn sbdp(problem: Problem<'_>, observer: &mut dyn Observer, guided: bool) -> Outcome {
    let (disassembly, begun) = Disassembly::beside(problem, observer, |p| Begun::of(p, guided));
    let begun = match begun {
        Ok(begun) => begun,
        Err(interrupt) => return disassembly.outcome(Some(interrupt.into()), String::new(), Vec::new()),
    };
    let mut search = Search::new(disassembly, begun, guided);
    let stop = search.run().err();
    let (evidence, blocked) = (search.evidence(), search.blocked());
    search.disassembly.outcome(stop, evidence, blocked)
}

impl<'a, 'o> Search<'a, 'o> {
    pub(super) fn new(mut disassembly: Disassembly<'a, 'o>, begun: Begun, guided: bool) -> Self {
        let Begun { directions, translations, rotations, blockages, took } = begun;
        disassembly.counters.static_analysis += took;
        let problem = &disassembly.problem;
        let as_paper = problem.actions == ActionSet::Paper;
        let scene = &problem.scene;
        let bodies = scene.bodies.iter().enumerate();
        let balls =
            bodies.map(|(p, b)| guided && !as_paper && is_ball(&b.shape, least_travel(scene, p))).collect();
        let mut search = Self {
            guided,
            nodes: Vec::new(),
            roots: 0,
            known: (0..scene.bodies.len()).map(|p| KnownStates::new(scene, p)).collect(),
            directions,
            rays: Rays::beside(&translations),
            twists: Twists::beside(&rotations),
            translations,
            rotations,
            swept: Swept::default(),
            ahead: Ahead::default(),
            retracted: HashMap::new(),
            in_the_way: HashMap::new(),
            coarsest: 1.0,
            balls,
            links: None,
            separate_lists: as_paper,
            translation_passes: if as_paper { 1 } else { TRANSLATION_PASSES },
            distrust_static: false,
            disassembly,
        };
        search.make_roots(blockages);
        search
    }

    fn run(&mut self) -> Result<(), Stop> {
        self.take_free_parts()?;
        loop {
            let mut gain = Gain::default();
            for _ in 0..self.translation_passes {
                let pass = self.pass(Phase::Translation)?;
                if self.disassembly.is_done() {
                    return Ok(());
                }
                gain.removed |= pass.removed;
                gain.new_states |= pass.new_states;
                if !pass.new_states {
                    break;
                }
            }
            let turned = self.pass(Phase::Rotation)?;
            if self.disassembly.is_done() {
                return Ok(());
            }
            if gain.any() || turned.any() || self.simulate_rays() || self.ask_for_all_twists() {
                continue;
            }
            if !self.guided {
                return Ok(());
            }
            self.distrust_static = true;
            let last = self.pass(Phase::Translation);
            self.distrust_static = false;
            if self.disassembly.is_done() || !last?.any() {
                return Ok(());
            }
        }
    }

    fn make_roots(&mut self, blockages: Vec<Blockage>) {
        for (part, blockage) in blockages.into_iter().enumerate() {
            if self.disassembly.problem.may_move(part) {
                self.add_node(Node {
                    part,
                    path: vec![self.disassembly.assembled(part)],
                    translation: Some(blockage),
                    rotation: Blockage::open(self.rotations.len()),
                    origin: None,
                    novelty: 0.0,
                    alive: true,
                });
                self.trace_analysis(self.nodes.len() - 1);
            }
        }
        self.roots = self.nodes.len();
    }

    pub(super) fn add_node(&mut self, node: Node) {
        self.known[node.part].add(self.nodes.len(), *node.pose());
        self.disassembly.counters.states += 1;
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
        self.disassembly.trace(|| TraceEvent::Pass { phase: phase.into(), depth_limit: None });
        let mut gain = Gain::default();
        let mut open: Vec<usize> = self.expandable(phase);
        while !open.is_empty() && !self.disassembly.is_done() {
            self.analyse(phase, &open)?;
            if self.sweep_out(phase, &open)? {
                gain.removed = true;
                self.take_free_parts()?;
                open = self.expandable(phase);
                continue;
            }
            if self.offer_rays(phase, &open)? || self.offer_twists(phase, &open)? {
                continue;
            }
            // Before the first simulation: what leaves straight is out.
            if self.find_links()? {
                open = self.expandable(phase);
                continue;
            }
            let batch = self.extract(phase, &mut open);
            let result = self.expand(phase, &batch)?;
            gain.new_states |= result.new_states;
            if result.new_states && self.turns_by_action(phase) {
                return Ok(gain);
            }
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

    /// Static analysis of displaced states that have none yet.
    fn analyse(&mut self, phase: Phase, open: &[usize]) -> Result<(), Stop> {
        if phase == Phase::Rotation {
            return Ok(());
        }
        let todo: Vec<_> = open.iter().copied().filter(|&i| self.nodes[i].translation.is_none()).collect();
        if !self.guided {
            for i in todo {
                let blockage = Blockage::open(self.rays.own.common);
                self.nodes[i].translation = Some(self.with_own(phase, self.nodes[i].part, blockage));
            }
            return Ok(());
        }
        let started = Instant::now();
        let (problem, nodes) = (&self.disassembly.problem, &self.nodes);
        let Problem { scene, static_analysis, termination, cache, .. } = problem;
        let standing: Vec<_> = todo.iter().map(|&i| self.disassembly.standing(nodes[i].part)).collect();
        let translations = &self.translations[..self.rays.own.common];
        let analysis = Analysis { rule: *static_analysis, scene, translations, cache };
        let found = todo
            .par_iter()
            .zip(standing)
            .map(|(&i, standing)| {
                termination.check()?;
                let node = &nodes[i];
                let least = least_travel(scene, node.part);
                analysis.blocked_from(&standing, node.part, node.pose(), least, termination)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        for (&i, blockage) in todo.iter().zip(found) {
            self.nodes[i].translation = Some(self.with_own(phase, self.nodes[i].part, blockage));
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        for i in todo {
            self.trace_analysis(i);
        }
        Ok(())
    }

    /// Simulates the open actions of some states of one priority, in order.
    fn expand(&mut self, phase: Phase, batch: &[usize]) -> Result<Gain, Stop> {
        let count = match phase {
            Phase::Translation if !self.rays.simulated => self.rays.own.common,
            _ => self.actions(phase).len(),
        };
        let mut jobs: Vec<Job> =
            batch.iter().flat_map(|&node| (0..count).map(move |action| Job { node, action })).collect();
        let by_action = self.turns_by_action(phase);
        if by_action {
            self.look_ahead(&jobs)?;
            jobs.sort_by_cached_key(|job| self.promise(*job));
        }
        let mut gain = Gain::default();
        let mut next = 0;
        let mut expanded = HashSet::new();
        while next < jobs.len() {
            let (window, end) = self.window(phase, &jobs, next);
            next = end;
            let mut motions = self.simulated(phase, &window)?.into_iter();
            while let Some((job, motion)) = motions.next() {
                if by_action && expanded.insert(job.node) {
                    self.trace_expansion(phase, job.node);
                }
                self.disassembly.charge()?;
                self.disassembly.used(&motion);
                let changed = self.take(phase, job, motion, &mut gain)?;
                // Where turning led a part is looked at before it is turned on, or another part is.
                let look_there = by_action && gain.new_states;
                if look_there && !changed {
                    motions.by_ref().for_each(|(job, motion)| self.ahead.keep(phase, job, motion));
                }
                if look_there || changed {
                    // Later results of this window answer a question that has changed.
                    next = jobs
                        .iter()
                        .position(|j| (j.node, j.action) == (job.node, job.action))
                        .map_or(end, |i| i + 1);
                    break;
                }
            }
            // What a part that was turned out leaves free mostly leaves straight: pushes first.
            let pushes_first = phase == Phase::Rotation && gain.removed && !self.separate_lists;
            if self.disassembly.is_done() || pushes_first || (by_action && gain.new_states) {
                break;
            }
        }
        Ok(gain)
    }

    /// The motions of some jobs, in order, up to the first that leads out.
    fn simulated(&mut self, phase: Phase, window: &[Job]) -> Result<Vec<(Job, Motion)>, Stop> {
        let ahead = self.ahead.valid_at(self.disassembly.version());
        let todo: Vec<Job> = window.iter().copied().filter(|job| !ahead.has(phase, *job)).collect();
        let runs: Vec<Run> = todo.iter().map(|job| self.run_of(phase, *job)).collect();
        let mut fresh = self.disassembly.simulate(&runs)?.into_iter();
        let mut known = |job: &Job| Some((*job, self.ahead.take(phase, *job).or_else(|| fresh.next())?));
        Ok(window.iter().map_while(&mut known).collect())
    }

    pub(super) fn run_of(&self, phase: Phase, job: Job) -> Run {
        let node = &self.nodes[job.node];
        Run { part: node.part, start: *node.pose(), action: self.actions(phase)[job.action] }
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

    pub(super) fn is_open(&self, phase: Phase, job: Job) -> bool {
        let node = &self.nodes[job.node];
        node.alive
            && node.blockage(phase).is_some_and(|b| match (self.guided, self.distrust_static) {
                (true, false) => b.is_open(job.action),
                (true, true) => b.is_untried(job.action),
                (false, _) => !b.is_barred(job.action),
            })
    }

    /// Takes in a motion; true if the scene changed by it.
    fn take(&mut self, phase: Phase, job: Job, motion: Motion, gain: &mut Gain) -> Result<bool, Stop> {
        let Motion { path, end, .. } = motion;
        let run = self.run_of(phase, job);
        tracing::debug!(part = run.part, node = job.node, action = %run.action, steps = path.len(), ?end, "simulated");
        let (word, by) = match end {
            End::Disassembled(_) => {
                let state = self.state(job.node);
                self.disassembly.trace_simulation(state, &run, "disassembled", &[], path.len(), None);
                self.take_out(phase, job, path, gain)?;
                return Ok(true);
            }
            End::Collision { with } => ("collision", with),
            End::Undecided { touched, .. } => ("undecided", touched),
        };
        let is_new = match path.last().copied() {
            Some(end) => self.is_new_state(phase, run.part, &end)?,
            None => false,
        };
        let leads_to = is_new.then_some(self.nodes.len() + 1 - self.roots);
        let from = self.state(job.node);
        self.disassembly.trace_simulation(from, &run, word, &by, path.len(), leads_to);
        self.block(phase, job, by);
        if is_new {
            gain.new_states = true;
            let path = joined(&self.nodes[job.node].path, &path);
            let unturned = Blockage::open(self.twists.own.common);
            let rotation = self.with_own(Phase::Rotation, run.part, unturned);
            let origin = Some((job.node, phase, job.action));
            let novelty = self.known[run.part].novelty(&path[path.len() - 1]);
            let (part, translation) = (run.part, None);
            self.add_node(Node { part, path, translation, rotation, origin, novelty, alive: true });
        }
        Ok(false)
    }

    fn block(&mut self, phase: Phase, job: Job, by: Vec<usize>) {
        if let Some(b) = self.nodes[job.node].blockage_mut(phase) {
            b.block_jointly(job.action, by);
        }
    }

    /// Thins and verifies a path that leads out, and takes the part out if it holds.
    fn take_out(&mut self, phase: Phase, job: Job, motion: Vec<Pose>, gain: &mut Gain) -> Result<(), Stop> {
        let (run, prefix) = (self.run_of(phase, job), self.nodes[job.node].path.clone());
        match self.disassembly.prove(run, &prefix, motion)? {
            Proof::Path { path, depth } => {
                self.remove(run.part, path, depth);
                gain.removed = true;
            }
            Proof::PrefixRefuted => self.drop_state(job.node)?,
            Proof::Refuted { by } => {
                // Nothing that another part's leaving changes: never again from here.
                let by = if self.guided { by } else { Vec::new() };
                self.block(phase, job, by);
            }
            Proof::Otherwise(motion) => {
                self.take(phase, job, motion, &mut Gain::default())?;
            }
        }
        Ok(())
    }

    /// Parts whose hull is apart from all others' need no motion.
    fn take_free_parts(&mut self) -> Result<(), Stop> {
        while let Some(part) = self.disassembly.free_part()? {
            self.remove(part, vec![self.disassembly.assembled(part)], 0.0);
        }
        Ok(())
    }

    pub(super) fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64) {
        let mut waited_for = Vec::new();
        for node in &mut self.nodes {
            if node.part == part {
                if node.is_root() {
                    let blockages = [node.translation.as_ref(), Some(&node.rotation)];
                    waited_for
                        .extend(blockages.into_iter().flatten().flat_map(|b| b.outlived().iter().copied()));
                }
                node.alive = false;
                // Its path and blockages are of no use any more.
                node.path.truncate(1);
                continue;
            }
            if let Some(b) = &mut node.translation {
                b.remove(part);
            }
            node.rotation.remove(part);
        }
        waited_for.sort_unstable();
        waited_for.dedup();
        self.disassembly.remove(part, path, depth, waited_for);
    }
}
