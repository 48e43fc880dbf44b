//! An observer that keeps removals back until it is known which of them count.

use super::outcome::Removal;
use super::problem::Observer;
use super::trace::TraceEvent;

/// Passes on all events but removals.
pub(super) struct DeferredRemovals<'o> {
    observer: &'o mut dyn Observer,
}

impl<'o> DeferredRemovals<'o> {
    pub(super) fn new(observer: &'o mut dyn Observer) -> Self {
        Self { observer }
    }
}

impl Observer for DeferredRemovals<'_> {
    fn progress(&mut self, removed: usize, simulations: u64) {
        self.observer.progress(removed, simulations);
    }

    fn removal(&mut self, _removal: &Removal) {}

    fn traces(&self) -> bool {
        self.observer.traces()
    }

    fn traced(&mut self, event: TraceEvent) {
        self.observer.traced(event);
    }
}
