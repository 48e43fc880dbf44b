//! The analysis before a search: directions, actions along them, and the blocking graphs of the assembled state.

use std::time::{Duration, Instant};

use nalgebra::Vector3;

use crate::blocking_graph::{Analysis, Blockage, StateGraphs};
use crate::simulation::Action;
use crate::termination::Interrupt;

use super::directions::Directions;
use super::problem::Problem;
use super::state::least_travel;

/// The blocking graphs of the assembled state along the directions that a search would begin with.
///
/// # Errors
/// The termination condition became true.
pub fn initial_graphs(problem: &Problem<'_>) -> Result<Vec<StateGraphs>, Interrupt> {
    let (translations, _) = problem.action_lists(&problem.directions()?);
    assembled_graphs(problem, &translations)
}

fn assembled_graphs(problem: &Problem<'_>, translations: &[Action]) -> Result<Vec<StateGraphs>, Interrupt> {
    let Problem { scene, present, static_analysis, termination, cache, .. } = problem;
    let least = |part| least_travel(scene, part);
    let analysis = Analysis { rule: *static_analysis, scene, translations, cache };
    analysis.assembled_graphs(present, &least, termination)
}

/// The results of the analysis.
pub(super) struct InitialAnalysis {
    pub(super) directions: Directions,
    pub(super) translations: Vec<Action>,
    pub(super) rotations: Vec<Action>,
    /// Per part, as assembled.
    pub(super) graphs: Vec<StateGraphs>,
    /// The direction up, if it is given.
    given_up: Option<Vector3<f64>>,
    /// How long the analysis took.
    pub(super) duration: Duration,
}

impl InitialAnalysis {
    /// The number of the translation upward: the one nearest to the given direction, or else the one along which most
    /// parts can go at first; of several, the one nearest to +z.
    pub(super) fn upward(&self) -> usize {
        let open = |i: usize| match self.given_up {
            Some(_) => 0,
            None => self.graphs.iter().filter(|graphs| graphs.blockage.is_open(i)).count(),
        };
        let near = self.given_up.unwrap_or_else(Vector3::z);
        let forces = self.translations.iter().map(|action| action.force().dot(&near)).enumerate();
        let best = forces.max_by(|a, b| open(a.0).cmp(&open(b.0)).then(a.1.total_cmp(&b.1)));
        best.map_or(0, |(up, _)| up)
    }

    /// The direction up.
    pub(super) fn up(&self) -> Vector3<f64> {
        if let Some(up) = self.given_up {
            return up;
        }
        self.translations.get(self.upward()).map_or_else(Vector3::z, |action| action.force())
    }

    /// # Errors
    /// The termination condition became true.
    pub(super) fn of(problem: &Problem<'_>, guided: bool) -> Result<Self, Interrupt> {
        let directions = problem.directions()?;
        let (translations, rotations) = problem.action_lists(&directions);
        let started = Instant::now();
        let graphs = if guided {
            assembled_graphs(problem, &translations)?
        } else {
            let open = StateGraphs { blockage: Blockage::open(translations.len()), remembered: false };
            vec![open; problem.scene.bodies.len()]
        };
        let given_up = problem.up;
        Ok(Self { directions, translations, rotations, graphs, given_up, duration: started.elapsed() })
    }
}
