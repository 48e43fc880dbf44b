//! Clients of the daemon. One client receives one plan at a time, so each call takes one and gives it back.

use std::collections::HashSet;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sbdp_client::{Client, ClientError, ConnectOptions, Interrupt};
use tokio::sync::watch;

/// The clients that are connected.
#[derive(Debug)]
pub(crate) struct Pool {
    runtime_dir: Option<PathBuf>,
    /// True once the gateway ends.
    shutdown: watch::Receiver<bool>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    idle: Vec<Member>,
    /// The process ids of all daemons that were reached.
    daemons: HashSet<u32>,
}

#[derive(Debug)]
struct Member {
    client: Client,
    /// Whether the call that has the client is abandoned.
    abandoned: Arc<Mutex<Arc<AtomicBool>>>,
}

/// A client for one call; when it is dropped, the next call may have it.
#[derive(Debug)]
pub(crate) struct Lease {
    pool: Arc<Pool>,
    member: Option<Member>,
    client: Client,
}

/// The caller that waits for an answer. When it is dropped, as when a call is cancelled, the thread of the call learns
/// that it is abandoned.
#[derive(Debug, Default)]
pub(crate) struct Waiter(Arc<AtomicBool>);

impl Waiter {
    /// What is set when nobody waits any more.
    pub(crate) fn abandoned(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }
}

impl Drop for Waiter {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The content of a lock. No thread can leave it half changed.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Pool {
    pub(crate) fn new(runtime_dir: Option<PathBuf>, shutdown: watch::Receiver<bool>) -> Self {
        Self { runtime_dir, shutdown, state: Mutex::default() }
    }

    /// A client that is idle, or a new one. What waits for the daemon with it ends when the call is abandoned, or the
    /// gateway ends. This blocks, as does all that is done with the client.
    pub(crate) fn lease(self: &Arc<Self>, abandoned: Arc<AtomicBool>) -> Result<Lease, ClientError> {
        let idle = lock(&self.state).idle.pop();
        let member = match idle {
            Some(member) => {
                *lock(&member.abandoned) = abandoned;
                member
            }
            None => self.connect(abandoned)?,
        };
        Ok(Lease { pool: Arc::clone(self), client: member.client.clone(), member: Some(member) })
    }

    fn connect(&self, abandoned: Arc<AtomicBool>) -> Result<Member, ClientError> {
        let abandoned = Arc::new(Mutex::new(abandoned));
        let (of_call, shutdown) = (Arc::clone(&abandoned), self.shutdown.clone());
        let is_wanted = move || *shutdown.borrow() || lock(&of_call).load(Ordering::Relaxed);
        let options = ConnectOptions {
            runtime_dir: self.runtime_dir.clone(),
            interrupt: Some(Interrupt::new(is_wanted)),
            ..ConnectOptions::default()
        };
        Ok(Member { client: Client::connect_with(options)?, abandoned })
    }

    /// How often another daemon was reached than before.
    pub(crate) fn restarts(&self) -> u32 {
        u32::try_from(lock(&self.state).daemons.len().saturating_sub(1)).unwrap_or(u32::MAX)
    }
}

impl Lease {
    /// Takes the daemon that was just reached into account.
    pub(crate) fn note_daemon(&self) {
        lock(&self.pool.state).daemons.insert(self.client.pid());
    }
}

impl Deref for Lease {
    type Target = Client;

    fn deref(&self) -> &Client {
        &self.client
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.note_daemon();
        lock(&self.pool.state).idle.extend(self.member.take());
    }
}
