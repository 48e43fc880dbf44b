//! The steps of a plan in words. Of the path alone: no mesh is needed.
//!
//! A straight way has its direction and length, a screw its turns and how far they bring the part. Several steps whose moves are alike share one sentence, with the range of their lengths and turns.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::moves::{Move, MoveKind, NEARLY, QUARTERLY, brought_near, moves, telling};
use crate::document::kind_of;
use crate::document::{FreeGroupDocument, PlanDocument, StepDocument};
use crate::plan::{PlanKind, StepEnd};

/// A sentence names no more moves than this.
const MOST: usize = 3;
/// Count of names in a sentence; more are counted, since a longer list hides the verb. At half a row of four screws is not
/// named; at double a sentence fills two lines.
const MOST_NAMES: usize = 6;

/// A move in words, without its verb.
struct ToldMove {
    kind: MoveKind,
    text: String,
}

impl ToldMove {
    /// Moves that are alike: where to, and how far. The sense of a screw is that which is seen from the side where the part
    /// is when it is out: a turn about a direction is counter-clockwise for who looks against it.
    fn of(alike: &[&Move], plan: PlanKind, may_screw: bool, units: Option<&str>) -> Self {
        let (first, kind) = (alike[0], alike[0].kind());
        let of = |value: fn(&Move) -> f64| {
            let values = alike.iter().map(|m| value(m));
            (values.clone().fold(f64::INFINITY, f64::min), values.fold(0.0, f64::max))
        };
        let (length, turned) = (lengths(of(|m| m.length.abs()), units), turned(of(|m| m.angle)));
        match kind {
            MoveKind::Straight => {
                Self { kind, text: format!("along {} ({length})", direction(&first.along)) }
            }
            MoveKind::Screw if may_screw => {
                let viewer = match plan {
                    PlanKind::Disassembly => first.sense(),
                    PlanKind::Assembly => -first.sense(),
                };
                let is_counter = first.along.dot(&viewer) > 0.0;
                let hand = if is_counter { "counter-clockwise" } else { "clockwise" };
                Self { kind, text: format!("{hand} seen from {}, {turned} ({length})", direction(&viewer)) }
            }
            _ if first.length == 0.0 => {
                Self { kind: MoveKind::Turn, text: format!("by {turned} about {}", direction(&first.along)) }
            }
            _ => Self {
                kind: MoveKind::Turn,
                text: format!("by {turned} along {} ({length})", direction(&first.sense())),
            },
        }
    }
}

/// Tells the steps of one plan.
pub(super) struct Words<'a> {
    plan: &'a PlanDocument,
    kind: PlanKind,
    /// One per step.
    courses: Vec<Course>,
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
            [only] => Self::one(&part_word(only)),
            names => Self { what: format!("{} together", told_names(names, " and ")), is_several: true },
        }
    }

    fn it(&self) -> &'static str {
        if self.is_several { "them" } else { "it" }
    }
}

fn is_number(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit())
}

/// A part in a sentence: its name, after the word `part` if it is digits alone.
pub(crate) fn part_word(name: &str) -> String {
    if is_number(name) { format!("part {name}") } else { name.to_owned() }
}

/// All names in a row; `last` is between the last two.
pub(crate) fn part_words<S: AsRef<str>>(names: &[S], last: &str) -> String {
    let are_numbers = names.len() > 1 && names.iter().all(|name| is_number(name.as_ref()));
    let word = |name: &S| if are_numbers { name.as_ref().to_owned() } else { part_word(name.as_ref()) };
    let words: Vec<String> = names.iter().map(word).collect();
    let row = match &words[..] {
        [first @ .., end] if !first.is_empty() => format!("{}{last}{end}", first.join(", ")),
        _ => words.concat(),
    };
    if are_numbers { format!("parts {row}") } else { row }
}

/// Names in a row, of many the first and a count; `last` is between the last two.
pub(super) fn told_names<S: AsRef<str>>(names: &[S], last: &str) -> String {
    match names.split_at_checked(MOST_NAMES) {
        Some((shown, rest)) if !rest.is_empty() => {
            format!("{} and {} more", part_words(shown, ", "), rest.len())
        }
        _ => part_words(names, last),
    }
}

/// That a group was not taken apart.
pub(super) fn kept_together(group: &[String]) -> String {
    format!("Not taken apart: {}", told_names(group, " and "))
}

/// That a group can begin to move.
pub(super) fn free_together(group: &FreeGroupDocument) -> String {
    let along = direction(&group.direction.into());
    format!("Can begin to move together along {along}: {}", told_names(&group.parts, " and "))
}

