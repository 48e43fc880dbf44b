//! The one condition that all long-running work polls: cancelled, or past its deadline.

mod silence;

use std::cell::Cell;
use std::panic::Location;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

pub use silence::{Silence, Watch};

/// Why work stopped early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Interrupt {
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// The deadline passed.
    #[error("the deadline passed")]
    DeadlinePassed,
}

/// The one condition that all long-running work polls.
#[derive(Debug, Clone, Default)]
pub struct Termination {
    cancelled: Arc<AtomicBool>,
    deadline: Option<Instant>,
    planning_time: Option<PlanningTime>,
    race: Option<(Arc<AtomicUsize>, usize)>,
    watch: Option<Arc<Watch>>,
}

/// A span of time in which some of the work does not count. Copies count together.
#[derive(Debug, Clone)]
struct PlanningTime {
    started: Instant,
    limit: Duration,
    /// Nanoseconds of work that does not count.
    left_out: Arc<AtomicU64>,
}

impl PlanningTime {
    fn spent(&self) -> Duration {
        self.started.elapsed().saturating_sub(Duration::from_nanos(self.left_out.load(Ordering::Relaxed)))
    }
}

impl Termination {
    /// A condition with an optional deadline.
    #[must_use]
    pub fn new(deadline: Option<Instant>) -> Self {
        Self { cancelled: Arc::default(), deadline, ..Self::default() }
    }

    /// A flag that ends the work when it is set, shared with those that may cancel.
    #[must_use]
    pub fn cancel_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancelled)
    }

    /// The same for work that is useless as soon as `winner` holds less than `rank`.
    #[must_use]
    pub fn unless_won(&self, winner: &Arc<AtomicUsize>, rank: usize) -> Self {
        Self { race: Some((Arc::clone(winner), rank)), ..self.clone() }
    }

    /// The same, with a watch on how often it is checked.
    #[must_use]
    pub fn watched(&self, watch: &Arc<Watch>) -> Self {
        Self { watch: Some(Arc::clone(watch)), ..self.clone() }
    }

    /// The same with at most this much time from now.
    #[must_use]
    pub fn within(&self, limit: Duration) -> Self {
        let limit = Instant::now().checked_add(limit);
        let earlier = [self.deadline, limit].into_iter().flatten().min();
        Self { deadline: earlier, ..self.clone() }
    }

    /// The same with a limit of the time from now on in which work that is [left out](Self::leave_out) does not
    /// count.
    #[must_use]
    pub fn with_planning_time(&self, limit: Duration) -> Self {
        let planning_time = PlanningTime { started: Instant::now(), limit, left_out: Arc::default() };
        Self { planning_time: Some(planning_time), ..self.clone() }
    }

    /// The same without that limit: for work that is to be left out of it.
    #[must_use]
    pub fn without_planning_time(&self) -> Self {
        Self { planning_time: None, ..self.clone() }
    }

    /// Excludes work that took this long from that limit, if there is one.
    pub fn leave_out(&self, took: Duration) {
        if let Some(planning_time) = &self.planning_time {
            let nanoseconds = u64::try_from(took.as_nanos()).unwrap_or(u64::MAX);
            planning_time.left_out.fetch_add(nanoseconds, Ordering::Relaxed);
        }
    }

    /// The same with half of the time that is left.
    #[must_use]
    pub fn halfway(&self) -> Self {
        let now = Instant::now();
        let half = |d: Instant| now + d.saturating_duration_since(now) / 2;
        let half_time = |b: &PlanningTime| {
            let spent = b.spent();
            PlanningTime { limit: spent + b.limit.saturating_sub(spent) / 2, ..b.clone() }
        };
        let planning_time = self.planning_time.as_ref().map(half_time);
        Self { deadline: self.deadline.map(half), planning_time, ..self.clone() }
    }

    /// Whether the clock can end the work.
    #[must_use]
    pub fn has_deadline(&self) -> bool {
        self.deadline.is_some() || self.planning_time.is_some()
    }

    /// # Errors
    /// The reason to stop, if there is one.
    #[track_caller]
    pub fn check(&self) -> Result<(), Interrupt> {
        if let Some(watch) = &self.watch {
            watch.looked(Location::caller());
        }
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Interrupt::Cancelled);
        }
        if let Some((winner, rank)) = &self.race
            && winner.load(Ordering::Relaxed) < *rank
        {
            return Err(Interrupt::Cancelled);
        }
        let is_late = self.deadline.is_some_and(|d| Instant::now() >= d);
        if is_late || self.planning_time.as_ref().is_some_and(|b| b.spent() >= b.limit) {
            return Err(Interrupt::DeadlinePassed);
        }
        Ok(())
    }
}

