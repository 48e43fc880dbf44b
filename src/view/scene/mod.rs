//! The neutral scene: parts with meshes and colours, and the steps on a timeline. In the input's units and
//! frame; times in seconds.

mod builder;
#[cfg(test)]
mod tests;
mod timeline;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::colour::colours;
use super::explode::{exploded_parts, spread};
use super::verdict::verdict;
use super::words::{free_together, kept_together};
use super::{PALETTE, Rgb, ViewError};
use crate::document::kind_of;
use crate::document::{BlockedDocument, Placements, PlanDocument};
use crate::geometry::{Assembly, Bounds};
use crate::plan::{PlanKind, PlanStatus};

use builder::{SceneBuilder, check_parts};
use timeline::PAUSE;

/// Boxes closer than this share of the longest side count as touching.
const TOUCHING: f64 = 1e-6;
/// Where a node frame stands in the input's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The middle of the part's box.
    pub centre: Point3<f64>,
    /// How the node is turned.
    pub rotation: UnitQuaternion<f64>,
}

/// A mesh as it is drawn, in the node frame: lengths of the input from the middle of the part's box.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnPart {
    /// Vertices; those on sharp edges are there once per side.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, outward, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Sharp edges, as pairs of vertices.
    pub edges: Vec<[u32; 2]>,
}

/// A part that is there at the start.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenePart {
    /// Its name.
    pub name: String,
    /// Index of its mesh. Equal parts share one.
    pub drawn: usize,
    /// Its place in [`PALETTE`].
    pub colour: usize,
    /// Where it stands assembled.
    pub assembled: Placement,
    /// Where it stands before its first step; assembled if it has none.
    pub start: Placement,
    /// Its box when assembled.
    pub bounds: Bounds,
    /// The steps that move it, ascending.
    pub steps: Vec<usize>,
    /// Where it is at some moments of its steps, times strictly ascending. Between two moments of a step it moves on a
    /// line and its rotation slerps; between two steps it stands.
    pub keys: Vec<Keyframe>,
    /// When it has left the assembly, or is in it (seconds); `None` if it does neither.
    pub crosses: Option<f64>,
    /// From when to when something is done to it, or to the group that it belongs to outside the assembly (seconds).
    pub handled: Option<[f64; 2]>,
    /// Whether it stands in the assembly all the time.
    pub stays: bool,
    /// Whether it may not move.
    pub fixed: bool,
    /// From its assembled place to its place in the exploded view.
    pub exploded: Vector3<f64>,
}

impl ScenePart {
    /// Where it is at a time.
    #[must_use]
    pub fn placement(&self, time: f64) -> Placement {
        let next = self.keys.partition_point(|key| key.time <= time);
        match (next.checked_sub(1).map(|i| self.keys[i]), self.keys.get(next)) {
            (None, _) => self.start,
            (Some(last), None) => last.placement,
            (Some(a), Some(b)) => {
                let u = (time - a.time) / (b.time - a.time);
                let centre = a.placement.centre + (b.placement.centre - a.placement.centre) * u;
                // Half turns have no short way: either is right.
                let turned = a.placement.rotation.try_slerp(&b.placement.rotation, u, 1e-9);
                Placement { centre, rotation: turned.unwrap_or(b.placement.rotation) }
            }
        }
    }
}

/// Where a part is at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keyframe {
    /// Seconds from the start of the timeline.
    pub time: f64,
    /// Where the part is then.
    pub placement: Placement,
}

/// A step on the timeline.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneStep {
    /// Indices of the parts that it moves, in the order of the plan.
    pub parts: Vec<usize>,
    /// The step that takes the group out, or puts it in, to which they belong.
    pub of: Option<usize>,
    /// When it begins, in seconds.
    pub begins: f64,
    /// When it is over, in seconds.
    pub ends: f64,
    /// Whether its parts only go aside: they leave no body, and get into none.
    pub is_aside: bool,
    /// The parts of the body that they leave, as long as they are in it; of an assembly plan, of that which they get into.
    /// Those that move are among them, those that left before are not.
    pub body: Vec<usize>,
    /// Other parts that must have moved before.
    pub after: Vec<usize>,
    /// Other parts that have to be held, if the plan says so.
    pub held: Vec<usize>,
    /// The step in words.
    pub words: String,
}

/// Parts that belong together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SceneGroup {
    /// Indices of the parts, in the order of the plan.
    pub parts: Vec<usize>,
    /// What there is to say about them.
    pub words: String,
}

/// Which way is up in the input's frame, by the custom of the files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Up {
    /// +y, as glTF prescribes.
    Y,
    /// +z, as most mechanical CAD has it.
    Z,
}

