//! Assembly plans: a disassembly reversed, and every part's way from where it waits to where its insertion
//! begins (the paper's discussion: reverse the plan, link each part's start to it by RRT-Connect).
//!
//! Data flow: removals (from `search`) → where parts wait (`staging`) → all that stands and waits while one
//! part moves (`room`) → its way through that (`transfer`, by RRT-Connect) → [`Insertion`]s in order.
//!
//! A path in reverse passes the same places, so an insertion past what stands is as verified as the removal
//! was. The rest is verified here, with the same check and no penetration allowed: the way to the insertion
//! past all that stands and waits, and the insertion past all that waits. Groups, and the parts that are put together to
//! groups, wait nowhere: each begins where its insertion does; so do all parts where some are moved aside. Ways are found by random poses:
//! the same for the same question, but a way that is not found is no proof that there is none. No floor is
//! in the way of anything.

mod room;
mod staging;
#[cfg(test)]
mod tests;
mod transfer;

use nalgebra::{Translation3, Vector3};
use rayon::prelude::*;

use crate::geometry::{Bounds, Pose};
use crate::plan::{Verdict, Verifier};
use crate::scene::{Scene, StandingParts, exit_direction};
use crate::search::Removal;
use crate::termination::{Interrupt, Termination};

use room::Room;
use transfer::{MOST_SAMPLES, Transfer};

/// Insertions that are planned in parallel; they are reported in order.
const AT_ONCE: usize = 8;
/// How far a part is led away from where its insertion begins before it may go anywhere: this share of its
/// reach, or of this share of the longest side if that is more.
const RETREAT: f64 = 0.5;
const LEAST_RETREAT: f64 = 0.04;

/// Where parts begin, in the planning frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Waiting {
    /// Each where its insertion begins; it is not there before its turn.
    Nowhere,
    /// Beside the assembly, but for those whose pose (of their shape) is given.
    Beside(Vec<(usize, Pose)>),
}

/// A part put in, or several as one rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct Insertion {
    /// The parts, ascending.
    pub parts: Vec<usize>,
    /// Whether they stay aside among the others until a later insertion.
    pub aside: bool,
    /// The later insertion (its place in the order) that puts the group in to which they belong.
    pub of: Option<usize>,
    /// Poses of the part's shape, or of the body of all parts; the last one assembled; verified.
    pub path: Vec<Pose>,
    /// Largest depth beyond what is allowed that verification found.
    pub depth: f64,
    /// The insertions (their places in the order, ascending) that must come before, since this part, in place, would
    /// block them from where they begin. Ways to there are verified in this order alone.
    pub requires: Vec<usize>,
    /// The earliest round, from 0, in which it can be done, if all insertions are done as soon as they can be.
    pub wave: usize,
}

/// Why a part could not be put in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Hindrance {
    /// It waits in others.
    WaitsIn,
    /// Others wait where it is inserted.
    InsertionMeets,
    /// RRT-Connect found no path from where it waits to where its insertion begins, with this many random poses.
    NoWay(usize),
}

/// Why not all parts were put in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unfinished {
    /// One part could not be, and who hinders it, ascending, if that is known.
    Hindered(usize, Hindrance, Vec<usize>),
    /// The termination condition became true.
    Interrupted(Interrupt),
}

impl From<Interrupt> for Unfinished {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

/// A disassembly in reverse.
pub struct Assembling<'a> {
    removals: &'a [Removal],
    /// Parts that stand from the start.
    standing: Vec<usize>,
    /// Where the others wait; `None` if they are not there before their turn.
    waiting: Option<Vec<(usize, Pose)>>,
    room: Room,
    /// By insertion.
    orders: Vec<Order>,
    termination: &'a Termination,
}

/// An insertion: of which removal it is the reverse, which insertions it requires, and its wave.
#[derive(Debug, Clone, Default)]
struct Order {
    place: usize,
    requires: Vec<usize>,
    wave: usize,
}

/// The insertions that some removals become in reverse: what a removal requires to be out comes after it. A group is put
/// together right before it is put in.
fn reversed(removals: &[Removal]) -> Vec<Order> {
    let mut order = Vec::new();
    put_in(None, removals, &mut order);
    let mut orders: Vec<Order> = Vec::new();
    for &place in &order {
        let required = |(number, earlier): (usize, &usize)| {
            removals[*earlier].requires.contains(&place).then_some(number)
        };
        let requires: Vec<usize> = order[..orders.len()].iter().enumerate().filter_map(required).collect();
        let wave = requires.iter().map(|&i| orders[i].wave + 1).max().unwrap_or(0);
        orders.push(Order { place, requires, wave });
    }
    orders
}

