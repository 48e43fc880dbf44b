//! The one condition that everything long-running polls: cancelled, or past its deadline.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Why work stopped early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interrupt {
    /// Somebody asked for it.
    Cancelled,
    /// The deadline passed.
    DeadlinePassed,
}

/// The one condition that everything long-running polls.
#[derive(Debug, Clone, Default)]
pub struct Termination {
    cancelled: Arc<AtomicBool>,
    deadline: Option<Instant>,
    race: Option<(Arc<AtomicUsize>, usize)>,
}

impl Termination {
    /// A condition with an optional deadline.
    #[must_use]
    pub fn new(deadline: Option<Instant>) -> Self {
        Self { cancelled: Arc::default(), deadline, race: None }
    }

    /// A flag that ends the work when it is set; shared with whoever may cancel.
    #[must_use]
    pub fn cancel_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancelled)
    }

    /// The same for work that is in vain as soon as `winner` holds less than `rank`.
    #[must_use]
    pub fn unless_won(&self, winner: &Arc<AtomicUsize>, rank: usize) -> Self {
        Self { race: Some((Arc::clone(winner), rank)), ..self.clone() }
    }

    /// The same with at most so much time from now on.
    #[must_use]
    pub fn within(&self, limit: Duration) -> Self {
        let limit = Instant::now().checked_add(limit);
        let earlier = [self.deadline, limit].into_iter().flatten().min();
        Self { deadline: earlier, ..self.clone() }
    }

    /// The same with half of the time that is left.
    #[must_use]
    pub fn halfway(&self) -> Self {
        let now = Instant::now();
        let half = |d: Instant| now + d.saturating_duration_since(now) / 2;
        Self { deadline: self.deadline.map(half), ..self.clone() }
    }

    /// Whether the clock can end the work.
    #[must_use]
    pub fn has_deadline(&self) -> bool {
        self.deadline.is_some()
    }

    /// # Errors
    /// The reason to stop, if there is one.
    pub fn check(&self) -> Result<(), Interrupt> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Interrupt::Cancelled);
        }
        if let Some((winner, rank)) = &self.race
            && winner.load(Ordering::Relaxed) < *rank
        {
            return Err(Interrupt::Cancelled);
        }
        match self.deadline {
            Some(d) if Instant::now() >= d => Err(Interrupt::DeadlinePassed),
            _ => Ok(()),
        }
    }
}
