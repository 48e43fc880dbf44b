//! Whom a search tells what it does.

use super::answer;
use crate::geometry::Assembly;
use crate::search::{Observer, PlanSink, Progress, Removal, Stage, TraceEvent};

/// Hands a search's events on, in the input's units.
pub(super) struct Relay<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) sink: &'a mut dyn PlanSink,
    pub(super) total: u32,
}

impl Observer for Relay<'_> {
    fn progress(&mut self, removed: usize, simulations: u64) {
        let (done, total) = (removed as u32, self.total);
        self.sink.progress(Progress { stage: Stage::Search, done, total, simulations });
    }

    fn removal(&mut self, removal: &Removal) {
        self.sink.step(&answer::removal(self.assembly, removal));
    }

    fn traces(&self) -> bool {
        self.sink.traces()
    }

    fn traced(&mut self, event: TraceEvent) {
        self.sink.traced(event);
    }
}

/// Hands on how a search gets on, but no step.
pub(super) struct WithoutSteps<'a> {
    pub(super) sink: &'a mut dyn PlanSink,
}

impl PlanSink for WithoutSteps<'_> {
    fn progress(&mut self, progress: Progress) {
        self.sink.progress(progress);
    }

    fn step(&mut self, _: &crate::plan::PlanStep) {}

    fn traces(&self) -> bool {
        self.sink.traces()
    }

    fn traced(&mut self, event: TraceEvent) {
        self.sink.traced(event);
    }
}

/// Nobody listens.
pub(super) struct Discard;

impl PlanSink for Discard {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &crate::plan::PlanStep) {}
}
