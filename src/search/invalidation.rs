//! The states to drop when the check on the triangles refutes the way to one.
//!
//! A way is checked only once it leads out, so the motion that does not hold may lie far back, and all states
//! that began there go with it. The action that led there is tried again, with the refuting points as samples,
//! but only some times: else an action that is refuted again and again would never end.

use std::collections::HashMap;

use crate::budgets::REFINEMENTS;
use crate::geometry::Pose;

use super::state::StateAction;
use super::states::States;

/// How often the result of each action was refuted.
#[derive(Debug, Default)]
pub(super) struct Invalidation(HashMap<StateAction, usize>);

impl Invalidation {
    /// Ends a state whose way was refuted, with the first state on that way whose own way does not hold, and
    /// with all states that began there.
    pub(super) fn drop_way<E>(
        &mut self,
        states: &mut States,
        node: usize,
        mut holds: impl FnMut(usize, &[Pose]) -> Result<bool, E>,
    ) -> Result<(), E> {
        let nodes = &mut states.nodes;
        let mut first = node;
        while let Some(origin) = nodes[first].origin {
            let parent = &nodes[origin.node];
            if parent.is_root() || holds(parent.part, &parent.path)? {
                break;
            }
            first = origin.node;
        }
        let mut dropped = vec![false; nodes.len()];
        dropped[first] = true;
        for at in first..nodes.len() {
            // A parent is older than its children.
            dropped[at] |= nodes[at].origin.is_some_and(|origin| dropped[origin.node]);
            nodes[at].alive &= !dropped[at];
        }
        let Some(origin) = nodes[first].origin else { return Ok(()) };
        let times = self.0.entry(origin).or_default();
        *times += 1;
        if *times <= REFINEMENTS
            && let Some(b) = nodes[origin.node].blockage_mut(origin.phase)
        {
            b.reopen(origin.action);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::super::request::ActionSet;
    use super::super::state::StateNode;
    use super::super::strategy::Strategy;
    use super::super::trace::PlanningPhase;
    use super::*;
    use crate::blocking_graph::Blockage;
    use crate::fixtures::{block_on_plate, scene};

    #[test]
    fn what_began_on_a_refuted_way_goes_with_it_and_its_action_is_tried_again_some_times() {
        let (scene, _) = scene(block_on_plate());
        let strategy = Strategy::new(true, ActionSet::Extended);
        let (mut states, mut invalidation) = (States::new(&scene, strategy), Invalidation::default());
        let add = |states: &mut States, parent: Option<usize>, pose: Pose| {
            let mut path = parent.map_or(Vec::new(), |node| states.nodes[node].path.clone());
            path.push(pose);
            let origin = parent.map(|node| StateAction { node, phase: PlanningPhase::Rotation, action: 0 });
            let rotation = Blockage::open(1);
            states.add(StateNode {
                part: 1,
                path,
                translation: None,
                rotation,
                origin,
                novelty: 1.0,
                alive: true,
            });
            states.nodes.len() - 1
        };
        let at = |x: f64, z: f64| Pose::translation(x, 0.0, z);
        let root = add(&mut states, None, at(0.0, 0.0));
        // A way that goes below the plate does not hold.
        let holds =
            |_: usize, path: &[Pose]| Ok::<_, Infallible>(path.iter().all(|pose| pose.translation.z >= 0.0));
        for time in 1..=REFINEMENTS + 1 {
            states.nodes[root].rotation.block_jointly(0, vec![0]);
            let beside = add(&mut states, Some(root), at(1.0, 0.5));
            // Through the plate and up again: what is refuted lies two motions before the state that is dropped.
            let under = add(&mut states, Some(beside), at(1.0, -0.5));
            let up = add(&mut states, Some(under), at(1.0, 1.0));
            let last = add(&mut states, Some(up), at(2.0, 1.0));
            let sibling = add(&mut states, Some(under), at(0.0, 1.0));
            states.nodes[beside].rotation.block_jointly(0, vec![0]);
            assert!(invalidation.drop_way(&mut states, up, holds).is_ok());
            let alive = [beside, under, up, last, sibling].map(|node| states.nodes[node].alive);
            assert_eq!(alive, [true, false, false, false, false]);
            assert!(states.nodes[beside].rotation.is_open(0) && !states.nodes[root].rotation.is_open(0));
            // The same action from the root, refuted once more.
            assert!(invalidation.drop_way(&mut states, beside, holds).is_ok());
            assert_eq!(states.nodes[root].rotation.is_open(0), time <= REFINEMENTS, "{time}");
        }
    }
}
