//! A client of the daemon.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sbdp_ipc::bytes;
use sbdp_ipc::endpoint::default_runtime_dir;
use sbdp_ipc::headers::RequestKind;
use sbdp_ipc::status::Status;

use crate::connection::{Connection, Through};
use crate::error::ClientError;
use crate::options::{ConnectOptions, Handle};
use crate::process_bound::{ProcessBound, pid};

/// Longest pause between two checks for an interruption by the caller.
const PAUSE: Duration = Duration::from_millis(50);

/// How many uploads are noted, at 32 bytes each. A client that plans more assemblies than this in turn asks once more
/// for each of them whether the daemon has it: about 20 µs.
const UPLOADS_NOTED: usize = 4096;

/// A client of one daemon. Threads may share it; clones are the same client. It receives one plan at a time.
#[derive(Debug, Clone)]
pub struct Client {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    options: ConnectOptions,
    runtime_dir: PathBuf,
    connection: Mutex<Arc<ProcessBound<Connection>>>,
    planning: AtomicBool,
    restarts: AtomicU32,
    next_request: AtomicU64,
    /// Assemblies that the daemon has received, and may have dropped since.
    uploaded: Mutex<HashSet<Handle>>,
    /// The process that connected.
    pid: u32,
}

impl Client {
    /// Connects to the daemon of the default runtime folder.
    ///
    /// # Errors
    /// No daemon is running, it speaks another version, or it has too many clients.
    pub fn connect() -> Result<Self, ClientError> {
        Self::connect_with(ConnectOptions::default())
    }

    /// Connects with options.
    ///
    /// # Errors
    /// No daemon is running, it speaks another version, or it has too many clients.
    pub fn connect_with(options: ConnectOptions) -> Result<Self, ClientError> {
        let runtime_dir = options.runtime_dir.clone().unwrap_or_else(default_runtime_dir);
        let connection = Connection::open(&runtime_dir, options.poll)?;
        Ok(Self {
            shared: Arc::new(Shared {
                options,
                runtime_dir,
                connection: Mutex::new(Arc::new(ProcessBound::new(connection))),
                planning: AtomicBool::new(false),
                restarts: AtomicU32::new(0),
                next_request: AtomicU64::new(1),
                uploaded: Mutex::default(),
                pid: pid(),
            }),
        })
    }

    /// The daemon's status.
    ///
    /// # Errors
    /// The daemon is gone or does not answer.
    pub fn status(&self) -> Result<Status, ClientError> {
        let header = Self::header(RequestKind::Status, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("status", Through::Plan, header, length, |_| {}, self.options().timeout)?;
        Ok(Status::decode(answer.as_slice())?)
    }

    /// All metrics of the daemon: a JSON object, to which fields may be added.
    ///
    /// # Errors
    /// The daemon is gone, does not answer, or does not know this request.
    pub fn metrics(&self) -> Result<String, ClientError> {
        let header = Self::header(RequestKind::Metrics, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("metrics", Through::Plan, header, length, |_| {}, self.options().timeout)?;
        let wrong = |_| ClientError::Protocol("its metrics are no text".to_owned());
        String::from_utf8(answer.as_slice().to_vec()).map_err(wrong)
    }

    /// The daemon's process id.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.known_connection().pid()
    }

    /// How often this client has followed a daemon that was restarted.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.shared.restarts.load(Ordering::Relaxed)
    }

    pub(crate) fn options(&self) -> &ConnectOptions {
        &self.shared.options
    }

    pub(crate) fn new_request(&self) -> u64 {
        self.shared.next_request.fetch_add(1, Ordering::Relaxed)
    }

    /// Reserves the client's one plan; false if it is already in use.
    pub(crate) fn begin_plan(&self) -> bool {
        !self.shared.planning.swap(true, Ordering::Acquire)
    }

    pub(crate) fn end_plan(&self) {
        self.shared.planning.store(false, Ordering::Release);
    }

    /// Whether the daemon received this assembly from here, or said that it knows it. It may have dropped it since.
    pub(crate) fn has_uploaded(&self, handle: Handle) -> bool {
        self.uploaded().contains(&handle)
    }

    pub(crate) fn note_uploaded(&self, handle: Handle) {
        let mut uploaded = self.uploaded();
        if uploaded.len() >= UPLOADS_NOTED {
            uploaded.clear();
        }
        uploaded.insert(handle);
    }

    fn uploaded(&self) -> MutexGuard<'_, HashSet<Handle>> {
        self.shared.uploaded.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fails in a forked child of the process that connected.
    pub(crate) fn check_process(&self) -> Result<(), ClientError> {
        if self.shared.pid == pid() { Ok(()) } else { Err(ClientError::Forked { pid: self.shared.pid }) }
    }

    /// Fails if the caller wants to interrupt the call.
    pub(crate) fn check_interrupt(&self) -> Result<(), ClientError> {
        match &self.options().interrupt {
            Some(interrupt) if interrupt.is_wanted() => Err(ClientError::Interrupted),
            _ => Ok(()),
        }
    }

    /// Sleeps until a point in time, unless the caller interrupts.
    pub(crate) fn pause(&self, until: Instant) -> Result<(), ClientError> {
        loop {
            self.check_interrupt()?;
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(PAUSE));
        }
    }

    /// The current connection, to a daemon that may be gone.
    pub(crate) fn known_connection(&self) -> Arc<ProcessBound<Connection>> {
        // Nothing in between can leave it half changed.
        Arc::clone(&self.shared.connection.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// A connection to the running daemon: a new one if another daemon has replaced the one
    /// before.
    pub(crate) fn connection(&self) -> Result<Arc<ProcessBound<Connection>>, ClientError> {
        self.check_process()?;
        let mut known = self.shared.connection.lock().unwrap_or_else(PoisonError::into_inner);
        if !known.is_alive() {
            let found = Connection::open(&self.shared.runtime_dir, self.options().poll)?;
            *known = Arc::new(ProcessBound::new(found));
            self.uploaded().clear();
            self.shared.restarts.fetch_add(1, Ordering::Relaxed);
        }
        Ok(Arc::clone(&known))
    }
}

#[cfg(test)]
mod tests {
    use crate::{Client, Event, Plan, PlanStream, Session, Step};

    #[test]
    fn threads_share_clients_and_hand_streams_on() {
        fn shared<T: Send + Sync + 'static>() {}
        fn moves<T: Send + 'static>() {}
        shared::<Client>();
        shared::<Step>();
        shared::<Plan>();
        moves::<Event>();
        moves::<PlanStream>();
        moves::<Session>();
    }
}
