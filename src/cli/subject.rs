//! A plan with the assembly that it is about, for what shows plans.

use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, Unit, UnitQuaternion};
use sbdp_ipc::document::FloorDocument;

use super::error::CliError;
use super::part_names::part_named;
use crate::blocking_graph::DirectionalGraph;
use crate::cache::CacheSettings;
use crate::document::content_of;
use crate::document::{MOTION_ROUNDING, Placements, kind_of};
use crate::document::{PlanDocument, SourceDocument};
use crate::files::{LoadOptions, StepSettings, customary_up, load};
use crate::geometry::{
    Assembly, Floor, Pose, Revision, SourceAssembly, SourceMesh, content_hash, pose_from_waypoint,
};
use crate::plan::PlanKind;
use crate::search::Termination;
use crate::service::{AssemblyId, Service};
use crate::view::{Instructions, PlanScene, Up, ViewError, equal_parts, glb, page, read_plan};

/// A plan, and the meshes that it moves.
pub(super) struct Subject {
    /// The assembly as it was read (and turned).
    pub(super) base: SourceAssembly,
    /// What differs from it.
    pub(super) revision: Revision,
    /// The plan.
    pub(super) plan: PlanDocument,
}

impl From<ViewError> for CliError {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::TooLarge(_) => Self::Failed(error.to_string()),
            ViewError::NoPlan { .. } | ViewError::Mismatch { .. } => Self::Refused(error.to_string()),
        }
    }
}

impl Subject {
    /// A plan about an assembly that differs by a revision from what was read. Parts are moved as the plan has
    /// them assembled.
    pub(super) fn new(base: SourceAssembly, revision: Revision, plan: PlanDocument) -> Self {
        let names: Vec<&String> = base.parts.iter().chain(&revision.added).map(|p| &p.name).collect();
        // A part that is not there is found when plan and assembly are put together.
        let place = |name: &String| names.iter().position(|n| *n == name);
        let moved = assembled_poses(&plan).into_iter().filter_map(|(name, pose)| Some((place(name)?, pose)));
        let revision = Revision { moved: moved.collect(), ..revision };
        Self { base, revision, plan }
    }

    /// A plan from a file, with the assembly that it names or another one.
    pub(super) fn read(file: &Path, meshes: Option<&Path>) -> Result<Self, CliError> {
        Self::of(plan_in(file)?, meshes)
    }

