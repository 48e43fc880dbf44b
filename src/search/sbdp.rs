//! SBDP and SBDP*: State-Based Disassembly Planning, without and with the guidance of directional blocking
//! graphs.
//!
//! Source: the paper, Algorithm 1; for SBDP* with the evaluation functions (f_c, f_a), the constraints and the
//! decisions of its sections on blocking graphs. With the paper's action set it differs from the paper as the table in
//! `src/search/README.md` says. Beyond that set, a collision is about a set of parts, translational passes repeat while they
//! find new states, since turning costs more, and both kinds of planning share their states, since a bayonet needs
//! both.
//!
//! Before states are expanded with translations, every open action of every open state is swept, in the order
//! of expansion. Sweeps are so much cheaper than simulations that parts which leave straight are all out
//! before the first simulation.
//!
//! Simulations run ahead in parallel, but their results are used in the order of the serial algorithm and
//! thrown away where an earlier one changed the question: plans do not depend on the number of threads.

mod stages;

use std::collections::{BTreeSet, HashSet};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::{Analysis, Blockage, StateGraphs};
use crate::budgets::{TRANSLATION_PASSES, WINDOW_PER_THREAD};
use crate::geometry::Pose;
use crate::simulation::{End, Motion, Sweep};
use crate::termination::Interrupt;

use super::action_table::ActionTable;
use super::cell_memory::{CellMemory, CellStage};
use super::disassembly::{Disassembly, Proof, Stop, Transition, joined};
use super::groups::GroupMemory;
use super::initial_analysis::InitialAnalysis;
use super::inseparable::InseparablePairs;
use super::invalidation::Invalidation;
use super::novelty::Novelty;
use super::order::Order;
use super::outcome::Outcome;
use super::problem::{Effort, Observer, Problem, VerifiedPath};
use super::release::Release;
use super::report::SearchReport;
use super::request::ActionSet;
use super::speculation::Speculation;
use super::state::{StateAction, StateNode, least_travel};
use super::states::{PhaseStates, States};
use super::strategy::Strategy;
use super::support::Supports;
use super::sweep_memory::{BlockedSweep, SweepMemory};
use super::trace::{PlanningPhase, TraceEvent};
use super::unscrewing::UnscrewingMemory;

/// The results of a pass.
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

struct Sbdp<'a, 'o> {
    disassembly: Disassembly<'a, 'o>,
    strategy: Strategy,
    states: States,
    actions: ActionTable,
    order: Order,
    novelty: Novelty,
    invalidation: Invalidation,
    sweep_memory: SweepMemory,
    cell_memory: CellMemory,
    unscrewing_memory: UnscrewingMemory,
    /// Small parts that were searched at their own scale in vain, with the number of removals before.
    small_searched: HashSet<(Effort, usize, usize)>,
    group_memory: GroupMemory,
    speculation: Speculation,
    /// Parts that were the base until another one was.
    former_bases: Vec<usize>,
}

/// Searches until everything asked for is out, nothing more can be found, or a limit is met. With the extended actions,
/// a base stays as long as others leave.
pub(super) fn sbdp(problem: Problem<'_>, observer: &mut dyn Observer, guided: bool) -> Outcome {
    let (mut disassembly, initial) =
        Disassembly::beside(problem, observer, |p| InitialAnalysis::of(p, guided));
    let initial = match initial {
        Ok(initial) => initial,
        Err(interrupt) => {
            return disassembly.outcome(Some(interrupt.into()), InseparablePairs::default(), Vec::new());
        }
    };
    let problem = &mut disassembly.problem;
    // Of a search that others came before, the base is known.
    if problem.actions == ActionSet::Extended && problem.base.parts.is_empty() {
        problem.base = problem.chosen_base(&problem.present, &initial.up());
    }
    let mut search = Sbdp::new(disassembly, initial, guided);
    let stop = search.settle_preferred().and_then(|()| search.run()).err();
    let (report, disassembly) = search.report();
    report.log(disassembly);
    let blocked = report.blocked(disassembly);
    let is_stuck = search.strategy.is_extended() && !search.disassembly.is_done();
    let free_together = if is_stuck { search.groups().free_together() } else { Vec::new() };
    let outcome = search.disassembly.outcome(stop, search.order.into_inseparable(), blocked);
    Outcome { free_together, ..outcome }
}

