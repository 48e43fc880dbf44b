//! Reads plans as JSON from strangers: what is read here holds together.

use std::collections::HashSet;

use nalgebra::Vector3;

use super::ViewError;
use crate::document::{MOTION_ROUNDING, Placements, kind_of};
use crate::document::{PlanDocument, SCHEMA, StepDocument};
use crate::geometry::Waypoint;
use crate::plan::PlanKind;

/// Quaternions of waypoints are this close to unit length.
const UNIT: f64 = 1e-3;
/// Coordinates of waypoints are smaller: squares of single floats must be finite.
const FURTHEST: f64 = 1e18;

/// Reads a plan and checks that it holds together: known schema and kind, all names those of parts, each step moves
/// parts that stand in the body that it names, paths of at least one rigid transform, of which the first (of an assembly
/// plan: the last) is the identity.
///
/// # Errors
/// It is no plan, or does not hold together; the error names the place.
pub fn read_plan(text: &str) -> Result<PlanDocument, ViewError> {
    let refused = |reason: String| ViewError::NoPlan { reason };
    let raw: serde_json::Value = serde_json::from_str(text).map_err(|e| refused(format!("not JSON: {e}")))?;
    match raw.get("schema").and_then(|s| s.as_str()) {
        Some(SCHEMA) => {}
        Some(other) => return Err(refused(format!("its schema is `{other}`"))),
        None => return Err(refused("it has no `schema`".to_owned())),
    }
    // From the text once more, so that the error says where.
    let plan = PlanDocument::from_json(text).map_err(|e| refused(e.to_string()))?;
    check(&plan).map_err(refused)?;
    Ok(plan)
}

fn check(plan: &PlanDocument) -> Result<(), String> {
    if ![PlanKind::Assembly, PlanKind::Disassembly].map(PlanKind::name).contains(&plan.kind.as_str()) {
        return Err(format!("`kind` is `{}`; known are `disassembly` and `assembly`", plan.kind));
    }
    let mut parts = HashSet::new();
    if let Some(twice) = plan.parts.iter().find(|p| !parts.insert(p.as_str())) {
        return Err(format!("`parts` names `{twice}` twice"));
    }
    for (field, name) in named(plan) {
        if !parts.contains(name) {
            return Err(format!("`{field}` names `{name}`, which is not among `parts`"));
        }
    }
    for (name, pose) in &plan.initial.poses {
        check_waypoint(pose).map_err(|e| format!("`initial.poses.{name}` {e}"))?;
    }
    check_steps(plan)
}

/// All names of parts outside `parts`, with their fields.
fn named(plan: &PlanDocument) -> impl Iterator<Item = (&'static str, &str)> {
    let lists = [
        ("initial.removed", &plan.initial.removed),
        ("fixed", &plan.fixed),
        ("keep", &plan.keep),
        ("base", &plan.base),
        ("remaining", &plan.remaining),
    ];
    let lists = lists.into_iter().flat_map(|(field, list)| list.iter().map(move |n| (field, n)));
    let targets = plan.targets.iter().flatten().map(|n| ("targets", n));
    let poses = plan.initial.poses.keys().map(|n| ("initial.poses", n));
    let steps = plan.steps.iter().flat_map(|s| s.parts.iter().map(|n| ("steps[].parts", n)));
    let kept = plan.kept_together.iter().flatten().map(|n| ("kept_together", n));
    let free = plan.free_together.iter().flat_map(|g| g.parts.iter().map(|n| ("free_together[].parts", n)));
    let groups = kept.chain(free);
    let blocked = plan.blocked.iter().flat_map(|b| {
        std::iter::once(("blocked[].part", &b.part)).chain(b.by.iter().map(|n| ("blocked[].by", n)))
    });
    let states = plan.initial.stability.iter().chain(plan.steps.iter().filter_map(|s| s.stability.as_ref()));
    let stability = states.flat_map(|state| {
        let unstable = state
            .unstable
            .iter()
            .flat_map(|u| u.falls.iter().map(|fall| &fall.part).chain(u.hold.iter().flatten()));
        unstable.chain(&state.unknown).map(|n| ("stability", n))
    });
    let clearance = plan.steps.iter().filter_map(|s| s.clearance.as_ref()).flat_map(|clearance| {
        let closest = clearance.closest.iter().flat_map(|closest| [&closest.moving, &closest.standing]);
        closest.chain(&clearance.touching).map(|n| ("steps[].clearance", n))
    });
    let tools = plan.steps.iter().filter_map(|s| s.tools.as_ref()).flatten();
    let tools = tools.flat_map(|tool| tool.blocked_by.iter().map(|n| ("steps[].tools[].blocked_by", n)));
    let reports = stability.chain(clearance).chain(tools);
    let listed = lists.chain(targets).chain(poses).chain(steps).chain(groups).chain(blocked).chain(reports);
    listed.map(|(field, name)| (field, name.as_str()))
}

