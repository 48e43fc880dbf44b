//! Uploads and revisions, from their reception to their answer, without any transport.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use sbdp_ipc::clock;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::RequestHeader;

use super::events::Incoming;
use super::jobs::{AdmitJob, Received};
use super::metrics::{Latencies, LatencyKind};
use super::outgoing::Outgoing;
use super::request_queue::{Class, Owner, Rejected, Ticket};
use super::resources;
use super::session::Link;
use super::shared_queue::SharedQueue;
use super::shutdown::Shutdown;
use crate::service::AssemblyId;
use crate::termination::Termination;

/// An upload that waits or is being taken in.
#[derive(Debug)]
struct Upload<L> {
    link: L,
    header: RequestHeader,
    /// An upload that still waits then is of no use to its client.
    deadline: Option<Instant>,
    received: Instant,
    cancel: Arc<AtomicBool>,
}

impl<L> Upload<L> {
    fn cancel_work(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }
}

/// Uploads that need less memory than this (bytes) are not compared with the free memory: to find that takes
/// reading files.
const SMALL: u64 = 64 << 20;

/// The ticket of an upload in the queue.
pub(crate) fn ticket(owner: Owner, bytes: usize) -> Ticket {
    Ticket { owner, class: Class::Interactive, bytes: bytes as u64 }
}

/// The uploads that are not answered yet.
#[derive(Debug)]
pub(super) struct Uploads<L> {
    open: HashMap<u64, Upload<L>>,
    next: u64,
    pub(super) queue: Arc<SharedQueue<AdmitJob>>,
    /// How much memory is left, in bytes, if the system tells it.
    pub(super) free_memory: fn() -> Option<u64>,
}

impl<L: Link> Uploads<L> {
    pub(super) fn new(queue: Arc<SharedQueue<AdmitJob>>) -> Self {
        Self { open: HashMap::new(), next: 0, queue, free_memory: resources::free_memory }
    }

    pub(super) fn len(&self) -> usize {
        self.open.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.open.clear();
    }

    pub(super) fn cancel_work(&self) {
        self.open.values().for_each(Upload::cancel_work);
    }

    /// Why an upload of `bytes` bytes would be refused now. Called before the bytes are copied.
    pub(super) fn refusal(&self, owner: Owner, bytes: usize) -> Option<WireError> {
        if let Err(rejected) = self.queue.check(ticket(owner, bytes)) {
            return Some(self.rejection(owner, rejected));
        }
        let needed = resources::memory_needed(bytes as u64);
        if needed < SMALL {
            return None;
        }
        let free = (self.free_memory)().filter(|free| *free < needed)?;
        let message = format!(
            "to take in these {} MB of meshes needs about {} MB of memory, and {} MB are free: upload coarser \
             meshes, or give the daemon more memory",
            bytes >> 20,
            needed >> 20,
            free >> 20
        );
        Some(WireError::new(ErrorCode::TooLarge, message))
    }

    fn rejection(&self, owner: Owner, rejected: Rejected) -> WireError {
        let busy = |message: &str| WireError::busy(message, self.queue.hint_ms(owner));
        match rejected {
            Rejected::Closed => Shutdown::error(),
            Rejected::Full => busy("busy: too many uploads wait"),
            Rejected::OwnerSpent => busy("busy: this client has had its share of the time for uploads"),
            Rejected::OwnerFull => busy("busy: too much of what this client uploaded waits already"),
        }
    }

    /// Queues an upload, or answers why not.
    pub(super) fn take_in(
        &mut self,
        incoming: Incoming<L>,
        job: impl FnOnce(Received) -> AdmitJob,
        outgoing: &mut Outgoing,
    ) {
        let Incoming { link, owner, header, payload, .. } = incoming;
        let deadline_ns = header.upload_deadline_ns();
        if deadline_ns.is_some_and(|d| d <= clock::monotonic_ns()) {
            return outgoing.error(&link, &header, &expired());
        }
        let number = self.next;
        self.next += 1;
        let ticket = ticket(owner, payload.as_slice().len());
        // Without the deadline: an upload that is late but nearly taken in serves a client that comes again.
        let termination = Termination::default();
        let cancel = termination.cancel_flag();
        match self.queue.push(ticket, job(Received { number, bytes: payload, termination })) {
            Ok(()) => {
                let deadline = deadline_ns.and_then(clock::instant_of);
                let received = Instant::now();
                self.open.insert(number, Upload { link, header, deadline, received, cancel });
            }
            Err(rejected) => {
                let error = self.rejection(owner, rejected);
                outgoing.error(&link, &header, &error);
            }
        }
    }

    /// Answers an upload, unless its client left.
    pub(super) fn answer(
        &mut self,
        number: u64,
        result: Result<AssemblyId, WireError>,
        outgoing: &mut Outgoing,
        latencies: &mut Latencies,
    ) {
        let Some(Upload { link, header, received, .. }) = self.open.remove(&number) else { return };
        latencies.add(LatencyKind::Upload, received.elapsed());
        match result {
            Ok(id) => outgoing.handle(&link, &header, id.0, true),
            Err(error) => outgoing.error(&link, &header, &error),
        }
    }

    /// Ends uploads whose client left, and waiting ones whose deadline passed.
    pub(super) fn settle(&mut self, now: Instant, outgoing: &mut Outgoing, latencies: &mut Latencies) {
        let mut over = Vec::new();
        for (&number, upload) in &self.open {
            let gone = !upload.link.is_connected();
            if gone || upload.deadline.is_some_and(|d| d <= now) {
                let withdrawn = self.queue.withdraw(|job| job.number() == Some(number));
                if gone || withdrawn {
                    over.push((number, gone));
                }
            }
        }
        for (number, gone) in over {
            if gone {
                if let Some(upload) = self.open.remove(&number) {
                    upload.cancel_work();
                }
            } else {
                self.answer(number, Err(expired()), outgoing, latencies);
            }
        }
    }

    /// The next deadline of an upload.
    pub(super) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        // An upload that is late and still here is being taken in: nothing is to be done then.
        self.open.values().filter_map(|u| u.deadline).filter(|d| *d > now).min()
    }
}

fn expired() -> WireError {
    WireError::new(ErrorCode::Expired, "the deadline passed before the upload was looked at")
}
