//! Actions that single parts have beside those of all, drawn from what a part touches as assembled.
//!
//! They come behind the common ones in the list of their kind, and are withheld from all other parts. The
//! evaluation f_a does not count them: parts are compared by what is open to all. They are looked for again when
//! a part that they came from is gone.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::Blockage;
use crate::simulation::Action;
use crate::termination::Interrupt;

use super::disassembly::Stop;
use super::problem::Problem;
use super::sbdp::Search;
use super::state::{Node, Phase};

/// Which actions of one kind are whose.
#[derive(Debug)]
pub(super) struct OwnActions {
    /// So many, the first ones, are open to all parts.
    pub(super) common: usize,
    /// No more than so many others, of all parts together.
    most: usize,
    /// cos of the angle within which two directions are one.
    alike: f64,
    /// Per part: what it touched when its actions were looked for.
    touched: HashMap<usize, Vec<usize>>,
    /// Parts with the actions that are theirs.
    offered: HashSet<(usize, usize)>,
}

impl OwnActions {
    pub(super) fn new(common: usize, most: usize, alike: f64) -> Self {
        Self { common, most, alike, touched: HashMap::new(), offered: HashSet::new() }
    }

    /// Whether an action is one that this part has beside those of all.
    pub(super) fn has(&self, part: usize, action: usize) -> bool {
        self.offered.contains(&(part, action))
    }
}

impl Search<'_, '_> {
    fn own(&self, phase: Phase) -> &OwnActions {
        match phase {
            Phase::Translation => &self.rays.own,
            Phase::Rotation => &self.twists.own,
        }
    }

    /// Looks for the own actions of those open parts as assembled that are to be asked; true if anything was
    /// added. `find` is told a part and what stands beside it, and tells actions and the parts that it looked at.
    pub(super) fn offer_own(
        &mut self,
        phase: Phase,
        open: &[usize],
        is_asked: impl Fn(usize) -> bool,
        find: impl Fn(&Problem<'_>, usize, &[usize]) -> Result<(Vec<Action>, Vec<usize>), Interrupt> + Sync,
    ) -> Result<bool, Stop> {
        let started = Instant::now();
        let standing = self.disassembly.everything.standing();
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        let is_known = |part: &usize| self.own(phase).touched.get(part).is_some_and(|t| t.iter().all(stands));
        let roots = open.iter().map(|&i| &self.nodes[i]).filter(|n| n.is_root());
        let parts: Vec<usize> = roots.map(|n| n.part).filter(|p| is_asked(*p) && !is_known(p)).collect();
        let problem = &self.disassembly.problem;
        let found = parts.par_iter().map(|&part| {
            problem.termination.check()?;
            let others: Vec<usize> = standing.iter().copied().filter(|&p| p != part).collect();
            find(problem, part, &others)
        });
        let found = found.collect::<Result<Vec<_>, Interrupt>>()?;
        let mut added = false;
        for (part, (actions, touched)) in parts.into_iter().zip(found) {
            match phase {
                Phase::Translation => &mut self.rays.own,
                Phase::Rotation => &mut self.twists.own,
            }
            .touched
            .insert(part, touched);
            for action in actions {
                added |= self.offer(phase, part, action);
            }
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        Ok(added)
    }

    /// Makes an action a part's own, unless there is one as good for all; whether it was not yet.
    fn offer(&mut self, phase: Phase, part: usize, wanted: Action) -> bool {
        let Self { rays, twists, translations, rotations, nodes, .. } = self;
        let (own, actions) = match phase {
            Phase::Translation => (&mut rays.own, translations),
            Phase::Rotation => (&mut twists.own, rotations),
        };
        let action = match actions.iter().position(|a| a.is_like(&wanted, own.alike)) {
            Some(common) if common < own.common => return false,
            Some(known) => known,
            None if actions.len() - own.common == own.most => return false,
            None => {
                actions.push(wanted);
                nodes.iter_mut().filter_map(|n| n.blockage_mut(phase)).for_each(Blockage::add_withheld);
                actions.len() - 1
            }
        };
        let is_new = own.offered.insert((part, action));
        if is_new {
            tracing::debug!(part, action = %actions[action], "own action");
            let of_part = |n: &&mut Node| n.part == part;
            let blockages = nodes.iter_mut().filter(of_part).filter_map(|n| n.blockage_mut(phase));
            blockages.for_each(|b| b.reopen(action));
        }
        is_new
    }

    /// The blockage of a new state of a part, completed: it knows of common actions only.
    pub(super) fn with_own(&self, phase: Phase, part: usize, mut blockage: Blockage) -> Blockage {
        let own = self.own(phase);
        for action in own.common..self.actions(phase).len() {
            blockage.add_withheld();
            if own.has(part, action) {
                blockage.reopen(action);
            }
        }
        blockage
    }
}
