//! The steps of a plan in words. Of the path alone: no mesh is needed.
//!
//! The displacement from one waypoint to the next is a turn about some axis in space with a shift along it
//! (Chasles); both are the same for all points of the part. Displacements in a row that are alike are told as
//! one: a straight way by its direction and length, a screw by its turns and how far they bring the part.

use nalgebra::Vector3;

use super::document::kind_of;
use crate::geometry::{Pose, pose_from_waypoint};
use crate::plan::export::{PlanDocument, StepDocument};
use crate::plan::{PlanKind, StepEnd};

/// Turns below this (radians) are none.
const NO_TURN: f64 = 0.01;
/// cos of the angle within which two directions are one (3 degrees) …
const ALIKE: f64 = 0.9986;
/// … and within which one is told as an axis of the frame (2 degrees).
const NEARLY: f64 = 0.9994;
/// Moves shorter than this share of the whole way are not told …
const SLIGHT: f64 = 0.03;
/// … and no more than so many.
const MOST: usize = 3;
/// Count of names in a sentence; more are counted, since a longer list hides the verb. At half a row of four screws is not
/// named; at double a sentence fills two lines.
const MOST_NAMES: usize = 6;

/// One move of a part, as it is told.
#[derive(Debug, Clone, PartialEq)]
struct Move {
    /// Unit direction: of the way, or of the axis that the part turns about counter-clockwise.
    along: Vector3<f64>,
    /// How far, along `along`; negative against it.
    length: f64,
    /// How far it turns, radians; 0 for straight moves.
    angle: f64,
}

impl Move {
    fn between(a: &Pose, b: &Pose) -> Self {
        let shift = b * a.inverse();
        match shift.rotation.axis_angle() {
            Some((axis, angle)) if angle > NO_TURN => {
                Self { along: *axis, length: shift.translation.vector.dot(&axis), angle }
            }
            _ => {
                let way = b.translation.vector - a.translation.vector;
                let along = way.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
                Self { along, length: way.norm(), angle: 0.0 }
            }
        }
    }

    /// Takes the next move in, if it goes on in the same way.
    fn goes_on(&mut self, next: &Self) -> bool {
        let same = self.along.dot(&next.along) > ALIKE && (self.angle > 0.0) == (next.angle > 0.0);
        if same {
            let way = self.along * self.length.abs() + next.along * next.length.abs();
            self.along = way.try_normalize(f64::MIN_POSITIVE).unwrap_or(self.along);
            self.length += next.length;
            self.angle += next.angle;
        }
        same
    }

    /// Whether it is too short to be told, of a way of some length.
    fn is_slight(&self, whole: f64) -> bool {
        self.length.abs() < whole * SLIGHT && self.angle < 0.1
    }

    /// Whether it is along no axis of the frame, as ways are that only bring a part up from where it waits.
    fn is_oblique(&self) -> bool {
        self.along.amax() < NEARLY
    }

    /// Where to, and how far.
    fn told(&self, units: Option<&str>) -> String {
        let sense = if self.length < 0.0 { -self.along } else { self.along };
        if self.angle == 0.0 {
            return format!("along {} ({})", direction(&sense), length(self.length, units));
        }
        let turned = turned(self.angle);
        if self.length.abs() < 1e-6 {
            return format!("by {turned} about {}", direction(&self.along));
        }
        format!("by {turned} along {} ({})", direction(&sense), length(self.length.abs(), units))
    }
}

/// The moves of a path.
fn moves(step: &StepDocument) -> Vec<Move> {
    let poses: Vec<Pose> = step.path.iter().map(pose_from_waypoint).collect();
    let mut moves: Vec<Move> = Vec::new();
    for pair in poses.windows(2) {
        let next = Move::between(&pair[0], &pair[1]);
        if (next.length == 0.0 && next.angle == 0.0) || moves.last_mut().is_some_and(|m| m.goes_on(&next)) {
            continue;
        }
        moves.push(next);
    }
    moves
}

fn whole(moves: &[Move]) -> f64 {
    moves.iter().map(|m| m.length.abs()).sum()
}

