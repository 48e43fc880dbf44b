//! Where the parts of a plan stand while it is carried out, and which of them are one body then.
//!
//! A body is the assembly, or a group that a step took out of one. A body has a frame: the rigid motion from where its
//! parts stood in the assembly to where the body stands. A part has a pose in its body: the identity, or another one
//! once it was moved aside. A step moves parts within the frame of their body, so a part is at
//! `frame of the body ∘ waypoint ∘ pose in the body ∘ assembled pose`. An assembly plan is the same backwards.

use std::collections::{HashMap, HashSet};

use super::{PlanDocument, StepDocument};
use crate::geometry::{Pose, pose_from_waypoint};
use crate::plan::{PlanKind, StepEnd};

/// Radians, and share of the length of the way. A rigid motion that differs from another by less is the same one: products of a
/// few motions with coordinates in double precision are off by some 1e-15, in text of twelve digits by 1e-12. At half and
/// double no effect; a thousand times as much takes parts that were moved by a hair for parts that were not.
pub(crate) const MOTION_ROUNDING: f64 = 1e-9;

/// Where a step acts. Rigid motions in the input's units and frame.
#[derive(Debug, Clone, PartialEq)]
pub struct StepFrame {
    /// The frame of the body that the step takes its parts from, or adds them to.
    pub body: Pose,
    /// By part of the step: its pose in that body when the step begins (of an assembly plan: when it ends).
    pub standing: Vec<Pose>,
    /// Where the step leaves its parts.
    pub ends: StepEnd,
}

/// Where parts stand during a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Placements {
    /// By step.
    pub steps: Vec<StepFrame>,
    /// By part: the motion from its assembled pose to where it is when everything is apart: in the end, or, of an
    /// assembly plan, at the start.
    pub apart: Vec<Pose>,
}

/// A part that is there.
#[derive(Debug, Clone, Copy)]
struct Standing {
    /// The step that took its body out; `None` in the assembly.
    body: Option<usize>,
    pose: Pose,
}

/// What a step moves, and what stands with it in the same body meanwhile: numbers of parts, each with its pose in that body.
#[derive(Debug, Clone, PartialEq)]
pub struct StepParts {
    /// What it moves.
    pub moving: Vec<(usize, Pose)>,
    /// What stands.
    pub standing: Vec<(usize, Pose)>,
}

/// What a step took out.
#[derive(Debug, Clone, Copy)]
struct Body {
    frame: Pose,
    /// It has several parts.
    is_group: bool,
}

impl Placements {
    /// Carries a plan out: that of an assembly backwards.
    ///
    /// # Errors
    /// The steps contradict each other, in words that name the step: one moves no part, one part twice, one that does
    /// not stand in the body named by `of`, or along no path; or it ends in a way that is not known, or not of this
    /// kind of plan.
    pub fn new(kind: PlanKind, plan: &PlanDocument) -> Result<Self, String> {
        Self::carried_out(kind, plan, |_, _| ())
    }

    /// By step, what it moves and what stands with it then.
    ///
    /// # Errors
    /// As of [`Self::new`].
    pub fn parts_of_steps(kind: PlanKind, plan: &PlanDocument) -> Result<Vec<StepParts>, String> {
        let mut found: Vec<Option<StepParts>> = vec![None; plan.steps.len()];
        Self::carried_out(kind, plan, |number, parts| found[number] = Some(parts()))?;
        Ok(found.into_iter().flatten().collect())
    }

