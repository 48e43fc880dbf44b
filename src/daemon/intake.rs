//! Meshes that come in: what happens to uploads and revisions, without any transport.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use sbdp_ipc::clock;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::RequestHeader;

use super::dispatcher::{Dispatcher, Incoming};
use super::jobs::{AdmitJob, Received};
use super::metrics::LatencyKind;
use super::planning::Planning;
use super::request_queue::{Class, Owner, Rejected, Ticket};
use super::resources;
use super::session::Link;
use crate::service::AssemblyId;
use crate::termination::Termination;

/// An upload that waits or is being taken in.
#[derive(Debug)]
pub(super) struct Upload<L> {
    link: L,
    header: RequestHeader,
    /// When it is of no use to its client any more, if it still waits then.
    pub(super) deadline: Option<Instant>,
    received: Instant,
    cancel: Arc<AtomicBool>,
}

impl<L> Upload<L> {
    /// Nobody waits for it any more.
    pub(super) fn cancel_work(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }
}

/// What needs less memory than this is not asked for: the answer takes reading files.
const SMALL: u64 = 64 << 20;

/// What the queue knows of an upload.
pub(crate) fn ticket(owner: Owner, bytes: usize) -> Ticket {
    Ticket { owner, class: Class::Interactive, bytes: bytes as u64 }
}

impl<L: Link, P: Planning> Dispatcher<L, P> {
    pub(super) fn have(&mut self, incoming: &Incoming<L>) {
        match <[u8; 32]>::try_from(incoming.payload.as_slice()) {
            Ok(handle) => {
                let known = self.service.knows(AssemblyId(handle));
                self.answer_handle(&incoming.link, &incoming.header, handle, known);
            }
            Err(_) => {
                let error = WireError::new(ErrorCode::Malformed, "a handle has 32 bytes");
                self.answer_error(&incoming.link, &incoming.header, &error);
            }
        }
    }

    /// Why an upload of so many bytes would not be taken now. Asked before they are copied.
    pub(crate) fn refuses_upload(&self, owner: Owner, bytes: usize) -> Option<WireError> {
        if let Err(rejected) = self.queues.admissions.check(ticket(owner, bytes)) {
            return Some(self.upload_rejected(owner, rejected));
        }
        let needed = resources::memory_needed(bytes as u64);
        if needed < SMALL {
            return None;
        }
        let free = (self.limits.free_memory)().filter(|free| *free < needed)?;
        let message = format!(
            "to take in these {} MB of meshes needs about {} MB of memory, and {} MB are free: upload coarser \
             meshes, or give the daemon more memory",
            bytes >> 20,
            needed >> 20,
            free >> 20
        );
        Some(WireError::new(ErrorCode::TooLarge, message))
    }

    fn upload_rejected(&self, owner: Owner, rejected: Rejected) -> WireError {
        let busy = |message: &str| WireError::busy(message, self.queues.admissions.hint_ms(owner));
        match rejected {
            Rejected::Closed => self.shutting_down(),
            Rejected::Full => busy("busy: too many uploads wait"),
            Rejected::OwnerSpent => busy("busy: this client has had its share of the time for uploads"),
            Rejected::OwnerFull => busy("busy: too much of what this client uploaded waits already"),
        }
    }

    /// Lets meshes be taken in.
    pub(super) fn take_in(&mut self, incoming: Incoming<L>, job: impl FnOnce(Received) -> AdmitJob) {
        self.counters.uploads += 1;
        let Incoming { link, owner, header, payload, .. } = incoming;
        let deadline_ns = header.upload_deadline_ns();
        if deadline_ns.is_some_and(|d| d <= clock::monotonic_ns()) {
            return self.answer_error(&link, &header, &expired());
        }
        let number = self.next_upload;
        self.next_upload += 1;
        let ticket = ticket(owner, payload.as_slice().len());
        // Not by the deadline: what is late but nearly taken in serves the client that comes again.
        let termination = Termination::default();
        let cancel = termination.cancel_flag();
        match self.queues.admissions.push(ticket, job(Received { number, bytes: payload, termination })) {
            Ok(()) => {
                let deadline = deadline_ns.and_then(clock::instant_of);
                let received = Instant::now();
                self.uploads.insert(number, Upload { link, header, deadline, received, cancel });
            }
            Err(rejected) => {
                let error = self.upload_rejected(owner, rejected);
                self.answer_error(&link, &header, &error);
            }
        }
    }

    pub(super) fn admitted(&mut self, number: u64, result: Result<AssemblyId, WireError>) {
        let Some(Upload { link, header, received, .. }) = self.uploads.remove(&number) else { return };
        self.latencies.add(LatencyKind::Upload, received.elapsed());
        match result {
            Ok(id) => self.answer_handle(&link, &header, id.0, true),
            Err(error) => self.answer_error(&link, &header, &error),
        }
    }

    /// Those whose client left, and those that are late, do not wait any longer.
    pub(super) fn settle_uploads(&mut self, now: Instant) {
        let mut over = Vec::new();
        for (&number, upload) in &self.uploads {
            let gone = !upload.link.is_connected();
            if gone || upload.deadline.is_some_and(|d| d <= now) {
                let withdrawn = self.queues.admissions.withdraw(|job| job.number() == Some(number));
                if gone || withdrawn {
                    over.push((number, gone));
                }
            }
        }
        for (number, gone) in over {
            if gone {
                if let Some(upload) = self.uploads.remove(&number) {
                    upload.cancel_work();
                }
            } else {
                self.admitted(number, Err(expired()));
            }
        }
    }

    /// When the first of them is late.
    pub(super) fn next_upload_deadline(&self, now: Instant) -> Option<Instant> {
        // One that is late and still there is at work: nothing is to be done then.
        self.uploads.values().filter_map(|u| u.deadline).filter(|d| *d > now).min()
    }
}

fn expired() -> WireError {
    WireError::new(ErrorCode::Expired, "the deadline passed before the upload was looked at")
}