/// What a step does, of the path alone.
#[derive(Debug)]
struct Course {
    /// Whether the part is brought near before the moves, from where it waits.
    is_brought: bool,
    /// The moves that the sentence names.
    moves: Vec<Move>,
}

impl<'a> Words<'a> {
    pub(super) fn of(plan: &'a PlanDocument) -> Self {
        let kind = kind_of(plan);
        let course = |step: &StepDocument| {
            let all = moves(step);
            let brought = match kind {
                PlanKind::Assembly if step.ends != StepEnd::Aside.name() => brought_near(&all),
                _ => 0,
            };
            Course { is_brought: brought > 0, moves: telling(&all[brought..]) }
        };
        Self { plan, kind, courses: plan.steps.iter().map(course).collect() }
    }

    /// A step: what is done, and of which group if it is not of the assembly.
    pub(super) fn step(&self, step: usize) -> String {
        self.done(&[step], &Moved::all(&self.plan.steps[step].parts))
    }

    /// Whether one sentence tells what two steps do, but for their parts.
    pub(super) fn is_alike(&self, a: usize, b: usize) -> bool {
        let (of, ends) = (&self.plan.steps[a].of, &self.plan.steps[a].ends);
        let (own, other) = (&self.courses[a], &self.courses[b]);
        (of, ends) == (&self.plan.steps[b].of, &self.plan.steps[b].ends)
            && own.is_brought == other.is_brought
            && own.moves.len() == other.moves.len()
            && own.moves.iter().zip(&other.moves).all(|(a, b)| a.is_alike(b))
    }

    /// What is done in steps that are alike to what goes by some name.
    pub(super) fn done(&self, steps: &[usize], moved: &Moved) -> String {
        let units = self.plan.units.as_deref();
        let StepDocument { of, ends, .. } = &self.plan.steps[steps[0]];
        let Course { is_brought, moves } = &self.courses[steps[0]];
        let is_aside = *ends == StepEnd::Aside.name();
        let told = |k: usize| {
            let alike: Vec<&Move> = steps.iter().map(|&step| &self.courses[step].moves[k]).collect();
            // Where a part is inserted it may have turned on its way to there, too.
            let may_screw = !is_aside && (self.kind == PlanKind::Disassembly || k + 1 == moves.len());
            ToldMove::of(&alike, self.kind, may_screw, units)
        };
        let told: Vec<ToldMove> = (0..moves.len()).map(told).collect();
        let whither = match self.kind {
            _ if is_aside => ASIDE,
            PlanKind::Disassembly => OUT,
            PlanKind::Assembly => IN,
        };
        let done = sentence(whither, moved, &told, *is_brought);
        match (of, self.kind) {
            (None, _) => done,
            (Some(of), PlanKind::Disassembly) => format!("Of the group of step {}: {}", of + 1, lower(&done)),
            (Some(of), PlanKind::Assembly) => format!("For the group of step {}: {}", of + 1, lower(&done)),
        }
    }
}