/// The moves that are worth telling.
fn telling(moves: &[Move]) -> Vec<Move> {
    let whole = whole(moves);
    let telling: Vec<Move> = moves.iter().filter(|m| !m.is_slight(whole)).cloned().collect();
    if telling.is_empty() { moves.to_vec() } else { telling }
}

/// How many of the first moves only bring a part up from where it waits: those up to the last one that is along
/// no axis, as random ways are.
fn brought_up(moves: &[Move]) -> usize {
    let whole = whole(moves);
    let before = &moves[..moves.len().saturating_sub(1)];
    before.iter().rposition(|m| m.is_oblique() && !m.is_slight(whole)).map_or(0, |last| last + 1)
}

/// Tells the steps of one plan.
pub(super) struct Words<'a> {
    plan: &'a PlanDocument,
    kind: PlanKind,
}

/// The subject of a sentence: what a step moves.
pub(super) struct Moved {
    what: String,
    /// It is several parts.
    is_several: bool,
}

impl Moved {
    /// One part, or what stands for one.
    pub(super) fn one(what: &str) -> Self {
        Self { what: what.to_owned(), is_several: false }
    }

    /// The parts of a step.
    fn all(names: &[String]) -> Self {
        match names {
            [only] => Self::one(only),
            names => Self { what: format!("{} together", told_names(names, " and ")), is_several: true },
        }
    }

    fn it(&self) -> &'static str {
        if self.is_several { "them" } else { "it" }
    }
}

/// Names in a row, of many the first and a count; `last` is between the last two.
pub(super) fn told_names<S: AsRef<str>>(names: &[S], last: &str) -> String {
    let shown: Vec<&str> = names.iter().take(MOST_NAMES).map(AsRef::as_ref).collect();
    match (names.len() - shown.len(), &shown[..]) {
        (0, [first @ .., end]) if !first.is_empty() => format!("{}{last}{end}", first.join(", ")),
        (0, _) => shown.join(", "),
        (more, _) => format!("{} and {more} more", shown.join(", ")),
    }
}

impl<'a> Words<'a> {
    pub(super) fn of(plan: &'a PlanDocument) -> Self {
        Self { plan, kind: kind_of(plan) }
    }

    /// A step: what is done, and of which group if it is not of the assembly.
    pub(super) fn step(&self, step: usize) -> String {
        self.done(step, &Moved::all(&self.plan.steps[step].parts))
    }

    /// What is done in a step to what goes by some name.
    pub(super) fn done(&self, step: usize, moved: &Moved) -> String {
        let units = self.plan.units.as_deref();
        let StepDocument { of, ends, .. } = &self.plan.steps[step];
        let all = moves(&self.plan.steps[step]);
        let is_aside = *ends == StepEnd::Aside.name();
        let brought = if self.kind == PlanKind::Assembly && !is_aside { brought_up(&all) } else { 0 };
        let moves = telling(&all[brought..]);
        let told: Vec<String> = moves.iter().map(|m| m.told(units)).collect();
        let turns = moves.iter().any(|m| m.angle > 0.0);
        let done = match self.kind {
            _ if is_aside => aside(moved, &told, turns),
            PlanKind::Disassembly => out(moved, &told, turns),
            PlanKind::Assembly => into(moved, &told, turns, brought > 0),
        };
        match (of, self.kind) {
            (None, _) => done,
            (Some(of), PlanKind::Disassembly) => format!("Of the group of step {}: {}", of + 1, lower(&done)),
            (Some(of), PlanKind::Assembly) => format!("For the group of step {}: {}", of + 1, lower(&done)),
        }
    }
}

