//! How long the gateway takes beside a client of this machine: `latency SBDPD GATEWAY ASSEMBLY [ROUNDS]`. Starts both
//! programs, and prints the median, the ninth decile and the slowest in milliseconds, local and through the gateway in
//! turns:
//!
//! - repeat: a plan that the daemon remembers, from request to end.
//! - cancel: from the wish to cancel to the end of the stream, with the plan so far.
//! - drop: from dropping the stream until the daemon works on nothing, as a client of this machine sees it.
//! - timeout: from the request's timeout to the end of its stream.
//! - deadline: from the deadline of a call to the end of its stream: negative, for the plan is to come before. Locally as
//!   `timeout`.

#![allow(clippy::print_stdout, reason = "it prints figures")]

use std::error::Error;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use sbdp::exchange::wire_assembly;
use sbdp_client::{Client, ConnectOptions, Event, Handle, PlanOptions, PlanStream, Planner};
use sbdp_gateway::proto::planner_service_client::PlannerServiceClient;
use sbdp_gateway::proto::{self, CancelRequest, PlanEvent, PlanRequest, plan_event};
use sbdp_ipc::endpoint::Endpoint;
use tonic::transport::{Channel, Endpoint as Address};
use tonic::{Request, Streaming};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Long enough that the search is under way, short enough for many rounds.
const UNDER_WAY: Duration = Duration::from_millis(150);

struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Both ways to the daemon.
struct Ways {
    local: Client,
    remote: PlannerServiceClient<Channel>,
    other: PlannerServiceClient<Channel>,
    handle: Handle,
    rounds: usize,
}

/// Milliseconds, locally and through the gateway.
#[derive(Default)]
struct Figures {
    local: Vec<f64>,
    remote: Vec<f64>,
}

impl Figures {
    fn show(mut self, name: &str) {
        for (way, times) in [("local", &mut self.local), ("gateway", &mut self.remote)] {
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
            println!("{name:9} {way:8} {:8.2} {:8.2} {:8.2}", at(0.5), at(0.9), at(1.0));
        }
    }
}

fn since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

fn local_end(mut stream: PlanStream) -> Outcome<()> {
    while let Some(event) = stream.next_event()? {
        if let Event::Done(_) = event {
            return Ok(());
        }
    }
    Err("no end".into())
}

async fn remote_end(mut events: Streaming<PlanEvent>) -> Outcome<()> {
    let mut ended = false;
    while let Some(event) = events.message().await? {
        ended = matches!(event.event, Some(plan_event::Event::End(_)));
    }
    if ended { Ok(()) } else { Err("no end".into()) }
}

impl Ways {
    /// A plan whose search does not end by itself.
    fn local_long(&self, timeout: Option<Duration>) -> Outcome<PlanStream> {
        let (planner, max_simulations) = (Planner::Rrt, Some(u64::MAX));
        let options =
            PlanOptions { planner, max_simulations, no_cache: true, timeout, ..PlanOptions::default() };
        Ok(self.local.plan(self.handle, &options)?)
    }

    fn request(&self) -> PlanRequest {
        PlanRequest { handle: self.handle.0.to_vec().into(), ..PlanRequest::default() }
    }

    fn long(&self) -> PlanRequest {
        let planner = proto::Planner::Rrt.into();
        PlanRequest { planner, max_simulations: Some(u64::MAX), no_cache: true, ..self.request() }
    }

    async fn plan(&mut self, request: PlanRequest) -> Outcome<Streaming<PlanEvent>> {
        Ok(self.remote.plan(request).await?.into_inner())
    }

    /// Waits until the daemon works on nothing.
    fn idle(&self) -> Outcome<()> {
        while self.local.status()?.numbers.running > 0 {
            std::thread::sleep(Duration::from_micros(200));
        }
        Ok(())
    }

    async fn repeat(&mut self) -> Outcome<Figures> {
        let mut figures = Figures::default();
        // The first is planned, and the gateway's first connects to the daemon.
        local_end(self.local.plan(self.handle, &PlanOptions::default())?)?;
        remote_end(self.plan(self.request()).await?).await?;
        for _ in 0..self.rounds * 20 {
            let start = Instant::now();
            local_end(self.local.plan(self.handle, &PlanOptions::default())?)?;
            figures.local.push(since(start));
            let start = Instant::now();
            remote_end(self.plan(self.request()).await?).await?;
            figures.remote.push(since(start));
        }
        Ok(figures)
    }

