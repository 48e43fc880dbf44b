//! Serves the metrics on a Unix socket, for Prometheus: a connection gets the text of the last tick.

use std::io::{Read, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The time that a connection has for its request, and for reading the response. Other connections wait.
const PATIENCE: Duration = Duration::from_secs(1);

/// The socket and the text that it serves. The socket's file is removed when this is dropped.
#[derive(Debug)]
pub(crate) struct MetricsSocket {
    text: Arc<Mutex<String>>,
    path: PathBuf,
}

impl MetricsSocket {
    /// Opens the socket, in place of one that a dead daemon left.
    pub(crate) fn serve(path: &Path) -> std::io::Result<Self> {
        // Only a socket is ever removed; the lock keeps a living daemon's from us.
        if std::fs::symlink_metadata(path).is_ok_and(|m| m.file_type().is_socket()) {
            std::fs::remove_file(path)?;
        }
        let listener = UnixListener::bind(path)?;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600))?;
        let text = Arc::new(Mutex::new(String::new()));
        let shared = Arc::clone(&text);
        let answer = move || {
            for stream in listener.incoming() {
                let text = shared.lock().unwrap_or_else(PoisonError::into_inner).clone();
                let served = stream.and_then(|stream| respond(stream, &text));
                if let Err(error) = served {
                    tracing::debug!(%error, "metrics not served");
                    // Never spin when there are no descriptors left.
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
        };
        std::thread::Builder::new().name("sbdp-metrics".to_owned()).spawn(answer)?;
        Ok(Self { text, path: path.to_owned() })
    }

    pub(crate) fn update(&self, text: String) {
        *self.text.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }
}

impl Drop for MetricsSocket {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Answers any HTTP request with the text.
fn respond(mut stream: UnixStream, text: &str) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let (mut request, mut piece) = (Vec::new(), [0; 512]);
    while !request.windows(4).any(|w| w == b"\r\n\r\n") && request.len() < 8192 {
        match stream.read(&mut piece)? {
            0 => break,
            n => request.extend_from_slice(&piece[..n]),
        }
    }
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4\r\nConnection: close\r\n";
    write!(stream, "{head}Content-Length: {}\r\n\r\n{text}", text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_asks_gets_the_newest_text_and_others_are_not_kept_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics");
        let metrics = MetricsSocket::serve(&path).unwrap();
        metrics.update("sbdp_up 1\n".to_owned());
        let _silent = UnixStream::connect(&path).unwrap();
        let mut asking = UnixStream::connect(&path).unwrap();
        asking.write_all(b"GET /metrics HTTP/1.1\r\n\r\n").unwrap();
        let mut answer = String::new();
        asking.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with("\r\n\r\nsbdp_up 1\n"), "{answer}");
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        drop(metrics);
        assert!(!path.exists());
        std::fs::write(&path, "not a socket").unwrap();
        assert!(MetricsSocket::serve(&path).is_err() && path.exists(), "what is no socket is left alone");
    }
}