impl<'a, 'o> Sbdp<'a, 'o> {
    fn new(mut disassembly: Disassembly<'a, 'o>, initial: InitialAnalysis, guided: bool) -> Self {
        let (upward, up) = (initial.upward(), initial.up());
        let InitialAnalysis { directions, translations, rotations, graphs, duration, .. } = initial;
        disassembly.counters.static_analysis += duration;
        let strategy = Strategy::new(guided, disassembly.problem.actions);
        if strategy.is_extended() {
            // Opposite translations are neighbours.
            disassembly.supports = Supports::of(&graphs, upward ^ 1);
        }
        let mut search = Self {
            strategy,
            states: States::new(&disassembly.problem.scene, strategy),
            actions: ActionTable::new(directions, translations, rotations),
            order: Order::new(&disassembly.problem, strategy, up),
            novelty: Novelty::default(),
            invalidation: Invalidation::default(),
            sweep_memory: SweepMemory::default(),
            cell_memory: CellMemory::default(),
            unscrewing_memory: UnscrewingMemory::default(),
            small_searched: HashSet::new(),
            group_memory: GroupMemory::default(),
            speculation: Speculation::default(),
            former_bases: Vec::new(),
            disassembly,
        };
        for (part, StateGraphs { blockage, remembered }) in graphs.into_iter().enumerate() {
            if search.disassembly.problem.is_movable(part) {
                search.disassembly.counters.graphs_recalled += u64::from(remembered);
                search.add_node(StateNode {
                    part,
                    path: vec![search.disassembly.assembled(part)],
                    translation: Some(blockage),
                    rotation: Blockage::open(search.actions.rotations.common),
                    origin: None,
                    novelty: 0.0,
                    alive: true,
                });
                let node = search.states.nodes.len() - 1;
                let (report, disassembly) = search.report();
                report.trace_analysis(node, disassembly);
            }
        }
        search
    }

    fn run(&mut self) -> Result<(), Stop> {
        self.take_free_parts()?;
        let passes = if self.strategy.separate_lists { 1 } else { TRANSLATION_PASSES };
        loop {
            let mut gain = Gain::default();
            for _ in 0..passes {
                let pass = self.pass(PlanningPhase::Translation)?;
                if self.disassembly.is_done() {
                    return Ok(());
                }
                gain.removed |= pass.removed;
                gain.new_states |= pass.new_states;
                if !pass.new_states {
                    break;
                }
            }
            if self.leave_along_threads()? || self.leave_at_own_scale(Effort::Pushes)? {
                if self.disassembly.is_done() {
                    return Ok(());
                }
                continue;
            }
            if self.leave_together(|groups| groups.leave_straight())? || self.loosen_preferred()? {
                if self.disassembly.is_done() {
                    return Ok(());
                }
                continue;
            }
            // Before the searches that take longest.
            if self.find_inseparable()? {
                continue;
            }
            let left = self.leave_by_cells(CellStage::BeforeTurning)?
                || self.leave_together(|groups| groups.leave(Effort::Pushes))?;
            if self.disassembly.is_done() || (!left && self.disassembly.problem.effort == Effort::Pushes) {
                return Ok(());
            }
            if left {
                continue;
            }
            if self.give_up_preferred() {
                continue;
            }
            // Others may leave once the base has: nothing is turned before.
            let Disassembly { problem, everything, .. } = &mut self.disassembly;
            if problem.release_base(everything.standing()) {
                self.take_free_parts()?;
                continue;
            }
            if self.leave_by_cells(CellStage::AfterCriticalTurn)? {
                if self.disassembly.is_done() {
                    return Ok(());
                }
                continue;
            }
            let turned = self.pass(PlanningPhase::Rotation)?;
            if self.disassembly.is_done() {
                return Ok(());
            }
            // States without graphs waited in this pass.
            let some_waited = self.strategy.skips_analysis;
            self.strategy.skips_analysis = turned.removed && self.of(PlanningPhase::Translation).decision_d();
            if gain.any()
                || turned.any()
                || some_waited
                || self.actions.simulate_rays()
                || self.actions.draw_all_twists(self.strategy)
            {
                continue;
            }
            // The paper trusts its graphs.
            if !self.strategy.is_extended() {
                if self.release_rest()? {
                    continue;
                }
                return Ok(());
            }
            self.strategy.distrust_static = true;
            let last = self.pass(PlanningPhase::Translation);
            self.strategy.distrust_static = false;
            let left = self.disassembly.is_done()
                || last?.any()
                || self.leave_by_cells(CellStage::Last)?
                || self.leave_at_own_scale(Effort::All)?
                || self.leave_together(|groups| groups.leave(Effort::All))?;
            if self.disassembly.is_done() || !(left || self.release_rest()?) {
                return Ok(());
            }
        }
    }

