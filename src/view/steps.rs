//! A plan as instructions in words: Markdown, in English, lengths in the plan's units.

use std::fmt::Write;

use super::instructions::Instructions;

/// The instructions as Markdown.
#[must_use]
pub fn markdown(instructions: &Instructions) -> String {
    let Instructions { title, verdict, before, list, rest, stuck, left_out } = instructions;
    let mut text = format!("# {title}\n\n");
    if let Some((mark, why)) = verdict.as_deref().and_then(|verdict| verdict.split_once(". ")) {
        let _ = writeln!(text, "**{mark}.** {why}\n");
    }
    if let Some(before) = before {
        let _ = writeln!(text, "{before}\n");
    }
    for instruction in list {
        if let Some(heading) = &instruction.heading {
            let _ = writeln!(text, "## {heading}\n");
        }
        let _ = writeln!(text, "**{}.** {}.\n", instruction.numbers(), instruction.words);
    }
    for sentence in rest {
        let _ = writeln!(text, "{sentence}\n");
    }
    if !stuck.is_empty() {
        text.push_str("## What is stuck\n\n");
    }
    for line in stuck {
        let _ = writeln!(text, "- {line}");
    }
    if let Some(left_out) = left_out {
        let _ = writeln!(text, "\n{left_out}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::document::tests::{plan, step};
    use super::*;
    use crate::document::{BlockedDocument, FreeGroupDocument, GroupDocument, PlanDocument, StepDocument};

    fn markdown(plan: &PlanDocument, classes: Option<&[usize]>) -> String {
        super::markdown(&Instructions::of(plan, classes))
    }

    fn lifted(part: &str, by: f64, requires: &[usize]) -> StepDocument {
        let mut step = step(part, &[[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, by, 1.0, 0.0, 0.0, 0.0]]);
        step.requires = requires.to_vec();
        step
    }

    fn bolted() -> PlanDocument {
        let names = ["bolt-1", "bolt-2", "bolt-3", "cover", "base"];
        let steps = vec![
            lifted("bolt-1", 14.0, &[]),
            lifted("bolt-2", 14.0, &[]),
            lifted("bolt-3", 14.0, &[]),
            lifted("cover", 3.0, &[0, 1, 2]),
        ];
        PlanDocument {
            parts: names.map(String::from).into(),
            steps,
            remaining: vec!["base".into()],
            ..plan()
        }
    }

    #[test]
    fn equal_fasteners_are_one_instruction() {
        let text = markdown(&bolted(), None);
        assert_eq!(
            text,
            "# Taking apart: 4 steps\n\n\
             **1–3.** Take 3 × bolt out along +Z (14 mm), one by one: bolt-1, bolt-2, bolt-3.\n\n\
             **4.** Take cover out along +Z (3 mm), after bolt-1, bolt-2, bolt-3.\n\n\
             Stays: base.\n\n"
        );
    }

    #[test]
    fn groups_of_the_input_are_headings_unless_they_alternate() {
        let group = |name: &str, parts: &[&str]| GroupDocument {
            name: name.into(),
            parts: parts.iter().map(|p| (*p).to_owned()).collect(),
        };
        let mut plan = bolted();
        plan.steps.extend([lifted("pin", 1.0, &[]), lifted("cap", 2.0, &[]), lifted("lid", 3.0, &[])]);
        plan.groups = vec![
            group("frame", &["bolt-1", "bolt-2", "bolt-3", "cover"]),
            group("frame/bolts", &["bolt-1", "bolt-2"]),
        ];
        let text = markdown(&plan, None);
        assert!(text.contains("steps\n\n## frame/bolts\n\n**1–2.**"), "{text}");
        assert!(text.contains("## frame\n\n**3.** Take bolt-3"), "{text}");
        assert!(text.contains("## Other parts\n\n**5.** Take pin"), "{text}");
        plan.groups = vec![group("odd", &["bolt-1", "bolt-3", "pin", "lid"])];
        assert!(!markdown(&plan, None).contains("##"), "{}", markdown(&plan, None));
    }

    #[test]
    fn only_what_is_equal_and_does_the_same_is_grouped() {
        let told = |plan: &PlanDocument, classes: Option<&[usize]>| {
            markdown(plan, classes).lines().filter(|l| l.starts_with("**")).count()
        };
        assert_eq!(told(&bolted(), Some(&[0, 1, 0, 2, 3])), 4, "bolt-2 is another kind of bolt");
        assert_eq!(told(&bolted(), Some(&[0, 0, 0, 0, 3])), 2, "the cover goes another way");
        let mut plan = bolted();
        plan.steps[1] = lifted("bolt-2", 14.0, &[0]);
        assert_eq!(told(&plan, None), 3, "bolt-2 requires bolt-1 to be out");
        let named = |n: &str| n.replace("bolt-", "");
        plan = bolted();
        plan.parts.iter_mut().for_each(|p| *p = named(p));
        plan.steps.iter_mut().flat_map(|s| &mut s.parts).for_each(|part| *part = named(part));
        assert_eq!(told(&plan, None), 4, "numbers alone say nothing");
        assert!(markdown(&plan, Some(&[0, 0, 0, 1, 2])).contains("3 × equal parts"));
    }

    #[test]
    fn lengths_that_differ_a_bit_are_a_range() {
        let mut plan = bolted();
        (plan.steps[1], plan.steps[2]) = (lifted("bolt-2", 14.4, &[]), lifted("bolt-3", 13.2, &[]));
        let text = markdown(&plan, None);
        assert!(text.contains("**1–3.** Take 3 × bolt out along +Z (13.2–14.4 mm), one by one: "), "{text}");
        plan.steps[2] = lifted("bolt-3", 10.7, &[]);
        let text = markdown(&plan, None);
        assert!(
            text.contains("**1–2.** Take 2 × bolt out along +Z (14.0–14.4 mm)"),
            "too far from the second: {text}"
        );
        plan.steps[2] = lifted("bolt-3", 14.0, &[]);
        let tilted = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [14.0 * sin, 0.0, 14.0 * cos, 1.0, 0.0, 0.0, 0.0]
        };
        for (degrees, steps) in [(2.5, "**1–3.**"), (3.5, "**1–2.**")] {
            plan.steps[2].path[1] = tilted(degrees);
            assert!(markdown(&plan, None).contains(steps), "{degrees} degrees");
        }
    }

    #[test]
    fn steps_of_groups_and_of_other_bodies_are_told_one_by_one() {
        let bolts = |change: fn(&mut PlanDocument)| {
            let mut plan = bolted();
            change(&mut plan);
            markdown(&plan, None)
        };
        let with_group: fn(&mut PlanDocument) = |plan| {
            plan.steps =
                vec![lifted("bolt-1", 14.0, &[]), lifted("bolt-2", 14.0, &[]), lifted("bolt-3", 14.0, &[])];
            plan.steps[0].parts.push("cover".into());
            plan.steps[0].parts.push("bolt-3".into());
            plan.steps[2].of = Some(0);
            plan.steps[2].requires = vec![0];
        };
        let text = bolts(with_group);
        let expected = "**1.** Take bolt-1, cover and bolt-3 together out along +Z (14 mm).\n\n\
             **2.** Take bolt-2 out along +Z (14 mm).\n\n\
             **3.** Of the group of step 1: take bolt-3 out along +Z (14 mm).\n\n";
        assert!(text.contains(expected), "{text}");
        let text = bolts(|plan| {
            let group = lifted("cover", 14.0, &[]);
            plan.steps.insert(
                0,
                StepDocument { parts: ["bolt-1", "bolt-2", "cover"].map(String::from).into(), ..group },
            );
            plan.steps.truncate(3);
            plan.steps[1..].iter_mut().for_each(|step| step.of = Some(0));
        });
        let expected = "**2–3.** Of the group of step 1: take 2 × bolt out along +Z (14 mm), one by one: bolt-1, bolt-2.";
        assert!(text.contains(expected), "{text}");
        let text = bolts(|plan| plan.steps[1].ends = "aside".into());
        assert!(text.contains("**2.** Move bolt-2 aside along +Z (14 mm).\n"), "{text}");
    }

    #[test]
    fn groups_that_stayed_together_are_told() {
        let free = FreeGroupDocument {
            parts: ["cover", "base"].map(String::from).into(),
            direction: [0.0, 0.0, -1.0],
        };
        let kept = vec![["bolt-1", "bolt-2"].map(String::from).into()];
        let text =
            markdown(&PlanDocument { kept_together: kept, free_together: vec![free], ..bolted() }, None);
        assert!(text.contains("Not taken apart: bolt-1 and bolt-2.\n"), "{text}");
        assert!(text.contains("Can begin to move together along −Z: cover and base.\n"), "{text}");
    }

    #[test]
    fn what_is_stuck_is_told() {
        let blocked = |part: &str, action: &str| BlockedDocument {
            part: part.into(),
            by: vec!["base".into()],
            action: action.into(),
        };
        let plan = PlanDocument {
            status: "infeasible".into(),
            reason: Some("They are linked.".into()),
            blocked: vec![blocked("cover", "+x"), blocked("cover", "+rx"), blocked("bolt-1", "-z")],
            ..bolted()
        };
        let text = markdown(&plan, None);
        assert!(text.contains("**Not complete (infeasible).** They are linked.\n\n"), "{text}");
        assert!(
            text.ends_with(
                "## What is stuck\n\n- cover: +x by base\n- bolt-1: -z by base\n\n\
                 1 more blocked action of these parts: the plan's JSON has them.\n"
            ),
            "{text}"
        );
    }

    #[test]
    fn assemblies_are_told_the_other_way() {
        let text = markdown(&PlanDocument { kind: "assembly".into(), ..bolted() }, None);
        assert!(
            text.starts_with("# Putting together") && text.contains("Put 3 × bolt in along +Z"),
            "{text}"
        );
        assert!(text.contains("goes in after bolt-1"), "{text}");
    }
}
