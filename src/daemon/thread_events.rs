//! Events that other threads of this process send to the port thread, and how these wake it.
//!
//! With warm caches, a plan's steps follow each other within microseconds. On few processors the worker would be slowed
//! down by the threads that it wakes. So steps that come soon after a wake-up do not wake the port thread: it polls for
//! that long by itself ([`Recently`]).

use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use iceoryx2::port::notifier::Notifier;
use sbdp_ipc::Transport;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use super::DaemonError;
use super::ports::Ports;
use super::workers::{Report, WorkerEvent};

/// An event from another thread of this process.
pub(super) enum ThreadEvent {
    Worker(WorkerEvent),
    Terminate,
    Reload,
}

/// Steps that follow within this time share one wake-up.
const TOGETHER: Duration = Duration::from_millis(1);

/// Wakes the port thread. Threads hold the notifier weakly: one that is still busy when the daemon ends must not
/// keep the service's files alive.
fn wake(notifier: &Weak<Notifier<Transport>>) {
    if let Some(notifier) = notifier.upgrade() {
        // A failed wake-up costs one tick, no more.
        let _ = notifier.notify();
    }
}

/// When the port thread was woken last.
#[derive(Debug, Default)]
struct Wakes(Option<Instant>);

impl Wakes {
    /// Whether a report must wake it.
    fn is_due(&mut self, event: &WorkerEvent, now: Instant) -> bool {
        let is_seen_soon = self.0.is_some_and(|last| now.saturating_duration_since(last) < TOGETHER);
        let is_due = !(matches!(event, WorkerEvent::Step(..)) && is_seen_soon);
        if is_due {
            self.0 = Some(now);
        }
        is_due
    }
}

/// Sends workers' reports to the port thread.
pub(super) fn reporter(ports: &Ports, sender: Sender<ThreadEvent>) -> Report {
    let notifier = Arc::downgrade(&ports.wake_self);
    let shared = Mutex::new((sender, Wakes::default()));
    Arc::new(move |event| {
        let is_due = {
            let (sender, wakes) = &mut *shared.lock().unwrap_or_else(PoisonError::into_inner);
            // The time before the report is sent: it is read later than that.
            let is_due = wakes.is_due(&event, Instant::now());
            // A send fails only when the port thread has ended.
            let _ = sender.send(ThreadEvent::Worker(event));
            is_due
        };
        if is_due {
            wake(&notifier);
        }
    })
}

/// Sends signals to the port thread.
pub(super) fn watch_signals(ports: &Ports, sender: Sender<ThreadEvent>) -> Result<(), DaemonError> {
    let system = |source| DaemonError::System { what: "watching signals", source };
    let notifier = Arc::downgrade(&ports.wake_self);
    let mut signals = Signals::new([SIGTERM, SIGINT, SIGHUP]).map_err(system)?;
    let watch = move || {
        for signal in signals.forever() {
            let _ = sender.send(if signal == SIGHUP { ThreadEvent::Reload } else { ThreadEvent::Terminate });
            wake(&notifier);
        }
    };
    std::thread::Builder::new().name("sbdp-signals".to_owned()).spawn(watch).map_err(system)?;
    Ok(())
}

/// When a report was read last: reports that follow soon come without a wake-up.
#[derive(Debug, Default)]
pub(super) struct Recently(Option<Instant>);

impl Recently {
    /// A report was read.
    pub(super) fn heard(&mut self, now: Instant) {
        self.0 = Some(now);
    }

    /// How long to wait for the next event, if there is `timeout` for it.
    pub(super) fn patience(&self, now: Instant, timeout: Duration) -> Duration {
        // Twice the time: a wait of this length that begins near its end lasts beyond it.
        let may_follow = self.0.is_some_and(|last| now.saturating_duration_since(last) < 2 * TOGETHER);
        if may_follow { timeout.min(TOGETHER) } else { timeout }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::daemon::jobs::SessionKey;

    #[test]
    fn a_step_that_wakes_nobody_is_read_soon() {
        let start = Instant::now();
        let at = |us: u64| start + Duration::from_micros(us);
        let key = SessionKey { client: 1, request: 1 };
        let step = || WorkerEvent::Step(key, Default::default());
        let tick = Duration::from_secs(1);
        let (mut wakes, mut recently) = (Wakes::default(), Recently::default());
        assert!(wakes.is_due(&WorkerEvent::Started(key), at(0)), "all but steps wake");
        assert_eq!(recently.patience(at(0), tick), tick);
        // What woke the port thread is read some time later.
        recently.heard(at(300));
        let mut seen_by = at(300);
        for us in (0..1000).step_by(50) {
            assert!(!wakes.is_due(&step(), at(us)), "{us}");
            // Read by the look before, or by one that comes within the time.
            while seen_by < at(us) {
                let patience = recently.patience(seen_by, tick);
                assert!(patience <= TOGETHER, "{us}");
                seen_by += patience;
            }
        }
        assert!(wakes.is_due(&step(), at(1000)), "so late it wakes again");
        assert!(wakes.is_due(&WorkerEvent::Started(key), at(1001)), "and so does what is no step");
        assert_eq!(recently.patience(at(2300), tick), tick, "then it sleeps");
        assert_eq!(recently.patience(at(400), Duration::from_micros(7)), Duration::from_micros(7));
    }
}
