//! `sbdp bench load`.

use std::path::PathBuf;
use std::process::ExitCode;

use super::super::args::{BenchCancel, BenchLoad, BenchLoadClient, BenchSoak};
use super::super::error::CliError;
use super::super::print;
use super::THIS_PROGRAM;
use super::through_daemon::{frame, written};
use crate::bench::{self, CancelRequest, Load, LoadClient, LoadRequest, Phase, SoakRequest};
use crate::files::load_assembly;
use crate::geometry::SourceAssembly;

pub(super) fn load(arguments: &BenchLoad) -> Result<ExitCode, CliError> {
    let request = LoadRequest {
        assembly: arguments.assembly.clone(),
        clients: arguments.clients.get(),
        requests: arguments.requests.get(),
        variety: arguments.variety,
        seed: arguments.seed,
        disturb: arguments.disturb,
        runtime_dir: arguments.runtime_dir.clone(),
        program: PathBuf::from(THIS_PROGRAM),
    };
    let load = bench::load(&request)?;
    print(&text(&load))?;
    written(arguments.json.as_deref(), &load)
}

pub(super) fn soak(arguments: &BenchSoak) -> Result<ExitCode, CliError> {
    let request = SoakRequest {
        load: LoadRequest {
            assembly: arguments.assembly.clone(),
            clients: arguments.clients.get(),
            requests: arguments.requests.get(),
            variety: 16,
            seed: arguments.seed,
            disturb: false,
            runtime_dir: None,
            program: PathBuf::from(THIS_PROGRAM),
        },
        client_kills: arguments.client_kills,
        daemon_kills: arguments.daemon_kills,
    };
    let soak = bench::soak(&request)?;
    let left = soak.left_in_shared_memory.iter().chain(&soak.left_in_root);
    let left: String = left.map(|path| format!("left: {}\n", path.display())).collect();
    print(&format!(
        "{} clients and {} daemons killed; a new daemon was ready within {:.0} ms; {} clients gave up\n\
         {} of {} questions answered otherwise than undisturbed\n{}{left}",
        soak.client_kills,
        soak.daemon_kills,
        soak.slowest_restart_ms,
        soak.clients_failed,
        soak.differing_from_undisturbed,
        soak.compared,
        phase("those who lived", &soak.phase),
    ))?;
    written(arguments.json.as_deref(), &soak)
}

pub(super) fn cancel(arguments: &BenchCancel) -> Result<ExitCode, CliError> {
    let request = CancelRequest {
        assemblies: arguments.assemblies.clone(),
        samples: arguments.samples,
        threads: arguments.threads,
    };
    eprintln!(
        "assembly: plan ms; ended: p50, p99, longest ms until the worker is free (at this share of the plan); \
         longest work in processor ms without a look at whether to end (between these looks)"
    );
    let records = bench::cancel(&request, |r| {
        eprintln!(
            "{}: {:.1}; {}: {:.2}, {:.2}, {:.2} ({:.2}); {:.2} ({})",
            r.assembly,
            r.plan_ms,
            r.ended,
            r.p50_ms,
            r.p99_ms,
            r.longest_ms,
            r.longest_at,
            r.silence_ms,
            r.silent_between
        );
    })?;
    written(arguments.json.as_deref(), &records)
}

pub(super) fn client(arguments: &BenchLoadClient) -> Result<ExitCode, CliError> {
    bench::load_client(&LoadClient {
        runtime_dir: arguments.runtime_dir.clone(),
        assembly: assembly(arguments.assembly.as_ref())?,
        role: arguments.role.into(),
        requests: arguments.requests,
        seed: arguments.seed,
        variety: arguments.variety,
    })?;
    Ok(ExitCode::SUCCESS)
}

fn assembly(given: Option<&PathBuf>) -> Result<SourceAssembly, CliError> {
    Ok(match given {
        Some(path) => load_assembly(path)?,
        None => frame(),
    })
}

fn text(load: &Load) -> String {
    let mut text = format!("{} clients\n{}", load.clients, phase("without disturbers", &load.calm));
    if let (Some(disturbed), Some(ratios)) = (&load.disturbed, &load.p99_ratio) {
        text += &phase("beside one stopped, one flooding, one that never reads", disturbed);
        text += "p99 beside them over p99 without:";
        ratios.iter().for_each(|(kind, ratio)| text += &format!(" {kind:?} {ratio:.2}"));
        text.push('\n');
    }
    text
}

fn phase(title: &str, phase: &Phase) -> String {
    let (early, late) = (phase.daemon.at_2000, phase.daemon.at_end);
    let mut text = format!(
        "\n{title}, {:.1} s: {} sent, {} answered, {} refused, {} dropped by the client, {} lost, {} differing; the daemon counted {} plan requests\n\
         daemon at request {}: {} KiB resident ({} private), {} descriptors; at {}: {} ({}), {}\n\
         {:<12}{:>8}{:>10}{:>9}{:>12}{:>12}\n",
        phase.wall_s,
        phase.sent,
        phase.answered,
        phase.refused,
        phase.dropped,
        phase.lost,
        phase.differing,
        phase.plans_received,
        early.requests,
        early.resident_kib,
        early.private_kib,
        early.descriptors,
        late.requests,
        late.resident_kib,
        late.private_kib,
        late.descriptors,
        "kind",
        "sent",
        "answered",
        "refused",
        "p50 us",
        "p99 us",
    );
    for (kind, k) in &phase.kinds {
        let (name, refused) = (format!("{kind:?}"), k.refused.values().sum::<u64>());
        let (p50, p99) = (k.p50_us, k.p99_us);
        text += &format!("{name:<12}{:>8}{:>10}{refused:>9}{p50:>12.0}{p99:>12.0}\n", k.sent, k.answered);
    }
    phase.lost_because.iter().for_each(|reason| text += &format!("lost: {reason}\n"));
    text
}