    /// Lets the next of the parts leave that stay so far, where nothing leaves without them; false if there are none.
    fn release_rest(&mut self) -> Result<bool, Stop> {
        let released = self.disassembly.release(Release::GivenBase);
        if released {
            self.take_free_parts()?;
        }
        Ok(released)
    }

    /// One run of Algorithm 1's `disassembly` over the open list.
    fn pass(&mut self, phase: PlanningPhase) -> Result<Gain, Stop> {
        self.disassembly.trace(|| TraceEvent::Pass { phase, depth_limit: None });
        let mut gain = Gain::default();
        let mut open: Vec<usize> = self.expandable(phase);
        while !open.is_empty() && !self.disassembly.is_done() {
            self.analyse(phase, &open)?;
            let left =
                self.sweep_out(phase, &open)? || self.leave_together(|groups| groups.leave_preferred())?;
            if left {
                gain.removed = true;
                self.take_free_parts()?;
                open = self.expandable(phase);
                continue;
            }
            let Self { strategy, states, actions, disassembly, .. } = self;
            if actions.draw(*strategy, phase, &open, states, disassembly)? {
                continue;
            }
            // Before the first simulation: what leaves straight is out.
            if self.order.find_inseparable(self.strategy, &self.disassembly, InseparablePairs::find_linked)? {
                open = self.expandable(phase);
                continue;
            }
            let batch = self.order.extract(&self.of(phase), &mut open, &self.disassembly);
            let result = self.expand(phase, &batch)?;
            gain.new_states |= result.new_states;
            if result.new_states && self.strategy.orders_actions(phase) {
                return Ok(gain);
            }
            if result.removed {
                gain.removed = true;
                self.take_free_parts()?;
                if phase == PlanningPhase::Rotation {
                    return Ok(gain);
                }
                open = self.expandable(phase);
            }
        }
        Ok(gain)
    }