/// A plan that can be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanScene {
    /// The assembly's name.
    pub name: String,
    /// Unit of all lengths, if known.
    pub units: Option<String>,
    /// Which way is up.
    pub up: Up,
    /// Whether parts come out or go in.
    pub kind: PlanKind,
    /// How planning ended.
    pub status: String,
    /// Why it is not complete, in two sentences.
    pub verdict: Option<String>,
    /// Groups that left together and were not taken apart.
    pub kept_together: Vec<SceneGroup>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<SceneGroup>,
    /// What blocks the parts that should have moved; by name.
    pub blocked: Vec<BlockedDocument>,
    /// The meshes.
    pub drawn: Vec<DrawnPart>,
    /// The parts that are there, in the assembly's order.
    pub parts: Vec<ScenePart>,
    /// The steps in order.
    pub steps: Vec<SceneStep>,
}

impl PlanScene {
    /// The scene of a plan about an assembly, whose parts stand where the plan has them assembled; those that it does
    /// not move, where they stand all the time.
    ///
    /// # Errors
    /// The plan is about other parts, or its steps contradict each other.
    pub fn new(assembly: &Assembly, up: Up, plan: &PlanDocument) -> Result<Self, ViewError> {
        check_parts(assembly, plan)?;
        let placements =
            Placements::new(kind_of(plan), plan).map_err(|reason| ViewError::NoPlan { reason })?;
        let mut stage = SceneBuilder::new(assembly, plan);
        let mut parts: Vec<ScenePart> = stage.present.clone().iter().map(|&part| stage.part(part)).collect();
        let (steps, leaving) = stage.steps(&placements, &mut parts);
        let boxes: Vec<Bounds> = parts.iter().map(|p| p.bounds).collect();
        let units = units_left(plan, &parts);
        for (part, shift) in parts.iter_mut().zip(exploded_parts(&boxes, spread(&boxes, &units), &leaving)) {
            part.exploded = shift;
        }
        let group = |names: &[String], words: String| {
            let parts = names.iter().filter_map(|name| parts.iter().position(|p| p.name == *name));
            SceneGroup { parts: parts.collect(), words }
        };
        let kept = plan.kept_together.iter().map(|g| group(g, kept_together(g))).collect();
        let free = plan.free_together.iter().map(|g| group(&g.parts, free_together(g))).collect();
        let mut scene = Self {
            name: assembly.name.clone(),
            units: plan.units.clone().or_else(|| assembly.units.clone()),
            up,
            kind: kind_of(plan),
            status: plan.status.clone(),
            verdict: verdict(plan),
            kept_together: kept,
            free_together: free,
            blocked: plan.blocked.clone(),
            steps,
            drawn: std::mem::take(&mut stage.drawn),
            parts,
        };
        scene.colour(&stage.classes());
        Ok(scene)
    }

    /// Seconds until all is done.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.steps.last().map_or(0.0, |s| s.ends + PAUSE)
    }

    /// The box of all parts when assembled.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.parts.iter().fold(Bounds::EMPTY, |b, p| b.union(&p.bounds))
    }

    /// The box of a part at a place.
    pub(super) fn bounds_at(&self, part: usize, at: &Placement) -> Bounds {
        let vertices = self.drawn[self.parts[part].drawn].positions.iter();
        let place = |p: &[f32; 3]| at.centre + at.rotation * Vector3::from(p.map(f64::from));
        vertices.fold(Bounds::EMPTY, |bounds, p| bounds.with_point(&place(p)))
    }

    /// The colour of a part.
    #[must_use]
    pub fn rgb(&self, part: usize) -> Rgb {
        PALETTE[self.parts[part].colour]
    }

    /// `classes`: one per part, the same for equal parts.
    fn colour(&mut self, classes: &[usize]) {
        let near = self.bounds().extents().max() * TOUCHING;
        let meets = |a: &ScenePart, b: &ScenePart| a.bounds.grown(near).meets(&b.bounds);
        let neighbours: Vec<Vec<usize>> = (0..self.parts.len())
            .map(|p| {
                (0..self.parts.len()).filter(|&q| q != p && meets(&self.parts[p], &self.parts[q])).collect()
            })
            .collect();
        let sizes: Vec<f64> = self.parts.iter().map(|p| p.bounds.extents().norm()).collect();
        for (part, colour) in self.parts.iter_mut().zip(colours(classes, &sizes, &neighbours)) {
            part.colour = colour;
        }
    }
}

/// What is drawn apart although no step takes it apart: of a plan that is not complete, the parts that are left, and the
/// groups among them that can begin to move together.
fn units_left(plan: &PlanDocument, parts: &[ScenePart]) -> Vec<Vec<usize>> {
    if plan.status == PlanStatus::Complete.name() {
        return Vec::new();
    }
    let group = |part: usize| plan.free_together.iter().position(|g| g.parts.contains(&parts[part].name));
    let mut units: Vec<(Option<usize>, Vec<usize>)> = Vec::new();
    for part in (0..parts.len()).filter(|&part| parts[part].crosses.is_none()) {
        let own = group(part);
        match units.iter_mut().find(|(other, _)| own.is_some() && *other == own) {
            Some((_, unit)) => unit.push(part),
            None => units.push((own, vec![part])),
        }
    }
    units.into_iter().map(|(_, unit)| unit).collect()
}
