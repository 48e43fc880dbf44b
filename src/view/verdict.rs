//! Why a plan is not complete, in two sentences, and the blocked actions that matter.

use super::words::{capital, part_word, part_words};
use crate::document::kind_of;
use crate::document::{BlockedDocument, PlanDocument};
use crate::plan::{PlanKind, PlanStatus, StepEnd};

/// Count of blocked parts that a short list names: those that the fewest parts block. At half, the list of a frame with four
/// stuck screws lacks one; at double, the list fills a terminal of 24 lines.
const MOST_BLOCKED: usize = 6;
/// Count of parts that a verdict names; more are counted. As many as the search names in its reasons.
const MOST_NAMED: usize = 4;
/// The action of two parts that never come apart, and that of a part of an assembly plan that has no way in.
const ANY: &str = "any";
const INSERTION: &str = "insertion";

/// Which parts remain and why, and whether that is proved; nothing of a complete plan.
pub(crate) fn verdict(plan: &PlanDocument) -> Option<String> {
    if plan.status == PlanStatus::Complete.name() {
        return None;
    }
    let is_search_over = [PlanStatus::Infeasible, PlanStatus::Exhausted].map(PlanStatus::name);
    let is_hindered = plan.blocked.iter().any(|b| b.action == INSERTION);
    match plan.reason.as_deref() {
        // The search's own words: what remains, and what is proved.
        Some(own) if is_search_over.contains(&plan.status.as_str()) && !is_hindered => Some(own.to_owned()),
        reason => {
            let reason = capital(reason.unwrap_or("the search ended").trim_end_matches('.'));
            Some(format!("{}. {reason}; nothing is proved.", left(plan)))
        }
    }
}

/// The parts that a plan leaves where they are.
fn left(plan: &PlanDocument) -> String {
    let (parts, [one, many]) = match kind_of(plan) {
        PlanKind::Disassembly if plan.remaining.len() < 2 && !plan.kept_together.is_empty() => {
            (plan.kept_together.concat(), ["remains", "remain"])
        }
        PlanKind::Disassembly => (plan.remaining.clone(), ["remains", "remain"]),
        PlanKind::Assembly => (not_in_place(plan), ["is not in place", "are not in place"]),
    };
    match &parts[..] {
        [] => "No part remains".to_owned(),
        [only] => format!("{} {one}", capital(&format!("part {only}"))),
        parts if parts.len() > MOST_NAMED => format!("{} parts {many}", parts.len()),
        [first @ .., last] => format!("Parts {} and {last} {many}", first.join(", ")),
    }
}

fn not_in_place(plan: &PlanDocument) -> Vec<String> {
    let steps = plan.steps.iter().filter(|step| step.of.is_none() && step.ends == StepEnd::In.name());
    let placed: Vec<&String> =
        steps.flat_map(|s| &s.parts).chain(&plan.remaining).chain(&plan.initial.removed).collect();
    plan.parts.iter().filter(|part| !placed.contains(part)).cloned().collect()
}

/// What keeps the parts that should have come out, a line per part, and a count of what the lines leave out. Unless all
/// are asked for: of each part the action that the fewest parts block, of a few parts, those with the fewest first.
pub(crate) fn blockers(plan: &PlanDocument, is_all: bool) -> (Vec<String>, Option<String>) {
    let mut parts: Vec<Vec<&BlockedDocument>> = Vec::new();
    for blocked in &plan.blocked {
        match parts.iter_mut().find(|own| own[0].part == blocked.part) {
            Some(own) => own.push(blocked),
            None => parts.push(vec![blocked]),
        }
    }
    let total = parts.len();
    if !is_all {
        let rank = |b: &&BlockedDocument| (b.action != ANY, b.by.len());
        // Both sorts are stable: of equal ones, translations come before turns, and parts keep their order.
        parts.iter_mut().for_each(|own| own.sort_by_key(rank));
        parts.sort_by_key(|own| rank(&own[0]));
        parts.truncate(MOST_BLOCKED);
        parts.iter_mut().for_each(|own| own.truncate(1));
    }
    let told = |b: &&BlockedDocument| {
        let action = if b.action == ANY { "every action" } else { &b.action };
        format!("{action} by {}", part_words(&b.by, ", "))
    };
    let line = |own: &Vec<&BlockedDocument>| {
        let actions: Vec<String> = own.iter().map(told).collect();
        format!("{}: {}", part_word(&own[0].part), actions.join("; "))
    };
    let actions = plan.blocked.len() - parts.iter().map(Vec::len).sum::<usize>();
    let left_out = (actions > 0).then(|| {
        let plural = if actions == 1 { "" } else { "s" };
        match total - parts.len() {
            0 => format!("{actions} more blocked action{plural} of these parts"),
            more => format!("{actions} more blocked action{plural}, and with them all of {more} parts"),
        }
    });
    (parts.iter().map(line).collect(), left_out)
}

