//! What a client's buffer cannot take yet waits here, within bounds.
//!
//! Chunks leave in order. Without credit at most [`STREAM_WINDOW`] are under way, one fewer
//! than the client's buffer holds: the error that ends a stream always finds room.

use std::collections::VecDeque;
use std::sync::Arc;

use sbdp_ipc::error::WireError;
use sbdp_ipc::headers::ResponseKind;
use sbdp_ipc::layout::{PLAN_CHUNK, RESPONSE_BUFFER, STREAM_WINDOW};
use sbdp_ipc::plan::{Step, StepsHeader, encode_steps};

/// More waits than may wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Overflow;

/// A message that waits.
#[derive(Debug)]
enum Message {
    Step(Step),
    Whole { kind: ResponseKind, bytes: Arc<Vec<u8>> },
}

impl Message {
    fn bytes(&self) -> usize {
        match self {
            Self::Step(step) => step.wire_bytes(),
            Self::Whole { bytes, .. } => bytes.len(),
        }
    }
}

/// Steps that fit one chunk.
struct Group {
    bytes: usize,
}

impl Group {
    fn of(first: &Step) -> Self {
        Self { bytes: size_of::<StepsHeader>() + first.wire_bytes() }
    }

    /// Adds a step if it fits.
    fn takes(&mut self, next: &Step) -> bool {
        let bytes = self.bytes + next.wire_bytes();
        let fits = bytes <= PLAN_CHUNK;
        if fits {
            self.bytes = bytes;
        }
        fits
    }
}

/// The messages of all steps of a plan, in order, as they travel when all wait.
pub(crate) fn steps_messages(steps: &[Step]) -> Vec<Vec<u8>> {
    let mut messages = Vec::new();
    let mut first = 0;
    while let Some(step) = steps.get(first) {
        let mut group = Group::of(step);
        let count = 1 + steps[first + 1..].iter().take_while(|next| group.takes(next)).count();
        messages.push(encode_steps(first as u32, &steps[first..first + count]));
        first += count;
    }
    messages
}

/// A message that is being sent, from `offset` on.
#[derive(Debug)]
struct Sending {
    kind: ResponseKind,
    bytes: Arc<Vec<u8>>,
    offset: usize,
    retry_ms: u32,
}

/// A chunk to send now.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Chunk<'o> {
    pub(crate) kind: ResponseKind,
    pub(crate) sequence: u64,
    pub(crate) offset: u64,
    pub(crate) total: u64,
    pub(crate) retry_ms: u32,
    pub(crate) bytes: &'o [u8],
}

/// The outbox of one request.
#[derive(Debug)]
pub(crate) struct Outbox {
    waiting: VecDeque<Message>,
    waiting_bytes: usize,
    limit: usize,
    sending: Option<Sending>,
    window: u64,
    sent: u64,
    consumed: u64,
    steps: u32,
}

impl Outbox {
    pub(crate) fn new(limit: usize) -> Self {
        Self {
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            limit,
            sending: None,
            window: STREAM_WINDOW,
            sent: 0,
            consumed: 0,
            steps: 0,
        }
    }

    pub(crate) fn push_step(&mut self, step: Step) -> Result<(), Overflow> {
        self.push(Message::Step(step))
    }

    /// A message whose bytes others may hold, too.
    pub(crate) fn push_whole(&mut self, kind: ResponseKind, bytes: Arc<Vec<u8>>) -> Result<(), Overflow> {
        self.push(Message::Whole { kind, bytes })
    }

    fn push(&mut self, message: Message) -> Result<(), Overflow> {
        let after = self.waiting_bytes.saturating_add(message.bytes());
        // A single message is taken at any length: refusing it would never get better.
        if after > self.limit && !self.waiting.is_empty() {
            return Err(Overflow);
        }
        self.waiting_bytes = after;
        self.waiting.push_back(message);
        Ok(())
    }