/// Adds the removals out of the assembly or a group in reverse, behind those that put each one's group together.
fn put_in(of: Option<usize>, removals: &[Removal], order: &mut Vec<usize>) {
    for place in (0..removals.len()).rev().filter(|&place| removals[place].of == of) {
        put_in(Some(place), removals, order);
        order.push(place);
    }
}

impl<'a> Assembling<'a> {
    /// What puts the parts of some removals back to those that `remain`. A pose given for a part that
    /// does not move is of no use.
    #[must_use]
    pub fn new(
        scene: &Scene,
        verifier: &Verifier,
        removals: &'a [Removal],
        remain: &[usize],
        waiting: &Waiting,
        termination: &'a Termination,
    ) -> Self {
        let waiting = match waiting {
            Waiting::Nowhere => None,
            // Ways are looked for among parts in their places.
            Waiting::Beside(_) if removals.iter().any(|r| r.aside) => None,
            Waiting::Beside(given) => Some(waiting_beside(scene, removals, given)),
        };
        let room = Room::new(scene, verifier, waiting.as_deref().unwrap_or_default());
        let mut standing = remain.to_vec();
        standing.sort_unstable();
        Self { removals, standing, waiting, room, orders: reversed(removals), termination }
    }

    /// Where each part that will move begins, in the order in which they move.
    #[must_use]
    pub fn starts(&self) -> Vec<(usize, Pose)> {
        let mut starts: Vec<(usize, Pose)> = Vec::new();
        for &part in self.orders.iter().flat_map(|order| &self.removals[order.place].parts) {
            if starts.iter().all(|(known, _)| *known != part) {
                starts.push((part, self.start_of(part)));
            }
        }
        starts
    }

    /// Where a part waits, or else where its insertion begins: in a group, with the group where its own does.
    fn start_of(&self, part: usize) -> Pose {
        let given = self.waiting.iter().flatten().find(|(waits, _)| *waits == part);
        // The group that a part is in leaves before it is taken apart, as it stood then.
        let moves = self.removals.iter().filter(|r| r.parts.contains(&part));
        let end = || {
            let assembled = self.room.scene.bodies[part].planning_from_shape;
            let (of_groups, stands) = moves.fold((Pose::identity(), assembled), |(of_groups, stands), r| {
                if r.is_group() { (of_groups * r.motion(), stands) } else { (of_groups, r.motion() * stands) }
            });
            of_groups * stands
        };
        given.map_or_else(end, |(_, pose)| *pose)
    }

    /// Reports the insertions in order, as they are found.
    ///
    /// # Errors
    /// A part could not be put in; those reported before it are in place.
    pub fn run(&self, mut report: impl FnMut(Insertion)) -> Result<(), Unfinished> {
        // What is put together to a group is reported with the group.
        let mut within = Vec::new();
        for some in self.orders.chunks(AT_ONCE) {
            let found: Vec<_> = some.par_iter().map(|order| self.insertion(order)).collect();
            for insertion in found {
                let insertion = insertion?;
                if insertion.of.is_some() {
                    within.push(insertion);
                } else {
                    within.drain(..).for_each(&mut report);
                    report(insertion);
                }
            }
        }
        Ok(())
    }

    /// The reverse of a removal.
    fn insertion(&self, Order { place, requires, wave }: &Order) -> Result<Insertion, Unfinished> {
        let place = *place;
        let removal = &self.removals[place];
        let in_order: Vec<Pose> = removal.path.iter().rev().copied().collect();
        let (mut path, mut depth) = (in_order, removal.depth);
        if self.waiting.is_some()
            && let Some(part) = removal.alone()
        {
            let waits = self.removals[..place].iter().filter_map(Removal::alone);
            let mut waiting: Vec<usize> = waits.map(|part| self.room.waiting(part)).collect();
            waiting.sort_unstable();
            let past = self.room.check(&waiting, part, &path, self.termination)?;
            if !past.penetrations.is_empty() {
                return Err(self.hindered(part, Hindrance::InsertionMeets, &past));
            }
            let (way, to_there) = self.transfer(place, part, waiting)?;
            depth = depth.max(past.depth).max(to_there);
            path.splice(..1, way);
        }
        let Removal { parts, of, aside, .. } = removal.clone();
        let of = of.and_then(|group| self.orders.iter().position(|order| order.place == group));
        Ok(Insertion { parts, of, aside, path, depth, requires: requires.clone(), wave: *wave })
    }