/// With a small first letter.
fn lower(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

fn out(moved: &Moved, moves: &[String], turns: bool) -> String {
    let Moved { what, .. } = moved;
    match moves {
        [] => format!("Lift {what} away: nothing holds {}", moved.it()),
        [only] if turns => format!("Turn {what} out {only}"),
        [only] => format!("Take {what} out {only}"),
        moves => led("out", moved, moves),
    }
}

fn aside(moved: &Moved, moves: &[String], turns: bool) -> String {
    let Moved { what, .. } = moved;
    match moves {
        [] => format!("Leave {what} where {}", if moved.is_several { "they are" } else { "it is" }),
        [only] if turns => format!("Turn {what} aside {only}"),
        [only] => format!("Move {what} aside {only}"),
        moves => led("aside", moved, moves),
    }
}

/// Several moves, the last one of which leads out or aside.
fn led(whither: &str, moved: &Moved, moves: &[String]) -> String {
    match moves {
        [first, .., last] if moves.len() > MOST => {
            let (begun, left) = (begun(moved, first), moves.len() - 2);
            format!("{begun}, go on in {left} moves, then {}", ended(moved, whither, last))
        }
        [first, between @ .., last] => {
            let begun = begun(moved, first);
            format!("{begun}{}, then {}", gone_on(moved, between), ended(moved, whither, last))
        }
        _ => moves.concat(),
    }
}

fn into(moved: &Moved, moves: &[String], turns: bool, brought: bool) -> String {
    let Moved { what, .. } = moved;
    let up = format!("Bring {what} up");
    match moves {
        [] if moved.is_several => format!("Put {what} in their places: they touch nothing on the way"),
        [] => format!("Put {what} in its place: it touches nothing on the way"),
        [only] if brought => format!("{up}, then {}", ended(moved, "in", only)),
        [only] if turns => format!("Turn {what} in {only}"),
        [only] => format!("Put {what} in {only}"),
        [before @ .., last] if moves.len() > MOST => {
            format!("{up} in {} moves, then {}", before.len(), ended(moved, "in", last))
        }
        [before @ .., last] if brought => {
            format!("{up}{}, then {}", gone_on(moved, before), ended(moved, "in", last))
        }
        moves => led("in", moved, moves),
    }
}

fn is_turn(told: &str) -> bool {
    told.starts_with("by")
}

fn begun(moved: &Moved, first: &str) -> String {
    format!("{} {} {first}", if is_turn(first) { "Turn" } else { "Move" }, moved.what)
}

fn turned_on(moved: &Moved, told: &str) -> String {
    if is_turn(told) { format!("turn {} ", moved.it()) } else { String::new() }
}

fn gone_on(moved: &Moved, between: &[String]) -> String {
    between.iter().map(|m| format!(", then {}{m}", turned_on(moved, m))).collect()
}

fn ended(moved: &Moved, whither: &str, last: &str) -> String {
    format!("{}{whither} {last}", turned_on(moved, last))
}

/// The other parts that the steps move which a step requires, in the order of the steps. That the group of a step is out
/// goes without saying.
pub(super) fn required(plan: &PlanDocument, step: usize) -> Vec<&str> {
    let Some(own) = plan.steps.get(step) else { return Vec::new() };
    let others = own.requires.iter().filter(|number| Some(**number) != own.of);
    let parts = others.filter_map(|&number| plan.steps.get(number)).flat_map(|s| &s.parts);
    let mut names: Vec<&str> = Vec::new();
    for name in parts.filter(|name| !own.parts.contains(name)) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// A direction by the axis of the frame that it is along, else by its coordinates.
pub(crate) fn direction(d: &Vector3<f64>) -> String {
    let axis = d.iamax();
    if d[axis].abs() > NEARLY {
        return format!("{}{}", if d[axis] > 0.0 { '+' } else { '−' }, ["X", "Y", "Z"][axis]);
    }
    // No "-0.00".
    let [x, y, z] = [d.x, d.y, d.z].map(|c| (c * 100.0).round() / 100.0 + 0.0);
    format!("({x:.2}, {y:.2}, {z:.2})")
}

/// Whole and half turns from one turn on, else degrees.
fn turned(angle: f64) -> String {
    let turns = angle / std::f64::consts::TAU;
    if turns < 0.995 {
        return format!("{:.0}°", angle.to_degrees());
    }
    let turns = (turns * 10.0).round() / 10.0;
    if turns == 1.0 { "1 turn".to_owned() } else { format!("{turns} turns") }
}

/// A length in three digits, with its unit if known.
pub(super) fn length(value: f64, units: Option<&str>) -> String {
    let digits = 2 - value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
    let number = match digits {
        _ if value == 0.0 => "0".to_owned(),
        8.. | ..=-5 => format!("{value:.2e}"),
        0..=7 => {
            let fixed = format!("{value:.*}", digits as usize);
            if fixed.contains('.') {
                fixed.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                fixed
            }
        }
        _ => format!("{value:.0}"),
    };
    format!("{number} {}", units.unwrap_or("units"))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::super::document::tests::{nested, plan, reversed, step};
    use super::*;
    use crate::geometry::{Waypoint, waypoint_from_pose};

    fn at(shift: [f64; 3], turn: [f64; 3]) -> Waypoint {
        waypoint_from_pose(&Pose::new(shift.into(), turn.into()))
    }

    fn told(kind: &str, path: &[Waypoint]) -> String {
        let plan = PlanDocument { kind: kind.into(), steps: vec![step("1", path)], ..plan() };
        Words::of(&plan).step(0)
    }

    /// Down a right-handed thread of pitch 1.25 about a line off the origin.
    fn thread(turns: f64) -> Vec<Waypoint> {
        let axis = Pose::translation(20.0, 5.0, 0.0);
        let count = (turns * 8.0) as usize;
        (0..=count)
            .map(|i| {
                let turn = -(i as f64) * turns / count as f64;
                let screw = Pose::new(Vector3::z() * turn * -1.25, Vector3::z() * turn * TAU);
                waypoint_from_pose(&(axis * screw * axis.inverse()))
            })
            .collect()
    }

    #[test]
    fn straight_ways_are_told_by_direction_and_length() {
        let start = at([0.0; 3], [0.0; 3]);
        let path = [start, at([0.0, 0.0, 4.0], [0.0; 3]), at([0.0, 0.0, 13.5], [0.0; 3])];
        assert_eq!(told("disassembly", &path), "Take 1 out along +Z (13.5 mm)");
        assert_eq!(told("assembly", &[path[2], path[0]]), "Put 1 in along −Z (13.5 mm)");
        let slot = [start, at([5.0, 0.0, 0.0], [0.0; 3]), at([5.0, 6.0, 8.0], [0.0; 3])];
        assert_eq!(
            told("disassembly", &slot),
            "Move 1 along +X (5 mm), then out along (0.00, 0.60, 0.80) (10 mm)"
        );
        assert_eq!(told("disassembly", &[start]), "Lift 1 away: nothing holds it");
    }

    #[test]
    fn groups_and_parts_aside_are_told_as_such() {
        let all = |plan: &PlanDocument| -> Vec<String> {
            (0..plan.steps.len()).map(|step| Words::of(plan).step(step)).collect()
        };
        assert_eq!(
            all(&nested()),
            [
                "Take 0, 1 and 2 together out along +Z (8 mm)",
                "Of the group of step 1: move 1 aside along +X (1 mm)",
                "Of the group of step 1: take 1 and 2 together out along +Y (5 mm)",
                "Of the group of step 3: take 2 out along +X (6 mm)",
            ]
        );
        assert_eq!(
            all(&reversed(nested())),
            [
                "For the group of step 2: put 2 in along −X (6 mm)",
                "For the group of step 4: put 1 and 2 together in along −Y (5 mm)",
                "For the group of step 4: move 1 aside along −X (1 mm)",
                "Put 0, 1 and 2 together in along −Z (8 mm)",
            ]
        );
        let parts: Vec<String> = (0..8).map(|i| i.to_string()).collect();
        let turn = [at([0.0; 3], [0.0; 3]), at([0.0; 3], [0.0, 0.0, PI / 4.0])];
        let path = [turn[0], at([0.0, 0.0, 3.0], [0.0; 3]), at([0.0, 0.0, 3.0], [0.0, 0.0, PI / 4.0])];
        let several = |ends: &str, path: &[Waypoint]| {
            let step = StepDocument { parts: parts.clone(), ends: ends.into(), ..step("0", path) };
            let plan = PlanDocument { steps: vec![step], parts: parts.clone(), ..plan() };
            Words::of(&plan).step(0)
        };
        let who = "0, 1, 2, 3, 4, 5 and 2 more together";
        assert_eq!(several("out", &path[..1]), format!("Lift {who} away: nothing holds them"));
        assert_eq!(several("aside", &turn), format!("Turn {who} aside by 45° about +Z"));
        assert_eq!(
            several("out", &path),
            format!("Move {who} along +Z (3 mm), then turn them out by 45° about +Z")
        );
    }

    #[test]
    fn what_goes_without_saying_is_not_required() {
        let mut plan = nested();
        plan.steps[2].requires = vec![0, 1];
        plan.steps[3].requires = vec![1, 2];
        let all = |plan: &PlanDocument| -> Vec<Vec<String>> {
            (0..4).map(|step| required(plan, step).into_iter().map(String::from).collect()).collect()
        };
        let none: [&str; 0] = [];
        assert_eq!(all(&plan), [&none[..], &none, &none, &["1"]]);
        let together = reversed(nested());
        assert_eq!(together.steps[3].requires, [1, 2]);
        assert_eq!(all(&together), [none; 4], "a group has in it what was put into it");
    }

    #[test]
    fn screws_are_told_in_turns_wherever_their_axis_is() {
        assert_eq!(told("disassembly", &thread(11.5)), "Turn 1 out by 11.5 turns along +Z (14.4 mm)");
        let mut back = thread(11.5);
        back.reverse();
        assert_eq!(told("assembly", &back), "Turn 1 in by 11.5 turns along −Z (14.4 mm)");
        let mut path = thread(2.0);
        let last = pose_from_waypoint(&path[path.len() - 1]);
        path.push(waypoint_from_pose(&(Pose::translation(0.0, 0.0, 30.0) * last)));
        let text = told("disassembly", &path);
        assert_eq!(text, "Turn 1 by 2 turns along +Z (2.5 mm), then out along +Z (30 mm)");
        path.reverse();
        let text = told("assembly", &path);
        assert_eq!(text, "Move 1 along −Z (30 mm), then turn it in by 2 turns along −Z (2.5 mm)");
    }

    #[test]
    fn bayonets_are_told_in_degrees() {
        let start = at([0.0; 3], [0.0; 3]);
        let turned = at([0.0; 3], [0.0, 0.0, PI / 4.0]);
        let text = told("disassembly", &[start, turned, at([0.0, 0.0, 9.0], [0.0, 0.0, PI / 4.0])]);
        assert_eq!(text, "Turn 1 by 45° about +Z, then out along +Z (9 mm)");
    }

    #[test]
    fn long_ways_are_cut_short() {
        let corner = |i: usize| at([(i / 2) as f64 * 5.0, i.div_ceil(2) as f64 * 5.0, 0.0], [0.0; 3]);
        let path: Vec<_> = (0..=6).map(corner).collect();
        let text = told("disassembly", &path);
        assert_eq!(text, "Move 1 along +Y (5 mm), go on in 4 moves, then out along +X (5 mm)");
        assert_eq!(told("assembly", &path), "Bring 1 up in 5 moves, then in along +X (5 mm)");
    }

    #[test]
    fn how_a_part_is_brought_up_is_not_told() {
        let at = |x, y, z| at([x, y, z], [0.0; 3]);
        let waits = [at(90.0, 20.0, 0.0), at(90.0, 20.0, 40.0), at(5.0, 1.0, 30.0), at(5.0, 0.0, 30.0)];
        let slot = [at(5.0, 0.0, 8.0), at(0.0, 0.0, 8.0)];
        let path = [&waits[..], &slot[..]].concat();
        assert_eq!(
            told("assembly", &path),
            "Bring 1 up, then along −Y (1 mm), then along −Z (22 mm), then in along −X (5 mm)"
        );
        assert_eq!(
            told("assembly", &[&waits[..3], &[at(5.0, 1.0, 0.0)]].concat()),
            "Bring 1 up, then in along −Z (30 mm)"
        );
        assert_eq!(told("disassembly", &[waits[0], waits[1]]), "Take 1 out along +Z (40 mm)");
    }

    #[test]
    fn lengths_have_three_digits() {
        for (value, text) in
            [(14.0, "14 mm"), (13.456, "13.5 mm"), (0.02, "0.02 mm"), (1234.5, "1234 mm"), (0.0, "0 mm")]
        {
            assert_eq!(length(value, Some("mm")), text);
        }
        assert_eq!(length(100.0, None), "100 units");
    }
}
