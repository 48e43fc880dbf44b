//! The events of a plan on their way from the thread that follows it to the caller.

use std::pin::Pin;
use std::task::{Context, Poll, ready};

use tokio::sync::{mpsc, oneshot};
use tokio_stream::Stream;
use tonic::Status;

use crate::pool::Waiter;
use crate::proto::PlanEvent;
use crate::status::internal;

/// Events that wait for a caller to read them; the thread waits when there are more, and the daemon then keeps the others
/// up to its own limits. At one, each event would wait for the caller; at hundreds, long paths fill the memory.
const WAITING: usize = 16;

/// What the thread has.
#[derive(Debug)]
pub(crate) struct Sender {
    pub(crate) events: mpsc::Sender<PlanEvent>,
    /// The last event, or why there is none. This never waits for the caller.
    pub(crate) end: oneshot::Sender<Result<PlanEvent, Status>>,
}

/// What the caller reads. When it is dropped, as when the call is cancelled, the thread learns that.
#[derive(Debug)]
pub(crate) struct PlanEvents {
    events: mpsc::Receiver<PlanEvent>,
    end: Option<oneshot::Receiver<Result<PlanEvent, Status>>>,
    _waiter: Waiter,
}

pub(crate) fn channel(waiter: Waiter) -> (Sender, PlanEvents) {
    let (events, received) = mpsc::channel(WAITING);
    let (end, ended) = oneshot::channel();
    (Sender { events, end }, PlanEvents { events: received, end: Some(ended), _waiter: waiter })
}

impl Stream for PlanEvents {
    type Item = Result<PlanEvent, Status>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        if let Some(event) = ready!(self.events.poll_recv(context)) {
            return Poll::Ready(Some(Ok(event)));
        }
        let Some(end) = &mut self.end else { return Poll::Ready(None) };
        let ended = ready!(Pin::new(end).poll(context));
        self.end = None;
        let failed = |_| Err(internal("the gateway failed while it followed this plan"));
        Poll::Ready(Some(ended.unwrap_or_else(failed)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio_stream::StreamExt;

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().build().unwrap().block_on(future)
    }

    #[test]
    fn the_end_comes_after_all_events_and_a_broken_thread_is_an_error() {
        block_on(async {
            let (sender, mut events) = channel(Waiter::default());
            sender.events.try_send(PlanEvent::default()).unwrap();
            sender.end.send(Ok(PlanEvent::default())).unwrap();
            drop(sender.events);
            assert!(events.next().await.unwrap().is_ok());
            assert!(events.next().await.unwrap().is_ok());
            assert!(events.next().await.is_none());
            assert!(events.next().await.is_none());
            let (sender, mut events) = channel(Waiter::default());
            drop(sender);
            assert_eq!(events.next().await.unwrap().unwrap_err().code(), tonic::Code::Internal);
            assert!(events.next().await.is_none());
        });
    }
}
