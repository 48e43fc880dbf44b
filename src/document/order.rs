//! The same plan with its steps in another order.

use super::{PlanDocument, StepDocument};

/// The plan with its steps in another order (numbers of the steps as they were), in which each comes after those that it
/// requires. Of a disassembly in which nothing is moved aside, every such order is right: with more parts out than a path
/// requires, it is free all the same.
#[must_use]
pub fn reordered(plan: &PlanDocument, order: &[usize]) -> PlanDocument {
    let place = |step: usize| order.iter().position(|&other| other == step);
    let step = |&number: &usize| {
        let step = plan.steps.get(number)?;
        let mut requires: Vec<usize> = step.requires.iter().filter_map(|&step| place(step)).collect();
        requires.sort_unstable();
        Some(StepDocument { of: step.of.and_then(place), requires, ..step.clone() })
    };
    PlanDocument { steps: order.iter().filter_map(step).collect(), ..plan.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{plan_of, step_of};
    use crate::plan::{PlanStatus, PlanStep};

    #[test]
    fn numbers_of_steps_follow_their_steps() {
        let step = |part: usize, requires: &[usize], of: Option<usize>| PlanStep {
            requires: requires.to_vec(),
            of,
            ..step_of(part)
        };
        let steps =
            vec![step(0, &[], None), step(1, &[], None), step(2, &[1, 0], None), step(3, &[1], Some(1))];
        let plan = PlanDocument::from(&plan_of(PlanStatus::Complete, steps));
        let found = reordered(&plan, &[1, 3, 0, 2]);
        let of =
            |i: usize| (found.steps[i].parts.clone(), found.steps[i].requires.clone(), found.steps[i].of);
        let was = |i: usize| plan.steps[i].parts.clone();
        assert_eq!(of(0), (was(1), vec![], None));
        assert_eq!(of(1), (was(3), vec![0], Some(0)));
        assert_eq!(of(2), (was(0), vec![], None));
        assert_eq!(of(3), (was(2), vec![0, 2], None));
    }
}
