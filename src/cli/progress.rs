//! Progress on a terminal; nothing in pipes.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::search::{Progress, Stage, Tried};
use crate::view::part_word;

/// Redraws at least this often, for the clock: one motion of a part may take minutes.
const TICK: Duration = Duration::from_millis(500);

/// Shows the stages of a request on stderr.
pub(super) struct ProgressDisplay {
    bar: ProgressBar,
    stage: Option<Stage>,
    /// Of the parts.
    names: Vec<String>,
}

impl ProgressDisplay {
    /// Of a plan for parts with these names; hidden if it is `quiet`, or nobody would see it.
    pub(super) fn new(quiet: bool, names: impl Iterator<Item = String>) -> Self {
        let bar = ProgressBar::new(0);
        let is_shown = !quiet && std::io::stderr().is_terminal();
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        bar.set_draw_target(target);
        let display = Self { bar, stage: None, names: names.collect() };
        if is_shown {
            display.style("{spinner} {elapsed:>4} preparing");
            display.bar.enable_steady_tick(TICK);
        }
        display
    }

    /// A template that does not parse would only cost the looks.
    fn style(&self, template: &str) {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
    }

    fn enter(&mut self, stage: Stage) {
        if self.stage == Some(stage) {
            return;
        }
        self.stage = Some(stage);
        // What does not fit the width is cut off at the end.
        self.style("{bar:20} {elapsed:>4} {wide_msg}");
    }

    pub(super) fn progress(&mut self, progress: Progress) {
        if self.bar.is_hidden() {
            return;
        }
        self.bar.set_length(u64::from(progress.total));
        self.bar.set_position(u64::from(progress.done));
        self.bar.set_message(message(&progress, &self.names));
        self.enter(progress.stage);
    }

    pub(super) fn step_found(&mut self) {
        if self.stage == Some(Stage::Search) {
            self.bar.inc(1);
        }
    }
}

/// What is done, and what is tried.
fn message(progress: &Progress, names: &[String]) -> String {
    let Progress { stage, done, total, simulations, tried } = progress;
    match stage {
        Stage::Sdf => format!("{done} of {total} distance fields"),
        Stage::Transfer => format!("{done} of {total} put in"),
        Stage::Search => {
            let counted = match simulations {
                0 => String::new(),
                1 => ", 1 simulation".to_owned(),
                more => format!(", {more} simulations"),
            };
            let named = |tried: &Tried| Some((names.get(tried.part)?, tried.turns));
            match tried.as_ref().and_then(named) {
                None => format!("{done} of {total} removed{counted}"),
                Some((name, turns)) => {
                    let how = if turns { "turning" } else { "moving" };
                    format!("{done} of {total} removed{counted}; {how} {}", part_word(name))
                }
            }
        }
    }
}

impl Drop for ProgressDisplay {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_tried_is_named() {
        let names = ["bolt 4".to_owned(), "7".to_owned()];
        let of = |stage, simulations, tried| {
            message(&Progress { stage, done: 12, total: 84, simulations, tried }, &names)
        };
        let tried = |part, turns| Some(Tried { part, turns });
        assert_eq!(of(Stage::Search, 0, tried(0, true)), "12 of 84 removed; turning bolt 4");
        let counted = "12 of 84 removed, 3 simulations; moving part 7";
        assert_eq!(of(Stage::Search, 3, tried(1, false)), counted);
        assert_eq!(of(Stage::Search, 1, None), "12 of 84 removed, 1 simulation");
        assert_eq!(of(Stage::Search, 0, tried(2, false)), "12 of 84 removed", "there is no such part");
        assert_eq!(of(Stage::Sdf, 0, None), "12 of 84 distance fields");
        assert_eq!(of(Stage::Transfer, 3, None), "12 of 84 put in");
    }
}
