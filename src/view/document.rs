//! Reads plans as JSON from strangers: what is read here holds together.

use std::collections::HashSet;

use super::ViewError;
use crate::geometry::Waypoint;
use crate::plan::PlanKind;
use crate::plan::export::{PlanDocument, SCHEMA};

/// Quaternions of waypoints are this close to unit length.
const UNIT: f64 = 1e-3;
/// Coordinates of waypoints are smaller: squares of single floats must be finite.
const FURTHEST: f64 = 1e18;

/// What a plan does that was read with [`read_plan`].
#[must_use]
pub fn kind_of(plan: &PlanDocument) -> PlanKind {
    if plan.kind == PlanKind::Assembly.name() { PlanKind::Assembly } else { PlanKind::Disassembly }
}

/// Reads a plan and checks that it holds together: known schema and kind, all names those of parts, no part
/// moved twice, paths of at least one rigid transform.
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
        ("base", &plan.base),
        ("remaining", &plan.remaining),
    ];
    let lists = lists.into_iter().flat_map(|(field, list)| list.iter().map(move |n| (field, n)));
    let targets = plan.targets.iter().flatten().map(|n| ("targets", n));
    let poses = plan.initial.poses.keys().map(|n| ("initial.poses", n));
    let steps = plan.steps.iter().map(|s| ("steps[].part", &s.part));
    let blocked = plan.blocked.iter().flat_map(|b| {
        std::iter::once(("blocked[].part", &b.part)).chain(b.by.iter().map(|n| ("blocked[].by", n)))
    });
    lists.chain(targets).chain(poses).chain(steps).chain(blocked).map(|(field, name)| (field, name.as_str()))
}

fn check_steps(plan: &PlanDocument) -> Result<(), String> {
    let mut gone: HashSet<&str> = plan.initial.removed.iter().map(String::as_str).collect();
    for (i, step) in plan.steps.iter().enumerate() {
        if !gone.insert(&step.part) {
            return Err(format!("`steps[{i}]` moves `{}`, which moved or was gone before", step.part));
        }
        if step.path.is_empty() {
            return Err(format!("`steps[{i}].path` is empty; a part that is free has one waypoint"));
        }
        if let Some(number) = step.requires.iter().find(|number| **number >= i) {
            return Err(format!("`steps[{i}].requires` has {number}, which is no step before it"));
        }
        for (k, waypoint) in step.path.iter().enumerate() {
            check_waypoint(waypoint).map_err(|e| format!("`steps[{i}].path[{k}]` {e}"))?;
        }
    }
    Ok(())
}

fn check_waypoint(waypoint: &Waypoint) -> Result<(), String> {
    let norm = waypoint[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
    if !waypoint.iter().all(|x| x.is_finite()) {
        return Err("is not finite".to_owned());
    }
    if let Some(far) = waypoint[..3].iter().find(|x| x.abs() > FURTHEST) {
        return Err(format!("is {far:e} away; more than {FURTHEST:e} cannot be shown"));
    }
    if (norm - 1.0).abs() > UNIT {
        return Err(format!("has a quaternion of length {norm:.3} instead of 1"));
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::plan::export::StepDocument;

    /// A plan of two parts, of which the second is lifted.
    pub(in crate::view) fn plan() -> PlanDocument {
        let text = r#"{"schema":"sbdp-plan/1.1","status":"complete","reason":null,"planner":"sbdp-star",
            "engine":"sliding","units":"mm","parts":["0","1"],"initial":{"removed":[],"poses":{}},
            "targets":null,"fixed":[],"base":[],"base_reason":null,"steps":[{"part":"1","motion":"translation",
            "path":[[0,0,0,1,0,0,0],[0,0,2,1,0,0,0]],"verified_depth":0,"requires":[],
            "wave":0,"direction":[0,0,1]}],"remaining":["0"],"blocked":[],
            "overlaps":[],"warnings":[],"stats":{"simulations":0,"simulations_run":0,"sweeps":0,"states":0,
            "sdf_time_s":0,"static_analysis_time_s":0,"path_time_s":0,"verify_time_s":0,"total_time_s":0,
            "cache":{"sdf_hits":0,"blocking_hits":0,"motion_hits":0,"plan_hit":false}}}"#;
        read_plan(text).unwrap()
    }

    /// A step along some waypoints.
    pub(in crate::view) fn step(part: &str, path: &[Waypoint]) -> StepDocument {
        StepDocument {
            part: part.into(),
            motion: "translation".into(),
            path: path.to_vec(),
            verified_depth: 0.0,
            requires: vec![],
            wave: 0,
            direction: None,
        }
    }

    fn refusal(change: impl FnOnce(&mut PlanDocument)) -> String {
        let mut plan = plan();
        change(&mut plan);
        read_plan(&plan.to_json().unwrap()).unwrap_err().to_string()
    }

    #[test]
    fn what_is_wrong_is_named() {
        let still = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        assert!(refusal(|p| p.schema = "sbdp-plan/9".into()).contains("`sbdp-plan/9`"));
        assert!(refusal(|p| p.kind = "repair".into()).contains("`repair`"));
        assert!(refusal(|p| p.parts.push("1".into())).contains("`1` twice"));
        assert!(refusal(|p| p.steps[0].part = "x".into()).contains("`steps[].part` names `x`"));
        assert!(refusal(|p| p.steps.push(step("1", &[still]))).contains("`steps[1]` moves `1`"));
        assert!(refusal(|p| p.steps[0].requires.push(0)).contains("`steps[0].requires` has 0"));
        assert!(refusal(|p| p.steps[0].path.clear()).contains("`steps[0].path` is empty"));
        assert!(refusal(|p| p.steps[0].path[1][3] = 3.0).contains("`steps[0].path[1]` has a quaternion"));
        assert!(refusal(|p| p.steps[0].path[1][2] = -1e300).contains("cannot be shown"));
        assert!(refusal(|p| p.initial.poses.extend([("0".into(), [0.0; 7])])).contains("initial.poses.0"));
    }

    #[test]
    fn other_files_are_told_apart() {
        for (text, reason) in
            [("v 0 0 0", "not JSON"), ("[]", "no `schema`"), ("{\"schema\":3}", "no `schema`")]
        {
            let error = read_plan(text).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains("sbdp plan --json"), "{error}");
        }
        let error = read_plan(r#"{"schema":"sbdp-plan/1.1","status":"complete"}"#).unwrap_err().to_string();
        assert!(error.contains("missing field"), "{error}");
    }

    #[test]
    fn a_plan_without_a_kind_takes_apart() {
        assert_eq!(kind_of(&plan()), PlanKind::Disassembly);
        let assembly = PlanDocument { kind: "assembly".into(), ..plan() };
        assert_eq!(kind_of(&read_plan(&assembly.to_json().unwrap()).unwrap()), PlanKind::Assembly);
    }
}
