//! The queues that feed the threads.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::jobs::{AdmitJob, PlanJob};
use super::prefetch::Prefetch;
use super::request_queue::{Owner, QueueLimits, Rejected, RequestQueue, Ticket};
use crate::config::Config;

/// A queue that threads share.
#[derive(Debug)]
pub(crate) struct SharedQueue<J> {
    queue: Mutex<RequestQueue<J>>,
    ready: Condvar,
}

/// A job at work. When it is dropped, also by a panic, the queue counts it as done.
#[derive(Debug)]
pub(crate) struct Working<'q, J> {
    queue: &'q SharedQueue<J>,
    ticket: Ticket,
    started: Instant,
}

impl<J> Drop for Working<'_, J> {
    fn drop(&mut self) {
        self.queue.lock_now().done(self.ticket, self.started.elapsed());
        // Waiting jobs of its client may begin now.
        self.queue.ready.notify_all();
    }
}

impl<J> SharedQueue<J> {
    fn new(bounds: QueueLimits) -> Self {
        Self { queue: Mutex::new(RequestQueue::new(bounds)), ready: Condvar::new() }
    }

    /// The queue is plain data, so it is consistent even if a thread panicked while it held the lock.
    fn lock(&self) -> MutexGuard<'_, RequestQueue<J>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The same, with the time that has passed.
    fn lock_now(&self) -> MutexGuard<'_, RequestQueue<J>> {
        let mut queue = self.lock();
        queue.pass_until(Instant::now());
        queue
    }

    fn rebound(&self, bounds: QueueLimits) {
        self.lock().rebound(bounds);
        self.ready.notify_all();
    }

    pub(crate) fn check(&self, ticket: Ticket) -> Result<(), Rejected> {
        self.lock_now().check(ticket)
    }

    pub(crate) fn push(&self, ticket: Ticket, job: J) -> Result<(), Rejected> {
        self.lock_now().push(ticket, job)?;
        self.ready.notify_one();
        Ok(())
    }

    /// Waits for a job; `None` when the queue is closed and empty.
    pub(crate) fn pop(&self) -> Option<(J, Working<'_, J>)> {
        let mut queue = self.lock();
        loop {
            if let Some((ticket, job)) = queue.pop() {
                return Some((job, Working { queue: self, ticket, started: Instant::now() }));
            }
            if queue.is_over() {
                return None;
            }
            queue = self.ready.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }

    pub(crate) fn withdraw(&self, fits: impl Fn(&J) -> bool) -> bool {
        let withdrawn = self.lock().withdraw(fits);
        if withdrawn {
            // A closed queue may be empty now.
            self.ready.notify_all();
        }
        withdrawn
    }

    pub(crate) fn close(&self) {
        self.lock().close();
        self.ready.notify_all();
    }

    pub(crate) fn len(&self) -> usize {
        self.lock().len()
    }

    pub(crate) fn hint_ms(&self, owner: Owner) -> u32 {
        self.lock().hint_ms(owner)
    }
}

/// Uploads that may wait to be healed; each client port has at most one.
const ADMISSION_QUEUE: usize = 128;

/// The queues of plans, of assemblies to take in, and of what is to be prepared.
#[derive(Debug, Clone)]
pub(crate) struct Queues {
    pub(crate) plans: Arc<SharedQueue<PlanJob>>,
    pub(crate) admissions: Arc<SharedQueue<AdmitJob>>,
    /// What is prepared while the workers are idle.
    pub(super) prefetch: Arc<Prefetch>,
    /// The time for planning the likely questions after one plan.
    pub(super) speculation: Duration,
}

/// The bounds of plans, and of assemblies to take in.
fn bounds(config: &Config) -> [QueueLimits; 2] {
    let (workers, requests) = (config.workers.count, &config.requests);
    // If there are several workers, one is left for other clients.
    let share = workers.saturating_sub(1).max(1);
    let megabytes = |mb: u64| mb.saturating_mul(1 << 20);
    let plans = QueueLimits {
        waiting: requests.queue,
        waiting_per_owner: requests.waiting_per_client.min(requests.queue),
        bytes: u64::MAX,
        bytes_per_owner: u64::MAX,
        workers,
        working_per_owner: match requests.working_per_client {
            0 => share,
            most => most,
        },
        working_batch: share,
        work_s_per_owner: Some(requests.work_s_per_client).filter(|most| *most > 0.0),
    };
    let admissions = QueueLimits {
        waiting: ADMISSION_QUEUE,
        waiting_per_owner: ADMISSION_QUEUE,
        bytes: megabytes(requests.uploads_mb),
        bytes_per_owner: megabytes(requests.uploads_mb_per_client),
        workers: 1,
        working_per_owner: 1,
        working_batch: 1,
        work_s_per_owner: None,
    };
    [plans, admissions]
}

impl Queues {
    pub(crate) fn new(config: &Config) -> Self {
        let [plans, admissions] = bounds(config);
        Self {
            plans: Arc::new(SharedQueue::new(plans)),
            admissions: Arc::new(SharedQueue::new(admissions)),
            prefetch: Arc::default(),
            speculation: config.cache.speculation(),
        }
    }

    /// Keeps other bounds from now on.
    pub(crate) fn reload(&self, config: &Config) {
        let [plans, admissions] = bounds(config);
        self.plans.rebound(plans);
        self.admissions.rebound(admissions);
    }

    pub(crate) fn close(&self) {
        self.plans.close();
        self.admissions.close();
        self.prefetch.close();
    }
}
