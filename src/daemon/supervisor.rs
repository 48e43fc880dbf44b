//! Notifies a service manager by the protocol of sd_notify(3): ready, stopping, still alive. Without one nothing
//! happens.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// The way to the service manager.
#[derive(Debug)]
pub(crate) struct Supervisor {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// How often it wants to hear of us.
    watchdog: Option<Duration>,
    last: Instant,
}

impl Supervisor {
    /// The one that started this process, if one did.
    pub(crate) fn of_this_process() -> Self {
        let variable = |name: &str| std::env::var(name).ok();
        // The variable may have been meant for another process, of which this one is a child.
        let mine = variable("WATCHDOG_PID").is_none_or(|pid| pid == std::process::id().to_string());
        let every = variable("WATCHDOG_USEC").and_then(|us| us.parse().ok()).filter(|_| mine);
        Self::new(variable("NOTIFY_SOCKET").as_deref(), every.map(Duration::from_micros))
    }

    fn new(address: Option<&str>, watchdog: Option<Duration>) -> Self {
        let address = address.filter(|a| !a.is_empty()).and_then(|a| match a.strip_prefix('@') {
            Some(name) => SocketAddr::from_abstract_name(name).ok(),
            None => SocketAddr::from_pathname(a).ok(),
        });
        let socket = address.and_then(|address| Some((UnixDatagram::unbound().ok()?, address)));
        Self { socket, watchdog, last: Instant::now() }
    }

    /// The longest that the port thread may sleep without saying that it lives.
    pub(crate) fn patience(&self) -> Option<Duration> {
        // Half of what would be too long, as sd_watchdog_enabled(3) advises.
        self.watchdog.filter(|_| self.socket.is_some()).map(|every| every / 2)
    }

    pub(crate) fn ready(&self) {
        self.tell("READY=1");
    }

    pub(crate) fn stopping(&self) {
        self.tell("STOPPING=1");
    }

    pub(crate) fn reloading(&self, done: bool) {
        let now = sbdp_ipc::clock::monotonic_ns() / 1000;
        self.tell(&if done { "READY=1".to_owned() } else { format!("RELOADING=1\nMONOTONIC_USEC={now}") });
    }

    /// To be called by the loop whose standstill is to be noticed.
    pub(crate) fn alive(&mut self) {
        if self.patience().is_some_and(|patience| self.last.elapsed() >= patience / 2) {
            self.last = Instant::now();
            self.tell("WATCHDOG=1");
        }
    }

    fn tell(&self, state: &str) {
        if let Some((socket, address)) = &self.socket
            && let Err(error) = socket.send_to_addr(state.as_bytes(), address)
        {
            tracing::warn!(%error, state, "the service manager was not told");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_manager_hears_of_the_start_of_life_and_of_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let manager = UnixDatagram::bind(&path).unwrap();
        let heard = || {
            let mut text = [0; 200];
            let length = manager.recv(&mut text).unwrap();
            String::from_utf8_lossy(&text[..length]).into_owned()
        };
        let mut supervisor = Supervisor::new(path.to_str(), Some(Duration::from_millis(8)));
        supervisor.ready();
        assert_eq!(heard(), "READY=1");
        std::thread::sleep(Duration::from_millis(4));
        supervisor.alive();
        assert_eq!(heard(), "WATCHDOG=1");
        supervisor.stopping();
        assert_eq!(heard(), "STOPPING=1");
        assert_eq!(supervisor.patience(), Some(Duration::from_millis(4)));
    }

    #[test]
    fn without_one_nothing_is_told_and_nobody_is_waited_for() {
        let mut supervisor = Supervisor::new(None, Some(Duration::from_millis(1)));
        supervisor.ready();
        supervisor.alive();
        assert_eq!(supervisor.patience(), None);
        assert!(Supervisor::new(Some("/nowhere/at/all"), None).socket.is_some(), "told in vain, not fatal");
        Supervisor::new(Some("/nowhere/at/all"), None).ready();
    }
}
