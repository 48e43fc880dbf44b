//! A daemon of a benchmark's own: its place, its shared memory, its cache.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use sbdp_client::{Client, ConnectOptions};
use sbdp_ipc::endpoint::{Endpoint, default_prefix};
use sbdp_ipc::layout::shared_memory_files;

use super::BenchError;

/// A process that does not become ready within this will never.
const READY: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(2);

/// A folder that goes with whoever made it.
#[derive(Debug)]
pub(super) struct Place {
    folder: PathBuf,
}

impl Place {
    pub(super) fn new(name: &str) -> Result<Self, BenchError> {
        let folder = std::env::temp_dir().join(format!("sbdp-{}-{name}", std::process::id()));
        std::fs::create_dir(&folder).map_err(|e| BenchError::file(&folder, &e))?;
        Ok(Self { folder })
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    pub(super) fn runtime_dir(&self) -> PathBuf {
        self.folder.join("run")
    }

    pub(super) fn cache(&self) -> PathBuf {
        self.folder.join("cache")
    }

    pub(super) fn root(&self) -> PathBuf {
        self.folder.join("iox")
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
        for file in shared_memory_files(&default_prefix(&self.runtime_dir())).unwrap_or_default() {
            let _ = std::fs::remove_file(file);
        }
    }
}

/// A process at a place, ended when it is dropped.
#[derive(Debug)]
pub(super) struct Server {
    child: Child,
    command: Command,
    place: Place,
}

impl Server {
    /// Starts `sbdpd`, which lies beside this program.
    pub(super) fn daemon(place: Place) -> Result<Self, BenchError> {
        Self::daemon_with(place, "")
    }

    /// The same with a configuration.
    pub(super) fn daemon_with(place: Place, config: &str) -> Result<Self, BenchError> {
        let program = std::env::current_exe().map_err(BenchError::failed)?;
        let file = place.folder().join("config.toml");
        std::fs::write(&file, config).map_err(|e| BenchError::file(&file, &e))?;
        let mut command = Command::new(program.with_file_name("sbdpd"));
        command.arg("--config").arg(file);
        command.arg("--runtime-dir").arg(place.runtime_dir()).arg("--root").arg(place.root());
        command.env("SBDP_CACHE_DIR", place.cache()).env("SBDP_LOG", "warn");
        Self::start(place, command)
    }

    /// Starts a process that publishes itself at the place as a daemon does.
    pub(super) fn start(place: Place, mut command: Command) -> Result<Self, BenchError> {
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let child = spawned(&mut command)?;
        let mut server = Self { child, command, place };
        server.wait_until_ready()?;
        Ok(server)
    }

    /// Ends the process and starts another in its place.
    pub(super) fn restart(&mut self) -> Result<(), BenchError> {
        self.end();
        self.child = spawned(&mut self.command)?;
        self.wait_until_ready()
    }

    fn wait_until_ready(&mut self) -> Result<(), BenchError> {
        let program = PathBuf::from(self.command.get_program());
        let started = Instant::now();
        while Endpoint::find(&self.place.runtime_dir()).map(|e| e.pid).ok() != Some(self.child.id()) {
            let ended = self.child.try_wait().map_err(|e: io::Error| BenchError::file(&program, &e))?;
            if ended.is_some() || started.elapsed() > READY {
                return Err(BenchError::Failed(format!("{} does not become ready", program.display())));
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// SIGKILL, and another daemon at the same place.
    pub(super) fn kill_and_restart(&mut self) -> Result<(), BenchError> {
        self.child.kill().and_then(|()| self.child.wait()).map_err(BenchError::failed)?;
        self.child = spawned(&mut self.command)?;
        self.wait_until_ready()
    }

    /// A clean end; what it leaves behind can be looked at until the server is dropped.
    pub(super) fn end(&mut self) {
        if !matches!(self.child.try_wait(), Ok(None)) {
            // Its number may be another's by now.
            return;
        }
        let pid = rustix::process::Pid::from_child(&self.child);
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        let started = Instant::now();
        while let Ok(None) = self.child.try_wait() {
            if started.elapsed() > READY {
                let _ = self.child.kill();
            }
            std::thread::sleep(LOOK);
        }
    }

    pub(super) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(super) fn place(&self) -> &Place {
        &self.place
    }

    pub(super) fn connect(&self) -> Result<Client, BenchError> {
        let options =
            ConnectOptions { runtime_dir: Some(self.place.runtime_dir()), ..ConnectOptions::default() };
        Client::connect_with(options).map_err(BenchError::failed)
    }

    pub(super) fn runtime_dir(&self) -> PathBuf {
        self.place.runtime_dir()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

fn spawned(command: &mut Command) -> Result<Child, BenchError> {
    command.spawn().map_err(|e| BenchError::file(Path::new(command.get_program()), &e))
}
