//! The instructions of a plan: its steps in words, in which steps in a row that do the same with equal parts are one. Every
//! form in which people read a plan (Markdown, HTML, pictures, the page) is made from these.

use super::handling::{has_same_tool, held, holding, with_tool};
use super::verdict::{blockers, verdict};
use super::words::{Moved, Words, capital, free_together, kept_together, part_words, required, told_names};
use crate::document::{GroupDocument, PlanDocument, StabilityDocument, StepDocument, kind_of};
use crate::plan::PlanKind;

/// A plan in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instructions {
    /// What is done, and in how many steps.
    pub title: String,
    /// Why the plan is not complete.
    pub verdict: Option<String>,
    /// Which parts are gone before the first step, and which have to be held from the start.
    pub before: Option<String>,
    /// What to do, in order.
    pub list: Vec<Instruction>,
    /// What stays, what is not taken apart, what can begin to move; a sentence each.
    pub rest: Vec<String>,
    /// What keeps the parts that are stuck; a line each.
    pub stuck: Vec<String>,
    /// What the lines about stuck parts leave out.
    pub left_out: Option<String>,
}

/// One instruction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instruction {
    /// The group of the input that begins here.
    pub heading: Option<String>,
    /// Its steps: one, or several in a row that do the same with equal parts.
    pub steps: Vec<usize>,
    /// What to do, without a full stop.
    pub words: String,
}

impl Instruction {
    /// The numbers of its steps, from 1.
    #[must_use]
    pub fn numbers(&self) -> String {
        match self.steps[..] {
            [only] => (only + 1).to_string(),
            [first, .., last] => format!("{}–{}", first + 1, last + 1),
            [] => String::new(),
        }
    }
}

impl Instructions {
    /// The instructions of a plan. Parts are equal if they are of one `class` (one per part of the plan); without classes,
    /// if their names differ in a number only.
    #[must_use]
    pub fn of(plan: &PlanDocument, classes: Option<&[usize]>) -> Self {
        let account = StepAccount { plan, classes, words: Words::of(plan) };
        let runs = account.runs();
        let headings = account.headings(&runs);
        let instruction = |(steps, heading): (Vec<usize>, _)| {
            let words = account.run(&steps);
            Instruction { heading, steps, words }
        };
        let (stuck, left_out) = blockers(plan, false);
        Self {
            title: account.title(),
            verdict: verdict(plan).map(|verdict| format!("Not complete ({}). {verdict}", plan.status)),
            before: account.before(),
            list: runs.into_iter().zip(headings).map(instruction).collect(),
            rest: account.rest(),
            stuck,
            left_out: left_out.map(|left_out| format!("{}: the plan's JSON has them.", capital(&left_out))),
        }
    }
}

/// The name without the number at its end: what `bolt-1` and `bolt-12` have in common.
fn stem(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches(['-', '_', ' ', '.', '#'])
}

struct StepAccount<'a> {
    plan: &'a PlanDocument,
    classes: Option<&'a [usize]>,
    words: Words<'a>,
}

