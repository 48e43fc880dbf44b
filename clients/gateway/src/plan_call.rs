//! A plan as the gateway follows it: from the daemon's stream to the caller's, in a thread that may block.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::{Duration, Instant};

use sbdp_client::{ClientError, Event, Handle, PlanOptions, PlanStream, Step};
use tokio::runtime;
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::timeout;
use tonic::Status;

use crate::answer;
use crate::cancel_keys::Cancellable;
use crate::deadline::Deadlines;
use crate::plan_events::Sender;
use crate::pool::Pool;
use crate::proto::{self, plan_event};
use crate::status;
use crate::summary::summary;

/// Longest wait without a look at whether the plan is still wanted. A cancelled call ends in the daemon within this time;
/// at half, waiting plans take twice the processor time (each some 0.3 % of a core), at double, cancelling is slower.
const LOOK: Duration = Duration::from_millis(5);
/// So long the caller may read nothing; the default of the daemon, which ends streams for the same reason
/// (`requests.slow_reader_s`).
const SLOW_READER: Duration = Duration::from_secs(60);
/// Bytes of a piece of the document. Clients of gRPC take messages of 4 MB: four times as much is refused by them; at half,
/// pieces are twice as many.
const DOCUMENT_PIECE: usize = 1 << 20;

/// What a call to `Plan` wants, and what it takes part in.
#[derive(Debug)]
pub(crate) struct PlanCall {
    pub(crate) handle: Handle,
    pub(crate) options: PlanOptions,
    pub(crate) wants_document: bool,
    pub(crate) deadlines: Deadlines,
    /// How much earlier than a call's deadline the daemon answers.
    pub(crate) margin: Duration,
    pub(crate) cancellable: Cancellable,
    pub(crate) abandoned: Arc<AtomicBool>,
    pub(crate) shutdown: watch::Receiver<bool>,
    pub(crate) pool: Arc<Pool>,
    /// It is one of the plans that may be under way.
    pub(crate) _permit: OwnedSemaphorePermit,
}

/// Why a plan is followed no further.
enum Stop {
    /// Nobody waits for it.
    Abandoned,
    Error(Status),
}

impl From<ClientError> for Stop {
    fn from(error: ClientError) -> Self {
        Self::Error(status::refused(&error))
    }
}

/// The caller's side of a plan that is being followed.
struct Caller<'c> {
    call: &'c PlanCall,
    sender: &'c Sender,
    cancelled: bool,
}

impl PlanCall {
    /// Follows the plan to its end.
    pub(crate) fn run(mut self, sender: Sender) {
        let ended = self.follow(&sender);
        // A caller that has the end may ask again at once: place and key are free then.
        drop(self);
        let end = match ended {
            Ok(end) => Ok(answer::event(plan_event::Event::End(end))),
            Err(Stop::Abandoned) => return tracing::debug!("a plan is not wanted any more"),
            Err(Stop::Error(status)) => {
                tracing::info!(code = ?status.code(), message = status.message(), "a plan ended with an error");
                Err(status)
            }
        };
        // Nobody may be there to read it.
        let _ = sender.end.send(end);
    }

    fn follow(&mut self, sender: &Sender) -> Result<proto::Summary, Stop> {
        let lease = self.pool.lease(Arc::clone(&self.abandoned))?;
        self.options.timeout = self.deadlines.time_for_daemon(Instant::now(), self.margin);
        let mut stream = lease.plan(self.handle, &self.options)?;
        let mut caller = Caller { call: self, sender, cancelled: false };
        let mut steps: Vec<Step> = Vec::new();
        loop {
            caller.look(&mut stream)?;
            match stream.poll_event(LOOK)? {
                Poll::Pending => {}
                Poll::Ready(Some(Event::Progress(progress))) => {
                    caller.offer(plan_event::Event::Progress(answer::progress(&progress)));
                }
                Poll::Ready(Some(Event::Step(step))) => {
                    caller.send(&mut stream, plan_event::Event::Step(answer::step(&step)))?;
                    if self.wants_document {
                        steps.push(step);
                    }
                }
                Poll::Ready(Some(Event::Trace(lines))) => {
                    caller.send(&mut stream, plan_event::Event::Trace(lines))?;
                }
                Poll::Ready(Some(Event::Restarted)) => {
                    steps.clear();
                    lease.note_daemon();
                    caller.send(&mut stream, plan_event::Event::Restarted(proto::Restarted {}))?;
                }
                Poll::Ready(Some(Event::Done(done))) => {
                    if self.wants_document {
                        for piece in pieces(&done.to_json(&steps)?) {
                            caller.send(&mut stream, plan_event::Event::Document(piece.to_owned()))?;
                        }
                    }
                    return Ok(summary(done));
                }
                Poll::Ready(None) => {
                    return Err(Stop::Error(status::internal("the plan ended without its summary")));
                }
            }
        }
    }
}

impl Caller<'_> {
    /// Whether the plan is still wanted; passes a wish to cancel on.
    fn look(&mut self, stream: &mut PlanStream) -> Result<(), Stop> {
        if self.call.abandoned.load(Ordering::Relaxed) {
            return Err(Stop::Abandoned);
        }
        if self.call.deadlines.call.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(Stop::Error(status::expired()));
        }
        if !self.cancelled && (self.call.cancellable.is_cancelled() || *self.call.shutdown.borrow()) {
            stream.cancel();
            self.cancelled = true;
        }
        Ok(())
    }

    /// Sends an event that may be left out.
    fn offer(&self, event: plan_event::Event) {
        let _ = self.sender.events.try_send(answer::event(event));
    }

    /// Sends an event; waits while the caller has others to read.
    fn send(&mut self, stream: &mut PlanStream, event: plan_event::Event) -> Result<(), Stop> {
        let event = match self.sender.events.try_send(answer::event(event)) {
            Ok(()) => return Ok(()),
            Err(TrySendError::Closed(_)) => return Err(Stop::Abandoned),
            Err(TrySendError::Full(event)) => event,
        };
        let (runtime, waits_since) = (runtime::Handle::current(), Instant::now());
        loop {
            self.look(stream)?;
            match runtime.block_on(async { timeout(LOOK, self.sender.events.reserve()).await }) {
                Ok(Ok(place)) => {
                    place.send(event);
                    return Ok(());
                }
                Ok(Err(_)) => return Err(Stop::Abandoned),
                Err(_) if waits_since.elapsed() > SLOW_READER => {
                    return Err(Stop::Error(status::slow_reader()));
                }
                Err(_) => {}
            }
        }
    }
}

/// A text in pieces, cut between characters.
fn pieces(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let mut end = rest.len().min(DOCUMENT_PIECE);
        while !rest.is_char_boundary(end) {
            end -= 1;
        }
        let (piece, after) = rest.split_at(end);
        rest = after;
        (!piece.is_empty()).then_some(piece)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documents_are_cut_between_characters() {
        let text = "a".to_owned() + &"é".repeat(DOCUMENT_PIECE);
        let pieces: Vec<&str> = pieces(&text).collect();
        assert_eq!(pieces.concat(), text);
        let lengths: Vec<usize> = pieces.iter().map(|piece| piece.len()).collect();
        assert_eq!(lengths, [DOCUMENT_PIECE - 1, DOCUMENT_PIECE, 2]);
        assert_eq!(super::pieces("").count(), 0);
    }
}
