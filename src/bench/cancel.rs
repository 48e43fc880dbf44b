//! `sbdp bench cancel`: how long planning goes on after it was cancelled, or its deadline has passed, at
//! moments spread over all of a plan, whatever it is at.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::BenchError;
use crate::files::load_assembly;
use crate::plan::PlanStep;
use crate::search::{PlanRequest, PlanSink, Progress};
use crate::service::{AssemblyId, Service};
use crate::termination::{Silence, Termination, Watch};

/// A plan that takes longer is watched for so long, and ended at moments within that.
const LONGEST: Duration = Duration::from_secs(60);

/// What to measure.
#[derive(Debug, Clone)]
pub struct CancelRequest {
    /// Folders or files of assemblies.
    pub assemblies: Vec<PathBuf>,
    /// Moments, of each assembly.
    pub samples: u32,
    /// Threads that plan; 0 for all processors.
    pub threads: usize,
}

/// What was measured of one assembly, in milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CancelRecord {
    /// The assembly.
    pub assembly: String,
    /// Of a whole plan.
    pub plan_ms: f64,
    /// Plans that were ended before they were done.
    pub ended: usize,
    /// Median of the time from then to the worker being free.
    pub p50_ms: f64,
    /// 99th percentile of it.
    pub p99_ms: f64,
    /// The longest.
    pub longest_ms: f64,
    /// At which share of the plan's time that was.
    pub longest_at: f64,
    /// Longest work of one thread in the whole plan without a look at whether it is to end, in processor
    /// time: what the longest would be at most on a machine that does nothing else.
    pub silence_ms: f64,
    /// The looks before and after it, in the source.
    pub silent_between: String,
}

/// Measures, every other moment by a deadline.
///
/// # Errors
/// An assembly cannot be read or planned.
pub fn cancel(
    request: &CancelRequest,
    mut told: impl FnMut(&CancelRecord),
) -> Result<Vec<CancelRecord>, BenchError> {
    let mut records = Vec::new();
    for path in &request.assemblies {
        let source = load_assembly(path).map_err(BenchError::failed)?;
        // Nothing derived from an assembly stays with it, so that every plan goes through every stage.
        let service = Service::default();
        let id = service.admit(&source).map_err(BenchError::failed)?.id;
        let question = PlanRequest { no_cache: true, threads: request.threads, ..PlanRequest::default() };
        let plan = |termination: &Termination| ended(&service, id, &question, termination);
        let started = Instant::now();
        let watch = Arc::new(Watch::default());
        plan(&Termination::new(started.checked_add(LONGEST)).watched(&watch))?;
        let whole = started.elapsed();
        let mut times = Vec::new();
        for sample in 0..request.samples {
            let share = (f64::from(sample) + 0.5) / f64::from(request.samples);
            if let Some(late) = late(plan, whole.mul_f64(share), sample % 2 == 1)? {
                times.push((late, share));
            }
        }
        let record = record(source.name, whole, times, watch.longest());
        told(&record);
        records.push(record);
    }
    Ok(records)
}

/// Hears nothing.
struct Deaf;

impl PlanSink for Deaf {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &PlanStep) {}
}

/// Plans; when that was over.
fn ended(
    service: &Service,
    id: AssemblyId,
    request: &PlanRequest,
    termination: &Termination,
) -> Result<Instant, BenchError> {
    service.plan(id, request, termination, &mut Deaf).map_err(BenchError::failed)?;
    Ok(Instant::now())
}

/// How long a plan goes on that is to end after some time; none if it was done before.
fn late(
    plan: impl Fn(&Termination) -> Result<Instant, BenchError> + Sync,
    after: Duration,
    by_deadline: bool,
) -> Result<Option<Duration>, BenchError> {
    let due = Instant::now() + after;
    let termination = Termination::new(by_deadline.then_some(due));
    let ended = std::thread::scope(|scope| {
        let planning = scope.spawn(|| plan(&termination));
        if !by_deadline {
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            termination.cancel_flag().store(true, Ordering::Relaxed);
        }
        planning.join().map_err(|_| BenchError::Failed("planning panicked".to_owned()))?
    })?;
    Ok((ended > due).then(|| ended - due))
}

fn record(
    assembly: String,
    whole: Duration,
    mut times: Vec<(Duration, f64)>,
    silence: Option<Silence>,
) -> CancelRecord {
    times.sort_by_key(|(late, _)| *late);
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let at = |share: f64| {
        let place = ((times.len() as f64 * share) as usize).min(times.len().saturating_sub(1));
        times.get(place).copied().unwrap_or_default()
    };
    CancelRecord {
        assembly,
        plan_ms: ms(whole),
        ended: times.len(),
        p50_ms: ms(at(0.5).0),
        p99_ms: ms(at(0.99).0),
        longest_ms: ms(at(1.0).0),
        longest_at: at(1.0).1,
        silence_ms: silence.map_or(0.0, |s| ms(s.time)),
        silent_between: silence.map_or_else(String::new, |s| s.between.map(|p| p.to_string()).join(" and ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_that_is_done_before_is_not_counted_and_one_that_goes_on_is_measured() {
        let done = |_: &Termination| Ok(Instant::now());
        assert_eq!(late(done, Duration::from_millis(20), false).unwrap(), None);
        let stubborn = |termination: &Termination| {
            while termination.check().is_ok() {
                std::thread::yield_now();
            }
            std::thread::sleep(Duration::from_millis(5));
            Ok(Instant::now())
        };
        for by_deadline in [false, true] {
            let late = late(stubborn, Duration::from_millis(5), by_deadline).unwrap().unwrap();
            assert!(late >= Duration::from_millis(5), "{late:?}");
        }
    }

    #[test]
    fn the_longest_is_told_with_its_moment() {
        let times = (1..=200).map(|i| (Duration::from_millis(i), i as f64 / 200.0)).rev().collect();
        let record = record("a".into(), Duration::from_secs(1), times, None);
        assert_eq!((record.p50_ms, record.p99_ms, record.longest_ms), (101.0, 199.0, 200.0));
        assert_eq!((record.ended, record.longest_at, record.silence_ms), (200, 1.0, 0.0));
    }
}
