//! `sbdp bench restart`: what a daemon that was started again still knows: the first answers after a
//! restart with a warm disk, beside those of a daemon that has everything in memory.

use std::time::{Duration, Instant};

use nalgebra::Point3;
use sbdp_client::{Client, Handle, PlanOptions};
use serde::Serialize;

use super::BenchError;
use super::asking::{figures, plan, summary};
use super::latency::{Percentiles, percentiles};
use super::replan::fastener;
use super::server::{Place, Server};
use crate::exchange::wire_assembly;
use crate::geometry::{Bounds, SourceAssembly};

/// So long a restarted daemon is left alone, where it may make ready what was asked last.
const QUIET: Duration = Duration::from_secs(2);

/// What was measured, in microseconds; connecting is left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Restart {
    /// Restarts of each kind.
    pub rounds: usize,
    /// The same plan again, by a daemon that has it in memory.
    pub repeat_plan_us: Percentiles,
    /// The same plan, as the first question after a restart.
    pub restarted_plan_us: Percentiles,
    /// A question about a part that stands elsewhere, by a daemon that planned the assembly.
    pub changed_us: Percentiles,
    /// Such a question, as the first one after a restart.
    pub restarted_changed_us: Percentiles,
    /// Such a question, after the restarted daemon was left alone for two seconds.
    pub prepared_changed_us: Percentiles,
    /// Distance fields that all first answers to such questions took from their files.
    pub fields_found: u64,
    /// Distance fields that they built, as there was no file.
    pub fields_built: u64,
}

/// Measures; each changed question is another one.
///
/// # Errors
/// A process cannot be started, or does not answer.
pub fn restart(assembly: &SourceAssembly, rounds: usize) -> Result<Restart, BenchError> {
    let mut daemon = Server::daemon(Place::new("restart")?)?;
    let client = daemon.connect()?;
    let handle = client.upload(&wire_assembly(assembly)).map_err(BenchError::failed)?;
    let (answered, _) = plan(&client, handle, &PlanOptions::default())?;
    let part = fastener(assembly, &answered)
        .ok_or_else(|| BenchError::Failed(format!("{}: nothing comes off", assembly.name)))?;
    let vertices: Vec<_> = assembly.parts[part].mesh.vertices.iter().map(|v| Point3::from(*v)).collect();
    let centre = Bounds::of(&vertices).centre();
    drop(client);
    let mut asked = 0;
    let mut changed = || {
        asked += 1;
        let by = FIRST * (1.0 + f64::from(asked) / 256.0);
        let moved = vec![(part as u32, answered.on_its_way(part, &centre, by))];
        PlanOptions { moved, ..PlanOptions::default() }
    };
    let mut times: [Vec<Duration>; 5] = Default::default();
    let (mut fields_found, mut fields_built) = (0, 0);
    for _ in 0..rounds {
        let client = daemon.connect()?;
        plan(&client, handle, &PlanOptions::default())?;
        times[0].push(took(&client, handle, &PlanOptions::default(), true)?);
        times[2].push(took(&client, handle, &changed(), false)?);
        drop(client);
        daemon.restart()?;
        let client = daemon.connect()?;
        times[1].push(took(&client, handle, &PlanOptions::default(), true)?);
        drop(client);
        daemon.restart()?;
        let client = daemon.connect()?;
        times[3].push(took(&client, handle, &changed(), false)?);
        let (found, built) = fields(&client)?;
        (fields_found, fields_built) = (fields_found + found, fields_built + built);
        drop(client);
        daemon.restart()?;
        let client = daemon.connect()?;
        std::thread::sleep(QUIET);
        times[4].push(took(&client, handle, &changed(), false)?);
    }
    let [repeat, restarted, changed, restarted_changed, prepared] = times.map(percentiles);
    Ok(Restart {
        rounds,
        repeat_plan_us: repeat,
        restarted_plan_us: restarted,
        changed_us: changed,
        restarted_changed_us: restarted_changed,
        prepared_changed_us: prepared,
        fields_found,
        fields_built,
    })
}

/// Distance fields that the daemon found on disk, and that it asked for and did not.
fn fields(client: &Client) -> Result<(u64, u64), BenchError> {
    let figures = figures(client)?;
    let kinds = figures["remembered"]["records"]["kinds"].as_array().cloned().unwrap_or_default();
    let of = |count: &str| kinds.iter().find(|k| k["kind"] == "field").and_then(|k| k[count].as_u64());
    // A daemon of an older build keeps none.
    Ok(of("hits").zip(of("misses")).unwrap_or_default())
}

/// How far the part is moved at least on its way out, in the assembly's unit.
const FIRST: f64 = 0.5;

fn took(client: &Client, handle: Handle, options: &PlanOptions, known: bool) -> Result<Duration, BenchError> {
    let started = Instant::now();
    let summary = summary(client, handle, options)?;
    let took = started.elapsed();
    if (summary.stats.plan_hit == 1) == known {
        Ok(took)
    } else {
        Err(BenchError::Failed(format!("the plan was {}remembered", if known { "not " } else { "" })))
    }
}
