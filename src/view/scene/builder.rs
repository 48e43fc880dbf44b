//! The parts of a scene, and its meshes: equal shapes share one.

use nalgebra::{Point3, Vector3};

use super::super::ViewError;
use super::super::equal_parts::equal_parts;
use super::super::shading::{Shaded, shaded};
use super::{DrawnPart, Placement, ScenePart};
use crate::document::PlanDocument;
use crate::geometry::{Assembly, Bounds, Pose};

/// Two copies of a shape are drawn from one mesh if their middles differ by less than this share of its size.
const SAME_MIDDLE: f64 = 1e-9;

pub(super) fn check_parts(assembly: &Assembly, plan: &PlanDocument) -> Result<(), ViewError> {
    let mismatch = |reason: String| ViewError::Mismatch { assembly: assembly.name.clone(), reason };
    if let Some(missing) = plan.parts.iter().find(|n| assembly.parts.iter().all(|p| p.name != **n)) {
        return Err(mismatch(format!("it has no part `{missing}`")));
    }
    if let Some(extra) = assembly.parts.iter().find(|p| !plan.parts.contains(&p.name)) {
        return Err(mismatch(format!("the plan knows nothing of its part `{}`", extra.name)));
    }
    Ok(())
}

/// What a scene is made from, and its meshes so far.
pub(super) struct SceneBuilder<'a> {
    assembly: &'a Assembly,
    pub(super) plan: &'a PlanDocument,
    /// Places in the assembly of the scene's parts.
    pub(super) present: Vec<usize>,
    pub(super) drawn: Vec<DrawnPart>,
    /// Of each mesh: the shape, and the point of it that is the origin.
    origins: Vec<(usize, Point3<f64>)>,
}

impl<'a> SceneBuilder<'a> {
    pub(super) fn new(assembly: &'a Assembly, plan: &'a PlanDocument) -> Self {
        let is_there = |i: &usize| !plan.initial.removed.contains(&assembly.parts[*i].name);
        let present = (0..assembly.parts.len()).filter(is_there).collect();
        Self { assembly, plan, present, drawn: Vec::new(), origins: Vec::new() }
    }

    /// Of each part that is there, its class: equal parts are of one.
    pub(super) fn classes(&self) -> Vec<usize> {
        let all = equal_parts(self.assembly);
        self.present.iter().map(|&part| all[part]).collect()
    }

    /// Index in the scene of a named part, if it is there.
    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.present.iter().position(|&i| self.assembly.parts[i].name == name)
    }

    /// The assembled pose of the part's shape, in the input's units.
    pub(super) fn assembled(&self, part: usize) -> Pose {
        let mut pose = self.assembly.parts[part].planning_from_shape;
        pose.translation.vector /= self.assembly.scale;
        pose
    }

    /// The middle of the assembled part's box.
    pub(super) fn centre(&self, part: usize) -> Point3<f64> {
        self.assembly.centre(part) / self.assembly.scale
    }

    /// Where a rigid motion brings an assembled part.
    pub(super) fn placement(&self, part: usize, motion: &Pose) -> Placement {
        let rotation = motion.rotation * self.assembled(part).rotation;
        Placement { centre: motion * self.centre(part), rotation }
    }

    /// The part before it is known when it moves.
    pub(super) fn part(&mut self, part: usize) -> ScenePart {
        let name = &self.assembly.parts[part].name;
        let assembled = self.placement(part, &Pose::identity());
        ScenePart {
            name: name.clone(),
            drawn: self.mesh(part),
            colour: 0,
            assembled,
            start: assembled,
            bounds: self.bounds(part, &Pose::identity()),
            steps: Vec::new(),
            keys: Vec::new(),
            crosses: None,
            handled: None,
            stays: self.plan.remaining.contains(name),
            fixed: self.plan.fixed.contains(name),
            exploded: Vector3::zeros(),
        }
    }

    /// The box of a part that a rigid motion brought elsewhere.
    pub(super) fn bounds(&self, part: usize, motion: &Pose) -> Bounds {
        let scale = self.assembly.scale;
        if *motion == Pose::identity() {
            let Bounds { min, max } = self.assembly.parts[part].bounds;
            return Bounds { min: min / scale, max: max / scale };
        }
        let pose = motion * self.assembled(part);
        let vertices = self.assembly.shape(part).surface.vertices();
        vertices.iter().fold(Bounds::EMPTY, |bounds, v| bounds.with_point(&(pose * (v / scale))))
    }

    /// The mesh of a part in its node frame; that of an equal part if it has the same middle.
    pub(super) fn mesh(&mut self, part: usize) -> usize {
        let (shape, scale) = (self.assembly.parts[part].shape, self.assembly.scale);
        let surface = &self.assembly.shape(part).surface;
        let origin = self.assembled(part).inverse() * self.centre(part);
        let close = surface.bounds().extents().max() / scale * SAME_MIDDLE;
        let same = |(s, o): &(usize, Point3<f64>)| *s == shape && (o - origin).norm() <= close;
        if let Some(known) = self.origins.iter().position(same) {
            return known;
        }
        let vertices: Vec<_> = surface.vertices().iter().map(|v| v / scale - origin.coords).collect();
        self.origins.push((shape, origin));
        self.drawn.push(drawn(shaded(&vertices, surface.triangles())));
        self.drawn.len() - 1
    }

    pub(super) fn size(&self) -> f64 {
        self.assembly.longest_side() / self.assembly.scale
    }
}

fn drawn(mesh: Shaded) -> DrawnPart {
    let single = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
    DrawnPart {
        positions: mesh.positions.iter().map(|p| single(&p.coords)).collect(),
        normals: mesh.normals.iter().map(single).collect(),
        triangles: mesh.triangles,
        edges: mesh.edges,
    }
}
