//! A bounded queue of jobs with priorities, quotas and fair turns. It holds no locks; `shared_queue`
//! shares it.
//!
//! The next job is chosen in this order: interactive jobs before batch jobs (but a batch job that was passed over
//! [`PATIENCE`] times goes next); of these, the jobs of the client with the fewest jobs at work; of these, those of the
//! client whose last turn is longest ago; of these, the oldest. So a client with a hundred requests delays only itself.

use std::collections::HashMap;
use std::time::{Duration, Instant};

/// A client, as far as quotas go: a process, however many ports it has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Owner(pub(crate) u64);

/// How urgent a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// Somebody waits for it.
    Interactive,
    /// It may wait.
    Batch,
}

/// What the queue knows of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Ticket {
    pub(crate) owner: Owner,
    pub(crate) class: Class,
    /// Bytes that it keeps while it waits.
    pub(crate) bytes: u64,
}

/// Why a job was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rejected {
    /// The queue is full.
    Full,
    /// This client has the most waiting jobs that one client may have.
    OwnerFull,
    /// This client has used up its share of the workers' time.
    OwnerSpent,
    /// The queue is closed.
    Closed,
}

/// What may wait and work at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct QueueLimits {
    /// Jobs that wait.
    pub(crate) waiting: usize,
    /// Those of one client.
    pub(crate) waiting_per_owner: usize,
    /// Bytes that waiting jobs keep. A job that would wait alone is always taken.
    pub(crate) bytes: u64,
    /// Those of one client.
    pub(crate) bytes_per_owner: u64,
    /// Who takes jobs; only for the hint when to come again.
    pub(crate) workers: usize,
    /// Jobs of one client at work.
    pub(crate) working_per_owner: usize,
    /// Batch jobs at work.
    pub(crate) working_batch: usize,
    /// Seconds of work per minute that one client may have in the long run, and at once after a pause.
    pub(crate) work_s_per_owner: Option<f64>,
}

/// The most interactive jobs that go before a waiting batch job.
const PATIENCE: u32 = 16;
/// The weight of the newest job in the running mean of the jobs' times.
const NEWEST: f64 = 0.2;
/// The least and the most milliseconds in the hint when to retry.
const HINT_MS: (f64, f64) = (10.0, 10_000.0);
/// Work is shared out by the minute.
const MINUTE_S: f64 = 60.0;
/// The most milliseconds in the hint for a client that has used up its share.
const LONGEST_HINT_MS: f64 = 3_600_000.0;

/// The queue.
#[derive(Debug)]
pub(crate) struct RequestQueue<J> {
    waiting: Vec<(Ticket, J)>,
    bounds: QueueLimits,
    /// By client: jobs at work, and the number of its last turn.
    owners: HashMap<Owner, Turns>,
    turns: u64,
    batch_working: usize,
    /// Interactive jobs taken while a batch job waited.
    passed: u32,
    mean_ms: f64,
    closed: bool,
    /// The time up to which what clients have had was forgiven.
    now: Instant,
}

#[derive(Debug, Clone, Copy, Default)]
struct Turns {
    working: usize,
    last: u64,
    /// Seconds of work that this client used and that are not forgiven yet.
    spent_s: f64,
}

impl<J> RequestQueue<J> {
    pub(crate) fn new(bounds: QueueLimits) -> Self {
        Self {
            waiting: Vec::new(),
            bounds,
            owners: HashMap::new(),
            turns: 0,
            batch_working: 0,
            passed: 0,
            mean_ms: 0.0,
            closed: false,
            now: Instant::now(),
        }
    }

    /// Lets time pass: used time is forgiven at the rate of a client's share.
    pub(crate) fn pass_until(&mut self, now: Instant) {
        let passed = now.saturating_duration_since(self.now).as_secs_f64();
        self.now = self.now.max(now);
        let Some(most) = self.bounds.work_s_per_owner else { return };
        for turns in self.owners.values_mut() {
            turns.spent_s = (turns.spent_s - most / MINUTE_S * passed).max(0.0);
        }
        self.forget_idle();
    }

    /// Sets other limits. Waiting jobs stay.
    pub(crate) fn rebound(&mut self, bounds: QueueLimits) {
        self.bounds = bounds;
        if bounds.work_s_per_owner.is_none() {
            self.owners.values_mut().for_each(|turns| turns.spent_s = 0.0);
        }
    }

    /// Whether a job would be taken now.
    pub(crate) fn check(&self, ticket: Ticket) -> Result<(), Rejected> {
        if self.closed {
            return Err(Rejected::Closed);
        }
        let (mut bytes, mut own, mut own_bytes) = (ticket.bytes, 0, ticket.bytes);
        for (other, _) in &self.waiting {
            bytes = bytes.saturating_add(other.bytes);
            if other.owner == ticket.owner {
                own += 1;
                own_bytes = own_bytes.saturating_add(other.bytes);
            }
        }
        if self.overspent(ticket.owner) > 0.0 {
            return Err(Rejected::OwnerSpent);
        }
        let QueueLimits { waiting_per_owner, bytes_per_owner, .. } = self.bounds;
        if own >= waiting_per_owner || (own > 0 && own_bytes > bytes_per_owner) {
            return Err(Rejected::OwnerFull);
        }
        let full = self.waiting.len() >= self.bounds.waiting;
        if full || (!self.waiting.is_empty() && bytes > self.bounds.bytes) {
            return Err(Rejected::Full);
        }
        Ok(())
    }

