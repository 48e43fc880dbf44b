//! The neutral scene: parts with meshes and colours, and the steps on a timeline. In the input's units and
//! frame; times in seconds.

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::colour::colours;
use super::document::kind_of;
use super::explode::{Placed, exploded, way_out};
use super::shading::{Shaded, shaded};
use super::words::{Words, required};
use super::{PALETTE, Rgb, ViewError};
use crate::geometry::{Assembly, Bounds, Pose, Waypoint, pose_from_waypoint};
use crate::plan::PlanKind;
use crate::plan::export::{BlockedDocument, PlanDocument};

/// Boxes closer than this share of the longest side count as touching.
const TOUCHING: f64 = 1e-6;
/// Two copies of a shape are drawn from one mesh if their middles differ by less than this share of its size.
const SAME_MIDDLE: f64 = 1e-9;
/// Seconds that a part takes to move by the assembly's longest side, and to turn once.
const PER_LENGTH: f64 = 1.6;
const PER_TURN: f64 = 0.6;
/// Seconds of a step, at least and at most; and between two steps.
const SHORTEST: f64 = 0.6;
const LONGEST: f64 = 8.0;
const PAUSE: f64 = 0.15;

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
    /// Where it stands before its step; assembled if it has none.
    pub start: Placement,
    /// Its box when assembled.
    pub bounds: Bounds,
    /// Its step, if it moves.
    pub step: Option<usize>,
    /// Whether it stands in the assembly all the time.
    pub stays: bool,
    /// Whether it may not move.
    pub fixed: bool,
    /// From its assembled place to its place in the exploded view.
    pub exploded: Vector3<f64>,
}

/// A moment of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Keyframe {
    /// Seconds from the start of the timeline.
    pub time: f64,
    /// Where the part is then; in between it moves on a line and its rotation slerps.
    pub placement: Placement,
}

/// A step on the timeline.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneStep {
    /// Index of the part.
    pub part: usize,
    /// One per waypoint, times strictly ascending.
    pub keys: Vec<Keyframe>,
    /// When it is over.
    pub ends: f64,
    /// Parts that must have moved before.
    pub after: Vec<usize>,
    /// The step in words.
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
    /// Why it is not complete.
    pub reason: Option<String>,
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
    /// The scene of a plan about an assembly, whose parts stand where the plan has them assembled.
    ///
    /// # Errors
    /// The plan is about other parts.
    pub fn new(assembly: &Assembly, up: Up, plan: &PlanDocument) -> Result<Self, ViewError> {
        check_parts(assembly, plan)?;
        let mut stage = SceneBuilder::new(assembly, plan);
        let parts: Vec<ScenePart> = stage.present.clone().iter().map(|&part| stage.part(part)).collect();
        let mut scene = Self {
            name: assembly.name.clone(),
            units: plan.units.clone().or_else(|| assembly.units.clone()),
            up,
            kind: kind_of(plan),
            status: plan.status.clone(),
            reason: plan.reason.clone(),
            blocked: plan.blocked.clone(),
            steps: stage.steps(),
            drawn: stage.drawn,
            parts,
        };
        scene.colour();
        scene.explode();
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

    /// The colour of a part.
    #[must_use]
    pub fn rgb(&self, part: usize) -> Rgb {
        PALETTE[self.parts[part].colour]
    }

    fn colour(&mut self) {
        let near = self.bounds().extents().max() * TOUCHING;
        let meets = |a: &ScenePart, b: &ScenePart| a.bounds.grown(near).meets(&b.bounds);
        let neighbours: Vec<Vec<usize>> = (0..self.parts.len())
            .map(|p| {
                (0..self.parts.len()).filter(|&q| q != p && meets(&self.parts[p], &self.parts[q])).collect()
            })
            .collect();
        let shapes: Vec<usize> = self.parts.iter().map(|p| p.drawn).collect();
        for (part, colour) in self.parts.iter_mut().zip(colours(&shapes, &neighbours)) {
            part.colour = colour;
        }
    }

    /// Parts go out along their own ways, those that leave last the least far.
    fn explode(&mut self) {
        let mut order: Vec<usize> = (0..self.steps.len()).collect();
        if self.kind == PlanKind::Disassembly {
            order.reverse();
        }
        let stays = self.parts.iter().filter(|p| p.step.is_none());
        let mut placed: Vec<Placed> =
            stays.map(|p| Placed { bounds: p.bounds, shift: Vector3::zeros() }).collect();
        for step in order {
            let step = &self.steps[step];
            let mut centres: Vec<_> = step.keys.iter().map(|k| k.placement.centre).collect();
            if self.kind == PlanKind::Assembly {
                centres.reverse();
            }
            let part = &mut self.parts[step.part];
            part.exploded = exploded(&part.bounds, &placed, &way_out(&part.bounds, &placed, &centres));
            placed.push(Placed { bounds: part.bounds, shift: part.exploded });
        }
    }
}

