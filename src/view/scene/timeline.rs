//! The steps of a plan on a timeline: when each begins and ends, and the key frames of its parts.

use nalgebra::Point3;

use super::super::explode::Leaving;
use super::super::handling::held;
use super::super::words::{Words, required};
use super::builder::SceneBuilder;
use super::{Keyframe, ScenePart, SceneStep};
use crate::document::{Placements, StabilityDocument, StepFrame, kind_of};
use crate::geometry::{Bounds, Pose, interpolate, pose_from_waypoint};
use crate::plan::{PlanKind, StepEnd};

/// Share of the longest side: the largest distance of the middle of a part from where the plan has it. In a turning group it
/// moves along an arc, of which key frames make chords. At half, there are 1.4 times as many; at double, gaps are visible.
pub(super) const ARC_ERROR: f64 = 1e-3;
/// Seconds for a motion by the assembly's longest side. Chosen by eye: at half, bends are missed; at double, viewers wait.
const PER_LENGTH: f64 = 2.2;
/// Seconds for a whole turn. At half, the sense of a screw is hard to see; at double, threads of many turns are tedious.
const PER_TURN: f64 = 0.9;
/// Seconds: the shortest step. At half, small parts jump; at double, plans of a hundred steps take minutes more.
const SHORTEST: f64 = 1.0;
/// Seconds: the longest step. At half, screws of many turns blur; at double, viewers wait.
const LONGEST: f64 = 8.0;
/// Seconds between two steps, in which the page fades the parts that are out. At half, the fading flickers; at double, viewers
/// wait.
pub(super) const PAUSE: f64 = 0.4;

impl SceneBuilder<'_> {
    /// Puts the steps on the timeline, one after the other, and the key frames into the parts; and which parts leave
    /// which body by which way, first to last (of an assembly plan: the steps backwards).
    pub(super) fn steps(
        &self,
        placements: &Placements,
        parts: &mut [ScenePart],
    ) -> (Vec<SceneStep>, Vec<Leaving>) {
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
            let states: Vec<&StabilityDocument> = step.stability.iter().collect();
            let held = held(self.plan, &states).into_iter().filter_map(|name| self.place(name));
            steps.push(SceneStep {
                parts: moving,
                of: step.of,
                begins: clock,
                ends: course.ends,
                is_aside: frame.ends == StepEnd::Aside,
                body: Vec::new(),
                after: after.collect(),
                held: held.collect(),
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