/// Whether a test that may be interrupted holds for all items: [`Iterator::all`] for such tests.
///
/// # Errors
/// The first error of the test, unless an item before failed it.
pub fn try_all<T, E>(
    items: impl IntoIterator<Item = T>,
    mut test: impl FnMut(T) -> Result<bool, E>,
) -> Result<bool, E> {
    for item in items {
        if !test(item)? {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Checks a condition at intervals, for work of many short steps: reading the clock at each step would take as long as
/// the step. Once the condition was seen to be true, it stays so.
#[derive(Debug)]
pub struct Poll<'t> {
    termination: Option<&'t Termination>,
    every: u32,
    steps: Cell<u32>,
    interrupt: Cell<Option<Interrupt>>,
}

impl<'t> Poll<'t> {
    /// Checks the condition, if there is one, at the first step and then at every `every`-th.
    #[must_use]
    pub fn every(every: u32, termination: Option<&'t Termination>) -> Self {
        Self { termination, every, steps: Cell::new(0), interrupt: Cell::new(None) }
    }

    /// The same, but the first check is after `steps` steps.
    #[cfg(test)]
    pub(crate) fn first_after(steps: u32, termination: &'t Termination) -> Self {
        Self { steps: Cell::new(1), ..Self::every(steps + 1, Some(termination)) }
    }

    /// To be called at each step.
    ///
    /// # Errors
    /// The condition was seen to be true.
    #[track_caller]
    pub fn check(&self) -> Result<(), Interrupt> {
        let Some(termination) = self.termination else { return Ok(()) };
        let steps = self.steps.get();
        if steps == 0 && self.interrupt.get().is_none() {
            self.interrupt.set(termination.check().err());
        }
        self.steps.set(if steps + 1 < self.every { steps + 1 } else { 0 });
        self.interrupt.get().map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_takes_nothing_of_the_planning_time() {
        let hour = Duration::from_secs(3600);
        let none = Termination::default().with_planning_time(Duration::ZERO);
        assert_eq!(none.check(), Err(Interrupt::DeadlinePassed));
        assert_eq!(none.without_planning_time().check(), Ok(()));
        // As if an hour had passed, all of it verification.
        let mut late = Termination::default().with_planning_time(hour);
        late.planning_time.as_mut().unwrap().started -= hour;
        let copy = late.clone();
        assert_eq!(late.check(), Err(Interrupt::DeadlinePassed));
        copy.leave_out(hour);
        assert_eq!((late.check(), late.halfway().check()), (Ok(()), Ok(())), "copies count together");
        let half = late.halfway().planning_time.unwrap();
        assert!(half.limit <= hour / 2 + half.spent() && half.limit > hour / 3, "{:?}", half.limit);
    }

    #[test]
    fn a_poll_looks_now_and_then_and_stays_over() {
        let termination = Termination::new(None);
        let poll = Poll::every(4, Some(&termination));
        assert!((0..5).all(|_| poll.check().is_ok()));
        termination.cancel_flag().store(true, Ordering::Relaxed);
        assert!((5..8).all(|_| poll.check().is_ok()), "not looked at");
        assert_eq!(poll.check(), Err(Interrupt::Cancelled));
        termination.cancel_flag().store(false, Ordering::Relaxed);
        assert!((0..9).all(|_| poll.check().is_err()));
        assert_eq!(Poll::every(1, None).check(), Ok(()));
    }
}
