//! A group as one rigid body, or a single part: the question whether it leaves the rest, which stays.

use nalgebra::{Translation3, Vector3};

use crate::geometry::Pose;
use crate::plan::Base;
use crate::scene::StandingParts;
use crate::simulation::{Action, Sweep, SweepQuestion, straight_sweep_past};
use crate::termination::Interrupt;

use super::disassembly::joined;
use super::outcome::{Outcome, Removal};
use super::own_scale::{scale_of, searched_at};
use super::preferred::PreferredGroups;
use super::problem::{Effort, Observer, Problem, VerifiedPath};
use super::requirements::Leaving;

/// A search for what leaves.
pub(super) type Search = fn(Problem<'_>, &mut dyn Observer) -> Outcome;

/// A problem in whose scene a group is one body, the only one that may move.
pub(super) struct Contraction<'a> {
    pub(super) problem: Problem<'a>,
    pub(super) body: usize,
    /// All that stands beside the group.
    pub(super) around: StandingParts,
}

impl<'a> Contraction<'a> {
    /// The question about a group among the parts that stand (both ascending).
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn new(problem: &Problem<'a>, standing: &[usize], group: &[usize]) -> Result<Self, Interrupt> {
        let (scene, body) = match *group {
            [part] => (problem.scene.clone(), part),
            _ => {
                let scene = problem.scene.with_joined(group, &problem.termination)?;
                (scene, problem.scene.bodies.len())
            }
        };
        let rest: Vec<usize> =
            standing.iter().copied().filter(|part| group.binary_search(part).is_err()).collect();
        let around = StandingParts::new(&scene, rest.clone());
        let mut present: Vec<usize> = rest.iter().copied().chain([body]).collect();
        present.sort_unstable();
        let targets = Some(vec![body]);
        let problem = Problem {
            scene,
            present,
            fixed: rest,
            base: Base::default(),
            keep: Vec::new(),
            preferred: PreferredGroups::default(),
            targets,
            is_group: true,
            earlier: Vec::new(),
            ..problem.clone()
        };
        Ok(Self { problem, body, around })
    }

    /// A verified way out along some legs and then along a line, where none of the parts enters any of the rest.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn way_out(
        &self,
        legs: &[Vector3<f64>],
        action: &Action,
    ) -> Result<Option<VerifiedPath>, Interrupt> {
        let Problem { scene, termination, .. } = &self.problem;
        let way = self.along(legs);
        let (start, direction) = (&way[way.len() - 1], &action.force());
        let question =
            SweepQuestion { scene, standing_parts: &self.around, part: self.body, start, direction };
        let clear = straight_sweep_past(&question, termination, |_| Ok::<_, Interrupt>(false))?;
        let Some(Sweep::Clear { path, .. }) = clear else { return Ok(None) };
        self.verified(&joined(&way, &path), self.leaving())
    }

    /// A verified way along some legs.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn way(&self, legs: &[Vector3<f64>]) -> Result<Option<VerifiedPath>, Interrupt> {
        self.verified(&self.along(legs), Leaving { aside: true, ..self.leaving() })
    }

    fn along(&self, legs: &[Vector3<f64>]) -> Vec<Pose> {
        let mut way = vec![self.problem.scene.bodies[self.body].planning_from_shape];
        for leg in legs {
            way.push(Translation3::from(*leg) * way[way.len() - 1]);
        }
        way
    }

    fn verified(&self, path: &[Pose], leaving: Leaving<'_, 'a>) -> Result<Option<VerifiedPath>, Interrupt> {
        let checked = self.problem.checked_path(&self.around.standing, self.body, path)?;
        let Ok(verified) = checked else { return Ok(None) };
        Ok(leaving.with_clearance(&[], verified)?.ok())
    }

    /// The parts of the group.
    pub(super) fn members(&self) -> &[usize] {
        self.problem.scene.members(&self.body)
    }

    /// The body as it leaves.
    pub(super) fn leaving(&self) -> Leaving<'_, 'a> {
        Leaving { problem: &self.problem, body: self.body, around: &self.around, aside: false }
    }

    /// The outcome of a search for a way out of the body, with some effort, at the body's own scale.
    pub(super) fn searched(&self, search: Search, effort: Effort, spent: u64) -> Outcome {
        let problem = Problem { effort, spent, ..self.problem.clone() };
        match scale_of(&problem, self.body) {
            None => search(problem, &mut Unobserved),
            Some(factor) => {
                let scale = (factor, problem.scene.longest_side);
                searched_at(&problem, scale, |scaled| search(scaled, &mut Unobserved))
            }
        }
    }
}

/// Ignores all events: bodies of groups are no parts of the assembly, and a search that may fail has no results yet.
pub(super) struct Unobserved;

impl Observer for Unobserved {
    fn progress(&mut self, _removed: usize, _simulations: u64) {}
    fn removal(&mut self, _removal: &Removal) {}
}
