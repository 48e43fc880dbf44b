//! What a client does automatically before it reports an error: it follows a daemon that was restarted, and
//! repeats requests to one that is busy.

use std::time::{Duration, Instant};

use crate::error::ClientError;
use crate::options::ConnectOptions;

/// Pause between two searches for a new daemon.
const LOOK: Duration = Duration::from_millis(20);

/// How long one request has been tried already.
#[derive(Debug, Default)]
pub(crate) struct Patience {
    busy_since: Option<Instant>,
    /// When the daemon was found to be gone, and by which error.
    lost: Option<(Instant, ClientError)>,
}

impl Patience {
    /// When to send the request again; the error if that is useless.
    pub(crate) fn after(
        &mut self,
        options: &ConnectOptions,
        error: ClientError,
    ) -> Result<Instant, ClientError> {
        let now = Instant::now();
        if let Some(hint) = error.retry_after() {
            let since = *self.busy_since.get_or_insert(now);
            let left = options.busy_wait.saturating_sub(now - since);
            return if left.is_zero() { Err(error) } else { Ok(now + hint.min(left)) };
        }
        if !error.is_no_daemon() || options.reconnect.is_zero() {
            return Err(error);
        }
        match self.lost.take() {
            None => {
                self.lost = Some((now, error));
                Ok(now)
            }
            // The first error tells what happened, later ones only that nothing has changed.
            Some((since, first)) if now - since >= options.reconnect => Err(first),
            lost => {
                self.lost = lost;
                Ok(now + LOOK)
            }
        }
    }

    /// A daemon accepted the request.
    pub(crate) fn asked(&mut self) {
        self.lost = None;
    }
}