    /// Seconds of work that a client has had beyond what it may have.
    fn overspent(&self, owner: Owner) -> f64 {
        self.bounds.work_s_per_owner.map_or(0.0, |most| self.turns_of(owner).spent_s - most)
    }

    pub(crate) fn push(&mut self, ticket: Ticket, job: J) -> Result<(), Rejected> {
        self.check(ticket)?;
        // A client that returns goes behind all waiting ones: otherwise a few clients that return at once would
        // always go before one that waits.
        if !self.waiting.iter().any(|(other, _)| other.owner == ticket.owner) {
            self.owners.entry(ticket.owner).or_default().last = self.turns;
        }
        self.waiting.push((ticket, job));
        Ok(())
    }

    /// The next job that may begin now. [`Self::done`] must follow.
    pub(crate) fn pop(&mut self) -> Option<(Ticket, J)> {
        let place = self.next_place()?;
        let (ticket, job) = self.waiting.remove(place);
        self.turns += 1;
        let owner = self.owners.entry(ticket.owner).or_default();
        owner.working += 1;
        owner.last = self.turns;
        match ticket.class {
            Class::Batch => {
                self.batch_working += 1;
                self.passed = 0;
            }
            Class::Interactive if self.waiting.iter().any(|(t, _)| t.class == Class::Batch) => {
                self.passed += 1;
            }
            Class::Interactive => self.passed = 0,
        }
        Some((ticket, job))
    }

    fn next_place(&self) -> Option<usize> {
        let may_work = |ticket: &Ticket| {
            let room = self.turns_of(ticket.owner).working < self.bounds.working_per_owner;
            room && (ticket.class == Class::Interactive || self.batch_working < self.bounds.working_batch)
        };
        let urgent = if self.passed < PATIENCE { Class::Interactive } else { Class::Batch };
        let rank = |(place, ticket): &(usize, Ticket)| {
            let Turns { working, last, .. } = self.turns_of(ticket.owner);
            (ticket.class != urgent, working, last, *place)
        };
        let tickets = self.waiting.iter().map(|(ticket, _)| *ticket).enumerate();
        tickets.filter(|(_, t)| may_work(t)).min_by_key(rank).map(|(place, _)| place)
    }

    fn turns_of(&self, owner: Owner) -> Turns {
        self.owners.get(&owner).copied().unwrap_or_default()
    }

    /// A popped job has ended.
    pub(crate) fn done(&mut self, ticket: Ticket, took: Duration) {
        let took_ms = took.as_secs_f64() * 1e3;
        self.mean_ms =
            if self.mean_ms == 0.0 { took_ms } else { self.mean_ms + NEWEST * (took_ms - self.mean_ms) };
        if ticket.class == Class::Batch {
            self.batch_working = self.batch_working.saturating_sub(1);
        }
        if let Some(turns) = self.owners.get_mut(&ticket.owner) {
            turns.working = turns.working.saturating_sub(1);
            if self.bounds.work_s_per_owner.is_some() {
                turns.spent_s += took.as_secs_f64();
            }
        }
        self.forget_idle();
    }

    /// Forgets clients without waiting jobs, jobs at work, and used time.
    fn forget_idle(&mut self) {
        let waiting = &self.waiting;
        let is_known = |owner: &Owner, turns: &Turns| {
            turns.working > 0 || turns.spent_s > 0.0 || waiting.iter().any(|(t, _)| t.owner == *owner)
        };
        self.owners.retain(|owner, turns| is_known(owner, turns));
    }

    /// Milliseconds after which a client that was refused had better come again: when what waits will
    /// about have been done, and what it has had beyond its share is forgiven.
    pub(crate) fn hint_ms(&self, owner: Owner) -> u32 {
        if let Some(most) = self.bounds.work_s_per_owner
            && self.overspent(owner) > 0.0
        {
            let ms = self.overspent(owner) / most * MINUTE_S * 1e3;
            return ms.clamp(HINT_MS.0, LONGEST_HINT_MS) as u32;
        }
        let jobs = self.waiting.len().max(1) as f64;
        (self.mean_ms * jobs / self.bounds.workers.max(1) as f64).clamp(HINT_MS.0, HINT_MS.1) as u32
    }

    /// Removes the waiting jobs that fit; whether there were any.
    pub(crate) fn withdraw(&mut self, fits: impl Fn(&J) -> bool) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|(_, job)| !fits(job));
        self.waiting.len() < before
    }

    /// Closes the queue. Waiting jobs may still be popped.
    pub(crate) fn close(&mut self) {
        self.closed = true;
    }

    /// Whether the queue is closed and empty.
    pub(crate) fn is_over(&self) -> bool {
        self.closed && self.waiting.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }
}

#[cfg(test)]
#[path = "request_queue_tests.rs"]
mod tests;
