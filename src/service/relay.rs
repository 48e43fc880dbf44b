//! Sinks and observers: they pass the events of a search on, in the input's units.

use super::answer;
use crate::geometry::Assembly;
use crate::search::{Observer, PlanSink, Progress, Removal, Stage, TraceEvent, Tried};

/// Passes the events of a search on to a sink.
pub(super) struct Relay<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) sink: &'a mut dyn PlanSink,
    pub(super) total: u32,
    pub(super) tried: Option<Tried>,
}

impl Observer for Relay<'_> {
    fn progress(&mut self, removed: usize, simulations: u64) {
        // A part that leaves in a group, or is moved aside, is in several removals.
        let (done, total) = (self.total.min(removed as u32), self.total);
        let tried = self.tried;
        self.sink.progress(Progress { stage: Stage::Search, done, total, simulations, tried });
    }

    fn tried(&mut self, tried: Tried) {
        self.tried = Some(tried);
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

/// Passes progress on, but no steps.
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

/// Drops all events.
pub(super) struct Discard;

impl PlanSink for Discard {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &crate::plan::PlanStep) {}
}
