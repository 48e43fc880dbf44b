//! Which blocked actions of the parts that remain are reported.

use super::outcome::{BlockedAction, Inseparable};

/// The name of all actions together, where parts never come apart.
pub(super) const ANY: &str = "any";

/// Number of actions that are reported of each part.
const OF_EACH_PART: usize = 3;

/// Of all blocked actions, those of each part that the fewest parts block, in the given order where as many block
/// them: translations before turns. An action that is blocked by one part says what to remove first.
pub(super) fn few_of_each_part(mut blocked: Vec<BlockedAction>) -> Vec<BlockedAction> {
    blocked.sort_by_key(|b| (b.part, b.by.len()));
    let mut out: Vec<BlockedAction> = Vec::new();
    for action in blocked {
        let kept = out.iter().rev().take_while(|b| b.part == action.part).count();
        if kept < OF_EACH_PART {
            out.push(action);
        }
    }
    out
}

/// That a pair never comes apart, for those parts of it that are wanted: nothing else about them matters.
pub(super) fn of_inseparable(pair: &Inseparable, wanted: &[usize]) -> Vec<BlockedAction> {
    let [a, b] = pair.parts;
    let is_wanted = |(part, _): &(usize, usize)| wanted.binary_search(part).is_ok();
    let held = [(a, b), (b, a)].into_iter().filter(is_wanted);
    held.map(|(part, by)| BlockedAction { part, action: ANY.to_owned(), by: vec![by] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::SeparationProof;

    #[test]
    fn each_part_has_at_most_three_actions_and_those_of_few_blockers_come_first() {
        let action = |part, action: &str, by: &[usize]| BlockedAction {
            part,
            action: action.to_owned(),
            by: by.to_vec(),
        };
        let kept = few_of_each_part(vec![
            action(4, "+x", &[1, 2]),
            action(4, "-x", &[1]),
            action(4, "+y", &[2, 3]),
            action(4, "+rz", &[3]),
            action(2, "+x", &[4, 1]),
        ]);
        let names: Vec<_> = kept.iter().map(|b| (b.part, b.action.as_str())).collect();
        assert_eq!(names, [(2, "+x"), (4, "-x"), (4, "+rz"), (4, "+x")]);
    }

    #[test]
    fn a_pair_that_never_comes_apart_blocks_those_of_it_that_are_wanted() {
        let pair = Inseparable { parts: [5, 2], proof: SeparationProof::Ball };
        let held: Vec<_> = of_inseparable(&pair, &[2, 3]).into_iter().map(|b| (b.part, b.by)).collect();
        assert_eq!(held, [(2, vec![5])]);
        assert_eq!(of_inseparable(&pair, &[2, 5]).len(), 2);
    }
}