    /// The way from where a part waits to where its insertion begins, and how deep it gets into anything.
    fn transfer(
        &self,
        place: usize,
        part: usize,
        waiting: Vec<usize>,
    ) -> Result<(Vec<Pose>, f64), Unfinished> {
        let removal = &self.removals[place];
        let mut among = self.standing.clone();
        let in_place = self.removals[place + 1..].iter().filter(|r| r.of.is_none());
        among.extend(in_place.flat_map(|r| &r.parts));
        among.sort_unstable();
        among.extend(waiting);
        let ends = [self.start_of(part), removal.path.last().copied().unwrap_or_default()];
        let at_start = self.room.check(&among, part, &ends[..1], self.termination)?;
        if !at_start.penetrations.is_empty() {
            return Err(self.hindered(part, Hindrance::WaitsIn, &at_start));
        }
        let away = self.away(removal, part, &among);
        // Away from all that it touches first, as far as that is free: the way there is easier to find.
        let [start, goal] = ends;
        let retreat =
            RETREAT * self.room.metric(part).reach.max(LEAST_RETREAT * self.room.scene.longest_side);
        let clear = Translation3::from(away * retreat) * goal;
        let last = self.room.check(&among, part, &[clear, goal], self.termination)?;
        let (goal, last) =
            if last.penetrations.is_empty() { (clear, Some(last.depth)) } else { (goal, None) };
        let found = Transfer::new(&self.room, &among, part, [start, goal], away, self.termination).path()?;
        let (mut way, depth) =
            found.ok_or_else(|| Unfinished::Hindered(part, Hindrance::NoWay(MOST_SAMPLES), Vec::new()))?;
        way.extend(last.map(|_| ends[1]));
        Ok((way, depth.max(last.unwrap_or(0.0))))
    }

    /// Where a removal leads at its end, a unit vector: if it leads nowhere, away from what stands.
    fn away(&self, removal: &Removal, part: usize, among: &[usize]) -> Vector3<f64> {
        if let [.., from, to] = &removal.path[..]
            && let Some(direction) =
                (to.translation.vector - from.translation.vector).try_normalize(f64::MIN_POSITIVE)
        {
            return direction;
        }
        let stands = |number: &usize| self.room.part(*number) == *number;
        let standing = among.iter().copied().filter(stands).collect();
        let around = StandingParts::new(&self.room.scene, standing);
        let pose = removal.path.last().copied().unwrap_or_default();
        let out = exit_direction(&self.room.scene, &around, part, &pose, None);
        // It tells where the others lie.
        out.map_or_else(Vector3::z, |direction| -direction)
    }

    fn hindered(&self, part: usize, what: Hindrance, verdict: &Verdict) -> Unfinished {
        let mut by: Vec<usize> = verdict.penetrations.iter().map(|e| self.room.part(e.other)).collect();
        by.sort_unstable();
        by.dedup();
        Unfinished::Hindered(part, what, by)
    }
}

/// Where parts wait: those given where they are given, the others laid out beside these and all that any
/// insertion passes.
fn waiting_beside(scene: &Scene, removals: &[Removal], given: &[(usize, Pose)]) -> Vec<(usize, Pose)> {
    let moves = |part: &usize| removals.iter().any(|r| r.alone() == Some(*part));
    let mut waiting: Vec<_> = given.iter().filter(|(part, _)| moves(part)).copied().collect();
    let others: Vec<usize> = removals.iter().rev().filter_map(Removal::alone).collect();
    let others: Vec<usize> = others.into_iter().filter(|p| given.iter().all(|(g, _)| g != p)).collect();
    let placed = waiting.iter().map(|(part, pose)| scene.bodies[*part].shape.bounds().transformed(pose));
    let assembled = scene.bodies.iter().map(|body| body.bounds);
    let inserted = removals.iter().flat_map(|r| {
        let bounds = |&part: &usize| {
            let body_from_part = r.path[0].inverse() * scene.bodies[part].planning_from_shape;
            let path: Vec<Pose> = r.path.iter().map(|pose| pose * body_from_part).collect();
            scene.swept_bounds(part, &path)
        };
        r.parts.iter().map(bounds).collect::<Vec<Bounds>>()
    });
    let occupied = placed.chain(assembled).chain(inserted).fold(Bounds::EMPTY, |all, b| all.union(&b));
    waiting.extend(staging::laid_out(scene, &others, &occupied));
    waiting
}