    async fn cancel(&mut self) -> Outcome<Figures> {
        let mut figures = Figures::default();
        for round in 0..self.rounds {
            let mut stream = self.local_long(None)?;
            std::thread::sleep(UNDER_WAY);
            let start = Instant::now();
            stream.cancel();
            local_end(stream)?;
            figures.local.push(since(start));
            let cancel_key = format!("latency {round}");
            let events = self.plan(PlanRequest { cancel_key: cancel_key.clone(), ..self.long() }).await?;
            tokio::time::sleep(UNDER_WAY).await;
            let start = Instant::now();
            self.other.cancel(CancelRequest { cancel_key }).await?;
            remote_end(events).await?;
            figures.remote.push(since(start));
        }
        Ok(figures)
    }

    async fn dropping(&mut self) -> Outcome<Figures> {
        let mut figures = Figures::default();
        for _ in 0..self.rounds {
            let stream = self.local_long(None)?;
            std::thread::sleep(UNDER_WAY);
            let start = Instant::now();
            drop(stream);
            self.idle()?;
            figures.local.push(since(start));
            let events = self.plan(self.long()).await?;
            tokio::time::sleep(UNDER_WAY).await;
            let start = Instant::now();
            drop(events);
            // The thread that sends the reset is another one; this one may block.
            self.idle()?;
            figures.remote.push(since(start));
        }
        Ok(figures)
    }

    async fn late(&mut self, of_call: bool) -> Outcome<Figures> {
        let mut figures = Figures::default();
        for _ in 0..self.rounds {
            let start = Instant::now() + UNDER_WAY;
            local_end(self.local_long(Some(UNDER_WAY))?)?;
            figures.local.push(since(start) - since_before(start));
            let start = Instant::now() + UNDER_WAY;
            let timeout_s = (!of_call).then(|| UNDER_WAY.as_secs_f64());
            let mut request = Request::new(PlanRequest { timeout_s, ..self.long() });
            if of_call {
                request.set_timeout(UNDER_WAY);
            }
            remote_end(self.remote.plan(request).await?.into_inner()).await?;
            figures.remote.push(since(start) - since_before(start));
        }
        Ok(figures)
    }
}

/// Milliseconds to a moment that is still to come.
fn since_before(moment: Instant) -> f64 {
    moment.saturating_duration_since(Instant::now()).as_secs_f64() * 1e3
}

fn start_daemon(program: &str, folder: &Path) -> Outcome<(Process, PathBuf)> {
    let runtime_dir = folder.join("run");
    let child = Command::new(program)
        .arg("--runtime-dir")
        .arg(&runtime_dir)
        .arg("--root")
        .arg(folder.join("iox"))
        .env("SBDP_CACHE_DIR", folder.join("cache"))
        .stderr(Stdio::null())
        .spawn()?;
    let mut process = Process(child);
    while Endpoint::find(&runtime_dir).is_err() {
        if process.0.try_wait()?.is_some() {
            return Err("the daemon ended at once".into());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok((process, runtime_dir))
}

fn start_gateway(program: &str, runtime_dir: &Path) -> Outcome<(Process, String)> {
    let mut child = Command::new(program)
        .args(["--listen", "127.0.0.1:0", "--runtime-dir"])
        .arg(runtime_dir)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let out = child.stdout.take().ok_or("no output")?;
    let process = Process(child);
    let mut line = String::new();
    BufReader::new(out).read_line(&mut line)?;
    Ok((process, line.trim().rsplit(' ').next().unwrap_or_default().to_owned()))
}

#[tokio::main]
async fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [sbdpd, gateway, assembly, rest @ ..] = &arguments[..] else {
        return Err("latency SBDPD GATEWAY ASSEMBLY [ROUNDS]".into());
    };
    let rounds = rest.first().map_or(Ok(50), |rounds| rounds.parse())?;
    let folder = tempfile::tempdir()?;
    let (_daemon, runtime_dir) = start_daemon(sbdpd, folder.path())?;
    let (_gateway, address) = start_gateway(gateway, &runtime_dir)?;
    let options = ConnectOptions { runtime_dir: Some(runtime_dir), ..ConnectOptions::default() };
    let local = Client::connect_with(options)?;
    let assembly = sbdp::files::load_assembly(Path::new(assembly))?;
    let handle = local.upload(&wire_assembly(&assembly))?;
    let channel = async || Address::from_shared(address.clone())?.connect().await;
    let (remote, other) =
        (PlannerServiceClient::new(channel().await?), PlannerServiceClient::new(channel().await?));
    let mut ways = Ways { local, remote, other, handle, rounds };
    println!("milliseconds           median      90 %  slowest");
    ways.repeat().await?.show("repeat");
    ways.cancel().await?.show("cancel");
    ways.dropping().await?.show("drop");
    ways.late(false).await?.show("timeout");
    ways.late(true).await?.show("deadline");
    Ok(())
}