fn check_steps(plan: &PlanDocument) -> Result<(), String> {
    let placements = Placements::new(kind_of(plan), plan)?;
    for (i, (step, frame)) in plan.steps.iter().zip(&placements.steps).enumerate() {
        if let Some(number) = step.requires.iter().find(|number| **number >= i) {
            return Err(format!("`steps[{i}].requires` has {number}, which is no step before it"));
        }
        for (k, waypoint) in step.path.iter().enumerate() {
            check_waypoint(waypoint).map_err(|e| format!("`steps[{i}].path[{k}]` {e}"))?;
        }
        check_start(kind_of(plan), step).map_err(|e| format!("`steps[{i}].path` {e}"))?;
        let motions = std::iter::once(&frame.body).chain(&frame.standing);
        let mut shifts = motions.map(|motion| &motion.translation.vector);
        shifts.try_for_each(check_distance).map_err(|e| format!("what `steps[{i}]` moves {e}"))?;
    }
    Ok(())
}

/// A path begins with the identity; that of an insertion ends with it.
fn check_start(kind: PlanKind, step: &StepDocument) -> Result<(), String> {
    let (waypoint, what) = match kind {
        PlanKind::Disassembly => (step.path.first(), "first"),
        PlanKind::Assembly => (step.path.last(), "last"),
    };
    let Some([shift @ .., _, i, j, k]) = waypoint else { return Ok(()) };
    let largest = step.path.iter().flat_map(|w| &w[..3]).fold(0.0, |a: f64, x| a.max(x.abs()));
    let is_shifted = shift.iter().any(|x| x.abs() > MOTION_ROUNDING * largest);
    if is_shifted || [i, j, k].iter().any(|x| x.abs() > MOTION_ROUNDING) {
        return Err(format!("has a {what} waypoint other than the identity"));
    }
    Ok(())
}

fn check_distance(shift: &Vector3<f64>) -> Result<(), String> {
    let far = shift.amax();
    // Infinity minus infinity is no number.
    if far.is_nan() || far > FURTHEST {
        return Err(format!("is {far:e} away; more than {FURTHEST:e} cannot be shown"));
    }
    Ok(())
}

