//! Shutting down: nothing new is taken, what runs gets its grace, everybody is answered.

use std::time::Instant;

use sbdp_ipc::error::{ErrorCode, WireError};

use super::dispatcher::Dispatcher;
use super::intake::Upload;
use super::planning::Planning;
use super::session::{Input, Link, State};

/// How far shutting down is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Closing {
    /// Not asked for.
    Open,
    /// Running requests may finish until then.
    Grace(Instant),
    /// They are cancelled and get until then to be answered.
    Drain(Instant),
}

impl Closing {
    /// When the next step is due without anything happening.
    pub(super) fn end(self) -> Option<Instant> {
        match self {
            Self::Open => None,
            Self::Grace(end) | Self::Drain(end) => Some(end),
        }
    }
}

impl<L: Link, P: Planning> Dispatcher<L, P> {
    pub(super) fn shutting_down(&self) -> WireError {
        WireError::new(ErrorCode::ShuttingDown, "the daemon is shutting down")
    }

    /// First signal: nothing new, and running requests get their grace. Second: no more grace.
    pub(super) fn terminate(&mut self, now: Instant) {
        self.closing = match self.closing {
            Closing::Open => Closing::Grace(now + self.limits.grace),
            Closing::Grace(_) => Closing::Grace(now),
            drain @ Closing::Drain(_) => drain,
        };
        self.queues.close();
        let error = self.shutting_down();
        for (key, session) in &mut self.sessions {
            if session.state() == State::Queued && self.queues.plans.withdraw(|job| job.key == *key) {
                session.end_with(Input::Refuse, &error);
            }
        }
    }

    pub(super) fn close_down(&mut self, now: Instant) {
        match self.closing {
            Closing::Grace(end) if end <= now => {
                for session in self.sessions.values() {
                    session.cancel_work();
                }
                self.uploads.values().for_each(Upload::cancel_work);
                self.closing = Closing::Drain(now + self.limits.drain);
            }
            Closing::Drain(end) if end <= now => {
                let error = self.shutting_down();
                for session in self.sessions.values_mut() {
                    // Legal from every live state: a worker that does not stop is left behind.
                    let input =
                        if matches!(session.state(), State::Streaming) { Input::Fail } else { Input::Refuse };
                    session.end_with(input, &error);
                    session.pump(now, self.limits.patience);
                    self.wakes.push(session.listener);
                }
                self.sessions.clear();
                self.uploads.clear();
            }
            _ => {}
        }
    }

    /// Shutting down, and everybody is answered.
    pub(crate) fn is_closed(&self) -> bool {
        self.closing != Closing::Open && self.sessions.is_empty() && self.uploads.is_empty()
    }
}
