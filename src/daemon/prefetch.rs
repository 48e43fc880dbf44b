//! What workers make ready while nothing is asked: fields, overlaps and blocking graphs of assemblies that
//! just came, or were asked about before a restart. Whatever is asked stops it.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::service::AssemblyId;
use crate::termination::Termination;

/// Whoever uploads mostly asks at once: so long nothing is begun.
const QUIET: Duration = Duration::from_millis(50);
/// So many assemblies may wait; those that came first are left out.
const MOST_WAITING: usize = 256;

/// What is to be made ready, and whether there is time for it. Shared by all threads.
#[derive(Debug, Default)]
pub(super) struct Prefetch {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    waiting: VecDeque<AssemblyId>,
    /// Requests that workers work on.
    busy: usize,
    quiet_since: Option<Instant>,
    /// Stops what is being made ready.
    stop: Option<Arc<AtomicBool>>,
    closed: bool,
}

/// As long as this lives, nothing is made ready.
#[derive(Debug)]
pub(super) struct Busy<'p>(&'p Prefetch);

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        let mut state = self.0.state();
        state.busy -= 1;
        state.quiet_since = Some(Instant::now());
        self.0.changed.notify_all();
    }
}

/// Once this is dropped, nothing is made ready any more.
#[derive(Debug)]
pub(super) struct Closing(pub(super) Arc<Prefetch>);

impl Drop for Closing {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl Prefetch {
    /// A worker works on a request.
    pub(super) fn busy(&self) -> Busy<'_> {
        let mut state = self.state();
        state.busy += 1;
        if let Some(stop) = &state.stop {
            stop.store(true, Ordering::Relaxed);
        }
        Busy(self)
    }

    /// Wants an assembly made ready, after those that wait.
    pub(super) fn want(&self, id: AssemblyId) {
        let mut state = self.state();
        state.waiting.retain(|waiting| *waiting != id);
        state.waiting.push_back(id);
        if state.waiting.len() > MOST_WAITING {
            state.waiting.pop_front();
        }
        self.changed.notify_all();
    }

    /// Nothing is made ready any more.
    pub(super) fn close(&self) {
        let mut state = self.state();
        state.closed = true;
        if let Some(stop) = &state.stop {
            stop.store(true, Ordering::Relaxed);
        }
        self.changed.notify_all();
    }

    /// Makes ready what is wanted, as long as it is quiet, until it is closed.
    pub(super) fn run(&self, prepare: impl Fn(AssemblyId, &Termination)) {
        while let Some((id, termination)) = self.next() {
            prepare(id, &termination);
            let mut state = self.state();
            let stopped = state.stop.take().is_some_and(|stop| stop.load(Ordering::Relaxed));
            if stopped && !state.closed && !state.waiting.contains(&id) {
                state.waiting.push_front(id);
            }
        }
    }

    /// Waits until it is quiet and something is wanted.
    fn next(&self) -> Option<(AssemblyId, Termination)> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            let quiet = state.quiet_since.map_or(Duration::MAX, |since| since.elapsed());
            if state.busy > 0 || state.waiting.is_empty() {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            } else if quiet < QUIET {
                let waited = self.changed.wait_timeout(state, QUIET - quiet);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
            } else if let Some(id) = state.waiting.pop_front() {
                let termination = Termination::default();
                state.stop = Some(termination.cancel_flag());
                return Some((id, termination));
            }
        }
    }

    /// It holds plain data: it is whole even if a holder panicked.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    fn id(n: u8) -> AssemblyId {
        AssemblyId([n; 32])
    }

    #[test]
    fn what_a_request_stopped_is_made_ready_when_it_is_over() {
        let prefetch = Arc::new(Prefetch::default());
        let (begun, seen) = channel();
        let thread = {
            let prefetch = Arc::clone(&prefetch);
            std::thread::spawn(move || {
                let tries = Mutex::new(0);
                prefetch.run(|id, termination| {
                    let mut tries = tries.lock().unwrap();
                    *tries += 1;
                    begun.send(id).unwrap();
                    // The first is long: only a request ends it.
                    while *tries == 1 && termination.check().is_ok() {
                        std::thread::yield_now();
                    }
                });
            })
        };
        prefetch.want(id(1));
        assert_eq!(seen.recv().unwrap(), id(1));
        prefetch.want(id(2));
        let busy = prefetch.busy();
        assert!(seen.try_recv().is_err(), "nothing begins beside a request");
        drop(busy);
        assert_eq!((seen.recv().unwrap(), seen.recv().unwrap()), (id(1), id(2)), "first what was stopped");
        prefetch.close();
        thread.join().unwrap();
        assert!(seen.recv().is_err());
    }

    #[test]
    fn what_is_wanted_twice_is_made_ready_once_and_the_oldest_are_left_out() {
        let prefetch = Prefetch::default();
        for n in 0..=255 {
            prefetch.want(id(n));
        }
        prefetch.want(id(7));
        prefetch.want(AssemblyId([1, 0].repeat(16).try_into().unwrap()));
        let state = prefetch.state();
        assert_eq!((state.waiting.len(), state.waiting[0]), (MOST_WAITING, id(1)));
        assert_eq!(state.waiting.iter().filter(|w| **w == id(7)).count(), 1);
    }
}
