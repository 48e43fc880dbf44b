//! `sbdp check`: what is in an assembly's files, without planning anything.

use std::process::ExitCode;

use super::args::CheckArguments;
use super::error::CliError;
use super::table::{TextTable, length};
use super::{interrupt, print};
use crate::blocking_graph::Audit;
use crate::files::is_tessellated;
use crate::geometry::{Assembly, Solidity, SourceAssembly};
use crate::plan::Overlap;
use crate::search::{Engine, Termination};
use crate::service::{Admission, Service};

pub(super) fn run(arguments: &CheckArguments) -> Result<ExitCode, CliError> {
    let assembly = arguments.input.read()?;
    let service = Service::default();
    let admission = service.admit(&assembly)?;
    let healed = service.assembly(admission.id)?;
    let overlaps = service.overlaps(admission.id)?;
    let mut text = headline(&assembly, &healed);
    text.push_str(&parts(&assembly, &healed));
    text.push_str(&list("found in reading", assembly.notes.iter().map(String::clone)));
    text.push_str(&findings(&healed));
    text.push_str(&given_twice(&admission));
    text.push_str("\noverlaps at the assembled pose:\n");
    let name = |part: usize| assembly.parts.get(part).map_or("?", |p| p.name.as_str());
    for overlap in &overlaps {
        let [a, b] = overlap.parts.map(name);
        let depth = length(overlap.depth, assembly.units.as_deref());
        let cause = if is_of_triangles(&assembly, overlap) { ", from tessellation" } else { "" };
        text.push_str(&format!("  {a} and {b}: {depth} deep{cause}\n"));
    }
    if overlaps.is_empty() {
        text.push_str("  none\n");
    }
    if arguments.graphs {
        let termination = Termination::default();
        interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
        match service.audit(admission.id, Engine::default(), arguments.dbg.into(), &termination)? {
            Some(audit) => text.push_str(&graphs(&audit, name)),
            None => return Err(CliError::Failed("interrupted".to_owned())),
        }
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Whether an overlap may be of the triangles alone, as it is no deeper than these may be off: chords of a hole lie inside
/// it.
fn is_of_triangles(assembly: &SourceAssembly, overlap: &Overlap) -> bool {
    let parts = overlap.parts.iter().filter_map(|&part| assembly.parts.get(part));
    assembly.resolution.is_some_and(|resolution| overlap.depth <= resolution)
        && parts.into_iter().any(|part| is_tessellated(&part.origin))
}

/// What static analysis says of the translations, against simulation.
fn graphs<'a>(audit: &Audit, name: impl Fn(usize) -> &'a str) -> String {
    let mut text = format!(
        "\nblocking graphs: {} of {} translations excluded, {} of them wrongly; {} more found blocked by simulation\n",
        audit.excluded,
        audit.actions,
        audit.wrong.len(),
        audit.overlooked,
    );
    for (part, action) in &audit.wrong {
        text.push_str(&format!("  {} can move along {action}\n", name(*part)));
    }
    text
}

/// Warnings of the whole assembly: those of single parts are findings of healing.
fn given_twice(admission: &Admission) -> String {
    list("given twice", admission.warnings.iter().filter(|w| w.part.is_none()).map(|w| w.message.clone()))
}

/// A paragraph of lines under a heading.
fn list(heading: &str, lines: impl Iterator<Item = String>) -> String {
    let lines: Vec<String> = lines.map(|line| format!("  {line}\n")).collect();
    let lines = if lines.is_empty() { "  nothing\n".to_owned() } else { lines.concat() };
    format!("\n{heading}:\n{lines}")
}

fn headline(assembly: &SourceAssembly, healed: &Assembly) -> String {
    let triangles: usize = (0..healed.parts.len()).map(|p| healed.shape(p).mesh().triangles.len()).sum();
    let units = assembly.units.as_deref().unwrap_or("unknown");
    let fixed = if assembly.fixed.is_empty() { "none".to_owned() } else { assembly.fixed.join(", ") };
    let resolution = assembly.resolution.map_or_else(String::new, |resolution| {
        let off = length(resolution, assembly.units.as_deref());
        format!("; triangles made of curved surfaces, up to {off} off")
    });
    format!(
        "{}: {} parts, {triangles} triangles; units {units}; fixed {fixed}{resolution}\n\n",
        assembly.name,
        healed.parts.len()
    )
}

fn parts(assembly: &SourceAssembly, healed: &Assembly) -> String {
    let mut table = TextTable::new(&["part", "triangles", "size", "volume", "inside by", "from"]);
    for (i, (given, part)) in assembly.parts.iter().zip(&healed.parts).enumerate() {
        let mesh = healed.shape(i).mesh();
        let size = part.bounds.extents() / healed.scale;
        let size: Vec<String> = size.iter().map(|s| length(*s, None)).collect();
        let sign = match mesh.solidity {
            Solidity::Closed => "closed surface",
            Solidity::Winding => "winding number",
            Solidity::Wall => "none: a wall",
        };
        table.row([
            given.name.clone(),
            mesh.triangles.len().to_string(),
            size.join(" × "),
            length(mesh.volume() / healed.scale.powi(3), None),
            sign.to_owned(),
            given.origin.clone(),
        ]);
    }
    table.render()
}

fn findings(healed: &Assembly) -> String {
    let found = healed.findings.iter().map(|(part, finding)| (&healed.parts[*part].name, finding));
    list("found in healing", found.map(|(part, finding)| format!("{part}: {finding}")))
}