/// With a capital first letter.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// With a small first letter.
fn lower(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

/// Where the last move of a step leads, by its verb and adverb.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Whither(&'static str, &'static str);

const OUT: Whither = Whither("take", "out");
const ASIDE: Whither = Whither("move", "aside");
const IN: Whither = Whither("put", "in");

fn sentence(whither: Whither, moved: &Moved, moves: &[ToldMove], is_brought: bool) -> String {
    let (Moved { what, is_several }, it) = (moved, moved.it());
    match moves {
        [] => match (whither, is_several) {
            (OUT, _) => format!("Lift {what} away: nothing holds {it}"),
            (IN, true) => format!("Put {what} in their places: they touch nothing on the way"),
            (IN, false) => format!("Put {what} in its place: it touches nothing on the way"),
            (_, true) => format!("Leave {what} where they are"),
            (_, false) => format!("Leave {what} where it is"),
        },
        [only] if !is_brought => capital(&ended(whither, what, only)),
        [before @ .., last] => {
            let last = ended(whither, it, last);
            let is_long = moves.len() > MOST;
            let (begun, between) = match before {
                [first, between @ ..] if !(is_brought || is_long && whither == IN) => {
                    (capital(&on_the_way(whither, what, first)), between)
                }
                _ => (format!("Bring {what} near"), before),
            };
            let between = match is_long {
                true if whither == IN => format!(" in {} moves", between.len()),
                true => format!(", go on in {} moves", between.len()),
                false => between.iter().map(|m| format!(", then {}", on_the_way(whither, it, m))).collect(),
            };
            format!("{begun}{between}, then {last}")
        }
    }
}

/// A move before the last.
fn on_the_way(whither: Whither, what: &str, told: &ToldMove) -> String {
    let ToldMove { kind, text } = told;
    match kind {
        MoveKind::Straight => format!("move {what} {text}"),
        MoveKind::Turn => format!("turn {what} {text}"),
        MoveKind::Screw => ended(whither, what, told),
    }
}

/// The last move.
fn ended(whither: Whither, what: &str, ToldMove { kind, text }: &ToldMove) -> String {
    let Whither(verb, adverb) = whither;
    match kind {
        MoveKind::Straight => format!("{verb} {what} {adverb} {text}"),
        MoveKind::Turn => format!("turn {what} {adverb} {text}"),
        MoveKind::Screw if whither != IN => format!("unscrew {what} {text}"),
        MoveKind::Screw if ["it", "them"].contains(&what) => format!("screw {what} in {text}"),
        MoveKind::Screw => format!("screw in {what} {text}"),
    }
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

/// Turns from the least to the most (radians): quarters of a turn where they are near, else turns with a decimal from one
/// turn on, else degrees.
fn turned((least, most): (f64, f64)) -> String {
    let [(a, unit_a), (b, unit_b)] = [least, most].map(|angle| {
        let turns = angle / TAU;
        let quarters = (turns * 4.0).round() as usize;
        let is_near = quarters > 0 && (turns - quarters as f64 / 4.0).abs() < QUARTERLY;
        match (is_near, quarters / 4) {
            (true, 0) => (["", "¼", "½", "¾"][quarters % 4].to_owned(), " turn"),
            (true, 1) if quarters == 4 => ("1".to_owned(), " turn"),
            (true, whole) => (format!("{whole}{}", ["", "¼", "½", "¾"][quarters % 4]), " turns"),
            (false, _) if turns < 1.0 => (format!("{:.0}", angle.to_degrees()), "°"),
            (false, _) => (format!("{turns:.1}"), " turns"),
        }
    });
    match (a == b, unit_a == unit_b) {
        (true, true) => format!("{a}{unit_a}"),
        (false, true) => format!("{a}–{b}{unit_b}"),
        (_, false) => format!("{a}{unit_a}–{b}{unit_b}"),
    }
}

/// Lengths from the least to the most in three digits of the latter, with their unit if known; one number if both are the
/// same then.
pub(super) fn lengths((least, most): (f64, f64), units: Option<&str>) -> String {
    let digits = 2 - most.max(f64::MIN_POSITIVE).log10().floor() as i32;
    let [a, b] = [least, most].map(|value| match digits {
        _ if value == 0.0 => "0".to_owned(),
        8.. | ..=-5 => format!("{value:.2e}"),
        _ => format!("{value:.*}", digits.max(0) as usize),
    });
    let is_decimal = b.contains('.') && !b.contains('e');
    let number = match a == b {
        true if is_decimal => b.trim_end_matches('0').trim_end_matches('.').to_owned(),
        true => b,
        false => format!("{a}–{b}"),
    };
    format!("{number} {}", units.unwrap_or("units"))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::super::document::tests::{nested, plan, reversed, step};
    use super::*;
    use crate::geometry::{Pose, Waypoint, pose_from_waypoint, waypoint_from_pose};

    fn at(shift: [f64; 3], turn: [f64; 3]) -> Waypoint {
        waypoint_from_pose(&Pose::new(shift.into(), turn.into()))
    }

    fn told(kind: &str, path: &[Waypoint]) -> String {
        let plan = PlanDocument { kind: kind.into(), steps: vec![step("1", path)], ..plan() };
        Words::of(&plan).step(0)
    }

    /// Off a thread of pitch 1.25 about a line off the origin, along +z.
    fn thread(turns: f64, is_right_handed: bool) -> Vec<Waypoint> {
        let axis = Pose::translation(20.0, 5.0, 0.0);
        let count = (turns * 8.0) as usize;
        // A nut on a right-handed thread that turns counter-clockwise about +z, as the hand's fingers point, goes along +z,
        // as its thumb points.
        let sense = if is_right_handed { 1.0 } else { -1.0 };
        (0..=count)
            .map(|i| {
                let turn = i as f64 * turns / count as f64;
                let screw = Pose::new(Vector3::z() * turn * 1.25, Vector3::z() * sense * turn * TAU);
                waypoint_from_pose(&(axis * screw * axis.inverse()))
            })
            .collect()
    }

    #[test]
    fn straight_ways_are_told_by_direction_and_length() {
        let start = at([0.0; 3], [0.0; 3]);
        let path = [start, at([0.0, 0.0, 4.0], [0.0; 3]), at([0.0, 0.0, 13.5], [0.0; 3])];
        assert_eq!(told("disassembly", &path), "Take part 1 out along +Z (13.5 mm)");
        assert_eq!(told("assembly", &[path[2], path[0]]), "Put part 1 in along −Z (13.5 mm)");
        let slot = [start, at([5.0, 0.0, 0.0], [0.0; 3]), at([5.0, 6.0, 8.0], [0.0; 3])];
        assert_eq!(
            told("disassembly", &slot),
            "Move part 1 along +X (5 mm), then take it out along (0.00, 0.60, 0.80) (10 mm)"
        );
        assert_eq!(told("disassembly", &[start]), "Lift part 1 away: nothing holds it");
    }

    #[test]
    fn groups_and_parts_aside_are_told_as_such() {
        let all = |plan: &PlanDocument| -> Vec<String> {
            (0..plan.steps.len()).map(|step| Words::of(plan).step(step)).collect()
        };
        assert_eq!(
            all(&nested()),
            [
                "Take parts 0, 1 and 2 together out along +Z (8 mm)",
                "Of the group of step 1: move part 1 aside along +X (1 mm)",
                "Of the group of step 1: take parts 1 and 2 together out along +Y (5 mm)",
                "Of the group of step 3: take part 2 out along +X (6 mm)",
            ]
        );
        assert_eq!(
            all(&reversed(nested())),
            [
                "For the group of step 2: put part 2 in along −X (6 mm)",
                "For the group of step 4: put parts 1 and 2 together in along −Y (5 mm)",
                "For the group of step 4: move part 1 aside along −X (1 mm)",
                "Put parts 0, 1 and 2 together in along −Z (8 mm)",
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
        let who = "parts 0, 1, 2, 3, 4, 5 and 2 more together";
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
    fn screws_are_told_by_hand_and_turns_wherever_their_axis_is() {
        for (is_right_handed, out, back) in
            [(true, "counter-clockwise", "clockwise"), (false, "clockwise", "counter-clockwise")]
        {
            let mut path = thread(11.5, is_right_handed);
            let text = told("disassembly", &path);
            assert_eq!(text, format!("Unscrew part 1 {out} seen from +Z, 11½ turns (14.4 mm)"));
            path.reverse();
            let text = told("assembly", &path);
            assert_eq!(text, format!("Screw in part 1 {back} seen from +Z, 11½ turns (14.4 mm)"));
            path = thread(2.0, is_right_handed);
            let last = pose_from_waypoint(&path[path.len() - 1]);
            path.push(waypoint_from_pose(&(Pose::translation(0.0, 0.0, 30.0) * last)));
            let text = told("disassembly", &path);
            let unscrewed = format!("Unscrew part 1 {out} seen from +Z, 2 turns (2.5 mm)");
            assert_eq!(text, format!("{unscrewed}, then take it out along +Z (30 mm)"));
            path.reverse();
            let text = told("assembly", &path);
            let screwed = format!("then screw it in {back} seen from +Z, 2 turns (2.5 mm)");
            assert_eq!(text, format!("Move part 1 along −Z (30 mm), {screwed}"));
        }
    }

    #[test]
    fn a_nut_that_leaves_downwards_is_seen_from_below() {
        let flip = Pose::new(Vector3::zeros(), Vector3::x() * PI);
        let down = thread(3.25, true).into_iter().map(|w| flip * pose_from_waypoint(&w) * flip.inverse());
        let down: Vec<Waypoint> = down.map(|pose| waypoint_from_pose(&pose)).collect();
        let text = told("disassembly", &down);
        assert_eq!(text, "Unscrew part 1 counter-clockwise seen from −Z, 3¼ turns (4.06 mm)");
    }

    #[test]
    fn what_drifts_while_it_turns_or_turns_little_is_no_screw() {
        let drift = [
            at([0.0; 3], [0.0; 3]),
            at([0.0, 0.0, 0.003], [0.0, 0.0, PI]),
            at([0.0, 0.0, 9.0], [0.0, 0.0, PI]),
        ];
        assert_eq!(
            told("disassembly", &drift),
            "Turn part 1 by ½ turn about +Z, then take it out along +Z (9 mm)"
        );
        // On its way to where it is put in.
        let way =
            [at([0.0, 9.0, 0.0], [0.0, 0.0, PI]), at([0.0, 9.0, -3.0], [0.0; 3]), at([0.0; 3], [0.0; 3])];
        let text = told("assembly", &way);
        assert!(text.starts_with("Turn part 1 by ½ turn along −Z (3 mm)"), "{text}");
        let tilt = [at([0.0; 3], [0.0; 3]), at([0.0, 0.0, 2.0], [0.0, 0.0, PI / 2.0])];
        assert_eq!(told("disassembly", &tilt), "Turn part 1 out by ¼ turn along +Z (2 mm)");
    }

    #[test]
    fn turns_are_told_in_quarters_where_they_are_near() {
        for (turns, text) in [
            (0.125, "45°"),
            (0.249, "¼ turn"),
            (0.5, "½ turn"),
            (0.8, "288°"),
            (1.01, "1 turn"),
            (1.25, "1¼ turns"),
            (8.485, "8½ turns"),
            (8.4, "8.4 turns"),
        ] {
            assert_eq!(turned((turns * TAU, turns * TAU)), text);
        }
        for (range, text) in
            [((8.0, 8.5), "8–8½ turns"), ((0.1, 0.111), "36–40°"), ((0.75, 1.5), "¾ turn–1½ turns")]
        {
            assert_eq!(turned((range.0 * TAU, range.1 * TAU)), text);
        }
    }

    #[test]
    fn names_of_digits_alone_are_parts() {
        for (names, text) in [
            (&["4"][..], "part 4"),
            (&["4", "12"], "parts 4 and 12"),
            (&["4", "nut 4", "m8"], "part 4, nut 4 and m8"),
            (&["nut 4"], "nut 4"),
            (&["-4"], "-4"),
        ] {
            assert_eq!(part_words(names, " and "), text);
        }
        let many: Vec<String> = (0..8).map(|i| i.to_string()).collect();
        assert_eq!(told_names(&many, " and "), "parts 0, 1, 2, 3, 4, 5 and 2 more");
    }

    #[test]
    fn bayonets_are_told_in_degrees() {
        let start = at([0.0; 3], [0.0; 3]);
        let turned = at([0.0; 3], [0.0, 0.0, PI / 4.0]);
        let text = told("disassembly", &[start, turned, at([0.0, 0.0, 9.0], [0.0, 0.0, PI / 4.0])]);
        assert_eq!(text, "Turn part 1 by 45° about +Z, then take it out along +Z (9 mm)");
    }

    #[test]
    fn long_ways_are_cut_short() {
        let corner = |i: usize| at([(i / 2) as f64 * 5.0, i.div_ceil(2) as f64 * 5.0, 0.0], [0.0; 3]);
        let path: Vec<_> = (0..=6).map(corner).collect();
        let text = told("disassembly", &path);
        assert_eq!(text, "Move part 1 along +Y (5 mm), go on in 4 moves, then take it out along +X (5 mm)");
        assert_eq!(told("assembly", &path), "Bring part 1 near in 5 moves, then put it in along +X (5 mm)");
    }

    #[test]
    fn how_a_part_is_brought_up_is_not_told() {
        let at = |x, y, z| at([x, y, z], [0.0; 3]);
        let waits = [at(90.0, 20.0, 0.0), at(90.0, 20.0, 40.0), at(5.0, 1.0, 30.0), at(5.0, 0.0, 30.0)];
        let slot = [at(5.0, 0.0, 8.0), at(0.0, 0.0, 8.0)];
        let path = [&waits[..], &slot[..]].concat();
        assert_eq!(
            told("assembly", &path),
            "Bring part 1 near, then move it along −Y (1 mm), then move it along −Z (22 mm), then put it in along −X (5 mm)"
        );
        assert_eq!(
            told("assembly", &[&waits[..3], &[at(5.0, 1.0, 0.0)]].concat()),
            "Bring part 1 near, then put it in along −Z (30 mm)"
        );
        assert_eq!(told("disassembly", &[waits[0], waits[1]]), "Take part 1 out along +Z (40 mm)");
    }

    #[test]
    fn lengths_have_three_digits() {
        let one = |value: f64, units| lengths((value, value), units);
        for (value, text) in
            [(14.0, "14 mm"), (13.456, "13.5 mm"), (0.02, "0.02 mm"), (1234.5, "1234 mm"), (0.0, "0 mm")]
        {
            assert_eq!(one(value, Some("mm")), text);
        }
        assert_eq!(one(100.0, None), "100 units");
        for (range, text) in
            [((12.0, 12.4), "12.0–12.4 mm"), ((12.001, 12.004), "12 mm"), ((980.0, 1020.0), "980–1020 mm")]
        {
            assert_eq!(lengths(range, Some("mm")), text);
        }
    }
}
