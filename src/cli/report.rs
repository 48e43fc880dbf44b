//! A plan as a text for people.

use std::collections::HashMap;

use nalgebra::Point3;

use super::report_lines::{clearance, stability, tools};
use super::table::{TextTable, length};
use crate::document::{
    CacheDocument, FreeGroupDocument, OverlapDocument, Placements, PlanDocument, StepDocument, StepFrame,
    WarningDocument, kind_of,
};
use crate::geometry::{Bounds, Pose, SourceAssembly, SourceMesh, pose_from_waypoint};
use crate::plan::{MotionKind, PlanKind, StepEnd};
use crate::view::{blockers, direction, part_word, part_words, verdict};

/// Count of parts that a row of the table names; more are counted. With names of ten letters, the row still fits 120
/// columns. At half, pairs alone are named; at double, rows wrap.
const MOST_NAMES: usize = 4;

/// Seconds of the shortest stage that is shown: with three digits, shorter ones are 0.
const SHORTEST: f64 = 0.5e-3;

/// The table of steps and all other sections. If it is `verbose`, with all overlaps and blocked actions, else with the
/// worst and few, and the number of the others.
pub(super) fn plan(assembly: &SourceAssembly, plan: &PlanDocument, verbose: bool) -> String {
    let mut text = headline(assembly, plan);
    if !plan.steps.is_empty() {
        text.push('\n');
        text.push_str(&steps(assembly, plan));
    }
    let sections = [
        ("base", base(plan)),
        ("remaining", remaining(plan)),
        ("stands", stability(plan)),
        ("passes nearest", clearance(plan, verbose)),
        ("tools", tools(plan)),
        ("left together and not taken apart", plan.kept_together.iter().map(|g| words(g, ", ")).collect()),
        ("not complete", verdict(plan).into_iter().collect()),
        ("can begin to move together", free_together(plan)),
        ("blocked", blocked(plan, verbose)),
        ("overlaps at the assembled pose", overlaps(plan, verbose)),
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

fn headline(assembly: &SourceAssembly, plan: &PlanDocument) -> String {
    let name = if assembly.name.is_empty() { "assembly" } else { &assembly.name };
    let done = match kind_of(plan) {
        PlanKind::Disassembly => "come off",
        PlanKind::Assembly => "are put in",
    };
    let crosses = plan.steps.iter().filter(|step| step.of.is_none() && step.ends != StepEnd::Aside.name());
    format!(
        "{name}: {}; {} of {} parts {done}, planner {}, engine {}\n",
        plan.status,
        crosses.map(|step| step.parts.len()).sum::<usize>(),
        plan.parts.len().saturating_sub(plan.initial.removed.len()),
        plan.planner,
        plan.engine
    )
}

fn steps(assembly: &SourceAssembly, plan: &PlanDocument) -> String {
    let has_groups = plan.steps.iter().any(|step| step.of.is_some());
    let group = has_groups.then_some("group of");
    let header =
        ["step", "part"].into_iter().chain(group).chain(["motion", "length", "direction", "after step"]);
    let mut table = TextTable::new(&header.collect::<Vec<_>>());
    let middles = middles(assembly, plan);
    for ((number, step), middle) in (1..).zip(&plan.steps).zip(middles) {
        let of = has_groups.then(|| step.of.map_or_else(String::new, |of| format!("step {}", of + 1)));
        let aside = if step.ends == StepEnd::Aside.name() { ", aside" } else { "" };
        let cells = [format!("{number}"), moved(step)].into_iter().chain(of).chain([
            format!("{}{aside}", step.motion),
            travelled(step, kind_of(plan), &middle, plan.units.as_deref()),
            step.direction.map_or_else(String::new, |d| direction(&d.into())),
            step.requires.iter().map(|number| format!("{}", number + 1)).collect::<Vec<_>>().join(", "),
        ]);
        table.row(cells);
    }
    table.render()
}

/// The parts of a step.
fn moved(step: &StepDocument) -> String {
    let shown = step.parts.len().min(MOST_NAMES);
    match step.parts.len() - shown {
        0 => step.parts.join(", "),
        more => format!("{} and {more} more", step.parts[..shown].join(", ")),
    }
}

/// How far the middle of the box of what moves goes, and how far it turns on the way.
fn travelled(step: &StepDocument, kind: PlanKind, middle: &Point3<f64>, units: Option<&str>) -> String {
    let poses: Vec<_> = step.path.iter().map(pose_from_waypoint).collect();
    let distance: f64 = poses.windows(2).map(|w| (w[1] * middle - w[0] * middle).norm()).sum();
    let turns = step.motion == MotionKind::Rotation.name();
    if distance == 0.0 && !turns {
        return match kind {
            PlanKind::Disassembly => "free already".to_owned(),
            PlanKind::Assembly => "in place".to_owned(),
        };
    }
    let turned: f64 = poses.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).sum();
    let straight = length(distance, units);
    if turns { format!("{straight}, turning {:.0}°", turned.to_degrees()) } else { straight }
}

/// By step, the middle of the box of the parts that it moves, where its path is the identity. Steps that contradict each
/// other have the middle of the parts as given.
fn middles(assembly: &SourceAssembly, plan: &PlanDocument) -> Vec<Point3<f64>> {
    let kind = kind_of(plan);
    let placements = Placements::new(kind, plan).ok();
    let numbers: HashMap<&str, usize> = plan.parts.iter().map(String::as_str).zip(0..).collect();
    let assembled = |part: usize| {
        let start = plan.initial.poses.get(&plan.parts[part]);
        let start = start.map_or_else(Pose::identity, pose_from_waypoint);
        match (kind, &placements) {
            (PlanKind::Assembly, Some(placements)) => placements.apart[part].inverse() * start,
            _ => start,
        }
    };
    let middle = |number: usize, step: &StepDocument| {
        let frame: Option<&StepFrame> = placements.as_ref().map(|p| &p.steps[number]);
        let parts = step.parts.iter().filter_map(|name| numbers.get(name.as_str()));
        let bounds = parts.enumerate().map(|(k, &part)| {
            let standing = frame.map_or_else(Pose::identity, |frame| frame.standing[k]);
            let mesh = assembly.parts.get(part).map(|p| &p.mesh);
            mesh.map_or(Bounds::EMPTY, |mesh| box_of(mesh, &(standing * assembled(part))))
        });
        let bounds = bounds.fold(Bounds::EMPTY, |all, bounds| all.union(&bounds));
        if bounds == Bounds::EMPTY { Point3::origin() } else { bounds.centre() }
    };
    plan.steps.iter().enumerate().map(|(number, step)| middle(number, step)).collect()
}

/// Vertices that no triangle uses do not belong to the part.
fn box_of(mesh: &SourceMesh, pose: &Pose) -> Bounds {
    let used = mesh.triangles.iter().flatten().filter_map(|&v| mesh.vertices.get(v as usize));
    used.fold(Bounds::EMPTY, |bounds, p| bounds.with_point(&(pose * Point3::from(*p))))
}

fn base(plan: &PlanDocument) -> Vec<String> {
    let reason = plan.base_reason.as_deref().unwrap_or("as given");
    if plan.base.is_empty() { Vec::new() } else { vec![format!("{}: {reason}", words(&plan.base, ", "))] }
}

fn remaining(plan: &PlanDocument) -> Vec<String> {
    if plan.remaining.is_empty() { Vec::new() } else { vec![words(&plan.remaining, ", ")] }
}

fn free_together(plan: &PlanDocument) -> Vec<String> {
    let line =
        |g: &FreeGroupDocument| format!("{} along {}", words(&g.parts, ", "), direction(&g.direction.into()));
    plan.free_together.iter().map(line).collect()
}

/// What keeps each part, and how much of it is left out.
fn blocked(plan: &PlanDocument, verbose: bool) -> Vec<String> {
    let (mut lines, left_out) = blockers(plan, verbose);
    lines.extend(left_out.map(|left_out| format!("{left_out} (-v lists them)")));
    lines
}

/// How many pairs overlap, and the deepest; or each pair.
fn overlaps(plan: &PlanDocument, verbose: bool) -> Vec<String> {
    let line = |o: &OverlapDocument| {
        let pair = words(&o.parts, " and ");
        format!("{pair}: {} deep", length(o.depth, plan.units.as_deref()))
    };
    let deepest = plan.overlaps.iter().max_by(|a, b| a.depth.total_cmp(&b.depth));
    match (deepest, plan.overlaps.len()) {
        (Some(deepest), count) if count > 1 && !verbose => {
            vec![format!("{count} pairs, the deepest {} (-v lists them)", line(deepest))]
        }
        _ => plan.overlaps.iter().map(line).collect(),
    }
}

fn warnings(plan: &PlanDocument) -> Vec<String> {
    let line = |w: &WarningDocument| match &w.part {
        Some(part) => format!("{}: {}", part_word(part), w.message),
        None => w.message.clone(),
    };
    plan.warnings.iter().map(line).collect()
}

fn stats(plan: &PlanDocument) -> String {
    let s = &plan.stats;
    let depth = plan.steps.iter().map(|step| step.verified_depth).fold(0.0, f64::max);
    let hit = if s.cache.plan_hit { ", plan remembered".to_owned() } else { reused(&s.cache) };
    let stages = [
        ("fields", s.sdf_time_s),
        ("overlaps", s.overlap_time_s.unwrap_or(0.0)),
        ("static analysis", s.static_analysis_time_s),
        ("paths", s.path_time_s),
        ("verification", s.verify_time_s),
        ("transfers", s.transfer_time_s.unwrap_or(0.0)),
    ];
    let lasting = stages.iter().filter(|(_, time)| *time >= SHORTEST);
    let times: Vec<String> = lasting.map(|(name, time)| format!("{name} {time:.3} s")).collect();
    let times = if times.is_empty() { String::new() } else { format!(": {}", times.join(", ")) };
    // Loading comes before what the total counts.
    let loaded = s.load_time_s.filter(|time| *time >= SHORTEST);
    let loaded = loaded.map_or_else(String::new, |time| format!("; loaded in {time:.3} s"));
    format!(
        "{} simulations ({} run), {} sweeps, {} states{hit}; verified to {}\ntotal {:.3} s{times}{loaded}\n",
        s.simulations,
        s.simulations_run,
        s.sweeps,
        s.states,
        length(depth, plan.units.as_deref()),
        s.total_time_s
    )
}

/// How much was there already.
fn reused(s: &CacheDocument) -> String {
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

/// Names beside the table.
fn words(parts: &[String], last: &str) -> String {
    let names: Vec<&str> = parts.iter().map(String::as_str).collect();
    part_words(&names, last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{plan_of, step_of};
    use crate::geometry::SourcePart;
    use crate::plan::{Base, Blocked, FreeGroup, Overlap, Plan, PlanStats, PlanStatus, PlanStep, Warning};

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
            parts: vec![part],
            of: None,
            ends: StepEnd::Out,
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
            reason: Some("Parts a and b remain. Nothing is proved.".into()),
            planner: "sbdp-star".into(),
            engine: "sliding".into(),
            units: Some("mm".into()),
            parts: ["a", "b", "c"].map(String::from).into(),
            removed: vec![],
            poses: vec![],
            targets: None,
            fixed: vec![],
            keep: vec![],
            base: Base { parts: vec![1], reason: Some("it is the largest".into()) },
            steps: vec![
                step(0, MotionKind::Rotation, vec![start, half_turn]),
                step(2, MotionKind::Translation, vec![start]),
            ],
            remaining: vec![1],
            kept_together: vec![],
            free_together: vec![FreeGroup { parts: vec![0, 1], direction: [0.0, 1.0, 0.0] }],
            blocked: vec![
                Blocked { part: 1, by: vec![0, 2], action: "+x".into() },
                Blocked { part: 1, by: vec![0], action: "-z".into() },
            ],
            overlaps: [(1, 0.25), (2, 0.5), (2, 0.125)]
                .map(|(b, depth)| Overlap { parts: [0, b], depth })
                .into(),
            warnings: vec![Warning { part: Some(2), message: "open".into() }],
            stats: PlanStats {
                motion_hits: 3,
                verdict_hits: Some(2),
                total_time_s: 1.5,
                verify_time_s: 0.25,
                ..PlanStats::default()
            },
        };
        let told = |verbose: bool, lines: &[&str]| {
            let text = super::plan(&assembly, &PlanDocument::from(&plan), verbose);
            lines.iter().for_each(|line| assert!(text.contains(line), "{line}\n{text}"));
        };
        let always = [
            "vice: infeasible; 2 of 3 parts come off",
            "1     a     rotation     0 mm, turning 180°             1",
            "2     c     translation  free already                   1",
            "  b: it is the largest",
            "not complete:\n  Parts a and b remain. Nothing is proved.\n\ncan begin to move together:\n  a, b along +Y\n\nblocked",
            "  c: open",
            "0 states, remembered: 3 motions, 2 verified paths; verified to 0.0100 mm\ntotal 1.500 s: verification 0.250 s\n",
        ];
        for verbose in [false, true] {
            told(verbose, &always);
        }
        told(
            false,
            &[
                "blocked:\n  b: -z by a\n  1 more blocked action of these parts (-v lists them)\n\n",
                "pose:\n  3 pairs, the deepest a and c: 0.5000 mm deep (-v lists them)\n\n",
            ],
        );
        told(
            true,
            &[
                "blocked:\n  b: +x by a, c; -z by a\n\n",
                "  a and b: 0.2500 mm deep\n  a and c: 0.5000 mm deep\n  a and c: 0.1250 mm deep\n\n",
            ],
        );
    }

    #[test]
    fn groups_are_told() {
        let boxes = [[0.0, 2.0], [2.0, 4.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]];
        let part = |(i, x): (usize, &[f64; 2])| SourcePart {
            name: i.to_string(),
            origin: String::new(),
            mesh: crate::fixtures::cuboid([x[0], 0.0, 0.0], [x[1], 2.0, 2.0]),
        };
        let parts: Vec<SourcePart> = boxes.iter().enumerate().map(part).collect();
        let names = parts.iter().map(|p| p.name.clone()).collect();
        let assembly = SourceAssembly { name: "box".into(), parts, ..Default::default() };
        let start = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let step = |parts: &[usize], of, ends, path: Vec<[f64; 7]>| PlanStep {
            parts: parts.to_vec(),
            of,
            ends,
            path,
            ..step_of(0)
        };
        let half_turn = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let turned = PlanStep {
            motion: MotionKind::Rotation,
            ..step(&[0, 1], None, StepEnd::Out, vec![start, half_turn])
        };
        let steps = vec![
            turned,
            step(&[1], Some(0), StepEnd::Aside, vec![start, [0.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0]]),
            step(&[2, 3, 4, 5, 6], None, StepEnd::Out, vec![start]),
        ];
        let plan =
            Plan { parts: names, kept_together: vec![vec![0, 1]], ..plan_of(PlanStatus::Complete, steps) };
        let text = super::plan(&assembly, &PlanDocument::from(&plan), false);
        // The middle of both boxes is at (2, 1): half a turn about the origin brings it to (−2, −1).
        for line in [
            "step  part                   group of  motion              length",
            "1     0, 1                             rotation            4.47, turning 180°",
            "2     1                      step 1    translation, aside  3.00",
            "3     2, 3, 4, 5 and 1 more            translation         free already",
            "left together and not taken apart:\n  parts 0, 1\n",
            "box: complete; 7 of 7 parts come off",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
    }
}
