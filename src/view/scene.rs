//! The neutral scene: parts with meshes and colours, and the steps on a timeline. In the input's units and
//! frame; times in seconds.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::colour::colours;
use super::document::kind_of;
use super::equal_parts::equal_parts;
use super::explode::{Leaving, exploded_parts, spread};
use super::shading::{Shaded, shaded};
use super::verdict::verdict;
use super::words::{Words, free_together, kept_together, required};
use super::{PALETTE, Rgb, ViewError};
use crate::document::{BlockedDocument, PlanDocument};
use crate::document::{Placements, StepFrame};
use crate::geometry::{Assembly, Bounds, Pose, interpolate, pose_from_waypoint};
use crate::plan::{PlanKind, PlanStatus, StepEnd};

/// Boxes closer than this share of the longest side count as touching.
const TOUCHING: f64 = 1e-6;
/// Two copies of a shape are drawn from one mesh if their middles differ by less than this share of its size.
const SAME_MIDDLE: f64 = 1e-9;
/// Share of the longest side. The middle of a part may be so far from where the plan has it: in a turning group it goes
/// along an arc, which key frames cut short.
const ARC_ERROR: f64 = 1e-3;
/// Seconds that a part takes to move by the assembly's longest side, and to turn once.
const PER_LENGTH: f64 = 2.2;
const PER_TURN: f64 = 0.9;
/// Seconds of a step, at least and at most; and between two steps, in which the page lets what is out fade.
const SHORTEST: f64 = 1.0;
const LONGEST: f64 = 8.0;
const PAUSE: f64 = 0.4;

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

    /// Of each part that is there, its class: equal parts are of one.
    fn classes(&self) -> Vec<usize> {
        let all = equal_parts(self.assembly);
        self.present.iter().map(|&part| all[part]).collect()
    }

    /// Index in the scene of a named part, if it is there.
    fn place(&self, name: &str) -> Option<usize> {
        self.present.iter().position(|&i| self.assembly.parts[i].name == name)
    }

    /// The assembled pose of the part's shape, in the input's units.
    fn assembled(&self, part: usize) -> Pose {
        let mut pose = self.assembly.parts[part].planning_from_shape;
        pose.translation.vector /= self.assembly.scale;
        pose
    }

    /// The middle of the assembled part's box.
    fn centre(&self, part: usize) -> Point3<f64> {
        self.assembly.centre(part) / self.assembly.scale
    }

    /// Where a rigid motion brings an assembled part.
    fn placement(&self, part: usize, motion: &Pose) -> Placement {
        let rotation = motion.rotation * self.assembled(part).rotation;
        Placement { centre: motion * self.centre(part), rotation }
    }

    /// The part before it is known when it moves.
    fn part(&mut self, part: usize) -> ScenePart {
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
    fn bounds(&self, part: usize, motion: &Pose) -> Bounds {
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
    fn mesh(&mut self, part: usize) -> usize {
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

    /// Puts the steps on the timeline, one after the other, and the key frames into the parts; and which parts leave
    /// which body by which way, first to last (of an assembly plan: the steps backwards).
    fn steps(&self, placements: &Placements, parts: &mut [ScenePart]) -> (Vec<SceneStep>, Vec<Leaving>) {
        let kind = kind_of(self.plan);
        let words = Words::of(self.plan);
        let (mut clock, mut steps, mut leaving) = (0.0, Vec::new(), Vec::new());
        for (number, (step, frame)) in self.plan.steps.iter().zip(&placements.steps).enumerate() {
            let moving: Vec<usize> = step.parts.iter().filter_map(|name| self.place(name)).collect();
            let path: Vec<Pose> = step.path.iter().map(pose_from_waypoint).collect();
            let course = self.course(frame, &moving, path, clock);
            for (&place, standing) in moving.iter().zip(&frame.standing) {
                let keys = self.keys(place, &course, &frame.body, standing);
                let part = &mut parts[place];
                if part.steps.is_empty() {
                    part.start = keys.first().map_or(part.start, |key| key.placement);
                }
                part.steps.push(number);
                part.keys.extend(keys);
                if frame.ends != StepEnd::Aside && step.of.is_none() {
                    part.crosses = Some(course.ends);
                }
            }
            if frame.ends != StepEnd::Aside {
                let mut centres: Vec<_> = course.poses.iter().map(|(_, pose)| pose * course.centre).collect();
                if kind == PlanKind::Assembly {
                    centres.reverse();
                }
                leaving.push(Leaving { number, of: step.of, parts: moving.clone(), centres });
            }
            let after = required(self.plan, number).into_iter().filter_map(|name| self.place(name));
            steps.push(SceneStep {
                parts: moving,
                of: step.of,
                begins: clock,
                ends: course.ends,
                is_aside: frame.ends == StepEnd::Aside,
                body: Vec::new(),
                after: after.collect(),
                words: words.step(number),
            });
            clock = course.ends + PAUSE;
        }
        if kind == PlanKind::Assembly {
            leaving.reverse();
        }
        let bodies: Vec<Vec<usize>> = (0..steps.len()).map(|step| body(step, kind, &steps, parts)).collect();
        steps.iter_mut().zip(bodies).for_each(|(step, body)| step.body = body);
        for (place, part) in parts.iter_mut().enumerate() {
            part.handled = handled(place, &part.steps, &steps, &leaving);
        }
        (steps, leaving)
    }

    /// Puts a path on the timeline: every part of it takes its share of the time by how far it goes and turns.
    fn course(&self, frame: &StepFrame, moving: &[usize], path: Vec<Pose>, begins: f64) -> Course {
        let boxes = moving.iter().zip(&frame.standing).map(|(&p, pose)| self.bounds(self.present[p], pose));
        let centre = boxes.fold(Bounds::EMPTY, |all, bounds| all.union(&bounds)).centre();
        let size = self.size();
        let effort = |a: &Pose, b: &Pose| {
            (b * centre - a * centre).norm() / size * PER_LENGTH
                + a.rotation.angle_to(&b.rotation) / std::f64::consts::TAU * PER_TURN
        };
        let total: f64 = path.windows(2).map(|w| effort(&w[0], &w[1])).sum();
        let lasts = total.clamp(SHORTEST, LONGEST);
        let (mut done, mut poses): (f64, Vec<(f64, Pose)>) = (0.0, Vec::new());
        for (i, &pose) in path.iter().enumerate() {
            done += if i > 0 { effort(&path[i - 1], &pose) } else { 0.0 };
            let share = if total > 0.0 { done / total } else { 0.0 };
            let time = begins + lasts * share;
            match poses.last_mut() {
                // What takes no time is no motion.
                Some(last) if last.0 >= time => *last = (time, pose),
                _ => poses.push((time, pose)),
            }
        }
        Course { centre, poses, ends: begins + lasts }
    }

    /// The key frames of one part of a step: those of the course, and between two where its middle goes along an arc as
    /// many as it takes to follow that.
    fn keys(&self, place: usize, course: &Course, body: &Pose, standing: &Pose) -> Vec<Keyframe> {
        let part = self.present[place];
        let lever = (standing * self.centre(part) - course.centre).norm();
        let key = |time: f64, pose: &Pose| Keyframe {
            time,
            placement: self.placement(part, &(body * pose * standing)),
        };
        let mut keys: Vec<Keyframe> =
            course.poses.first().map(|(time, pose)| key(*time, pose)).into_iter().collect();
        for pair in course.poses.windows(2) {
            let [(from, a), (to, b)] = [pair[0], pair[1]];
            let pieces = pieces(a.rotation.angle_to(&b.rotation), lever, self.size());
            keys.extend((1..pieces).map(|piece| {
                let u = piece as f64 / pieces as f64;
                key(from + (to - from) * u, &interpolate(&a, &b, &course.centre, u))
            }));
            keys.push(key(to, &b));
        }
        keys
    }

    fn size(&self) -> f64 {
        self.assembly.longest_side() / self.assembly.scale
    }
}

/// The path of a step on the timeline.
struct Course {
    /// The middle of the box of all that moves, in the frame of its body, where the path is the identity.
    centre: Point3<f64>,
    /// Motions within the body at times that strictly ascend.
    poses: Vec<(f64, Pose)>,
    /// When it is over.
    ends: f64,
}

/// Into how many pieces a turn is cut, so that lines between their ends are near enough to the arc of a lever. An arc of
/// an angle φ is no further from its chord than the lever times 1 − cos(φ/2).
fn pieces(angle: f64, lever: f64, size: f64) -> usize {
    /// Enough for levers of fifty times the longest side; longer ones are of damaged plans.
    const MOST: f64 = 256.0;
    let slack = size * ARC_ERROR;
    if lever <= slack {
        return 1;
    }
    let widest = 2.0 * (1.0 - slack / lever).acos();
    (angle / widest).ceil().clamp(1.0, MOST) as usize
}

/// The parts of the body that a step is about, ascending.
fn body(number: usize, kind: PlanKind, steps: &[SceneStep], parts: &[ScenePart]) -> Vec<usize> {
    let step = &steps[number];
    let moves = |other: &SceneStep, part: usize| {
        other.of == step.of && !other.is_aside && other.parts.contains(&part)
    };
    // Those that left before, or get in later.
    let others = match kind {
        PlanKind::Disassembly => &steps[..number],
        PlanKind::Assembly => &steps[number + 1..],
    };
    let belongs = |part: &usize| match step.of {
        Some(group) => steps[group].parts.contains(part),
        // What an assembly plan cannot put in waits elsewhere.
        None => {
            kind == PlanKind::Disassembly
                || parts[*part].stays
                || steps.iter().any(|other| moves(other, *part))
        }
    };
    let is_there = |part: &usize| {
        step.parts.contains(part) || (belongs(part) && !others.iter().any(|other| moves(other, *part)))
    };
    (0..parts.len()).filter(is_there).collect()
}

/// From when to when something is done to a part that some steps move, or to the group that it belongs to in the end
/// (of an assembly plan: at first).
fn handled(place: usize, own: &[usize], steps: &[SceneStep], leaving: &[Leaving]) -> Option<[f64; 2]> {
    let group = leaving.iter().rfind(|l| l.parts.contains(&place)).map(|l| l.number);
    let of_group = steps.iter().filter(|step| step.of.is_some() && step.of == group);
    own.iter().map(|&number| &steps[number]).chain(of_group).fold(None, |span, step| {
        let [from, to] = span.unwrap_or([step.begins, step.ends]);
        Some([step.begins.min(from), step.ends.max(to)])
    })
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

#[cfg(test)]
mod tests {
    use super::super::document::tests::{plan, reversed, step};
    use super::*;
    use crate::document::{FreeGroupDocument, StepDocument};
    use crate::fixtures::{cuboid, source};
    use crate::geometry::{Waypoint, waypoint_from_pose};

    const STILL: Waypoint = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

    /// A plate, and two boxes on it side by side, with their middles at (1, 1, 1) and (3, 1, 1).
    fn assembly() -> Assembly {
        let plate = cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]);
        let boxes = [0.0, 2.0].map(|x| cuboid([x, 0.0, 0.0], [x + 2.0, 2.0, 2.0]));
        let [one, two] = boxes;
        Assembly::new(&source([plate, one, two])).unwrap()
    }

    /// The boxes leave together, turned by 90° about +z on the way up by 10. Then the second goes up by 1 in the group,
    /// and out of it along what was +x.
    fn group() -> PlanDocument {
        let up = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        let away = [5.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let moved = |parts: &[&str], of: Option<usize>, ends: &str, to: Waypoint| StepDocument {
            parts: parts.iter().map(|&name| name.to_owned()).collect(),
            of,
            ends: ends.into(),
            requires: of.into_iter().collect(),
            ..step("1", &[STILL, to])
        };
        // The middle of both is at (2, 1, 1): it goes to (2, 1, 11).
        let turn = Pose::new(Vector3::new(3.0, -1.0, 10.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let steps = vec![
            moved(&["1", "2"], None, "out", waypoint_from_pose(&turn)),
            moved(&["2"], Some(0), "aside", up),
            moved(&["2"], Some(0), "out", away),
        ];
        PlanDocument { parts: ["0", "1", "2"].map(String::from).into(), steps, ..plan() }
    }

    fn scene(plan: &PlanDocument) -> PlanScene {
        PlanScene::new(&assembly(), Up::Z, plan).unwrap()
    }

    fn at(scene: &PlanScene, part: usize, time: f64) -> Placement {
        scene.parts[part].placement(time)
    }

    fn assert_at(scene: &PlanScene, part: usize, time: f64, centre: [f64; 3], tolerance: f64) {
        let found = at(scene, part, time).centre;
        assert!((found - Point3::from(centre)).norm() <= tolerance, "{part} is at {found} at {time}");
    }

    /// When steps begin and end, and their middle.
    fn times(scene: &PlanScene, step: usize) -> [f64; 3] {
        let SceneStep { begins, ends, .. } = scene.steps[step];
        [begins, (begins + ends) / 2.0, ends]
    }

    #[test]
    fn a_group_turns_on_its_way_out_and_is_taken_apart_where_it_lies() {
        let scene = scene(&group());
        let [begins, middle, ends] = times(&scene, 0);
        assert_at(&scene, 1, begins, [1.0, 1.0, 1.0], 0.0);
        assert_at(&scene, 1, ends, [2.0, 0.0, 11.0], 1e-9);
        assert_at(&scene, 2, ends, [2.0, 2.0, 11.0], 1e-9);
        // Half-way the middle of both has gone half of the way, and they are turned by 45°.
        let lever = std::f64::consts::FRAC_1_SQRT_2;
        let error = 8.0 * ARC_ERROR;
        assert_at(&scene, 1, middle, [2.0 - lever, 1.0 - lever, 6.0], error);
        assert_at(&scene, 2, middle, [2.0 + lever, 1.0 + lever, 6.0], error);
        let turned = at(&scene, 1, middle).rotation.angle_to(&scene.parts[1].assembled.rotation);
        assert!((turned - std::f64::consts::FRAC_PI_4).abs() < 1e-9, "{turned}");
        for u in 0..=100 {
            let time = begins + (ends - begins) * f64::from(u) / 100.0;
            let [one, two] = [1, 2].map(|part| at(&scene, part, time).centre);
            assert!(((one - two).norm() - 2.0).abs() <= 2.0 * error, "they stay as far apart as they are");
        }
        assert_at(&scene, 2, times(&scene, 1)[2], [2.0, 2.0, 12.0], 1e-9);
        let [_, middle, ends] = times(&scene, 2);
        assert_at(&scene, 2, middle, [2.0, 4.5, 12.0], 1e-9);
        assert_at(&scene, 2, ends, [2.0, 7.0, 12.0], 1e-9);
        assert_at(&scene, 1, ends, [2.0, 0.0, 11.0], 1e-9);
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        for part in [1, 2] {
            let expected = quarter * scene.parts[part].assembled.rotation;
            assert!(at(&scene, part, ends).rotation.angle_to(&expected) < 1e-9);
        }
    }

    #[test]
    fn parts_are_in_a_body_until_they_leave_it() {
        let bodies =
            |plan: &PlanDocument| scene(plan).steps.iter().map(|s| s.body.clone()).collect::<Vec<_>>();
        assert_eq!(bodies(&group()), [vec![0, 1, 2], vec![1, 2], vec![1, 2]]);
        assert_eq!(bodies(&reversed(group())), [vec![1, 2], vec![1, 2], vec![0, 1, 2]]);
        let mut one_by_one = group();
        one_by_one.steps.truncate(1);
        one_by_one.steps[0].parts = vec!["2".into()];
        one_by_one.steps.push(StepDocument { parts: vec!["1".into()], ..one_by_one.steps[0].clone() });
        assert_eq!(bodies(&one_by_one), [vec![0, 1, 2], vec![0, 1]]);
        assert_eq!(bodies(&reversed(one_by_one)), [vec![0, 1], vec![0, 1, 2]]);
    }

    #[test]
    fn an_assembly_plan_is_the_same_backwards() {
        let (apart, together) = (scene(&group()), scene(&reversed(group())));
        let duration = together.steps[2].ends;
        assert_eq!(apart.steps[2].ends, duration);
        for k in 0..=200 {
            let time = duration * f64::from(k) / 200.0;
            for part in 0..3 {
                let (there, back) = (at(&apart, part, duration - time), at(&together, part, time));
                assert!((there.centre - back.centre).norm() < 1e-9, "{part} at {time}");
                assert!(there.rotation.angle_to(&back.rotation) < 1e-7, "{part} at {time}");
            }
        }
        assert_eq!(together.parts[2].start.centre, at(&together, 2, 0.0).centre);
        assert_at(&together, 2, 0.0, [2.0, 7.0, 12.0], 1e-9);
    }

    #[test]
    fn it_is_known_from_when_to_when_parts_are_handled() {
        let apart = scene(&group());
        let [out, last] = [times(&apart, 0), times(&apart, 2)];
        assert_eq!((apart.parts[0].crosses, apart.parts[0].handled), (None, None));
        for part in [1, 2] {
            let ScenePart { crosses, handled, .. } = &apart.parts[part];
            // The first lies there while the second is taken off it.
            assert_eq!((*crosses, *handled), (Some(out[2]), Some([0.0, last[2]])), "part {part}");
        }
        assert_eq!([1, 2].map(|part| apart.parts[part].steps.clone()), [vec![0], vec![0, 1, 2]]);
        let together = scene(&reversed(group()));
        let [first, last] = [times(&together, 0), times(&together, 2)];
        for part in [1, 2] {
            let ScenePart { crosses, handled, .. } = &together.parts[part];
            assert_eq!((*crosses, *handled), (Some(last[2]), Some([first[0], last[2]])), "part {part}");
        }
        let mut aside = group();
        aside.steps.truncate(1);
        (aside.steps[0].parts, aside.steps[0].ends) = (vec!["1".into()], "aside".into());
        let aside = scene(&aside);
        assert_eq!(
            (aside.parts[1].crosses, aside.parts[1].handled),
            (None, Some([0.0, aside.steps[0].ends]))
        );
    }

    #[test]
    fn a_part_that_was_turned_aside_turns_about_the_middle_of_its_box_as_it_stands() {
        // An L, whose box has another middle once it is turned by 45°.
        let l_shape = crate::fixtures::l_shape();
        let assembly = Assembly::new(&source([l_shape, cuboid([0.0, 0.0, -5.0], [1.0, 1.0, -4.0])])).unwrap();
        let turn = |angle: f64| waypoint_from_pose(&Pose::new(Vector3::zeros(), Vector3::z() * angle));
        let eighth = std::f64::consts::FRAC_PI_4;
        let mut steps = vec![step("0", &[STILL, turn(eighth)]), step("0", &[STILL, turn(4.0 * eighth)])];
        steps[0].ends = "aside".into();
        let plan = PlanDocument { steps, remaining: vec!["1".into()], ..plan() };
        let scene = PlanScene::new(&assembly, Up::Z, &plan).unwrap();
        // Turned by 45° the corners of the L are at (0, ±√2…) about the origin: its box reaches from −√2 to √2 along x
        // and from 0 to 3/√2 along y (the corner that is missing would be at 2√2).
        let [_, middle, _] = times(&scene, 1);
        let box_middle = Point3::new(0.0, 1.5 * std::f64::consts::FRAC_1_SQRT_2, 0.5);
        let own = Point3::new(0.0, 2.0 * std::f64::consts::FRAC_1_SQRT_2, 0.5);
        // Half-way through the half turn about the origin, the box's middle is at half of its way, which is the origin.
        let offset = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0 * eighth) * (own - box_middle);
        let expected = Point3::new(0.0, 0.0, 0.5) + offset;
        assert_at(&scene, 0, middle, expected.into(), ARC_ERROR * 6.0);
    }

    #[test]
    fn groups_are_exploded_along_their_way_and_their_parts_along_their_own() {
        let scene = scene(&group());
        let [plate, one, two] = [0, 1, 2].map(|part| scene.parts[part].exploded);
        assert_eq!(plate, Vector3::zeros());
        assert!(one.z > 0.0 && one.xy().norm() < 1e-9, "{one}");
        // Up and away, as the two steps within the group lead.
        let own = (two - one).normalize();
        assert!((own - Vector3::new(5.0, 0.0, 1.0).normalize()).norm() < 1e-9, "{own}");
        let shown = [1, 2].map(|part| {
            let ScenePart { bounds, exploded, .. } = &scene.parts[part];
            Bounds { min: bounds.min + exploded, max: bounds.max + exploded }
        });
        assert!(!shown[0].grown(-1e-9).meets(&shown[1]), "{shown:?}");
        assert!(shown.iter().all(|bounds| bounds.min.z > 0.0), "{shown:?}");
    }

    #[test]
    fn groups_are_of_parts_of_the_scene() {
        let free = FreeGroupDocument { parts: vec!["0".into(), "2".into()], direction: [0.0, -1.0, 0.0] };
        let mut plan = PlanDocument { free_together: vec![free], ..group() };
        plan.kept_together = vec![vec!["2".into(), "1".into()]];
        (plan.status, plan.reason) = ("timeout".into(), Some("the deadline passed".into()));
        let PlanScene { kept_together, free_together, verdict, .. } = scene(&plan);
        let kept = SceneGroup { parts: vec![2, 1], words: "Not taken apart: parts 2 and 1".into() };
        assert_eq!(kept_together, [kept]);
        let words = "Can begin to move together along −Y: parts 0 and 2".to_owned();
        assert_eq!(free_together, [SceneGroup { parts: vec![0, 2], words }]);
        let verdict = verdict.unwrap();
        assert!(verdict.ends_with("remain. The deadline passed; nothing is proved."), "{verdict}");
    }

    #[test]
    fn steps_that_contradict_each_other_are_refused() {
        let mut plan = group();
        plan.steps[2].of = None;
        let error = PlanScene::new(&assembly(), Up::Z, &plan).unwrap_err().to_string();
        assert!(error.contains("`steps[2]` moves `2`, which does not stand in the assembly"), "{error}");
    }
}