#[cfg(test)]
mod tests {
    use super::super::document::tests::{plan, step};
    use super::*;

    fn stuck(status: &str, reason: &str) -> PlanDocument {
        PlanDocument { status: status.into(), reason: Some(reason.into()), ..plan() }
    }

    fn named(count: usize) -> Vec<String> {
        (0..count).map(|i| i.to_string()).collect()
    }

    #[test]
    fn the_verdict_is_what_remains_and_whether_it_is_proved() {
        assert_eq!(verdict(&plan()), None);
        let proved = "Parts 0 and 1 remain. It is proved that 0 and 1 never come apart: they are linked.";
        assert_eq!(verdict(&stuck("infeasible", proved)).unwrap(), proved);
        let silent = PlanDocument { reason: None, ..stuck("exhausted", "") };
        assert_eq!(verdict(&silent).unwrap(), "Part 0 remains. The search ended; nothing is proved.");
        let cut = PlanDocument { remaining: named(3), ..stuck("timeout", "the deadline passed") };
        assert_eq!(
            verdict(&cut).unwrap(),
            "Parts 0, 1 and 2 remain. The deadline passed; nothing is proved."
        );
        let many = PlanDocument { remaining: named(5), ..cut.clone() };
        assert!(verdict(&many).unwrap().starts_with("5 parts remain. "));
        let group = PlanDocument { remaining: vec!["0".into()], kept_together: vec![named(2)], ..cut };
        assert!(verdict(&group).unwrap().starts_with("Parts 0 and 1 remain. "));
    }

    #[test]
    fn parts_of_an_assembly_plan_are_not_in_place() {
        let mut inserted = step("1", &[[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]);
        inserted.ends = "in".into();
        let hindered = PlanDocument {
            kind: "assembly".into(),
            parts: named(3),
            steps: vec![inserted],
            blocked: vec![BlockedDocument {
                part: "2".into(),
                by: vec!["0".into()],
                action: "insertion".into(),
            }],
            ..stuck("exhausted", "Where 2 is inserted, 0 would wait.")
        };
        assert_eq!(
            verdict(&hindered).unwrap(),
            "Part 2 is not in place. Where 2 is inserted, 0 would wait; nothing is proved."
        );
    }

    #[test]
    fn blockers_are_few_and_what_is_left_out_is_counted() {
        let blocked = |part: usize, action: &str, by: &[&str]| BlockedDocument {
            part: part.to_string(),
            by: by.iter().map(|&name| name.into()).collect(),
            action: action.into(),
        };
        let list = vec![
            blocked(0, "+x", &["1", "a"]),
            blocked(0, "+y", &["1"]),
            blocked(1, "+x", &["0", "2"]),
            blocked(2, "any", &["3"]),
        ];
        let few = PlanDocument { blocked: list, ..plan() };
        let (lines, left_out) = blockers(&few, false);
        assert_eq!(
            lines,
            ["part 2: every action by part 3", "part 0: +y by part 1", "part 1: +x by parts 0, 2"]
        );
        assert_eq!(left_out.unwrap(), "1 more blocked action of these parts");
        let (lines, left_out) = blockers(&few, true);
        assert_eq!(lines[0], "part 0: +x by part 1, a; +y by part 1");
        assert_eq!((lines.len(), left_out), (3, None));
        let list = (0..9).flat_map(|p| [blocked(p, "+x", &["a", "b"]), blocked(p, "-x", &["a"])]).collect();
        let (lines, left_out) = blockers(&PlanDocument { blocked: list, ..plan() }, false);
        assert_eq!((lines.len(), lines[5].as_str()), (6, "part 5: -x by a"));
        assert_eq!(left_out.unwrap(), "12 more blocked actions, and with them all of 3 parts");
    }
}
