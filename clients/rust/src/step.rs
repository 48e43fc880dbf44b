//! Steps that own the memory in which they are read.

use std::fmt;
use std::sync::Arc;

use sbdp_ipc::bytes::{AlignedBytes, Malformed};
use sbdp_ipc::plan::{StepView, StepsView};
use sbdp_ipc::services::Answer;

use crate::process_bound::ProcessBound;

/// A whole message of the daemon.
#[derive(Debug)]
pub(crate) enum Message {
    /// In place.
    Shared(SharedAnswer),
    /// A copy, or put together from several chunks.
    Owned(AlignedBytes),
}

/// An answer that several threads may read at the same time.
pub(crate) struct SharedAnswer(ProcessBound<Answer>);

impl fmt::Debug for SharedAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SharedAnswer")
    }
}

// SAFETY: Through a shared reference an answer can only be read: its payload and header lie in memory that is mapped
// read-only and stays until the drop, which takes the lock of the port's state. iceoryx2 marks it `Send` for the same
// reason, and says nothing about `Sync`.
#[allow(unsafe_code, reason = "iceoryx2 does not mark answers as `Sync`")]
unsafe impl Sync for SharedAnswer {}

impl Message {
    pub(crate) fn shared(answer: Answer) -> Self {
        Self::Shared(SharedAnswer(ProcessBound::new(answer)))
    }

    /// A copy in memory of this process, so that the daemon gets its chunk back.
    pub(crate) fn owned(self) -> Self {
        match self {
            Self::Shared(answer) => Self::Owned(AlignedBytes::copy_of(answer.0.payload())),
            owned @ Self::Owned(_) => owned,
        }
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        match self {
            Self::Shared(answer) => answer.0.payload(),
            Self::Owned(bytes) => bytes.as_slice(),
        }
    }
}

/// The steps of one message, to be taken one after the other.
#[derive(Debug)]
pub(crate) struct Steps {
    message: Arc<Message>,
    count: usize,
    next: usize,
}

impl Steps {
    pub(crate) fn new(message: Message) -> Result<Self, Malformed> {
        let count = StepsView::new(message.bytes())?.len();
        Ok(Self { message: Arc::new(message), count, next: 0 })
    }

    pub(crate) fn message(&self) -> &Arc<Message> {
        &self.message
    }

    pub(crate) fn take_next(&mut self) -> Option<Step> {
        let index = self.next;
        if index >= self.count {
            return None;
        }
        self.next += 1;
        Some(Step { message: Arc::clone(&self.message), index })
    }
}

/// A verified step. It owns the memory in which it is read, together with the other steps of the same message: a copy,
/// or, if the stream reads in place, shared memory, which the daemon gets back when the last of these steps is dropped.
/// A clone is the same step, not a copy.
#[derive(Clone)]
pub struct Step {
    message: Arc<Message>,
    index: usize,
}

impl Step {
    /// Its fields.
    #[must_use]
    pub fn view(&self) -> StepView<'_> {
        // The message was checked when it came.
        StepsView::checked(self.message.bytes()).get(self.index).unwrap_or_default()
    }

    /// Whether it lies in shared memory.
    #[must_use]
    pub fn is_in_place(&self) -> bool {
        matches!(*self.message, Message::Shared(_))
    }
}

impl PartialEq for Step {
    fn eq(&self, other: &Self) -> bool {
        self.view() == other.view()
    }
}

impl fmt::Debug for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.view().fmt(f)
    }
}