    fn of(&self, phase: PlanningPhase) -> PhaseStates<'_> {
        let Self { strategy, states, disassembly, .. } = self;
        PhaseStates { strategy: *strategy, phase, states, scene: &disassembly.problem.scene }
    }

    fn expandable(&self, phase: PlanningPhase) -> Vec<usize> {
        self.order.expandable(&self.of(phase), &self.disassembly)
    }

    /// Static analysis of displaced states that have none yet.
    fn analyse(&mut self, phase: PlanningPhase, open: &[usize]) -> Result<(), Stop> {
        if phase == PlanningPhase::Rotation {
            return Ok(());
        }
        let (states, list) = (&mut self.states, &self.actions.translations);
        let todo: Vec<_> = open.iter().copied().filter(|&i| states.nodes[i].translation.is_none()).collect();
        if !self.strategy.guided {
            for i in todo {
                let node = &mut states.nodes[i];
                node.translation = Some(list.with_own(node.part, Blockage::open(list.common)));
            }
            return Ok(());
        }
        let started = Instant::now();
        let (problem, nodes) = (&self.disassembly.problem, &states.nodes);
        let Problem { scene, static_analysis, termination, cache, .. } = problem;
        let standing: Vec<_> = todo.iter().map(|&i| self.disassembly.standing(nodes[i].part)).collect();
        let translations = &list.all[..list.common];
        let analysis = Analysis { rule: *static_analysis, scene, translations, cache };
        let found = todo
            .par_iter()
            .zip(standing)
            .map(|(&i, standing)| {
                termination.check()?;
                let node = &nodes[i];
                let least = least_travel(scene, node.part);
                analysis.displaced_graphs(&standing, node.part, node.pose(), least, termination)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        for (&i, StateGraphs { blockage, remembered }) in todo.iter().zip(found) {
            let node = &mut states.nodes[i];
            self.disassembly.counters.graphs_recalled += u64::from(remembered);
            node.translation = Some(list.with_own(node.part, blockage));
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        let (report, disassembly) = self.report();
        todo.into_iter().for_each(|i| report.trace_analysis(i, disassembly));
        Ok(())
    }

    /// Takes out whatever straight sweeps from the open states show free, in one run over them; true if
    /// anything left.
    fn sweep_out(&mut self, phase: PlanningPhase, open: &[usize]) -> Result<bool, Stop> {
        if phase != PlanningPhase::Translation
            || !self.disassembly.problem.sweeps
            || self.strategy.distrust_static
        {
            return Ok(false);
        }
        let sweeps = self.order.sweeps(&self.of(phase), open, &self.actions, &self.disassembly);
        let (mut next, mut removed) = (0, false);
        // Where other parts carry than when the order was made, those that do now wait for the next run and its order.
        let (mut carriers, mut waiting) = (self.disassembly.carriers(), BTreeSet::new());
        while next < sweeps.len() && !self.disassembly.is_done() {
            let standing = self.disassembly.everything.standing();
            let waits = |at: StateAction| waiting.contains(&self.states.nodes[at.node].part);
            let is_wanted = |at: StateAction| {
                self.may_try(at) && !waits(at) && !self.sweep_memory.is_blocked(at, standing)
            };
            let (window, end) = window(&sweeps, next, rayon::current_num_threads(), is_wanted);
            next = end;
            let runs: Vec<Transition> = window.iter().map(|&i| self.transition(sweeps[i])).collect();
            let results = self.disassembly.sweep(&runs)?;
            for ((&i, run), result) in window.iter().zip(&runs).zip(results) {
                let at = sweeps[i];
                let blocked = match result {
                    // Before others are left in the air.
                    Some(Sweep::Clear { .. })
                        if carriers.contains(&run.part)
                            && self.leave_together(|groups| groups.leave_carried(run.part))? =>
                    {
                        return Ok(true);
                    }
                    Some(Sweep::Clear { path, .. }) => {
                        if self.states.nodes[at.node].alive && self.prove_sweep(at, run, &path)? {
                            // Later results answer a question that has changed.
                            (next, removed) = (i + 1, true);
                            carriers.remove(&run.part);
                            let carry_now = self.disassembly.carriers();
                            if carry_now != carriers {
                                waiting = carry_now;
                            }
                            break;
                        }
                        BlockedSweep::ForGood
                    }
                    Some(Sweep::Blocked { by }) => BlockedSweep::By(by),
                    None => BlockedSweep::ForGood,
                };
                self.sweep_memory.keep(at, blocked);
            }
        }
        Ok(removed)
    }

    /// Verifies a path that a sweep claims to be clear, and takes the part out if it holds.
    fn prove_sweep(&mut self, at: StateAction, run: &Transition, motion: &[Pose]) -> Result<bool, Stop> {
        let prefix = &self.states.nodes[at.node].path;
        match self.disassembly.prove_sweep(run, prefix, motion)? {
            Ok(VerifiedPath { path, depth }) => {
                let (state, part, action) = (self.states.number(at.node), run.part, run.action.to_string());
                self.disassembly.counters.sweeps += 1;
                self.disassembly.trace(|| TraceEvent::Swept { state, part, action });
                self.remove(part, path, depth)?;
                Ok(true)
            }
            Err(refuted) => {
                if refuted.prefix {
                    self.drop_way(at.node)?;
                }
                Ok(false)
            }
        }
    }

    /// Simulates the open actions of some states of one priority, in order.
    fn expand(&mut self, phase: PlanningPhase, batch: &[usize]) -> Result<Gain, Stop> {
        let by_action = self.strategy.orders_actions(phase);
        if !by_action {
            batch.iter().for_each(|&node| self.trace_expansion(phase, node));
        }
        let actions = 0..self.actions.simulated(phase);
        let of_node = |&node| actions.clone().map(move |action| StateAction { node, phase, action });
        let mut jobs: Vec<StateAction> = batch.iter().flat_map(of_node).collect();
        if by_action {
            let Self { order, states, actions, disassembly, .. } = self;
            order.measure_obstructions(&jobs, states, actions, disassembly)?;
            jobs.sort_by_cached_key(|&at| order.action_rank(at, states, actions));
        }
        let mut gain = Gain::default();
        let mut next = 0;
        let mut expanded = HashSet::new();
        while next < jobs.len() {
            let size = self.window_size(jobs[next]);
            let (window, end) = window(&jobs, next, size, |at| self.may_simulate(at));
            next = end;
            let mut motions = self.simulated(&jobs, &window)?.into_iter();
            while let Some((i, motion)) = motions.next() {
                let at = jobs[i];
                if by_action && expanded.insert(at.node) {
                    self.trace_expansion(phase, at.node);
                }
                self.disassembly.charge()?;
                self.disassembly.used(&motion);
                let changed = self.apply(at, motion, &mut gain)?;
                // The state that turning led to is looked at before that part or another is turned on.
                let look_there = by_action && gain.new_states;
                if look_there && !changed {
                    motions.by_ref().for_each(|(i, motion)| self.speculation.keep(jobs[i], motion));
                }
                if look_there || changed {
                    // Later results of this window answer a question that has changed.
                    next = i + 1;
                    break;
                }
            }
            // What a part that was turned out leaves free mostly leaves straight: pushes first (Algorithm 1, lines 21
            // and 22).
            let pushes_first = phase == PlanningPhase::Rotation && gain.removed;
            if self.disassembly.is_done() || pushes_first || (by_action && gain.new_states) {
                break;
            }
        }
        Ok(gain)
    }

    /// Pushes from the assembled pose often succeed, which voids what was run ahead; others seldom do.
    fn window_size(&self, first: StateAction) -> usize {
        let threads = rayon::current_num_threads();
        let likely = first.phase == PlanningPhase::Translation && self.states.nodes[first.node].is_root();
        if likely || threads == 1 { threads } else { WINDOW_PER_THREAD * threads }
    }

    /// The motions of some of the jobs, in order, up to the first that leads out.
    fn simulated(&mut self, jobs: &[StateAction], window: &[usize]) -> Result<Vec<(usize, Motion)>, Stop> {
        self.speculation.valid_at(self.disassembly.version());
        let todo = window.iter().map(|&i| jobs[i]).filter(|&at| !self.speculation.has(at));
        let runs: Vec<Transition> = todo.map(|at| self.transition(at)).collect();
        let mut fresh = self.disassembly.simulate(&runs)?.into_iter();
        let mut known = |&i: &usize| Some((i, self.speculation.take(jobs[i]).or_else(|| fresh.next())?));
        Ok(window.iter().map_while(&mut known).collect())
    }

    /// Whether an action is open and its part may leave.
    fn may_try(&self, at: StateAction) -> bool {
        let part = self.states.nodes[at.node].part;
        self.disassembly.problem.may_move(part) && self.states.is_open(self.strategy, at)
    }

    /// The same of a simulation at the scale of the assembly.
    fn may_simulate(&self, at: StateAction) -> bool {
        self.may_try(at) && !self.order.is_small(self.states.nodes[at.node].part)
    }

    fn transition(&self, at: StateAction) -> Transition {
        let node = &self.states.nodes[at.node];
        Transition { part: node.part, start: *node.pose(), action: self.actions.of(at.phase).all[at.action] }
    }

    /// Applies a motion to the search; true if the scene changed by it.
    fn apply(&mut self, at: StateAction, motion: Motion, gain: &mut Gain) -> Result<bool, Stop> {
        let Motion { path, end, .. } = motion;
        let run = self.transition(at);
        tracing::debug!(part = run.part, node = at.node, action = %run.action, steps = path.len(), ?end, "simulated");
        let state = self.states.number(at.node);
        let is_out = matches!(end, End::Disassembled(_));
        let (word, by) = end.described();
        if is_out {
            self.disassembly.trace_simulation(state, &run, word, &by, path.len(), None);
            self.take_out(at, path, gain)?;
            return Ok(true);
        }
        let is_new = match path.last() {
            Some(end) => {
                let Self { novelty, strategy, states, disassembly, .. } = self;
                let (strategy, scene) = (*strategy, &disassembly.problem.scene);
                let of = PhaseStates { strategy, phase: at.phase, states, scene };
                novelty.is_new(&of, disassembly, run.part, end)?
            }
            None => false,
        };
        let leads_to = is_new.then(|| self.states.number(self.states.nodes.len()));
        self.disassembly.trace_simulation(state, &run, word, &by, path.len(), leads_to);
        self.states.block(at, by);
        if is_new {
            gain.new_states = true;
            let path = joined(&self.states.nodes[at.node].path, &path);
            let rotations = &self.actions.rotations;
            let rotation = rotations.with_own(run.part, Blockage::open(rotations.common));
            let novelty = self.states.known[run.part].novelty(&path[path.len() - 1]);
            let (part, translation, origin) = (run.part, None, Some(at));
            self.add_node(StateNode { part, path, translation, rotation, origin, novelty, alive: true });
        }
        Ok(false)
    }

    /// Thins and verifies a path that leads out, and takes the part out if it holds.
    fn take_out(&mut self, at: StateAction, motion: Vec<Pose>, gain: &mut Gain) -> Result<(), Stop> {
        let run = self.transition(at);
        match self.disassembly.prove(run, &self.states.nodes[at.node].path, motion)? {
            Proof::Path(VerifiedPath { path, depth }) => {
                self.remove(run.part, path, depth)?;
                gain.removed = true;
            }
            Proof::PrefixRefuted => self.drop_way(at.node)?,
            Proof::Refuted { by } => {
                // Nothing that another part's leaving changes: never again from here.
                let by = if self.strategy.guided { by } else { Vec::new() };
                self.states.block(at, by);
            }
            Proof::Otherwise(motion) => {
                self.apply(at, motion, &mut Gain::default())?;
            }
        }
        Ok(())
    }

    fn drop_way(&mut self, node: usize) -> Result<(), Stop> {
        let holds = |part: usize, path: &[Pose]| self.disassembly.holds(part, path);
        self.invalidation.drop_way(&mut self.states, node, holds)
    }

    /// Parts whose hull is apart from all others' need no motion.
    fn take_free_parts(&mut self) -> Result<(), Stop> {
        while let Some(part) = self.disassembly.free_part()? {
            self.remove(part, vec![self.disassembly.assembled(part)], 0.0)?;
        }
        Ok(())
    }

    fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64) -> Result<(), Stop> {
        self.disassembly.remove(part, path, depth)?;
        self.states.remove(part);
        self.renew_base();
        self.settle_preferred()
    }

    fn add_node(&mut self, node: StateNode) {
        self.states.add(node);
        self.disassembly.counters.states += 1;
    }

    fn trace_expansion(&mut self, phase: PlanningPhase, node: usize) {
        let (report, disassembly) = self.report();
        report.trace_expansion(phase, node, disassembly);
    }

    /// The data of reports, and the disassembly whose observer receives them.
    fn report(&mut self) -> (SearchReport<'_>, &mut Disassembly<'a, 'o>) {
        let Self { strategy, states, actions, order, novelty, disassembly, .. } = self;
        (SearchReport { strategy: *strategy, states, actions, order, novelty }, disassembly)
    }
}

/// The indices of the next `size` wanted entries from an index on, and where those after them begin.
fn window(
    list: &[StateAction],
    from: usize,
    size: usize,
    is_wanted: impl Fn(StateAction) -> bool,
) -> (Vec<usize>, usize) {
    let window: Vec<usize> = (from..list.len()).filter(|&i| is_wanted(list[i])).take(size).collect();
    let end = window.last().filter(|_| window.len() == size).map_or(list.len(), |i| i + 1);
    (window, end)
}
