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

use std::collections::HashSet;
use std::time::Instant;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::blocking_graph::{Analysis, Blockage};
use crate::geometry::Pose;
use crate::simulation::{End, Motion, Sweep};
use crate::termination::Interrupt;
use crate::tolerances::TOUCHED;

use super::action_table::ActionTable;
use super::ball::is_ball;
use super::disassembly::{Disassembly, Proof, Run, Stop, joined};
use super::initial_analysis::InitialAnalysis;
use super::linked::Links;
use super::obstructions::Obstructions;
use super::outcome::Outcome;
use super::problem::{Observer, Problem};
use super::rays::extreme_pushes;
use super::rules::Rules;
use super::search_view::SearchView;
use super::speculation::Speculation;
use super::state::{Expansion, Phase, StateNode, least_travel};
use super::states::States;
use super::sweep_memory::{SweepBlock, SweepMemory};
use super::trace::TraceEvent;
use super::twists::null_twists;

/// The result of a pass.
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

struct Search<'a, 'o> {
    rules: Rules,
    disassembly: Disassembly<'a, 'o>,
    states: States,
    actions: ActionTable,
    sweeps: SweepMemory,
    speculation: Speculation,
    obstructions: Obstructions,
    /// The parts that are balls, which no action has to turn.
    balls: Vec<bool>,
    /// Which parts are linked, once that was computed.
    links: Option<Links>,
    /// The last resort: actions that static analysis excluded are simulated, too.
    distrust_static: bool,
}

/// Searches until all wanted parts are out, nothing more can be found, or a limit is met.
pub(super) fn sbdp(problem: Problem<'_>, observer: &mut dyn Observer, guided: bool) -> Outcome {
    let (disassembly, initial) = Disassembly::beside(problem, observer, |p| InitialAnalysis::of(p, guided));
    let initial = match initial {
        Ok(initial) => initial,
        Err(interrupt) => return disassembly.outcome(Some(interrupt.into()), String::new(), Vec::new()),
    };
    let mut search = Search::new(disassembly, initial, guided);
    let stop = search.run().err();
    let (evidence, blocked) = (search.view().evidence(), search.view().blocked());
    search.disassembly.outcome(stop, evidence, blocked)
}

impl<'a, 'o> Search<'a, 'o> {
    fn new(mut disassembly: Disassembly<'a, 'o>, initial: InitialAnalysis, guided: bool) -> Self {
        let InitialAnalysis { directions, translations, rotations, blockages, duration } = initial;
        disassembly.counters.static_analysis += duration;
        let problem = &disassembly.problem;
        let rules = Rules::new(problem.actions, guided);
        let scene = &problem.scene;
        let bodies = scene.bodies.iter().enumerate();
        let is_ball = |(p, b): (usize, &crate::scene::Body)| {
            rules.is_extended() && is_ball(&b.shape, least_travel(scene, p))
        };
        let balls = bodies.map(is_ball).collect();
        let mut search = Self {
            rules,
            states: States::new(scene, rules),
            actions: ActionTable::new(directions, translations, rotations),
            sweeps: SweepMemory::default(),
            speculation: Speculation::default(),
            obstructions: Obstructions::default(),
            balls,
            links: None,
            distrust_static: false,
            disassembly,
        };
        search.add_assembled_states(blockages);
        search
    }