    /// A plan with the assembly that it names or another one.
    pub(super) fn of(plan: PlanDocument, meshes: Option<&Path>) -> Result<Self, CliError> {
        let source = plan.source.clone().unwrap_or_default();
        let path = match meshes {
            Some(path) => path.to_owned(),
            None if source.assembly.is_empty() => {
                let reason = "the plan does not say where its meshes are; name the assembly with --meshes";
                return Err(CliError::Refused(reason.to_owned()));
            }
            None => PathBuf::from(&source.assembly),
        };
        if meshes.is_none() && !path.exists() {
            return Err(CliError::Refused(format!(
                "the meshes of the plan were in {}, where there is nothing; name the assembly with --meshes",
                path.display()
            )));
        }
        let options = options(&source)?;
        let mut base = load(&path, &options)?;
        let content = content_hash(&base);
        if let Some([w, x, y, z]) = source.rotate {
            base.rotate(&UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)));
        }
        let revision = revision(&base, &source, &options)?;
        if !source.content.is_empty() && content_of(&content, &revision) != source.content {
            let other = format!("the meshes in {} are not those that were planned", path.display());
            match meshes {
                // A user who names them may mean them: finer ones of the same parts.
                Some(_) => eprintln!("warning: {other}"),
                None => {
                    let advice = "plan again, or name the assembly with --meshes";
                    return Err(CliError::Refused(format!("{other}: {advice}")));
                }
            }
        }
        Ok(Self::new(base, revision, plan))
    }

    pub(super) fn admitted(&self) -> Result<(Service, AssemblyId), CliError> {
        let service = Service::default();
        let base = service.admit(&self.base)?;
        let id = service.revise(base.id, &self.revision)?.id;
        Ok((service, id))
    }

    /// The same, refused unless it has just the parts of the plan, so that these have the same numbers.
    pub(super) fn admitted_with_parts_of_plan(&self) -> Result<(Service, AssemblyId), CliError> {
        let (service, id) = self.admitted()?;
        if service.assembly(id)?.parts.iter().map(|part| &part.name).ne(&self.plan.parts) {
            return Err(CliError::Refused("the assembly has other parts than the plan".to_owned()));
        }
        Ok((service, id))
    }

    /// The assembly as the plan begins with it.
    pub(super) fn assembly(&self) -> Result<Assembly, CliError> {
        let (service, id) = self.admitted()?;
        Ok(service.assembly(id)?)
    }

    /// Which way is up, by the custom of its files.
    pub(super) fn up(&self) -> Up {
        if customary_up(&self.base)[1] > 0.0 { Up::Y } else { Up::Z }
    }

    /// The plan as instructions, in which equal parts are known by their shapes.
    pub(super) fn instructions(&self, assembly: &Assembly) -> Result<Instructions, CliError> {
        let classes = equal_parts(assembly);
        let class = |name: &String| {
            let part = assembly.parts.iter().position(|p| p.name == *name);
            part.map(|p| classes[p])
                .ok_or_else(|| CliError::Refused(format!("the assembly has no part `{name}`")))
        };
        let classes: Vec<usize> = self.plan.parts.iter().map(class).collect::<Result<_, _>>()?;
        Ok(Instructions::of(&self.plan, Some(&classes)))
    }

    /// The plan as a GLB scene.
    pub(super) fn glb(&self) -> Result<Vec<u8>, CliError> {
        Ok(glb::glb(&PlanScene::new(&self.assembly()?, self.up(), &self.plan)?)?)
    }

    /// The plan as a page, blocking graphs included.
    pub(super) fn page(&self, termination: &Termination) -> Result<String, CliError> {
        let (service, id) = self.admitted()?;
        let assembly = service.assembly(id)?;
        let names: Vec<String> = assembly.parts.iter().map(|p| p.name.clone()).collect();
        let is_gone = |name: &String| self.plan.initial.removed.contains(name);
        let removed: Vec<usize> = (0..names.len()).filter(|&i| is_gone(&names[i])).collect();
        let graphs: Option<Vec<DirectionalGraph>> =
            service.blocking_graphs(id, None, &removed, termination)?;
        let graphs = graphs.ok_or_else(|| CliError::Failed("interrupted".to_owned()))?;
        let scene = PlanScene::new(&assembly, self.up(), &self.plan)?;
        page::page(&scene, &self.instructions(&assembly)?, &names, &graphs)
            .map_err(|e| CliError::Failed(format!("cannot write the scene as JSON: {e}")))
    }
}

