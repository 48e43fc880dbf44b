//! A program that is not trusted, run with limits.

use std::ffi::{OsStr, OsString};
use std::fs::DirBuilder;
use std::io::{self, Read};
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::budgets::{STEP_STDERR_BYTES, STEP_STDOUT_BYTES};

/// What a process may use.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub(super) deadline: Duration,
    /// Of data (heap and private mappings), per process.
    pub(super) memory_bytes: u64,
    /// Of each file that it writes.
    pub(super) file_bytes: u64,
}

/// How a process ended by itself.
#[derive(Debug)]
pub(super) struct Finished {
    pub(super) stdout: Vec<u8>,
    /// The last line of stderr that is not empty.
    pub(super) complaint: String,
    /// 0 if all is well.
    pub(super) code: Option<i32>,
    pub(super) signal: Option<i32>,
}

/// Why a process did not end by itself.
#[derive(Debug)]
pub(super) enum Stopped {
    /// It could not be started.
    NotStarted(io::Error),
    /// The deadline passed.
    Late,
    /// It wrote more than it may to this stream.
    Flooded(&'static str),
}

/// Sets the limits, then becomes the program. A shell does it, as limits cannot be set between fork and exec without
/// unsafe code. The process in the background waits until sbdp's end of the pipe is closed, by whatever death, and then
/// kills all of the group. Arguments: blocks of 512 bytes per file, kB of data, the program and its arguments.
const LIMITED: &str = r#"
ulimit -c 0
ulimit -f "$1" && ulimit -d "$2" || exit 126
shift 2
exec 3<&0 </dev/null
(exec >/dev/null 2>&1; read -r _ <&3; kill -9 0) &
exec 3<&-
exec "$@"
"#;

/// Runs a program in a folder, which is also its folder for temporary files. When it has ended or was stopped, all
/// processes of its group are killed; one that left the group (a daemon of its own) is not found.
pub(super) fn run(
    program: &Path,
    arguments: &[OsString],
    folder: &Path,
    limits: &Limits,
) -> Result<Finished, Stopped> {
    let until = Instant::now() + limits.deadline;
    let mut group = Group::start(program, arguments, folder, limits).map_err(Stopped::NotStarted)?;
    let (sender, receiver) = channel();
    group.read(sender);
    let mut streams = Streams::default();
    let status = loop {
        if let Some(status) = group.child.try_wait().map_err(Stopped::NotStarted)? {
            break status;
        }
        // A converter takes a tenth of a second at least.
        let pause = Duration::from_millis(5).min(until.saturating_duration_since(Instant::now()));
        streams.receive(&receiver, pause)?;
        if Instant::now() >= until {
            return Err(Stopped::Late);
        }
    };
    group.kill();
    // A process that left the group may hold the streams open for ever.
    let patience = Instant::now() + Duration::from_secs(1);
    while streams.open > 0 && Instant::now() < patience {
        streams.receive(&receiver, Duration::from_millis(20))?;
    }
    Ok(Finished::new(streams, status))
}

/// A process and its children.
pub(super) struct Group {
    pub(super) child: Child,
}

impl Group {
    pub(super) fn start(
        program: &Path,
        arguments: &[OsString],
        folder: &Path,
        limits: &Limits,
    ) -> io::Result<Self> {
        let child = Command::new("/bin/sh")
            .args(["-c", LIMITED, "sbdp-converter"])
            .arg((limits.file_bytes / 512).to_string())
            .arg((limits.memory_bytes / 1024).to_string())
            .arg(OsStr::new(program))
            .args(arguments)
            .current_dir(folder)
            .env("TMPDIR", folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .spawn()?;
        Ok(Self { child })
    }

    /// Has threads read both streams, so that a full pipe never stops the process.
    fn read(&mut self, sender: Sender<Chunk>) {
        if let Some(stdout) = self.child.stdout.take() {
            let sender = sender.clone();
            thread::spawn(move || forward(stdout, Stream::Out, &sender));
        }
        if let Some(stderr) = self.child.stderr.take() {
            thread::spawn(move || forward(stderr, Stream::Error, &sender));
        }
    }

    fn kill(&self) {
        if let Some(group) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw) {
            // All are gone if it fails.
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.kill();
        // Killed: it is only taken note of.
        let _ = self.child.wait();
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    Out,
    Error,
}

/// Bytes of a stream; none at its end.
type Chunk = (Stream, Vec<u8>);

fn forward(mut stream: impl Read, which: Stream, sender: &Sender<Chunk>) {
    let mut buffer = vec![0; 1 << 16];
    loop {
        let read = match stream.read(&mut buffer) {
            Ok(read) => read,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => 0,
        };
        if sender.send((which, buffer[..read].to_vec())).is_err() || read == 0 {
            return;
        }
    }
}

/// What came of the two streams.
#[derive(Debug)]
struct Streams {
    out: Vec<u8>,
    /// The end of it.
    error: Vec<u8>,
    error_bytes: u64,
    open: u32,
}

impl Default for Streams {
    fn default() -> Self {
        Self { out: Vec::new(), error: Vec::new(), error_bytes: 0, open: 2 }
    }
}

/// Bytes of stderr that are kept: a line is not longer.
const KEPT: usize = 8192;

impl Streams {
    /// Takes what comes within the time.
    fn receive(&mut self, receiver: &Receiver<Chunk>, pause: Duration) -> Result<(), Stopped> {
        match receiver.recv_timeout(pause) {
            Ok((_, bytes)) if bytes.is_empty() => self.open = self.open.saturating_sub(1),
            Ok((Stream::Out, bytes)) => {
                self.out.extend(bytes);
                if self.out.len() as u64 > STEP_STDOUT_BYTES {
                    return Err(Stopped::Flooded("stdout"));
                }
            }
            Ok((Stream::Error, bytes)) => {
                self.error_bytes += bytes.len() as u64;
                self.error.extend(bytes);
                let surplus = self.error.len().saturating_sub(KEPT);
                self.error.drain(..surplus);
                if self.error_bytes > STEP_STDERR_BYTES {
                    return Err(Stopped::Flooded("stderr"));
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                self.open = 0;
                // Both streams are closed, and the process is still there.
                thread::sleep(pause);
            }
        }
        Ok(())
    }
}

impl Finished {
    fn new(streams: Streams, status: ExitStatus) -> Self {
        let error = String::from_utf8_lossy(&streams.error);
        let last = error.lines().map(str::trim).rfind(|line| !line.is_empty());
        Self {
            stdout: streams.out,
            complaint: last.unwrap_or_default().to_owned(),
            code: status.code(),
            signal: status.signal(),
        }
    }
}

/// A new folder that only this user may enter, removed with all that is in it.
#[derive(Debug)]
pub(super) struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    pub(super) fn new() -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = COUNT.fetch_add(1, Ordering::Relaxed);
            let name = format!("sbdp-step-{}-{number}", std::process::id());
            let path = std::env::temp_dir().join(name);
            match DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(Self(path)),
                // Left by a process of the same number that was killed.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // What cannot be removed now is removed with the system's temporary files.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
