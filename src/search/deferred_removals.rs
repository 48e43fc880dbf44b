//! An observer that keeps removals back until it is known which of them count.

use super::outcome::Removal;
use super::problem::Observer;
use super::request::Tried;
use super::trace::TraceEvent;

/// Passes on all events but removals.
pub(super) struct DeferredRemovals<'o> {
    observer: &'o mut dyn Observer,
    /// Removals and simulations of earlier searches for the same request.
    before: (usize, u64),
}

impl<'o> DeferredRemovals<'o> {
    pub(super) fn new(observer: &'o mut dyn Observer) -> Self {
        Self::after(observer, 0, 0)
    }

    /// That of a search after others that made some removals and simulations.
    pub(super) fn after(observer: &'o mut dyn Observer, removed: usize, simulations: u64) -> Self {
        Self { observer, before: (removed, simulations) }
    }
}

impl Observer for DeferredRemovals<'_> {
    fn progress(&mut self, removed: usize, simulations: u64) {
        let (earlier, spent) = self.before;
        self.observer.progress(earlier + removed, spent + simulations);
    }

    fn tried(&mut self, tried: Tried) {
        self.observer.tried(tried);
    }

    fn removal(&mut self, _removal: &Removal) {}

    fn traces(&self) -> bool {
        self.observer.traces()
    }

    fn traced(&mut self, event: TraceEvent) {
        self.observer.traced(event);
    }
}