    /// The error that ends the stream goes before everything that still waits.
    pub(crate) fn end_with(&mut self, error: &WireError) {
        self.waiting.clear();
        self.waiting_bytes = 0;
        self.window = RESPONSE_BUFFER as u64;
        self.sending = Some(Sending {
            kind: ResponseKind::Error,
            bytes: Arc::new(error.encode()),
            offset: 0,
            retry_ms: error.retry_ms,
        });
    }

    /// The client has received this many chunks in all. Nonsense changes nothing.
    pub(crate) fn grant(&mut self, consumed: u64) {
        if consumed > self.consumed && consumed <= self.sent {
            self.consumed = consumed;
        }
    }

    /// Nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.sending.is_none()
    }

    /// The next chunk, if there is one and the client has room for it.
    pub(crate) fn next_chunk(&mut self) -> Option<Chunk<'_>> {
        if self.sent - self.consumed >= self.window {
            return None;
        }
        if self.sending.is_none() {
            self.sending = self.encode_next();
        }
        let sequence = self.sent;
        let sending = self.sending.as_ref()?;
        let end = sending.bytes.len().min(sending.offset + PLAN_CHUNK);
        Some(Chunk {
            kind: sending.kind,
            sequence,
            offset: sending.offset as u64,
            total: sending.bytes.len() as u64,
            retry_ms: sending.retry_ms,
            bytes: &sending.bytes[sending.offset..end],
        })
    }

    /// The chunk was delivered.
    pub(crate) fn delivered(&mut self) {
        let Some(sending) = self.sending.as_mut() else { return };
        self.sent += 1;
        sending.offset = sending.bytes.len().min(sending.offset + PLAN_CHUNK);
        if sending.offset == sending.bytes.len() {
            self.sending = None;
        }
    }

    fn encode_next(&mut self) -> Option<Sending> {
        let first = self.pop()?;
        match first {
            Message::Whole { kind, bytes } => Some(Sending { kind, bytes, offset: 0, retry_ms: 0 }),
            Message::Step(step) => Some(self.encode_steps(step)),
        }
    }

    /// As many steps as fit one chunk travel together; one that does not fit goes alone.
    fn encode_steps(&mut self, first: Step) -> Sending {
        let mut group = Group::of(&first);
        let mut steps = vec![first];
        while let Some(Message::Step(next)) = self.waiting.front()
            && group.takes(next)
        {
            if let Some(Message::Step(step)) = self.pop() {
                steps.push(step);
            }
        }
        let encoded = encode_steps(self.steps, &steps);
        self.steps += steps.len() as u32;
        Sending { kind: ResponseKind::Steps, bytes: Arc::new(encoded), offset: 0, retry_ms: 0 }
    }

    fn pop(&mut self) -> Option<Message> {
        let message = self.waiting.pop_front()?;
        self.waiting_bytes = self.waiting_bytes.saturating_sub(message.bytes());
        Some(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use sbdp_ipc::bytes::AlignedBytes;
    use sbdp_ipc::error::ErrorCode;
    use sbdp_ipc::plan::StepsView;

    fn step(part: u32, waypoints: usize) -> Step {
        Step { parts: vec![part], path: vec![[f64::from(part); 7]; waypoints], ..Step::default() }
    }

    /// Reads like a client that grants credit as it goes.
    fn read_all(outbox: &mut Outbox) -> Vec<(ResponseKind, Vec<u8>)> {
        let mut messages: Vec<(ResponseKind, Vec<u8>)> = Vec::new();
        let mut received = 0;
        while let Some(chunk) = outbox.next_chunk() {
            assert_eq!(chunk.sequence, received);
            assert!(chunk.bytes.len() <= PLAN_CHUNK);
            if chunk.offset == 0 {
                messages.push((chunk.kind, Vec::new()));
            }
            let message = &mut messages.last_mut().unwrap().1;
            assert_eq!(message.len() as u64, chunk.offset);
            message.extend_from_slice(chunk.bytes);
            received += 1;
            outbox.delivered();
            outbox.grant(received);
        }
        messages
    }

    #[test]
    fn waiting_steps_travel_together() {
        let mut outbox = Outbox::new(1 << 20);
        for part in 0..5 {
            outbox.push_step(step(part, 2)).unwrap();
        }
        outbox.push_whole(ResponseKind::Summary, Arc::new(vec![1; 8])).unwrap();
        let messages = read_all(&mut outbox);
        assert_eq!(messages.len(), 2);
        let bytes = AlignedBytes::copy_of(&messages[0].1);
        assert_eq!(StepsView::new(bytes.as_slice()).unwrap().len(), 5);
        assert!(outbox.is_empty());
    }

    #[test]
    fn a_step_longer_than_a_chunk_comes_in_several() {
        let mut outbox = Outbox::new(1 << 20);
        outbox.push_step(step(3, 20_000)).unwrap();
        let messages = read_all(&mut outbox);
        let bytes = AlignedBytes::copy_of(&messages[0].1);
        let view = StepsView::new(bytes.as_slice()).unwrap();
        assert_eq!(view.get(0).unwrap().path.len(), 20_000);
    }

    #[test]
    fn without_credit_the_window_holds_and_the_final_error_still_fits() {
        let mut outbox = Outbox::new(1 << 20);
        let mut sent = 0;
        for part in 0..20 {
            outbox.push_step(step(part, 1)).unwrap();
            if outbox.next_chunk().is_some() {
                outbox.delivered();
                sent += 1;
            }
        }
        assert_eq!(sent, STREAM_WINDOW);
        outbox.end_with(&WireError::new(ErrorCode::SlowReader, "slow reader"));
        assert_eq!(outbox.next_chunk().unwrap().kind, ResponseKind::Error);
        outbox.delivered();
        assert!(outbox.is_empty() && outbox.next_chunk().is_none());
    }

    #[test]
    fn more_than_the_limit_overflows() {
        let mut outbox = Outbox::new(1000);
        assert_eq!(outbox.push_step(step(0, 100)), Ok(()), "a single message is always taken");
        assert_eq!(outbox.push_step(step(1, 1)), Err(Overflow));
    }

    proptest! {
        #[test]
        fn every_step_arrives_once_and_in_order(sizes in proptest::collection::vec(0_usize..6000, 0..30)) {
            let mut outbox = Outbox::new(usize::MAX);
            for (part, size) in (0_u32..).zip(&sizes) {
                outbox.push_step(step(part, *size)).unwrap();
            }
            let mut next = 0;
            for (_, message) in read_all(&mut outbox) {
                let bytes = AlignedBytes::copy_of(&message);
                for step in StepsView::new(bytes.as_slice()).unwrap().iter() {
                    prop_assert_eq!((step.number, step.parts), (next, &[next][..]));
                    prop_assert_eq!(step.path.len(), sizes[next as usize]);
                    next += 1;
                }
            }
            prop_assert_eq!(next as usize, sizes.len());
            let steps: Vec<Step> = (0_u32..).zip(&sizes).map(|(part, size)| step(part, *size)).collect();
            let mut waiting = Outbox::new(usize::MAX);
            steps.iter().for_each(|step| waiting.push_step(step.clone()).unwrap());
            let travelled: Vec<_> = read_all(&mut waiting).into_iter().map(|(_, bytes)| bytes).collect();
            prop_assert_eq!(steps_messages(&steps), travelled);
        }

        #[test]
        fn grants_never_open_more_than_the_window(grants in proptest::collection::vec(any::<u64>(), 0..20)) {
            let mut outbox = Outbox::new(usize::MAX);
            for part in 0..40 {
                outbox.push_step(step(part, 4600)).unwrap();
            }
            for grant in grants {
                while outbox.next_chunk().is_some() {
                    outbox.delivered();
                }
                prop_assert!(outbox.sent - outbox.consumed <= STREAM_WINDOW);
                outbox.grant(grant);
            }
        }
    }
}
