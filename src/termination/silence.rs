//! How long work goes on without looking at the termination condition: what a cancelled request may go on at
//! most, told without having to cancel it at just that moment.

use std::cell::Cell;
use std::panic::Location;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// A stretch of work of one thread without a look at the condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Silence {
    /// Of the processor: waiting for other threads, or for the machine, is no work.
    pub time: Duration,
    /// The looks before and after it, as places in the source.
    pub between: [&'static Location<'static>; 2],
}

/// Watches who looks at a condition.
#[derive(Debug, Default)]
pub struct Watch {
    longest: Mutex<Option<Silence>>,
}

thread_local! {
    /// The last look of this thread at any watched condition.
    static LAST: Cell<Option<(Duration, &'static Location<'static>)>> = const { Cell::new(None) };
}

impl Watch {
    /// The longest silence so far.
    #[must_use]
    pub fn longest(&self) -> Option<Silence> {
        *self.longest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn looked(&self, here: &'static Location<'static>) {
        if let Some((since, there)) = LAST.get() {
            let time = processor_time().saturating_sub(since);
            let mut longest = self.longest.lock().unwrap_or_else(PoisonError::into_inner);
            if longest.is_none_or(|l| time > l.time) {
                *longest = Some(Silence { time, between: [there, here] });
            }
        }
        LAST.set(Some((processor_time(), here)));
    }
}

/// Of this thread, since it began.
fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::Termination;
    use super::*;

    #[test]
    fn the_longest_stretch_of_work_between_two_looks_is_told_and_waiting_is_none() {
        let watch = Arc::new(Watch::default());
        let watched = Termination::default().watched(&watch);
        let look = || watched.check().unwrap();
        look();
        let begun = processor_time();
        while processor_time() - begun < Duration::from_millis(3) {
            std::hint::black_box(0);
        }
        let line = line!() + 1;
        look();
        std::thread::sleep(Duration::from_millis(20));
        look();
        let Silence { time, between } = watch.longest().unwrap();
        assert!(time >= Duration::from_millis(3), "{time:?}");
        assert!(between.iter().all(|place| place.file() == file!() && place.line() < line));
    }
}
