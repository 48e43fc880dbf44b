//! `sbdp bench load`: many clients, each a process of its own, ask the daemon for all kinds of things at
//! once; nothing may be lost, and the daemon may not grow. With disturbers beside them, the others are
//! to feel little of it.

mod client;
mod figures;
mod footprint;
mod mix;
mod soak;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sbdp_client::{Client, ConnectOptions};
use serde::Serialize;

pub use client::{LoadClient, Role, load_client};
pub use figures::{DaemonFigures, KindFigures, Phase, ProcessFootprint};
pub use mix::Kind;
pub use soak::{Soak, SoakRequest, soak};

use super::BenchError;
use super::server::{Place, Server};
use figures::ClientFigures;
use footprint::Watch;
pub(super) use footprint::footprint;

/// What to do.
#[derive(Debug, Clone)]
pub struct LoadRequest {
    /// Arguments that name the assembly to a client's process; none for the default one.
    pub assembly: Option<PathBuf>,
    /// Clients.
    pub clients: usize,
    /// Requests of all of them together.
    pub requests: usize,
    /// Different questions of each kind.
    pub variety: u64,
    /// Which questions.
    pub seed: u64,
    /// Do it all once more beside clients that are stopped, flood, and never read.
    pub disturb: bool,
    /// Of a running daemon; without it one is started, and ended afterwards.
    pub runtime_dir: Option<PathBuf>,
    /// This very program.
    pub program: PathBuf,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Load {
    /// Clients.
    pub clients: usize,
    /// Requests that were asked for.
    pub requests: usize,
    /// Different questions of each kind.
    pub variety: u64,
    /// Without disturbers.
    #[serde(flatten)]
    pub calm: Phase,
    /// The same beside disturbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disturbed: Option<Phase>,
    /// By kind, p99 beside disturbers over p99 without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p99_ratio: Option<BTreeMap<Kind, f64>>,
}

/// How often the daemon is looked at.
const LOOK: Duration = Duration::from_millis(20);
/// So many requests of one that floods come before the others begin.
const FLOODED: u64 = 100;

/// Puts the daemon under load.
///
/// # Errors
/// A process cannot be started, or the daemon cannot be reached.
pub fn load(request: &LoadRequest) -> Result<Load, BenchError> {
    let own = match request.runtime_dir {
        Some(_) => None,
        None => Some(Server::daemon(Place::new("load")?)?),
    };
    let runtime_dir = match (&own, &request.runtime_dir) {
        (Some(server), _) => server.runtime_dir(),
        (None, Some(folder)) => folder.clone(),
        (None, None) => sbdp_ipc::endpoint::default_runtime_dir(),
    };
    let start = Start::at(request, &runtime_dir)?;
    let calm = start.phase(&[])?;
    let disturbed = request.disturb.then(|| start.phase(&[Role::Stopped, Role::Flooding, Role::Deaf]));
    let disturbed = disturbed.transpose()?;
    let p99_ratio = disturbed.as_ref().map(|disturbed| {
        let ratio = |(kind, with): (&Kind, &KindFigures)| {
            let without = calm.kinds.get(kind).filter(|k| k.p99_us > 0.0)?;
            Some((*kind, with.p99_us / without.p99_us))
        };
        disturbed.kinds.iter().filter_map(ratio).collect()
    });
    Ok(Load {
        clients: request.clients,
        requests: request.requests,
        variety: request.variety,
        calm,
        disturbed,
        p99_ratio,
    })
}

/// A process that talks in lines; killed, by its id, when it is dropped.
struct Process {
    child: Child,
    reader: Option<JoinHandle<()>>,
}

impl Process {
    fn say(&mut self, line: &str) {
        if let Some(input) = &mut self.child.stdin {
            // One that is gone is missed by what it does not say.
            let _ = writeln!(input, "{line}").and_then(|()| input.flush());
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

/// What processes say.
enum Said {
    Ready,
    Figures(Box<ClientFigures>),
    /// The process ended.
    Nothing,
}

struct Start<'r> {
    request: &'r LoadRequest,
    runtime_dir: PathBuf,
    pid: u32,
    observer: Client,
}

impl<'r> Start<'r> {
    fn new(request: &'r LoadRequest, server: &Server) -> Result<Self, BenchError> {
        Self::at(request, &server.runtime_dir())
    }

    fn at(request: &'r LoadRequest, runtime_dir: &Path) -> Result<Self, BenchError> {
        let runtime_dir = runtime_dir.to_owned();
        let options = ConnectOptions { runtime_dir: Some(runtime_dir.clone()), ..ConnectOptions::default() };
        let observer = Client::connect_with(options).map_err(BenchError::failed)?;
        Ok(Self { request, runtime_dir, pid: observer.pid(), observer })
    }

    /// All clients at the same time, beside disturbers.
    fn phase(&self, disturbers: &[Role]) -> Result<Phase, BenchError> {
        let ended = Arc::new(AtomicU64::new(0));
        let plans =
            || Ok::<_, BenchError>(self.observer.status().map_err(BenchError::failed)?.numbers.requests);
        let before = plans()?;
        let (disturbing, disturber_said) = mpsc::channel();
        let mut around = Vec::new();
        for &role in disturbers {
            around.push((role, self.process(role, 0, 0, &disturbing, &ended)?));
            expect_ready(disturber_said.recv().ok(), "a disturber")?;
        }
        if disturbers.contains(&Role::Flooding) {
            // Else a short phase may be over before the flood has begun.
            while plans()? < before + FLOODED {
                match disturber_said.recv_timeout(LOOK) {
                    Err(mpsc::RecvTimeoutError::Timeout) => {}
                    _ => return Err(BenchError::Failed("a disturber ended".to_owned())),
                }
            }
        }
        let (sender, said) = mpsc::channel();
        let mut clients = Vec::new();
        for number in 0..self.request.clients {
            let share = share(self.request.requests, self.request.clients, number);
            let seed = self.request.seed.wrapping_add(number as u64);
            clients.push(self.process(Role::Asking, share, seed, &sender, &ended)?);
        }
        for _ in &clients {
            expect_ready(said.recv().ok(), "a client")?;
        }
        for (role, process) in &around {
            if *role == Role::Stopped {
                let pid = rustix::process::Pid::from_child(&process.child);
                rustix::process::kill_process(pid, rustix::process::Signal::STOP)
                    .map_err(BenchError::failed)?;
            }
        }
        let started = Instant::now();
        clients.iter_mut().for_each(|c| c.say("go"));
        let mut watch = Watch::new(self.pid);
        let mut figures = ClientFigures::default();
        let mut left = clients.len();
        while left > 0 {
            match said.recv_timeout(LOOK) {
                Ok(Said::Figures(theirs)) => {
                    figures.merge(*theirs);
                    left -= 1;
                }
                Ok(Said::Ready) | Err(mpsc::RecvTimeoutError::Timeout) => {}
                Ok(Said::Nothing) | Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return Err(BenchError::Failed("a client ended without its figures".to_owned()));
                }
            }
            watch.look(ended.load(Ordering::Relaxed));
        }
        let wall_s = started.elapsed().as_secs_f64();
        let received = plans()?.saturating_sub(before);
        watch.look(ended.load(Ordering::Relaxed));
        clients.iter_mut().for_each(|c| c.say("leave"));
        Ok(Phase::of(figures, received, wall_s, watch.figures()))
    }

    fn process(
        &self,
        role: Role,
        requests: usize,
        seed: u64,
        sender: &Sender<Said>,
        ended: &Arc<AtomicU64>,
    ) -> Result<Process, BenchError> {
        let mut command = Command::new(&self.request.program);
        command.args(["bench", "load-client", "--role", role.name(), "--runtime-dir"]).arg(&self.runtime_dir);
        command.args(["--requests", &requests.to_string(), "--seed", &seed.to_string()]);
        command.args(["--variety", &self.request.variety.to_string()]);
        if let Some(assembly) = &self.request.assembly {
            command.arg("--assembly").arg(assembly);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| BenchError::file(&self.request.program, &e))?;
        let output = child.stdout.take();
        let (sender, ended) = (sender.clone(), Arc::clone(ended));
        let read = move || {
            for line in output.into_iter().flat_map(|o| BufReader::new(o).lines()).map_while(Result::ok) {
                if let Some(count) = line.strip_prefix("done ") {
                    ended.fetch_add(count.parse().unwrap_or(0), Ordering::Relaxed);
                } else if line == "ready" {
                    let _ = sender.send(Said::Ready);
                } else if let Ok(figures) = serde_json::from_str(&line) {
                    let _ = sender.send(Said::Figures(Box::new(figures)));
                    return;
                }
            }
            let _ = sender.send(Said::Nothing);
        };
        Ok(Process { child, reader: Some(std::thread::spawn(read)) })
    }
}

fn expect_ready(said: Option<Said>, who: &str) -> Result<(), BenchError> {
    match said {
        Some(Said::Ready) => Ok(()),
        _ => Err(BenchError::Failed(format!("{who} ended before it was ready"))),
    }
}

/// How many of all requests the client of this number has.
fn share(requests: usize, clients: usize, number: usize) -> usize {
    requests / clients + usize::from(number < requests % clients)
}

impl Role {
    /// As on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Asking => "asking",
            Self::Stopped => "stopped",
            Self::Flooding => "flooding",
            Self::Deaf => "deaf",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn the_clients_requests_are_all_requests() {
        assert_eq!((0..7).map(|number| share(20_003, 7, number)).sum::<usize>(), 20_003);
    }
}
