//! `sbdp bench latency`: the same plan asked again and again through the daemon, beside the same
//! number of bytes through a peer that only copies them.

use std::path::Path;
use std::process::Command;
use std::sync::Barrier;
use std::time::{Duration, Instant};

use sbdp_client::{Client, Handle, PlanOptions, Summary};
use sbdp_ipc::plan::PlanRequest;
use serde::Serialize;

use super::BenchError;
use super::asking::summary;
use super::raw_peer::RawClient;
use super::server::{Place, Server};
use crate::exchange::wire_assembly;
use crate::geometry::SourceAssembly;

/// What to measure.
#[derive(Debug, Clone)]
pub struct LatencyRequest {
    /// The assembly that is planned.
    pub assembly: SourceAssembly,
    /// How many clients ask at the same time.
    pub clients: usize,
    /// How often each asks.
    pub rounds: usize,
    /// This very program, for the raw peer.
    pub program: std::path::PathBuf,
}

/// Median and 99th percentile of some times, in microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Latency {
    /// Clients at the same time.
    pub clients: usize,
    /// Rounds of each.
    pub rounds: usize,
    /// Bytes of an answer.
    pub payload_bytes: usize,
    /// The first answer, which was planned.
    pub first_plan_us: f64,
    /// A request to the raw peer and its answer.
    pub raw_event_rtt_us: Percentiles,
    /// A plan that was made before.
    pub repeat_plan_us: Percentiles,
    /// Of the former, those that came after the other peer's turn, when processes and processors had slept.
    pub raw_after_pause_us: Percentiles,
    /// The same of the latter.
    pub plan_after_pause_us: Percentiles,
}

/// Rounds before the measurement.
const WARM_UP: usize = ALTERNATION;
/// So many rounds all clients ask the one peer, then as many the other. Were each to change over by itself,
/// nearly all would wait at the slower one, and the faster would be measured with hardly any client. So many
/// that what it takes to wake a peer from its pause, which is told apart, is not the 99th percentile of both.
const ALTERNATION: usize = 250;

/// Measures, with raw and planned rounds in turn.
///
/// # Errors
/// A process cannot be started, or does not answer.
pub fn latency(request: &LatencyRequest) -> Result<Latency, BenchError> {
    let daemon = Server::daemon(Place::new("daemon")?)?;
    let client = daemon.connect()?;
    let assembly = wire_assembly(&request.assembly);
    let handle = client.upload(&assembly).map_err(BenchError::failed)?;
    let started = Instant::now();
    ask(&client, handle)?;
    let first_plan_us = micros(started.elapsed());
    if ask(&client, handle)?.stats.plan_hit == 0 {
        return Err(BenchError::Failed("the plan is not remembered: it ended by the clock".to_owned()));
    }
    let question = question(handle);
    let chunks = RawClient::connect(&daemon.runtime_dir())?.chunks(&question)?;
    let peer = raw_peer(&request.program, &chunks)?;
    let (raw, repeated) = rounds(request, &daemon, &peer, handle, &chunks)?;
    Ok(Latency {
        clients: request.clients,
        rounds: request.rounds,
        payload_bytes: chunks.iter().sum(),
        first_plan_us,
        raw_after_pause_us: percentiles(first_of_each_turn(&raw)),
        plan_after_pause_us: percentiles(first_of_each_turn(&repeated)),
        raw_event_rtt_us: percentiles(raw.concat()),
        repeat_plan_us: percentiles(repeated.concat()),
    })
}

fn raw_peer(program: &Path, chunks: &[usize]) -> Result<Server, BenchError> {
    let place = Place::new("raw")?;
    let mut command = Command::new(program);
    command.args(["bench", "raw-peer", "--runtime-dir"]).arg(place.runtime_dir());
    command.arg("--root").arg(place.root()).arg("--chunks");
    command.arg(chunks.iter().map(ToString::to_string).collect::<Vec<_>>().join(","));
    Server::start(place, command)
}

/// Times of the rounds of each turn of each client: with the raw peer, and of plans.
type Times = (Vec<Vec<Duration>>, Vec<Vec<Duration>>);

