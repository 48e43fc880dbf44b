//! Progress on a terminal; nothing in pipes.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::search::{Progress, Stage};

/// Shows the stages of a request on stderr.
pub(super) struct ProgressDisplay {
    bar: ProgressBar,
    stage: Option<Stage>,
}

impl ProgressDisplay {
    pub(super) fn new(quiet: bool) -> Self {
        let bar = ProgressBar::new(0);
        let target = if !quiet && std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        bar.set_draw_target(target);
        Self { bar, stage: None }
    }

    fn enter(&mut self, stage: Stage) {
        if self.stage == Some(stage) {
            return;
        }
        self.stage = Some(stage);
        let template = match stage {
            Stage::Sdf => "distance fields {bar:30} {pos}/{len}",
            Stage::Search => "search          {bar:30} {pos}/{len} parts out, {msg} [{elapsed}]",
            Stage::Transfer => "ways            {bar:30} {pos}/{len} parts in [{elapsed}]",
        };
        // A template that does not parse would only cost the looks.
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
    }
}

impl ProgressDisplay {
    pub(super) fn progress(&mut self, progress: Progress) {
        self.enter(progress.stage);
        self.bar.set_length(u64::from(progress.total));
        self.bar.set_position(u64::from(progress.done));
        self.bar.set_message(format!("{} simulations", progress.simulations));
    }

    pub(super) fn step_found(&mut self) {
        if self.stage != Some(Stage::Transfer) {
            self.enter(Stage::Search);
        }
    }
}

impl Drop for ProgressDisplay {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