fn check_waypoint(waypoint: &Waypoint) -> Result<(), String> {
    let norm = waypoint[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
    if !waypoint.iter().all(|x| x.is_finite()) {
        return Err("is not finite".to_owned());
    }
    check_distance(&Vector3::from_column_slice(&waypoint[..3]))?;
    if (norm - 1.0).abs() > UNIT {
        return Err(format!("has a quaternion of length {norm:.3} instead of 1"));
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::document::FreeGroupDocument;

    /// A plan of two parts, of which the second is lifted.
    pub(in crate::view) fn plan() -> PlanDocument {
        let text = r#"{"schema":"sbdp-plan/2","status":"complete","reason":null,"planner":"sbdp-star",
            "engine":"sliding","units":"mm","parts":["0","1"],"initial":{"removed":[],"poses":{}},
            "targets":null,"fixed":[],"base":[],"base_reason":null,"steps":[{"parts":["1"],"of":null,"ends":"out","motion":"translation",
            "path":[[0,0,0,1,0,0,0],[0,0,2,1,0,0,0]],"verified_depth":0,"requires":[],
            "wave":0,"direction":[0,0,1]}],"remaining":["0"],"kept_together":[],"free_together":[],"blocked":[],
            "overlaps":[],"warnings":[],"stats":{"simulations":0,"simulations_run":0,"sweeps":0,"states":0,
            "sdf_time_s":0,"static_analysis_time_s":0,"path_time_s":0,"verify_time_s":0,"total_time_s":0,
            "cache":{"sdf_hits":0,"blocking_hits":0,"motion_hits":0,"plan_hit":false}}}"#;
        read_plan(text).unwrap()
    }

    /// A step along some waypoints.
    pub(in crate::view) fn step(part: &str, path: &[Waypoint]) -> StepDocument {
        StepDocument {
            parts: vec![part.into()],
            of: None,
            ends: "out".into(),
            motion: "translation".into(),
            path: path.to_vec(),
            verified_depth: 0.0,
            requires: vec![],
            wave: 0,
            direction: None,
            stability: None,
            clearance: None,
            tools: None,
        }
    }

    fn refusal(change: impl FnOnce(&mut PlanDocument)) -> String {
        let mut plan = plan();
        change(&mut plan);
        read_plan(&plan.to_json().unwrap()).unwrap_err().to_string()
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert!(refusal(|p| p.schema = "sbdp-plan/9".into()).contains("`sbdp-plan/9`"));
        assert!(refusal(|p| p.kind = "repair".into()).contains("`repair`"));
        assert!(refusal(|p| p.parts.push("1".into())).contains("`1` twice"));
        assert!(refusal(|p| p.steps[0].parts[0] = "x".into()).contains("`steps[].parts` names `x`"));
        assert!(refusal(|p| p.kept_together.push(vec!["x".into()])).contains("`kept_together` names `x`"));
        let free = FreeGroupDocument { parts: vec!["x".into()], direction: [0.0; 3] };
        assert!(refusal(|p| p.free_together.push(free)).contains("`free_together[].parts` names `x`"));
        assert!(refusal(|p| p.steps[0].requires.push(0)).contains("`steps[0].requires` has 0"));
        assert!(refusal(|p| p.steps[0].path.clear()).contains("`steps[0].path` is empty"));
        assert!(refusal(|p| p.steps[0].path[1][3] = 3.0).contains("`steps[0].path[1]` has a quaternion"));
        assert!(refusal(|p| p.steps[0].path[1][2] = -1e300).contains("cannot be shown"));
        assert!(refusal(|p| p.initial.poses.extend([("0".into(), [0.0; 7])])).contains("initial.poses.0"));
    }

    /// Takes 0, 1 and 2 out together, moves 1 aside in this group, takes 1 and 2 out of it as a group of their own, and
    /// then these apart; 3 stays.
    pub(in crate::view) fn nested() -> PlanDocument {
        let still = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let moved = |parts: &[&str], of: Option<usize>, ends: &str, along: [f64; 3]| StepDocument {
            parts: parts.iter().map(|&name| name.to_owned()).collect(),
            of,
            ends: ends.into(),
            requires: of.into_iter().collect(),
            ..step("0", &[still, [along[0], along[1], along[2], 1.0, 0.0, 0.0, 0.0]])
        };
        let steps = vec![
            moved(&["0", "1", "2"], None, "out", [0.0, 0.0, 8.0]),
            moved(&["1"], Some(0), "aside", [1.0, 0.0, 0.0]),
            moved(&["1", "2"], Some(0), "out", [0.0, 5.0, 0.0]),
            moved(&["2"], Some(2), "out", [6.0, 0.0, 0.0]),
        ];
        let parts = ["0", "1", "2", "3"].map(String::from).into();
        PlanDocument { parts, steps, remaining: vec!["3".into()], ..plan() }
    }

    /// A plan backwards.
    pub(in crate::view) fn reversed(mut plan: PlanDocument) -> PlanDocument {
        let last = plan.steps.len() - 1;
        plan.kind = "assembly".into();
        plan.steps.reverse();
        for step in &mut plan.steps {
            step.path.reverse();
            step.of = step.of.map(|of| last - of);
            step.ends = step.ends.replace("out", "in");
        }
        let groups: Vec<Option<usize>> = plan.steps.iter().map(|step| step.of).collect();
        for (number, step) in plan.steps.iter_mut().enumerate() {
            step.requires = (0..number).filter(|inner| groups[*inner] == Some(number)).collect();
        }
        plan
    }

    #[test]
    fn groups_and_parts_aside_hold_together_either_way() {
        for plan in [nested(), reversed(nested())] {
            let text = plan.to_json().unwrap();
            assert_eq!(read_plan(&text).unwrap(), plan);
        }
    }

    #[test]
    fn parts_move_only_where_they_stand() {
        let refused = |plan: PlanDocument, change: fn(&mut Vec<StepDocument>)| {
            let mut plan = plan;
            change(&mut plan.steps);
            read_plan(&plan.to_json().unwrap()).unwrap_err().to_string()
        };
        let apart = |change: fn(&mut Vec<StepDocument>)| refused(nested(), change);
        let together = |change: fn(&mut Vec<StepDocument>)| refused(reversed(nested()), change);
        for (error, words) in [
            (apart(|s| s[1].parts.clear()), "`steps[1].parts` is empty"),
            (apart(|s| s[2].parts.push("1".into())), "`steps[2].parts` names `1` twice"),
            (
                apart(|s| s[3].parts = vec!["0".into()]),
                "moves `0`, which does not stand in the group of `steps[2]` before it",
            ),
            (
                apart(|s| s[3].of = Some(0)),
                "moves `2`, which does not stand in the group of `steps[0]` before it",
            ),
            (apart(|s| s[3].of = None), "moves `2`, which does not stand in the assembly before it"),
            (
                apart(|s| s[1].of = Some(2)),
                "`steps[1].of` is 2, which is no step that takes several parts out before it",
            ),
            (apart(|s| s[2].of = Some(1)), "`steps[2].of` is 1"),
            (apart(|s| s[2].of = Some(9)), "`steps[2].of` is 9"),
            (apart(|s| s[2].ends = "in".into()), "`steps[2].ends` is `in`; known here are `out` and `aside`"),
            (
                apart(|s| s[2].path[0][1] = 0.1),
                "`steps[2].path` has a first waypoint other than the identity",
            ),
            (
                apart(|s| s.iter_mut().for_each(|s| s.path[1][2] = 9e17)),
                "what `steps[3]` moves is 1.8e18 away",
            ),
            (
                together(|s| s[1].ends = "out".into()),
                "`steps[1].ends` is `out`; known here are `in` and `aside`",
            ),
            (
                together(|s| s[0].of = Some(0)),
                "`steps[0].of` is 0, which is no step that puts several parts in after it",
            ),
            (
                together(|s| s[0].of = Some(3)),
                "moves `2`, which does not stand in the group of `steps[3]` after it",
            ),
            (
                together(|s| s[1].path[1][4] = 1e-6),
                "`steps[1].path` has a last waypoint other than the identity",
            ),
        ] {
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    #[test]
    fn other_files_are_told_apart() {
        for (text, reason) in
            [("v 0 0 0", "not JSON"), ("[]", "no `schema`"), ("{\"schema\":3}", "no `schema`")]
        {
            let error = read_plan(text).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains("sbdp plan --json"), "{error}");
        }
        let error = read_plan(r#"{"schema":"sbdp-plan/2","status":"complete"}"#).unwrap_err().to_string();
        assert!(error.contains("missing field"), "{error}");
    }

    #[test]
    fn a_plan_without_a_kind_takes_apart() {
        assert_eq!(kind_of(&plan()), PlanKind::Disassembly);
        let assembly = reversed(plan());
        assert_eq!(kind_of(&read_plan(&assembly.to_json().unwrap()).unwrap()), PlanKind::Assembly);
    }
}
