//! Ends a daemon whose port thread stands still.
//!
//! A killed client may leave shared memory in a state in which the next process that uses it waits for ever. A daemon
//! that waits so would keep its place and serve no client: it ends with a log line, and the next daemon starts with
//! shared memory of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Looks without a beat in between after which the thread counts as stuck. They are counted, not timed: a
/// process that was stopped (SIGSTOP, suspend) has missed at most one when it goes on.
const LOOKS: u32 = 8;

/// Told that the port thread lives.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watchdog {
    beats: Arc<AtomicU64>,
}

impl Watchdog {
    /// Watches from now on, and calls `stuck` when there was no beat for about `limit`.
    ///
    /// # Errors
    /// No thread can be had.
    pub(crate) fn start(limit: Duration, stuck: impl FnOnce() + Send + 'static) -> std::io::Result<Self> {
        let this = Self::default();
        // When the last beat comes from a daemon that leaves, nobody holds them any more.
        let beats = Arc::downgrade(&this.beats);
        let watch = move || {
            let (mut last, mut looks) = (0, 0);
            while looks < LOOKS {
                std::thread::sleep(limit / LOOKS);
                let Some(beats) = beats.upgrade() else { return };
                let now = beats.load(Ordering::Relaxed);
                looks = if now == last { looks + 1 } else { 0 };
                last = now;
            }
            stuck();
        };
        std::thread::Builder::new().name("sbdp-watchdog".to_owned()).spawn(watch)?;
        Ok(this)
    }

    /// To be called by the thread whose standstill is to be noticed.
    pub(crate) fn beat(&self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
    }
}

/// Ends this process at once: the port thread holds what an orderly end would need.
pub(crate) fn give_up(limit: Duration, place: &str) {
    tracing::error!(
        seconds = limit.as_secs_f64(),
        "the thread that serves clients stands still: this daemon ends. Start it again (a service manager does \
         so by itself); clients come again. If it happens again, end all clients of {place} first, and report \
         this with the stack of the threads (`gdb -p PID -batch -ex 'thread apply all bt'` before it ends)"
    );
    std::process::abort();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn who_beats_is_left_alone_and_who_stops_is_noticed() {
        let (sender, stuck) = channel();
        // However busy the machine is, a beat comes between eight looks.
        let watchdog = Watchdog::start(Duration::from_secs(80), move || sender.send(()).unwrap()).unwrap();
        for _ in 0..50 {
            watchdog.beat();
            std::thread::sleep(Duration::from_millis(2));
        }
        assert!(stuck.try_recv().is_err(), "it lived");
        let (sender, stuck) = channel();
        let silent = Watchdog::start(Duration::from_millis(8), move || sender.send(()).unwrap()).unwrap();
        stuck.recv().unwrap();
        drop(silent);
    }

    #[test]
    fn nobody_is_missed_who_has_left() {
        let (sender, stuck) = channel();
        drop(Watchdog::start(Duration::from_millis(8), move || sender.send(()).unwrap()).unwrap());
        // The thread ends without a call, which lets go of the sender.
        assert!(stuck.recv().is_err());
    }
}
