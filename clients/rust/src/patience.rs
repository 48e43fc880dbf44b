//! What a client does by itself before it reports an error: it follows a daemon that was restarted, and
//! comes again to one that is busy.

use std::time::{Duration, Instant};

use crate::client::Client;
use crate::error::ClientError;

/// Pause between two looks for a new daemon.
const LOOK: Duration = Duration::from_millis(20);

/// How long one request has been tried already.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Patience {
    busy_since: Option<Instant>,
}

/// Why a request is made once more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Again {
    /// The daemon had no room for it.
    Busy,
    /// Another daemon has taken the place of the one that was asked.
    Restarted,
}

impl Patience {
    /// Waits until the request makes sense once more; the error if it never will.
    pub(crate) fn after(&mut self, client: &Client, error: ClientError) -> Result<Again, ClientError> {
        if let Some(hint) = error.retry_after() {
            let since = *self.busy_since.get_or_insert_with(Instant::now);
            let left = client.options.busy_wait.saturating_sub(since.elapsed());
            if left.is_zero() {
                return Err(error);
            }
            std::thread::sleep(hint.min(left));
            return Ok(Again::Busy);
        }
        if error.is_no_daemon() && !client.options.reconnect.is_zero() {
            return client.await_daemon(error).map(|()| Again::Restarted);
        }
        Err(error)
    }
}

impl Client {
    /// Waits for a daemon at the same place, as long as the options say.
    fn await_daemon(&self, error: ClientError) -> Result<(), ClientError> {
        let until = Instant::now() + self.options.reconnect;
        loop {
            match self.connection() {
                Ok(_) => return Ok(()),
                Err(e) if !e.is_no_daemon() => return Err(e),
                Err(_) if Instant::now() >= until => return Err(error),
                Err(_) => std::thread::sleep(LOOK),
            }
        }
    }
}
