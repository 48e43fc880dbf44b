//! A client of the daemon.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::sync::Arc;

use sbdp_ipc::bytes;
use sbdp_ipc::endpoint::default_runtime_dir;
use sbdp_ipc::headers::RequestKind;
use sbdp_ipc::status::Status;

use crate::connection::{Connection, Through};
use crate::error::ClientError;
use crate::options::ConnectOptions;

/// A client of the daemon of one place. It may move between threads but is used by one at a time.
#[derive(Debug)]
pub struct Client {
    pub(crate) options: ConnectOptions,
    runtime_dir: PathBuf,
    connection: RefCell<Arc<Connection>>,
    pub(crate) planning: Cell<bool>,
    restarts: Cell<u32>,
    next_request: Cell<u64>,
}

impl Client {
    /// Connects to the daemon of the default runtime folder.
    ///
    /// # Errors
    /// No daemon runs, it speaks another version, or it serves too many clients.
    pub fn connect() -> Result<Self, ClientError> {
        Self::connect_with(ConnectOptions::default())
    }

    /// Connects as told.
    ///
    /// # Errors
    /// No daemon runs, it speaks another version, or it serves too many clients.
    pub fn connect_with(options: ConnectOptions) -> Result<Self, ClientError> {
        let runtime_dir = options.runtime_dir.clone().unwrap_or_else(default_runtime_dir);
        let connection = Connection::open(&runtime_dir, options.poll)?;
        Ok(Self {
            options,
            runtime_dir,
            connection: RefCell::new(Arc::new(connection)),
            planning: Cell::new(false),
            restarts: Cell::new(0),
            next_request: Cell::new(1),
        })
    }

    /// How the daemon is.
    ///
    /// # Errors
    /// The daemon is gone or gives no answer.
    pub fn status(&self) -> Result<Status, ClientError> {
        let header = Self::header(RequestKind::Status, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("status", Through::Plan, header, length, |_| {}, self.options.timeout)?;
        Ok(Status::decode(answer.as_slice())?)
    }

    /// All metrics of the daemon: a JSON object, to which fields may be added.
    ///
    /// # Errors
    /// The daemon is gone, gives no answer, or is older than this request.
    pub fn metrics(&self) -> Result<String, ClientError> {
        let header = Self::header(RequestKind::Metrics, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("metrics", Through::Plan, header, length, |_| {}, self.options.timeout)?;
        let wrong = |_| ClientError::Protocol("its metrics are no text".to_owned());
        String::from_utf8(answer.as_slice().to_vec()).map_err(wrong)
    }

    /// The daemon's process id.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.connection.borrow().pid()
    }

    /// How often this client has followed a daemon that was restarted at the same place.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts.get()
    }

    pub(crate) fn new_request(&self) -> u64 {
        self.next_request.replace(self.next_request.get() + 1)
    }

    /// The connection as it is, to a daemon that may be gone.
    pub(crate) fn known_connection(&self) -> Arc<Connection> {
        Arc::clone(&self.connection.borrow())
    }

    /// The connection to the daemon that runs: a new one if another daemon has taken the place of the one
    /// before.
    pub(crate) fn connection(&self) -> Result<Arc<Connection>, ClientError> {
        let known = self.known_connection();
        if known.is_alive() {
            return Ok(known);
        }
        let found = Arc::new(Connection::open(&self.runtime_dir, self.options.poll)?);
        self.restarts.set(self.restarts.get() + 1);
        *self.connection.borrow_mut() = Arc::clone(&found);
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::Client;

    #[test]
    fn a_client_may_move_between_threads() {
        fn moves<T: Send>() {}
        moves::<Client>();
    }
}
