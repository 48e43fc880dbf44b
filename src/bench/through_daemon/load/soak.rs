//! `sbdp bench soak`: clients and the daemon are killed at random moments, over and over; in the end every
//! client must have got the answers that it gets undisturbed, and nothing may be left behind.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use sbdp_ipc::endpoint::default_prefix;
use sbdp_ipc::layout::shared_memory_files;
use serde::Serialize;

use super::super::BenchError;
use super::super::server::{Place, Server};
use super::client::Role;
use super::figures::{ClientFigures, DaemonFigures, Phase};
use super::mix::Mix;
use super::{LoadRequest, Process, Said, Start, expect_ready};

/// What to do.
#[derive(Debug, Clone)]
pub struct SoakRequest {
    /// The load; its requests are those of each client after the last kill.
    pub load: LoadRequest,
    /// Clients to be killed.
    pub client_kills: u32,
    /// Daemons to be killed.
    pub daemon_kills: u32,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Soak {
    /// Clients killed.
    pub client_kills: u32,
    /// Daemons killed.
    pub daemon_kills: u32,
    /// The longest time from the death of a daemon until the next one was ready, milliseconds.
    pub slowest_restart_ms: f64,
    /// Clients that gave up by themselves: there may be none.
    pub clients_failed: u32,
    /// Answers of clients that lived to their end, and of those that were left to end after the last kill.
    #[serde(flatten)]
    pub phase: Phase,
    /// Questions whose plan differed from the undisturbed one: there may be none.
    pub differing_from_undisturbed: u64,
    /// Questions that were compared.
    pub compared: u64,
    /// Files in shared memory after the clean stop: there may be none.
    pub left_in_shared_memory: Vec<PathBuf>,
    /// Files in iceoryx2's folder after it: there may be none.
    pub left_in_root: Vec<PathBuf>,
}

/// The longest pause between two kills.
const PAUSE_MS: u64 = 250;

/// Kills and looks what becomes of it.
///
/// # Errors
/// A process cannot be started.
pub fn soak(request: &SoakRequest) -> Result<Soak, BenchError> {
    let undisturbed = {
        let daemon = Server::daemon(Place::new("calm")?)?;
        run_to_the_end(&Start::new(&request.load, &daemon)?)?
    };
    let mut daemon = Server::daemon(Place::new("soak")?)?;
    let start = Start::new(&request.load, &daemon)?;
    let mut random = Mix::new(request.load.seed, 1);
    let began = Instant::now();
    let mut killing = Killing::begin(&start)?;
    let (mut clients, mut daemons, mut slowest) = (0, 0, Duration::ZERO);
    while clients < request.client_kills || daemons < request.daemon_kills {
        std::thread::sleep(Duration::from_millis(random.random() % PAUSE_MS));
        let left = [request.client_kills - clients, request.daemon_kills - daemons].map(u64::from);
        if random.random() % (left[0] + left[1]) < left[0] {
            let victim = (random.random() % request.load.clients as u64) as usize;
            killing.kill_client(victim)?;
            clients += 1;
        } else {
            let died = Instant::now();
            daemon.kill_and_restart()?;
            slowest = slowest.max(died.elapsed());
            daemons += 1;
        }
        killing.look()?;
    }
    let Killing { failed, mut figures, clients: victims, .. } = killing;
    // Those that are alive would keep the daemon from clearing up.
    drop(victims);
    figures.merge(run_to_the_end(&start)?);
    let wall_s = began.elapsed().as_secs_f64();
    let (compared, differing) = figures.compare(&undisturbed);
    drop(start);
    daemon.end();
    Ok(Soak {
        client_kills: clients,
        daemon_kills: daemons,
        slowest_restart_ms: slowest.as_secs_f64() * 1e3,
        clients_failed: failed,
        phase: Phase::of(figures, 0, wall_s, DaemonFigures::default()),
        differing_from_undisturbed: differing,
        compared,
        left_in_shared_memory: shared_memory_files(&default_prefix(&daemon.runtime_dir()))
            .map_err(BenchError::failed)?,
        left_in_root: files_below(&daemon.place().root()),
    })
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// All clients, with nobody killed.
fn run_to_the_end(start: &Start<'_>) -> Result<ClientFigures, BenchError> {
    let (sender, said) = mpsc::channel();
    let ended = Arc::new(AtomicU64::new(0));
    let mut clients = Vec::new();
    for number in 0..start.request.clients {
        clients.push(start.process(Role::Asking, start.request.requests, number as u64, &sender, &ended)?);
    }
    for _ in &clients {
        expect_ready(said.recv().ok(), "a client")?;
    }
    clients.iter_mut().for_each(|c| c.say("go"));
    let mut figures = ClientFigures::default();
    for _ in 0..clients.len() {
        match said.recv() {
            Ok(Said::Figures(theirs)) => figures.merge(*theirs),
            _ => return Err(BenchError::Failed("a client ended without its figures".to_owned())),
        }
    }
    clients.iter_mut().for_each(|c| c.say("leave"));
    Ok(figures)
}

/// Clients that are killed, and replaced.
struct Killing<'s> {
    start: &'s Start<'s>,
    clients: Vec<Victim>,
    ended: Arc<AtomicU64>,
    failed: u32,
    figures: ClientFigures,
}

struct Victim {
    process: Process,
    said: mpsc::Receiver<Said>,
}

impl<'s> Killing<'s> {
    fn begin(start: &'s Start<'s>) -> Result<Self, BenchError> {
        let ended = Arc::new(AtomicU64::new(0));
        let mut this =
            Self { start, clients: Vec::new(), ended, failed: 0, figures: ClientFigures::default() };
        for number in 0..start.request.clients {
            let victim = this.client(number)?;
            this.clients.push(victim);
        }
        Ok(this)
    }

    fn client(&self, number: usize) -> Result<Victim, BenchError> {
        let (sender, said) = mpsc::channel();
        let requests = self.start.request.requests;
        let mut process = self.start.process(Role::Asking, requests, number as u64, &sender, &self.ended)?;
        // It begins as soon as it can, whether anybody lives to see it or not.
        process.say("go");
        Ok(Victim { process, said })
    }

    fn kill_client(&mut self, number: usize) -> Result<(), BenchError> {
        // Dropping a process kills it.
        let replacement = self.client(number)?;
        self.clients[number] = replacement;
        Ok(())
    }

    /// Takes the figures of clients that have ended, and lets others take their places.
    fn look(&mut self) -> Result<(), BenchError> {
        for number in 0..self.clients.len() {
            while let Ok(said) = self.clients[number].said.try_recv() {
                match said {
                    Said::Ready => continue,
                    Said::Figures(theirs) => self.figures.merge(*theirs),
                    Said::Nothing => self.failed += 1,
                }
                self.clients[number].process.say("leave");
                let replacement = self.client(number)?;
                self.clients[number] = replacement;
                break;
            }
        }
        Ok(())
    }
}