fn first_of_each_turn(turns: &[Vec<Duration>]) -> Vec<Duration> {
    turns.iter().filter_map(|turn| turn.first().copied()).collect()
}

/// All clients at the same time; the times of all rounds.
fn rounds(
    request: &LatencyRequest,
    daemon: &Server,
    peer: &Server,
    handle: Handle,
    chunks: &[usize],
) -> Result<Times, BenchError> {
    let barrier = &Barrier::new(request.clients);
    let work = || {
        let mut asking = Asking::connected(daemon, peer, handle, chunks);
        let mut times = Times::default();
        let (mut done, all) = (0, WARM_UP + request.rounds);
        while done < all {
            let count = ALTERNATION.min(all - done);
            let measured = done >= WARM_UP;
            // Whoever has failed must not keep the others waiting.
            for (ask, times) in [(Asking::raw as Ask<'_>, &mut times.0), (Asking::plan, &mut times.1)] {
                barrier.wait();
                let took = asking.as_ref().map(|asking| (0..count).map(|_| ask(asking)).collect());
                match took {
                    Ok(Ok(took)) if measured => times.push(took),
                    Ok(Err(error)) => asking = Err(error),
                    _ => {}
                }
            }
            done += count;
        }
        asking.map(|_| times)
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..request.clients).map(|_| scope.spawn(work)).collect();
        let mut all = Times::default();
        for thread in threads {
            let times = thread.join().map_err(|_| BenchError::Failed("a client panicked".to_owned()))??;
            all.0.extend(times.0);
            all.1.extend(times.1);
        }
        Ok(all)
    })
}

/// One question of a client, and how long its answer took.
type Ask<'a> = fn(&Asking<'a>) -> Result<Duration, BenchError>;

/// A client of both.
struct Asking<'a> {
    client: Client,
    raw: RawClient,
    handle: Handle,
    question: Vec<u8>,
    chunks: &'a [usize],
}

impl<'a> Asking<'a> {
    fn connected(
        daemon: &Server,
        peer: &Server,
        handle: Handle,
        chunks: &'a [usize],
    ) -> Result<Self, BenchError> {
        let (client, raw) = (daemon.connect()?, RawClient::connect(&peer.runtime_dir())?);
        Ok(Self { client, raw, handle, question: question(handle), chunks })
    }

    fn raw(&self) -> Result<Duration, BenchError> {
        let length = self.chunks.iter().sum::<usize>();
        match self.raw.round(&self.question, self.chunks.len())? {
            (took, came) if came == length => Ok(took),
            (_, came) => Err(BenchError::Failed(format!("{came} bytes came, not {length}"))),
        }
    }

    fn plan(&self) -> Result<Duration, BenchError> {
        let started = Instant::now();
        let summary = ask(&self.client, self.handle)?;
        let took = started.elapsed();
        if summary.stats.plan_hit == 0 {
            return Err(BenchError::Failed("a plan was made that was made before".to_owned()));
        }
        Ok(took)
    }
}

/// The request of a plan with all options as they are by default.
fn question(handle: Handle) -> Vec<u8> {
    let PlanOptions { planner, engine, actions, .. } = PlanOptions::default();
    PlanRequest {
        handle: handle.0,
        planner: planner as u32,
        engine: engine as u32,
        actions: actions as u32,
        ..PlanRequest::default()
    }
    .encode()
}

fn ask(client: &Client, handle: Handle) -> Result<Summary, BenchError> {
    summary(client, handle, &PlanOptions::default())
}

pub(super) fn micros(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}

pub(super) fn percentiles(mut times: Vec<Duration>) -> Percentiles {
    times.sort_unstable();
    let at = |share: f64| {
        let place = (times.len() as f64 * share) as usize;
        times.get(place.min(times.len().saturating_sub(1))).map_or(f64::NAN, |t| micros(*t))
    };
    Percentiles { p50: at(0.5), p99: at(0.99) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_sorted_times() {
        let times = (1..=200).rev().map(Duration::from_micros).collect();
        assert_eq!(percentiles(times), Percentiles { p50: 101.0, p99: 199.0 });
        assert!(percentiles(Vec::new()).p50.is_nan());
    }
}
