//! `sbdp bench replan`: what it costs to plan again when one part of an assembly changed, through the
//! daemon, at once and after it was left alone, beside the same question asked of a daemon that knows nothing.

use std::path::PathBuf;
use std::time::Instant;

use sbdp_client::{Change, Client, Handle, PlanOptions};
use serde::Serialize;

use super::BenchError;
use super::asking::{Answered, AnsweredStep, leave_alone, plan};
use super::server::{Place, Server};
use crate::exchange::{wire_assembly, wire_part};
use crate::files::load_assembly;
use crate::geometry::{SourceAssembly, SourceMesh};

/// One question, cold or after the change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cost {
    /// From the change to the whole plan, seconds.
    pub time_s: f64,
    /// Simulations that were really run.
    pub simulations: u64,
}

/// One kind of change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplanRecord {
    /// The assembly.
    pub assembly: String,
    /// The part that changed.
    pub part: String,
    /// What became of it.
    pub change: &'static str,
    /// Asked of a daemon that knows the assembly but planned nothing.
    pub cold: Cost,
    /// Asked at once of a daemon that planned the assembly as it was.
    pub changed: Cost,
    /// Asked of one that had time to plan likely next requests.
    pub speculated: Cost,
    /// Whether all gave the same plan to the bit, which the cold daemon verified path by path.
    pub verified: bool,
}

/// A change of one part.
struct Changed {
    name: &'static str,
    options: PlanOptions,
    replaced: Option<SourceMesh>,
}

/// The moved part goes so far, in the assembly's unit if that is not known to be metres.
const MILLIMETRE: f64 = 1.0;
/// The mesh that replaces another is so much smaller.
const SMALLER: f64 = 0.98;

/// Measures all kinds of changes of one part of each assembly.
///
/// # Errors
/// An assembly cannot be read, or a daemon does not answer.
pub fn replan(
    assemblies: &[PathBuf],
    mut told: impl FnMut(&ReplanRecord),
) -> Result<Vec<ReplanRecord>, BenchError> {
    let mut records = Vec::new();
    for path in assemblies {
        let source = load_assembly(path).map_err(BenchError::failed)?;
        let base = Asked::of(&source, "base")?;
        let (plan, _) = plan(&base.client, base.handle, &PlanOptions::default())?;
        let part = fastener(&source, &plan)
            .ok_or_else(|| BenchError::Failed(format!("{}: nothing comes off", source.name)))?;
        let outward = plan.outward(part);
        drop(base);
        for change in changes(&source, part, outward) {
            let record = compared(&source, part, &change)?;
            told(&record);
            records.push(record);
        }
    }
    Ok(records)
}

fn compared(source: &SourceAssembly, part: usize, change: &Changed) -> Result<ReplanRecord, BenchError> {
    let (cold_plan, cold) = Asked::of(source, "cold")?.changed(source, part, change)?;
    let warm = Asked::of(source, "warm")?;
    plan(&warm.client, warm.handle, &PlanOptions::default())?;
    let (changed_plan, changed) = warm.changed(source, part, change)?;
    drop(warm);
    let ready = Asked::of(source, "ready")?;
    plan(&ready.client, ready.handle, &PlanOptions::default())?;
    leave_alone(&ready.client)?;
    let (speculated_plan, speculated) = ready.changed(source, part, change)?;
    Ok(ReplanRecord {
        assembly: source.name.clone(),
        part: source.parts[part].name.clone(),
        change: change.name,
        cold,
        changed,
        speculated,
        verified: changed_plan == cold_plan && speculated_plan == cold_plan,
    })
}

/// A daemon of its own that knows an assembly.
struct Asked {
    client: Client,
    handle: Handle,
    _daemon: Server,
}

impl Asked {
    fn of(source: &SourceAssembly, name: &str) -> Result<Self, BenchError> {
        let daemon = Server::daemon(Place::new(name)?)?;
        let client = daemon.connect()?;
        let handle = client.upload(&wire_assembly(source)).map_err(BenchError::failed)?;
        Ok(Self { client, handle, _daemon: daemon })
    }

    fn changed(
        &self,
        source: &SourceAssembly,
        part: usize,
        change: &Changed,
    ) -> Result<(Answered, Cost), BenchError> {
        let started = Instant::now();
        let mut handle = self.handle;
        if let Some(mesh) = &change.replaced {
            let mut with = wire_part(&source.parts[part]);
            with.vertices = sbdp_client::Vertices::F64(&mesh.vertices);
            let change = Change { replaced: vec![(part as u32, with)], ..Change::default() };
            handle = self.client.revise(handle, &change).map_err(BenchError::failed)?;
        }
        let (answered, summary) = plan(&self.client, handle, &change.options)?;
        let cost =
            Cost { time_s: started.elapsed().as_secs_f64(), simulations: summary.stats.simulations_run };
        Ok((answered, cost))
    }
}

/// A part that comes off alone and is called a bolt or screw, else the first that does.
pub(super) fn fastener(source: &SourceAssembly, plan: &Answered) -> Option<usize> {
    let leaves = || plan.steps.iter().filter_map(AnsweredStep::leaves_alone);
    let is_fastener = |&part: &usize| {
        let name = source.parts[part].name.to_lowercase();
        ["bolt", "screw"].iter().any(|kind| name.contains(kind))
    };
    leaves().find(is_fastener).or_else(|| leaves().next())
}

fn changes(source: &SourceAssembly, part: usize, outward: [f64; 3]) -> Vec<Changed> {
    let number = part as u32;
    let by = if source.units.as_deref() == Some("m") { MILLIMETRE / 1000.0 } else { MILLIMETRE };
    let [x, y, z] = outward.map(|x| x * by);
    let with = |name, options| Changed { name, options, replaced: None };
    let mesh = &source.parts[part].mesh;
    let count = mesh.vertices.len() as f64;
    let middle: [f64; 3] = [0, 1, 2].map(|a| mesh.vertices.iter().map(|v| v[a]).sum::<f64>() / count);
    let smaller = |v: &[f64; 3]| [0, 1, 2].map(|a| middle[a] + (v[a] - middle[a]) * SMALLER);
    let smaller = SourceMesh {
        vertices: mesh.vertices.iter().map(smaller).collect(),
        triangles: mesh.triangles.clone(),
    };
    let options = PlanOptions::default;
    vec![
        with("removed", PlanOptions { removed: vec![number], ..options() }),
        with("moved", PlanOptions { moved: vec![(number, [x, y, z, 1.0, 0.0, 0.0, 0.0])], ..options() }),
        Changed { name: "replaced", options: options(), replaced: Some(smaller) },
        with("locked", PlanOptions { fixed: vec![number], ..options() }),
    ]
}
