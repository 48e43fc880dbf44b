//! The clock that deadlines travel in: CLOCK_MONOTONIC, the same in every process of a machine.

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

/// Nanoseconds of CLOCK_MONOTONIC.
#[must_use]
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    (now.tv_sec as u64).saturating_mul(1_000_000_000).saturating_add(now.tv_nsec as u64)
}

/// The deadline that lies this far ahead.
#[must_use]
pub fn deadline_in(timeout: Duration) -> u64 {
    monotonic_ns().saturating_add(u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX))
}

/// The instant of a deadline; `None` if it is too far ahead for an `Instant`.
#[must_use]
pub fn instant_of(deadline_ns: u64) -> Option<Instant> {
    let now = monotonic_ns();
    if deadline_ns <= now {
        return Some(Instant::now());
    }
    Instant::now().checked_add(Duration::from_nanos(deadline_ns - now))
}