fn check_parts(assembly: &Assembly, plan: &PlanDocument) -> Result<(), ViewError> {
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
struct SceneBuilder<'a> {
    assembly: &'a Assembly,
    plan: &'a PlanDocument,
    /// Places in the assembly of the scene's parts.
    present: Vec<usize>,
    drawn: Vec<DrawnPart>,
    /// Of each mesh: the shape, and the point of it that is the origin.
    origins: Vec<(usize, Point3<f64>)>,
}

impl<'a> SceneBuilder<'a> {
    fn new(assembly: &'a Assembly, plan: &'a PlanDocument) -> Self {
        let is_there = |i: &usize| !plan.initial.removed.contains(&assembly.parts[*i].name);
        let present = (0..assembly.parts.len()).filter(is_there).collect();
        Self { assembly, plan, present, drawn: Vec::new(), origins: Vec::new() }
    }

    /// Index in the scene of a named part, if it is there.
    fn place(&self, name: &str) -> Option<usize> {
        self.present.iter().position(|&i| self.assembly.parts[i].name == name)
    }

    /// In the input's units: the transform from the shape's frame to the mesh as given.
    fn given_from_shape(&self, part: usize) -> Pose {
        let part = &self.assembly.parts[part];
        let mut pose = part.planning_from_shape;
        pose.translation.vector /= self.assembly.scale;
        part.moved.inverse() * pose
    }

    /// The middle of the part's box, as a point of the mesh as given.
    fn centre(&self, part: usize) -> Point3<f64> {
        let centre = self.assembly.centre(part) / self.assembly.scale;
        self.assembly.parts[part].moved.inverse() * centre
    }

    fn placement(&self, part: usize, waypoint: &Waypoint) -> Placement {
        let pose = pose_from_waypoint(waypoint);
        let rotation = pose.rotation * self.given_from_shape(part).rotation;
        Placement { centre: pose * self.centre(part), rotation }
    }

    fn part(&mut self, part: usize) -> ScenePart {
        let name = &self.assembly.parts[part].name;
        let still = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let stands = *self.plan.initial.poses.get(name).unwrap_or(&still);
        let step = self.plan.steps.iter().position(|s| s.part == *name);
        let path = step.map_or(&[][..], |s| &self.plan.steps[s].path);
        let first = *path.first().unwrap_or(&stands);
        let assembled = match kind_of(self.plan) {
            PlanKind::Disassembly => first,
            PlanKind::Assembly => *path.last().unwrap_or(&stands),
        };
        let bounds = self.assembly.parts[part].bounds;
        let scale = self.assembly.scale;
        ScenePart {
            name: name.clone(),
            drawn: self.mesh(part),
            colour: 0,
            assembled: self.placement(part, &assembled),
            start: self.placement(part, &first),
            bounds: Bounds { min: bounds.min / scale, max: bounds.max / scale },
            step,
            stays: self.plan.remaining.contains(name),
            fixed: self.plan.fixed.contains(name),
            exploded: Vector3::zeros(),
        }
    }

    /// The mesh of a part in its node frame; that of an equal part if it has the same middle.
    fn mesh(&mut self, part: usize) -> usize {
        let (shape, scale) = (self.assembly.parts[part].shape, self.assembly.scale);
        let surface = &self.assembly.shape(part).surface;
        let origin = self.given_from_shape(part).inverse() * self.centre(part);
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

    fn steps(&self) -> Vec<SceneStep> {
        let size = self.assembly.longest_side() / self.assembly.scale;
        let words = Words::of(self.plan);
        let mut clock = 0.0;
        let mut steps = Vec::new();
        for (i, step) in self.plan.steps.iter().enumerate() {
            let Some(place) = self.place(&step.part) else { continue };
            let path: Vec<_> = step.path.iter().map(|w| self.placement(self.present[place], w)).collect();
            let (keys, ends) = keys(&path, clock, size);
            clock = ends + PAUSE;
            let after = required(self.plan, i).filter_map(|name| self.place(name)).collect();
            steps.push(SceneStep { part: place, keys, ends, after, words: words.step(i) });
        }
        steps
    }
}

/// Puts a path on the timeline: every part of it takes its share of the time by how far it goes and turns.
fn keys(path: &[Placement], begins: f64, size: f64) -> (Vec<Keyframe>, f64) {
    let effort = |a: &Placement, b: &Placement| {
        (b.centre - a.centre).norm() / size * PER_LENGTH
            + a.rotation.angle_to(&b.rotation) / std::f64::consts::TAU * PER_TURN
    };
    let total: f64 = path.windows(2).map(|w| effort(&w[0], &w[1])).sum();
    let lasts = total.clamp(SHORTEST, LONGEST);
    let (mut done, mut keys): (f64, Vec<Keyframe>) = (0.0, Vec::new());
    for (i, &placement) in path.iter().enumerate() {
        done += if i > 0 { effort(&path[i - 1], &placement) } else { 0.0 };
        let share = if total > 0.0 { done / total } else { 0.0 };
        let key = Keyframe { time: begins + lasts * share, placement };
        match keys.last_mut() {
            // What takes no time is no motion.
            Some(last) if last.time >= key.time => *last = key,
            _ => keys.push(key),
        }
    }
    (keys, begins + lasts)
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