    /// Carries a plan out. `visit` is called with the number of each step and what says which parts it is about.
    fn carried_out(
        kind: PlanKind,
        plan: &PlanDocument,
        mut visit: impl FnMut(usize, &dyn Fn() -> StepParts),
    ) -> Result<Self, String> {
        let numbers: HashMap<&str, usize> = plan.parts.iter().map(String::as_str).zip(0..).collect();
        let whole = Standing { body: None, pose: Pose::identity() };
        let mut parts: Vec<Option<Standing>> = vec![Some(whole); plan.parts.len()];
        let gone = plan.initial.removed.iter().filter_map(|name| numbers.get(name.as_str()));
        gone.for_each(|&part| parts[part] = None);
        let mut bodies: Vec<Option<Body>> = vec![None; plan.steps.len()];
        let mut steps: Vec<Option<StepFrame>> = vec![None; plan.steps.len()];
        for turn in 0..plan.steps.len() {
            let number = match kind {
                PlanKind::Disassembly => turn,
                PlanKind::Assembly => plan.steps.len() - 1 - turn,
            };
            let step = &plan.steps[number];
            let ends = ending(kind, number, step)?;
            let body = body_of(kind, number, step, &bodies)?;
            let far = match kind {
                PlanKind::Disassembly => step.path.last(),
                PlanKind::Assembly => step.path.first(),
            };
            let far = far.map(pose_from_waypoint).ok_or_else(|| {
                format!("`steps[{number}].path` is empty; parts that are free have one waypoint")
            })?;
            let (mut moving, mut once) = (Vec::new(), HashSet::new());
            for name in &step.parts {
                let part = *numbers.get(name.as_str()).ok_or_else(|| {
                    format!("`steps[{number}].parts` names `{name}`, which is not among `parts`")
                })?;
                if !once.insert(part) {
                    return Err(format!("`steps[{number}].parts` names `{name}` twice"));
                }
                let stands = parts[part].filter(|stands| stands.body == step.of);
                moving.push((part, stands.ok_or_else(|| misplaced(kind, number, step, name))?.pose));
            }
            visit(number, &|| {
                let standing = parts.iter().enumerate().filter_map(|(part, stands)| {
                    stands
                        .filter(|stands| stands.body == step.of && !once.contains(&part))
                        .map(|s| (part, s.pose))
                });
                StepParts { moving: moving.clone(), standing: standing.collect() }
            });
            for &(part, pose) in &moving {
                parts[part] = Some(match ends {
                    StepEnd::Aside => Standing { body: step.of, pose: far * pose },
                    StepEnd::Out | StepEnd::In => Standing { body: Some(number), pose },
                });
            }
            let standing = moving.into_iter().map(|(_, pose)| pose).collect();
            bodies[number] =
                Some(Body { frame: body * far, is_group: ends != StepEnd::Aside && step.parts.len() > 1 });
            steps[number] = Some(StepFrame { body, standing, ends });
        }
        let frame = |body: Option<usize>| {
            body.and_then(|step| bodies[step]).map_or_else(Pose::identity, |body| body.frame)
        };
        let apart = parts.iter().map(|part| part.map_or_else(Pose::identity, |p| frame(p.body) * p.pose));
        Ok(Self { apart: apart.collect(), steps: steps.into_iter().flatten().collect() })
    }
}

fn ending(kind: PlanKind, number: usize, step: &StepDocument) -> Result<StepEnd, String> {
    let known = match kind {
        PlanKind::Disassembly => [StepEnd::Out, StepEnd::Aside],
        PlanKind::Assembly => [StepEnd::In, StepEnd::Aside],
    };
    if step.parts.is_empty() {
        return Err(format!("`steps[{number}].parts` is empty"));
    }
    known.into_iter().find(|end| end.name() == step.ends).ok_or_else(|| {
        let [one, other] = known.map(StepEnd::name);
        format!("`steps[{number}].ends` is `{}`; known here are `{one}` and `{other}`", step.ends)
    })
}

/// The frame of the body that a step acts in.
fn body_of(
    kind: PlanKind,
    number: usize,
    step: &StepDocument,
    bodies: &[Option<Body>],
) -> Result<Pose, String> {
    let Some(of) = step.of else { return Ok(Pose::identity()) };
    match bodies.get(of).copied().flatten().filter(|body| body.is_group) {
        Some(body) => Ok(body.frame),
        None => {
            let what = match kind {
                PlanKind::Disassembly => "takes several parts out before it",
                PlanKind::Assembly => "puts several parts in after it",
            };
            Err(format!("`steps[{number}].of` is {of}, which is no step that {what}"))
        }
    }
}

fn misplaced(kind: PlanKind, number: usize, step: &StepDocument, name: &str) -> String {
    let body = match step.of {
        None => "the assembly".to_owned(),
        Some(of) => format!("the group of `steps[{of}]`"),
    };
    let when = match kind {
        PlanKind::Disassembly => "before",
        PlanKind::Assembly => "after",
    };
    format!("`steps[{number}]` moves `{name}`, which does not stand in {body} {when} it")
}