    fn view(&self) -> SearchView<'_, 'a, 'o> {
        let Self { rules, disassembly, states, actions, links, balls, .. } = self;
        SearchView { rules: *rules, disassembly, states, actions, links: links.as_ref(), balls }
    }

    fn run(&mut self) -> Result<(), Stop> {
        self.take_free_parts()?;
        loop {
            let mut gain = Gain::default();
            for _ in 0..self.rules.translation_passes() {
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
            if gain.any() || turned.any() || self.has_more_actions() {
                continue;
            }
            if !self.rules.guided {
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

    /// Extends the actions that are tried; true if there are more.
    fn has_more_actions(&mut self) -> bool {
        self.actions.simulate_rays() || (self.rules.is_extended() && self.actions.twist_all_parts())
    }

    fn add_assembled_states(&mut self, blockages: Vec<Blockage>) {
        for (part, blockage) in blockages.into_iter().enumerate() {
            if self.disassembly.problem.may_move(part) {
                let node = self.add_state(StateNode {
                    part,
                    path: vec![self.disassembly.assembled(part)],
                    translation: Some(blockage),
                    rotation: Blockage::open(self.actions.of(Phase::Rotation).len()),
                    origin: None,
                    novelty: 0.0,
                    alive: true,
                });
                self.trace_analysis(node);
            }
        }
    }

    fn add_state(&mut self, node: StateNode) -> usize {
        self.disassembly.counters.states += 1;
        self.states.add(node)
    }

    /// One run of Algorithm 1's `disassembly` over the open list.
    fn pass(&mut self, phase: Phase) -> Result<Gain, Stop> {
        self.disassembly.trace(|| TraceEvent::Pass { phase: phase.into(), depth_limit: None });
        let mut gain = Gain::default();
        let mut open: Vec<usize> = self.view().expandable(phase);
        while !open.is_empty() && !self.disassembly.is_done() {
            self.analyse(phase, &open)?;
            if self.sweep_out(phase, &open)? {
                gain.removed = true;
                self.take_free_parts()?;
                open = self.view().expandable(phase);
                continue;
            }
            if self.derive_actions(phase, &open)? {
                continue;
            }
            // Before the first simulation: what leaves straight is out.
            if self.find_links()? {
                open = self.view().expandable(phase);
                continue;
            }
            let batch = self.extract(phase, &mut open);
            let result = self.expand(phase, &batch)?;
            gain.new_states |= result.new_states;
            if result.new_states && self.rules.turns_by_action(phase) {
                return Ok(gain);
            }
            if result.removed {
                gain.removed = true;
                self.take_free_parts()?;
                if phase == Phase::Rotation {
                    return Ok(gain);
                }
                open = self.view().expandable(phase);
            }
        }
        Ok(gain)
    }

    /// Static analysis of displaced states that have none yet.
    fn analyse(&mut self, phase: Phase, open: &[usize]) -> Result<(), Stop> {
        if phase == Phase::Rotation {
            return Ok(());
        }
        let todo: Vec<_> = open.iter().copied().filter(|&i| self.states[i].translation.is_none()).collect();
        if !self.rules.guided {
            for i in todo {
                let blockage = Blockage::open(self.actions.common(phase).len());
                let blockage = self.actions.with_own(phase, self.states[i].part, blockage);
                self.states[i].translation = Some(blockage);
            }
            return Ok(());
        }
        let started = Instant::now();
        let (problem, states) = (&self.disassembly.problem, &self.states);
        let Problem { scene, static_analysis, termination, cache, .. } = problem;
        let standing: Vec<_> = todo.iter().map(|&i| self.disassembly.standing(states[i].part)).collect();
        let translations = self.actions.common(phase);
        let analysis = Analysis { rule: *static_analysis, scene, translations, cache };
        let found = todo
            .par_iter()
            .zip(standing)
            .map(|(&i, standing)| {
                termination.check()?;
                let node = &states[i];
                let least = least_travel(scene, node.part);
                analysis.blocked_from(&standing, node.part, node.pose(), least, termination)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        for (&i, blockage) in todo.iter().zip(found) {
            let blockage = self.actions.with_own(phase, self.states[i].part, blockage);
            self.states[i].translation = Some(blockage);
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        for i in todo {
            self.trace_analysis(i);
        }
        Ok(())
    }

    /// Simulates the open actions of some states of one priority, in order.
    fn expand(&mut self, phase: Phase, batch: &[usize]) -> Result<Gain, Stop> {
        let count = self.actions.simulated(phase);
        let of_node = |&node: &usize| (0..count).map(move |action| Expansion { node, phase, action });
        let mut jobs: Vec<Expansion> = batch.iter().flat_map(of_node).collect();
        let by_action = self.rules.turns_by_action(phase);
        if by_action {
            self.obstructions.measure(&self.disassembly, &self.states, &self.actions, &jobs)?;
            jobs.sort_by_cached_key(|job| self.view().promise(&self.obstructions, job));
        }
        let mut gain = Gain::default();
        let mut next = 0;
        let mut expanded = HashSet::new();
        while next < jobs.len() {
            let (window, end) = self.window(phase, &jobs, next);
            next = end;
            let mut motions = self.simulated(&window)?.into_iter();
            while let Some((job, motion)) = motions.next() {
                if by_action && expanded.insert(job.node) {
                    self.trace_expansion(phase, job.node);
                }
                self.disassembly.charge()?;
                self.disassembly.used(&motion);
                let changed = self.take(job, motion, &mut gain)?;
                // Where turning led a part is looked at before it is turned on, or another part is.
                let look_there = by_action && gain.new_states;
                if look_there && !changed {
                    motions.by_ref().for_each(|(job, motion)| self.speculation.keep(job, motion));
                }
                if look_there || changed {
                    // Later results of this window answer a question that has changed.
                    next = jobs.iter().position(|j| *j == job).map_or(end, |i| i + 1);
                    break;
                }
            }
            // What a part that was turned out leaves free mostly leaves straight: pushes first.
            let pushes_first = phase == Phase::Rotation && gain.removed && !self.rules.separate_lists;
            if self.disassembly.is_done() || pushes_first || (by_action && gain.new_states) {
                break;
            }
        }
        Ok(gain)
    }

    /// The motions of some expansions, in order, up to the first that leads out.
    fn simulated(&mut self, window: &[Expansion]) -> Result<Vec<(Expansion, Motion)>, Stop> {
        let speculation = self.speculation.at(self.disassembly.version());
        let todo: Vec<Expansion> = window.iter().copied().filter(|job| !speculation.has(job)).collect();
        let runs: Vec<Run> = todo.iter().map(|job| self.run_of(job)).collect();
        let mut fresh = self.disassembly.simulate(&runs)?.into_iter();
        let mut known = |job: &Expansion| Some((*job, self.speculation.take(job).or_else(|| fresh.next())?));
        Ok(window.iter().map_while(&mut known).collect())
    }

    fn run_of(&self, job: &Expansion) -> Run {
        let node = &self.states[job.node];
        Run { part: node.part, start: *node.pose(), action: self.actions.of(job.phase)[job.action] }
    }

    /// The next expansions worth running, as many as there are threads, and the index after them.
    fn window(&self, phase: Phase, jobs: &[Expansion], from: usize) -> (Vec<Expansion>, usize) {
        let threads = rayon::current_num_threads();
        // Pushes from the assembled pose often succeed, which voids what was simulated after them; others seldom do,
        // and long and short ones share the threads better in a longer window.
        let likely = phase == Phase::Translation && self.states[jobs[from].node].is_root();
        let size = if likely || threads == 1 { threads } else { 4 * threads };
        let mut window = Vec::new();
        let mut at = from;
        while at < jobs.len() && window.len() < size {
            if self.is_open(&jobs[at]) {
                window.push(jobs[at]);
            }
            at += 1;
        }
        (window, at)
    }

    fn is_open(&self, job: &Expansion) -> bool {
        let node = &self.states[job.node];
        node.alive
            && node.blockage(job.phase).is_some_and(|b| match (self.rules.guided, self.distrust_static) {
                (true, false) => b.is_open(job.action),
                (true, true) => b.is_untried(job.action),
                (false, _) => !b.is_barred(job.action),
            })
    }

    /// Applies a motion to the search; true if it took the part out or led elsewhere after refinement.
    fn take(&mut self, job: Expansion, motion: Motion, gain: &mut Gain) -> Result<bool, Stop> {
        let Motion { path, end, .. } = motion;
        let run = self.run_of(&job);
        tracing::debug!(part = run.part, node = job.node, action = %run.action, steps = path.len(), ?end, "simulated");
        let (word, by) = match end {
            End::Disassembled(_) => {
                let state = self.states.number(job.node);
                self.disassembly.trace_simulation(state, &run, "disassembled", &[], path.len(), None);
                self.take_out(job, path, gain)?;
                return Ok(true);
            }
            End::Collision { with } => ("collision", with),
            End::Undecided { touched, .. } => ("undecided", touched),
        };
        let is_new = match path.last() {
            Some(end) => self.states.is_new(&self.disassembly, job.phase, run.part, end)?,
            None => false,
        };
        let leads_to = is_new.then(|| self.states.next_number());
        let from = self.states.number(job.node);
        self.disassembly.trace_simulation(from, &run, word, &by, path.len(), leads_to);
        self.block(&job, by);
        if is_new {
            gain.new_states = true;
            let path = joined(&self.states[job.node].path, &path);
            let unturned = Blockage::open(self.actions.common(Phase::Rotation).len());
            let rotation = self.actions.with_own(Phase::Rotation, run.part, unturned);
            let novelty = self.states.novelty(run.part, &path[path.len() - 1]);
            let (part, translation, origin) = (run.part, None, Some(job));
            self.add_state(StateNode { part, path, translation, rotation, origin, novelty, alive: true });
        }
        Ok(false)
    }

    fn block(&mut self, job: &Expansion, by: Vec<usize>) {
        if let Some(b) = self.states[job.node].blockage_mut(job.phase) {
            b.block_jointly(job.action, by);
        }
    }

    /// Thins and verifies a path that leads out, and takes the part out if it holds.
    fn take_out(&mut self, job: Expansion, motion: Vec<Pose>, gain: &mut Gain) -> Result<(), Stop> {
        let (run, prefix) = (self.run_of(&job), self.states[job.node].path.clone());
        match self.disassembly.prove(run, &prefix, motion)? {
            Proof::Path { path, depth } => {
                self.remove(run.part, path, depth);
                gain.removed = true;
            }
            Proof::PrefixRefuted => self.drop_refuted(job.node)?,
            Proof::Refuted { by } => {
                // No removal changes that: the action is not tried again from here.
                let by = if self.rules.guided { by } else { Vec::new() };
                self.block(&job, by);
            }
            Proof::Otherwise(motion) => {
                self.take(job, motion, &mut Gain::default())?;
            }
        }
        Ok(())
    }

    fn drop_refuted(&mut self, node: usize) -> Result<(), Stop> {
        let Self { states, disassembly, .. } = self;
        states.drop_refuted(node, |part, path| disassembly.holds(part, path))
    }

    /// Parts whose hull is apart from all others' need no motion.
    fn take_free_parts(&mut self) -> Result<(), Stop> {
        while let Some(part) = self.disassembly.free_part()? {
            self.remove(part, vec![self.disassembly.assembled(part)], 0.0);
        }
        Ok(())
    }

    fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64) {
        let waited_for = self.states.remove_part(part);
        self.disassembly.remove(part, path, depth, waited_for);
    }

    /// Takes the next states off the open list.
    fn extract(&mut self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        let batch = self.view().extract(phase, open);
        if !self.rules.turns_by_action(phase) {
            batch.iter().for_each(|&node| self.trace_expansion(phase, node));
        }
        batch
    }

    /// Derives the actions that single open parts have beside the common ones; true if there are new ones.
    fn derive_actions(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        let Self { actions, disassembly, states, .. } = self;
        match phase {
            Phase::Translation if !self.rules.separate_lists => {
                actions.derive_own(disassembly, states, (phase, open), |_, _| true, extreme_pushes)
            }
            Phase::Rotation if self.rules.is_extended() => {
                actions.derive_own(disassembly, states, (phase, open), ActionTable::twists, null_twists)
            }
            _ => Ok(false),
        }
    }

    /// Computes, once, which of the standing parts are linked; true if any are. Beyond the paper.
    fn find_links(&mut self) -> Result<bool, Interrupt> {
        if self.links.is_some() || !self.rules.is_extended() {
            return Ok(false);
        }
        let (problem, standing) = (&self.disassembly.problem, self.disassembly.everything.standing());
        let links = Links::among(&problem.scene, standing, &problem.termination)?;
        let any = standing.iter().any(|&p| links.holder(p, standing).is_some());
        self.links = Some(links);
        Ok(any)
    }

    /// Takes out all parts that straight sweeps from the open states show to be free, in one run over these; true if
    /// any left. Sweeps are so much cheaper than simulations that parts which leave straight are all out before the
    /// first simulation.
    fn sweep_out(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        if phase != Phase::Translation || !self.disassembly.problem.sweeps || self.distrust_static {
            return Ok(false);
        }
        let jobs = self.sweeps_of(open);
        let (mut next, mut removed) = (0, false);
        while next < jobs.len() && !self.disassembly.is_done() {
            let (window, end) = self.sweeps_from(&jobs, next);
            next = end;
            let runs: Vec<Run> = window.iter().map(|&at| self.run_of(&jobs[at])).collect();
            let results = self.disassembly.sweep(&runs)?;
            for ((&at, run), result) in window.iter().zip(&runs).zip(results) {
                let job = jobs[at];
                let block = match result {
                    Some(Sweep::Clear { path, .. }) => {
                        if self.states[job.node].alive && self.prove_sweep(&job, run, &path)? {
                            // Later results answer a question that has changed.
                            (next, removed) = (at + 1, true);
                            break;
                        }
                        SweepBlock::ForGood
                    }
                    Some(Sweep::Blocked { by }) => SweepBlock::By(by),
                    None => SweepBlock::ForGood,
                };
                self.sweeps.block(job, block);
            }
        }
        Ok(removed)
    }

    /// The next sweeps worth making, as many as there are threads, and the index after them.
    fn sweeps_from(&self, jobs: &[Expansion], from: usize) -> (Vec<usize>, usize) {
        let standing = self.disassembly.everything.standing();
        let wanted = |&at: &usize| self.is_open(&jobs[at]) && !self.sweeps.is_blocked(&jobs[at], standing);
        let window: Vec<usize> =
            (from..jobs.len()).filter(wanted).take(rayon::current_num_threads()).collect();
        let end = if window.len() < rayon::current_num_threads() { None } else { window.last() };
        let end = end.map_or(jobs.len(), |at| at + 1);
        (window, end)
    }

    /// The sweeps of open states in the order of expansion: displaced states first, then all parts as assembled; each
    /// along the shorter ways out first. Such a plan takes less room, and less is to be verified.
    fn sweeps_of(&self, open: &[usize]) -> Vec<Expansion> {
        let phase = Phase::Translation;
        let hull = self.disassembly.everything.hull();
        let forces: Vec<_> = self.actions.of(phase).iter().map(|action| action.force()).collect();
        let reach =
            |force: &Vector3<f64>| hull.iter().map(|p| p.coords.dot(force)).fold(f64::NEG_INFINITY, f64::max);
        let reaches: Vec<f64> = forces.iter().map(reach).collect();
        let jobs = |node: usize| {
            let state = &self.states[node];
            let bounds = self.disassembly.problem.scene.bodies[state.part].shape.bounds();
            let bounds = bounds.transformed(state.pose());
            let way = |action: &usize| reaches[*action] + bounds.support(&-forces[*action]);
            let mut actions: Vec<usize> = (0..forces.len()).collect();
            // Only a large difference counts, so the order is mostly the same in all assemblies.
            actions.sort_by_cached_key(|action| (way(action).max(TOUCHED).log2() * 2.0).floor() as i32);
            actions.into_iter().map(move |action| Expansion { node, phase, action })
        };
        self.view().ranked(phase, open.to_vec()).into_iter().flat_map(jobs).collect()
    }

    /// Verifies the path of a sweep, and takes the part out if it holds.
    fn prove_sweep(&mut self, job: &Expansion, run: &Run, motion: &[Pose]) -> Result<bool, Stop> {
        let prefix = self.states[job.node].path.clone();
        match self.disassembly.prove_sweep(run, &prefix, motion)? {
            Ok((path, depth)) => {
                let (state, part) = (self.states.number(job.node), run.part);
                let action = run.action.to_string();
                self.disassembly.counters.sweeps += 1;
                self.disassembly.trace(|| TraceEvent::Swept { state, part, action });
                self.remove(part, path, depth);
                Ok(true)
            }
            Err(refuted) => {
                if refuted.prefix {
                    self.drop_refuted(job.node)?;
                }
                Ok(false)
            }
        }
    }

    fn trace_analysis(&mut self, node: usize) {
        if self.disassembly.observer.traces()
            && let Some(event) = self.view().analysed(node)
        {
            self.disassembly.observer.traced(event);
        }
    }

    fn trace_expansion(&mut self, phase: Phase, node: usize) {
        if self.disassembly.observer.traces() {
            let event = self.view().expanded(phase, node);
            self.disassembly.observer.traced(event);
        }
    }
}