/// The plan in a file.
pub(super) fn plan_in(file: &Path) -> Result<PlanDocument, CliError> {
    let refused = |e: &dyn std::fmt::Display| CliError::Refused(format!("{}: {e}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|e| refused(&e))?;
    read_plan(&text).map_err(|e| refused(&e))
}

/// The mesh of a file that has just one.
pub(super) fn only_mesh(file: &Path, option: &str, options: &LoadOptions) -> Result<SourceMesh, CliError> {
    let mut parts = load(file, options)?.parts;
    match (parts.pop(), parts.len()) {
        (Some(part), 0) => Ok(part.mesh),
        (_, rest) => Err(CliError::Refused(format!(
            "{option}: `{}` has {} parts where one is wanted",
            file.display(),
            rest + 1
        ))),
    }
}

/// How the files were read.
fn options(source: &SourceDocument) -> Result<LoadOptions, CliError> {
    let refused = |e: String| CliError::Refused(format!("`source` in the plan: {e}"));
    let split = source.split.as_deref().map(str::parse).transpose().map_err(refused)?;
    let ignore = source.ignore.iter().map(|text| text.parse().map_err(refused)).collect::<Result<_, _>>()?;
    // Which converter ran is not in the plan: a plan from elsewhere must not name a program to run.
    let step = StepSettings { cache_folder: CacheSettings::default_folder(), ..StepSettings::default() };
    let step = StepSettings { deflection: source.deflection.unwrap_or(step.deflection), ..step };
    Ok(LoadOptions { split, ignore, step: Some(step) })
}

/// How files of further parts are read: as they say themselves, STEP files like those of the assembly.
pub(super) fn further(options: &LoadOptions) -> LoadOptions {
    LoadOptions { step: options.step.clone(), ..LoadOptions::default() }
}

/// What was changed before the plan began, but for parts that were moved.
fn revision(
    base: &SourceAssembly,
    source: &SourceDocument,
    options: &LoadOptions,
) -> Result<Revision, CliError> {
    let options = further(options);
    let mut revision = Revision::default();
    for (name, file) in &source.replaced {
        let place = part_named(base, "source.replaced", name)?;
        revision.replaced.push((place, only_mesh(Path::new(file), "source.replaced", &options)?));
    }
    for path in &source.added {
        revision.added.extend(load(Path::new(path), &options)?.parts);
    }
    if let Some(FloorDocument { up, centre, side }) = source.floor {
        let refused = || CliError::Refused("`source.floor` in the plan: `up` is no direction".to_owned());
        let up = Unit::try_new(up.into(), 0.0).ok_or_else(refused)?;
        revision.added.push(Floor { up, centre: centre.into(), side }.part());
    }
    Ok(revision)
}

/// The parts that stand assembled elsewhere than where they were given, and where. Those that an assembly plan
/// puts in begin elsewhere, too, but belong where their steps bring them from there. Of a plan whose steps contradict
/// each other there are none; it is refused where it is shown.
fn assembled_poses(plan: &PlanDocument) -> Vec<(&String, Pose)> {
    let Ok(Placements { apart, .. }) = Placements::new(kind_of(plan), plan) else { return Vec::new() };
    let assembled = |(name, apart): (_, Pose)| {
        let start = plan.initial.poses.get(name).map(pose_from_waypoint).unwrap_or_default();
        let (pose, farthest) = match kind_of(plan) {
            PlanKind::Disassembly => (start, 0.0),
            PlanKind::Assembly => (apart.inverse() * start, start.translation.vector.norm()),
        };
        let is_moved = pose.rotation.angle() > MOTION_ROUNDING
            || pose.translation.vector.norm() > MOTION_ROUNDING * farthest;
        is_moved.then_some((name, pose))
    };
    plan.parts.iter().zip(apart).filter_map(assembled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{plan_of, step_of};
    use crate::geometry::waypoint_from_pose;
    use crate::plan::{Plan, PlanStatus, PlanStep, StepEnd};

    /// Part 1 is put to part 0 by the first step, and both are put in by the second, from beside where they were given.
    fn assembly_plan(starts: [Pose; 2]) -> PlanDocument {
        let step = |parts: &[usize], of: Option<usize>, from: &Pose| PlanStep {
            parts: parts.to_vec(),
            of,
            ends: StepEnd::In,
            path: [*from, Pose::identity()].map(|pose| waypoint_from_pose(&pose)).to_vec(),
            ..step_of(0)
        };
        let poses = starts.map(|pose| waypoint_from_pose(&pose)).into_iter().enumerate().collect();
        let (group, own) = ways();
        PlanDocument::from(&Plan {
            kind: PlanKind::Assembly,
            parts: ["a", "b"].map(String::from).into(),
            poses,
            ..plan_of(PlanStatus::Complete, vec![step(&[1], Some(1), &own), step(&[0, 1], None, &group)])
        })
    }

    fn ways() -> (Pose, Pose) {
        let group = Pose::new([30.0, -200.0, 7.0].into(), [0.3, 1.1, -0.4].into());
        (group, Pose::new([0.0, 5.0, 0.1].into(), [0.0, 0.2, 0.0].into()))
    }

    #[test]
    fn parts_of_a_group_stand_assembled_where_all_their_steps_bring_them() {
        let (group, own) = ways();
        assert_eq!(assembled_poses(&assembly_plan([group, group * own])), []);
        let moved = Pose::new([1.0, 2.0, 3.0].into(), [0.0, 0.0, 0.5].into());
        let plan = assembly_plan([group, group * own * moved]);
        let found = assembled_poses(&plan);
        let [(name, pose)] = found[..] else { panic!("{found:?}") };
        assert_eq!(name, "b");
        assert!((pose.inverse() * moved).rotation.angle() < 1e-9, "{pose}");
        assert!((pose.translation.vector - moved.translation.vector).norm() < 1e-9, "{pose}");
    }
}