impl StepAccount<'_> {
    fn title(&self) -> String {
        let steps = self.plan.steps.len();
        let count = if steps == 1 { "1 step".to_owned() } else { format!("{steps} steps") };
        let what = match kind_of(self.plan) {
            PlanKind::Disassembly => "Taking apart",
            PlanKind::Assembly => "Putting together",
        };
        format!("{what}: {count}")
    }

    fn is_equal(&self, a: &str, b: &str) -> bool {
        let class = |name: &str| {
            let at = self.plan.parts.iter().position(|p| p == name)?;
            self.classes?.get(at)
        };
        match (class(a), class(b)) {
            (Some(a), Some(b)) => a == b,
            _ => !stem(a).is_empty() && stem(a) == stem(b),
        }
    }

    /// Runs of steps that become one instruction: each moves a single part, all out of the same body.
    fn runs(&self) -> Vec<Vec<usize>> {
        let mut runs: Vec<Vec<usize>> = Vec::new();
        for (i, step) in self.plan.steps.iter().enumerate() {
            let joins = |run: &&mut Vec<usize>| {
                let first = &self.plan.steps[run[0]];
                let ([a], [b]) = (&first.parts[..], &step.parts[..]) else { return false };
                self.is_equal(a, b)
                    && self.group(first) == self.group(step)
                    && has_same_tool(first, step)
                    && run.iter().all(|&other| self.words.is_alike(other, i))
                    && !run.iter().any(|g| step.requires.contains(g))
            };
            match runs.last_mut().filter(joins) {
                Some(run) => run.push(i),
                None => runs.push(vec![i]),
            }
        }
        runs
    }

    /// The innermost group that has all parts of a step.
    fn group(&self, step: &StepDocument) -> Option<&str> {
        let holds = |group: &&GroupDocument| step.parts.iter().all(|part| group.parts.contains(part));
        let innermost = self.plan.groups.iter().filter(holds).min_by_key(|group| group.parts.len());
        innermost.map(|group| group.name.as_str())
    }

    /// A heading before each run that is of another group than the one before; none at all if groups alternate, for
    /// headings of single instructions only tear them apart.
    fn headings(&self, runs: &[Vec<usize>]) -> Vec<Option<String>> {
        let groups: Vec<Option<&str>> = runs.iter().map(|run| self.group(&self.plan.steps[run[0]])).collect();
        let is_new = |i: usize| if i == 0 { groups[i].is_some() } else { groups[i] != groups[i - 1] };
        let changes = (0..runs.len()).filter(|&i| is_new(i)).count();
        let heading = |i: usize| match groups[i] {
            _ if 2 * changes > runs.len() || !is_new(i) => None,
            Some(name) => Some(name.to_owned()),
            None => Some("Other parts".to_owned()),
        };
        (0..runs.len()).map(heading).collect()
    }

    fn run(&self, run: &[usize]) -> String {
        let steps: Vec<&StepDocument> = run.iter().map(|&i| &self.plan.steps[i]).collect();
        let tool = with_tool(&steps, self.plan.units.as_deref());
        let after = format!("{}{}", self.after(run), holding(self.plan, &steps));
        if let [only] = run {
            return format!("{}{tool}{after}", self.words.step(*only));
        }
        let names: Vec<&str> =
            run.iter().flat_map(|&i| &self.plan.steps[i].parts).map(String::as_str).collect();
        let what = format!("{} × {}", names.len(), common_name(&names));
        let (told, list) = (self.words.done(run, &Moved::one(&what)), part_words(&names, ", "));
        // One by one: of several "it" would be wrong.
        let told = told
            .replace("nothing holds it", "nothing holds them")
            .replace("in its place: it touches", "in place: they touch");
        format!("{told}{tool}, one by one: {list}{after}")
    }

    /// What is gone, and what has to be held, before the first step.
    fn before(&self) -> Option<String> {
        let gone = &self.plan.initial.removed;
        let gone = (!gone.is_empty()).then(|| format!("Gone before: {}.", part_words(gone, ", ")));
        let states: Vec<&StabilityDocument> = self.plan.initial.stability.iter().collect();
        let held = held(self.plan, &states);
        let held = (!held.is_empty()).then(|| format!("Hold {} from the start.", part_words(&held, " and ")));
        let sentences: Vec<String> = gone.into_iter().chain(held).collect();
        (!sentences.is_empty()).then(|| sentences.join(" "))
    }

    /// The parts that the steps of a run require to have moved before.
    fn after(&self, run: &[usize]) -> String {
        let mut names: Vec<&str> = Vec::new();
        for name in run.iter().flat_map(|&i| required(self.plan, i)) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        if names.is_empty() {
            return String::new();
        }
        let parts = run.iter().map(|&i| self.plan.steps[i].parts.len()).sum();
        let verb = match (kind_of(self.plan), parts) {
            (PlanKind::Disassembly, _) => "after",
            (PlanKind::Assembly, 1) => "goes in after",
            (PlanKind::Assembly, _) => "go in after",
        };
        format!(", {verb} {}", told_names(&names, ", "))
    }

    /// What stays, what is not taken apart, what can begin to move.
    fn rest(&self) -> Vec<String> {
        let plan = self.plan;
        let stays = match kind_of(plan) {
            PlanKind::Disassembly => "Stays",
            PlanKind::Assembly => "Stands from the start",
        };
        let stay =
            (!plan.remaining.is_empty()).then(|| format!("{stays}: {}.", part_words(&plan.remaining, ", ")));
        let kept = plan.kept_together.iter().map(|group| format!("{}.", kept_together(group)));
        let free = plan.free_together.iter().map(|group| format!("{}.", free_together(group)));
        stay.into_iter().chain(kept).chain(free).collect()
    }
}

fn common_name<'a>(names: &[&'a str]) -> &'a str {
    let first = stem(names.first().unwrap_or(&""));
    if !first.is_empty() && names.iter().all(|n| stem(n) == first) { first } else { "equal parts" }
}
