//! A plan as a text for people.

use nalgebra::Point3;

use super::table::{TextTable, length};
use crate::geometry::{SourceAssembly, SourceMesh, pose_from_waypoint};
use crate::plan::{Base, MotionKind, Plan, PlanKind, PlanStats, PlanStep};
use crate::view::direction;

/// The table of steps and everything there is to know about the rest.
pub(super) fn plan(assembly: &SourceAssembly, plan: &Plan) -> String {
    let mut text = headline(assembly, plan);
    if !plan.steps.is_empty() {
        text.push('\n');
        text.push_str(&steps(assembly, plan));
    }
    let sections = [
        ("base", base(plan)),
        ("remaining", remaining(plan)),
        ("blocked", blocked(plan)),
        ("overlaps at the assembled pose", overlaps(plan)),
        ("warnings", warnings(plan)),
    ];
    for (title, lines) in sections {
        if !lines.is_empty() {
            text.push_str(&format!("\n{title}:\n"));
            lines.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
        }
    }
    text.push('\n');
    text.push_str(&stats(plan));
    text
}

fn headline(assembly: &SourceAssembly, plan: &Plan) -> String {
    let reason = plan.reason.as_ref().map_or(String::new(), |r| format!(" ({r})"));
    let name = if assembly.name.is_empty() { "assembly" } else { &assembly.name };
    let done = match plan.kind {
        PlanKind::Disassembly => "come off",
        PlanKind::Assembly => "are put in",
    };
    format!(
        "{name}: {}{reason}; {} of {} parts {done}, planner {}, engine {}\n",
        plan.status.name(),
        plan.steps.len(),
        plan.parts.len().saturating_sub(plan.removed.len()),
        plan.planner,
        plan.engine
    )
}

fn steps(assembly: &SourceAssembly, plan: &Plan) -> String {
    let mut table = TextTable::new(&["step", "part", "motion", "length", "direction", "after step"]);
    for (number, step) in (1..).zip(&plan.steps) {
        let mesh = assembly.parts.get(step.part).map(|p| &p.mesh);
        table.row([
            format!("{number}"),
            plan.part_name(step.part).to_owned(),
            step.motion.name().to_owned(),
            travelled(step, plan.kind, mesh, plan.units.as_deref()),
            step.direction.map_or_else(String::new, |d| direction(&d.into())),
            step.requires.iter().map(|number| format!("{}", number + 1)).collect::<Vec<_>>().join(", "),
        ]);
    }
    table.render()
}

/// How far the middle of the part's box goes, and how far the part turns on the way.
fn travelled(step: &PlanStep, kind: PlanKind, mesh: Option<&SourceMesh>, units: Option<&str>) -> String {
    let middle = mesh.map_or_else(Point3::origin, box_middle);
    let poses: Vec<_> = step.path.iter().map(pose_from_waypoint).collect();
    let distance: f64 = poses.windows(2).map(|w| (w[1] * middle - w[0] * middle).norm()).sum();
    if distance == 0.0 && step.motion == MotionKind::Translation {
        return match kind {
            PlanKind::Disassembly => "free already".to_owned(),
            PlanKind::Assembly => "in place".to_owned(),
        };
    }
    let turned: f64 = poses.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).sum();
    let straight = length(distance, units);
    match step.motion {
        MotionKind::Translation => straight,
        MotionKind::Rotation => format!("{straight}, turning {:.0}°", turned.to_degrees()),
    }
}

/// Vertices that no triangle uses do not belong to the part.
fn box_middle(mesh: &SourceMesh) -> Point3<f64> {
    let used = mesh.triangles.iter().flatten().filter_map(|&v| mesh.vertices.get(v as usize));
    let bounds = used.map(|p| Point3::from(*p)).fold(None, |bounds, p| match bounds {
        None => Some((p, p)),
        Some((lo, hi)) => Some((p.inf(&lo), p.sup(&hi))),
    });
    bounds.map_or_else(Point3::origin, |(lo, hi)| nalgebra::center(&lo, &hi))
}

fn base(plan: &Plan) -> Vec<String> {
    let line = |base: &Base| format!("{}: {}", plan.part_name(base.part), base.reason);
    plan.base.iter().map(line).collect()
}

fn remaining(plan: &Plan) -> Vec<String> {
    if plan.remaining.is_empty() { Vec::new() } else { vec![names(plan, &plan.remaining)] }
}

/// One line per part: what it met in each direction.
fn blocked(plan: &Plan) -> Vec<String> {
    let mut lines: Vec<(usize, String)> = Vec::new();
    for blocked in &plan.blocked {
        let what = format!("{} by {}", blocked.action, names(plan, &blocked.by));
        match lines.last_mut() {
            Some((part, line)) if *part == blocked.part => line.push_str(&format!("; {what}")),
            _ => lines.push((blocked.part, format!("{}: {what}", plan.part_name(blocked.part)))),
        }
    }
    lines.into_iter().map(|(_, line)| line).collect()
}

fn overlaps(plan: &Plan) -> Vec<String> {
    let units = plan.units.as_deref();
    let line = |o: &crate::plan::Overlap| {
        format!(
            "{} and {}: {} deep",
            plan.part_name(o.parts[0]),
            plan.part_name(o.parts[1]),
            length(o.depth, units)
        )
    };
    plan.overlaps.iter().map(line).collect()
}

fn warnings(plan: &Plan) -> Vec<String> {
    let line = |w: &crate::plan::Warning| match w.part {
        Some(part) => format!("{}: {}", plan.part_name(part), w.message),
        None => w.message.clone(),
    };
    plan.warnings.iter().map(line).collect()
}

fn stats(plan: &Plan) -> String {
    let s = &plan.stats;
    let depth = plan.steps.iter().map(|step| step.verified_depth).fold(0.0, f64::max);
    let hit = if s.plan_hit { ", plan remembered".to_owned() } else { reused(s) };
    let told =
        |name: &str, time: Option<f64>| time.map_or_else(String::new, |t| format!("{name} {t:.3} s, "));
    format!(
        "{} simulations ({} run), {} sweeps, {} states{hit}; {}fields {:.3} s, {}static analysis {:.3} s, \
         paths {:.3} s, verification {:.3} s, {}total {:.3} s; verified to {}\n",
        s.simulations,
        s.simulations_run,
        s.sweeps,
        s.states,
        told("loading", s.load_time_s),
        s.sdf_time_s,
        told("overlaps", s.overlap_time_s),
        s.static_analysis_time_s,
        s.path_time_s,
        s.verify_time_s,
        told("transfers", s.transfer_time_s),
        s.total_time_s,
        length(depth, plan.units.as_deref())
    )
}

/// How much was there already.
fn reused(s: &PlanStats) -> String {
    let counts = [
        (s.blocking_hits, "relations"),
        (s.graph_hits, "graphs of states"),
        (s.motion_hits, "motions"),
        (s.verdict_hits.unwrap_or(0), "verified paths"),
    ];
    let told = counts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
    let told: Vec<String> = told.collect();
    if told.is_empty() { String::new() } else { format!(", remembered: {}", told.join(", ")) }
}

fn names(plan: &Plan, parts: &[usize]) -> String {
    let names: Vec<&str> = parts.iter().map(|&p| plan.part_name(p)).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SourcePart;
    use crate::plan::{Blocked, Overlap, PlanStatus, Warning};

    #[test]
    fn everything_is_told() {
        let mesh = SourceMesh {
            vertices: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [9e9; 3]],
            triangles: vec![[0, 1, 2]],
        };
        let part = |n: &str| SourcePart { name: n.into(), origin: String::new(), mesh: mesh.clone() };
        let assembly = SourceAssembly {
            name: "vice".into(),
            parts: ["a", "b", "c"].map(part).into(),
            ..Default::default()
        };
        let half_turn = [2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let start = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let step = |part, motion, path| PlanStep {
            part,
            motion,
            path,
            verified_depth: 0.01,
            requires: vec![0],
            wave: 1,
            direction: None,
        };
        let plan = Plan {
            kind: PlanKind::Disassembly,
            status: PlanStatus::Infeasible,
            reason: Some("exhausted".into()),
            planner: "sbdp-star".into(),
            engine: "sliding".into(),
            units: Some("mm".into()),
            parts: ["a", "b", "c"].map(String::from).into(),
            removed: vec![],
            poses: vec![],
            targets: None,
            fixed: vec![],
            base: Some(Base { part: 1, reason: "it is the largest".into() }),
            steps: vec![
                step(0, MotionKind::Rotation, vec![start, half_turn]),
                step(2, MotionKind::Translation, vec![start]),
            ],
            remaining: vec![1],
            blocked: vec![
                Blocked { part: 1, by: vec![0, 2], action: "+x".into() },
                Blocked { part: 1, by: vec![0], action: "-z".into() },
            ],
            overlaps: vec![Overlap { parts: [0, 1], depth: 0.5 }],
            warnings: vec![Warning { part: Some(2), message: "open".into() }],
            stats: PlanStats { motion_hits: 3, verdict_hits: Some(2), ..PlanStats::default() },
        };
        let text = super::plan(&assembly, &plan);
        for line in [
            "vice: infeasible (exhausted); 2 of 3 parts come off",
            "1     a     rotation     0 mm, turning 180°             1",
            "2     c     translation  free already                   1",
            "  b: it is the largest",
            "  b: +x by a, c; -z by a",
            "  a and b: 0.5000 mm deep",
            "  c: open",
            "0 states, remembered: 3 motions, 2 verified paths; fields",
            "verified to 0.0100 mm",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
    }
}
