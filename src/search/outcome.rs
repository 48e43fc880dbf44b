//! The result of a search, in the planning frame.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geometry::Pose;
use crate::plan::{Base, FreeGroup, PlanStatus};

/// The most parts that a reason names as those that remain.
const NAMED_PARTS: usize = 4;

/// A part taken out, or several that move as one rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Removal {
    /// The parts, ascending.
    pub parts: Vec<usize>,
    /// The removal (its place in the order) that took the group out to which they belong; `None` where they leave the
    /// assembly. A group is taken apart as it stood there.
    pub of: Option<usize>,
    /// Whether they are only moved aside, and stay among the others.
    pub aside: bool,
    /// Poses of the part's shape, or of the body of all parts; as they stand before comes first; thinned and verified.
    pub path: Vec<Pose>,
    /// Largest depth beyond the pairs' allowed penetrations that verification found, past all parts but those that it
    /// requires to be out.
    pub depth: f64,
    /// The removals (their places in the order, ascending) whose parts this path would enter, assembled; and the one that
    /// took their group out.
    pub requires: Vec<usize>,
    /// The earliest round, from 0, in which it can be done, if all removals are done as soon as they can be.
    pub wave: usize,
}

impl Removal {
    /// The part, if it leaves the assembly alone.
    #[must_use]
    pub fn alone(&self) -> Option<usize> {
        match self.parts[..] {
            [part] if self.of.is_none() && !self.aside => Some(part),
            _ => None,
        }
    }

    /// Whether several parts leave together.
    #[must_use]
    pub fn is_group(&self) -> bool {
        self.parts.len() > 1 && !self.aside
    }

    /// The rigid motion from the beginning of the path to its end.
    #[must_use]
    pub fn motion(&self) -> Pose {
        let ends = self.path.first().zip(self.path.last());
        ends.map_or_else(Pose::identity, |(assembled, end)| end * assembled.inverse())
    }
}

/// An action of a part that remains, and the parts that block it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockedAction {
    /// The part.
    pub part: usize,
    /// The action's name.
    pub action: String,
    /// The parts in its way, ascending.
    pub by: Vec<usize>,
}

/// What proves that two parts never come apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SeparationProof {
    /// Closed curves on them are linked.
    Linked,
    /// A ball inside the first one fits through no opening of the second one.
    Ball,
    /// The first one is in a closed void of the second one.
    Void,
    /// The first one is wider than an opening of the second one on both sides of it.
    Neck,
}

/// Two parts that never come apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inseparable {
    /// The two.
    pub parts: [usize; 2],
    /// What proves it.
    pub proof: SeparationProof,
}

/// A part that comes nearer to another on its way than is wanted. Lengths are in the planning frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NearPass {
    /// The part that moves.
    pub part: usize,
    /// The part that it passes.
    pub other: usize,
    /// How near they come.
    pub distance: f64,
    /// How far they should be apart.
    pub kept: f64,
}

impl NearPass {
    /// How much of the distance is there.
    fn share(&self) -> f64 {
        self.distance / self.kept
    }

    /// The one of some passes that is the furthest from what is wanted.
    pub(super) fn worst(passes: impl IntoIterator<Item = Self>) -> Option<Self> {
        passes.into_iter().min_by(|a, b| a.share().total_cmp(&b.share()))
    }

    /// Of the nearest passes of some ways of some parts, the one that is the closest to what is wanted.
    pub(super) fn best(passes: impl IntoIterator<Item = Self>) -> Option<Self> {
        passes.into_iter().max_by(|a, b| a.share().total_cmp(&b.share()))
    }
}

/// Why a search is not complete.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A limit ended it, in words.
    Limit(String),
    /// It is proved that these never come apart.
    Inseparable(Inseparable),
    /// Nothing more was found, and nothing was proved.
    Exhausted,
    /// The same; and a way out was refused because it comes too near to another part.
    TooNear(NearPass),
}

impl Reason {
    /// At most two sentences about it, given which parts remain and the parts' names.
    #[must_use]
    pub fn text(&self, remaining: &[usize], name: impl Fn(usize) -> String) -> String {
        let Inseparable { parts: [a, b], proof } = match self {
            Self::Limit(words) => return words.clone(),
            Self::Exhausted => {
                return format!(
                    "{}. The search found no further motion that takes one of them out, and no proof that there is \
                     none.",
                    remain(remaining, &name)
                );
            }
            Self::TooNear(near) => {
                return format!(
                    "{}. On the widest way out of {} that was found, it keeps {:.0} % of the wanted distance from {}.",
                    remain(remaining, &name),
                    name(near.part),
                    near.share() * 100.0,
                    name(near.other)
                );
            }
            Self::Inseparable(pair) => *pair,
        };
        let (remain, a, b) = (remain(remaining, &name), name(a), name(b));
        let because = match proof {
            SeparationProof::Linked => "closed curves on the two are linked".to_owned(),
            SeparationProof::Ball => format!("a ball inside {a} fits through no opening of {b}"),
            SeparationProof::Neck => {
                format!(
                    "{a} passes an opening of {b}, and on both sides of it there is a disc inside {a} that is wider"
                )
            }
            SeparationProof::Void => format!("{a} is in a closed void of {b}"),
        };
        format!("{remain}. It is proved that {a} and {b} never come apart: {because}.")
    }
}

/// Which parts remain: their names, or their number if they are many.
fn remain(remaining: &[usize], name: impl Fn(usize) -> String) -> String {
    match remaining {
        [all @ .., last] if !all.is_empty() && remaining.len() <= NAMED_PARTS => {
            let all: Vec<String> = all.iter().map(|&part| name(part)).collect();
            format!("Parts {} and {} remain", all.join(", "), name(*last))
        }
        _ => format!("{} parts remain", remaining.len()),
    }
}

/// Counts and times of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Transition functions used; of RRT, the steps of its trees.
    pub simulations: u64,
    /// Of them, those whose motion was remembered.
    pub recalled: u64,
    /// Removals that a straight sweep showed, without simulation.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// States whose blocking graphs were answered from memory.
    #[serde(skip)]
    pub graphs_recalled: u64,
    /// Time in static analysis.
    #[serde(skip)]
    pub static_analysis: Duration,
    /// Time in sweeps, and in the simulations that were used.
    #[serde(skip)]
    pub simulation: Duration,
    /// Time in thinning and verification.
    #[serde(skip)]
    pub verification: Duration,
}

impl Counters {
    /// Adds those of another search for the same request.
    pub(super) fn add(&mut self, other: &Self) {
        self.simulations += other.simulations;
        self.recalled += other.recalled;
        self.sweeps += other.sweeps;
        self.states += other.states;
        self.graphs_recalled += other.graphs_recalled;
        self.static_analysis += other.static_analysis;
        self.simulation += other.simulation;
        self.verification += other.verification;
    }
}

/// How a search ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its status.
    pub status: PlanStatus,
    /// Why it is not complete.
    pub reason: Option<Reason>,
    /// Removals in order.
    pub removals: Vec<Removal>,
    /// The parts that the rest was taken off, and that did not leave.
    pub base: Base,
    /// Parts that remain in the assembly, ascending.
    pub remaining: Vec<usize>,
    /// The parts that stand together where the search ended before it was done: those that remain, or those of a group.
    pub unfinished: Vec<usize>,
    /// The blocked actions of the parts that should have come out: a few of each part.
    pub blocked: Vec<BlockedAction>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<FreeGroup>,
    /// Counts and times.
    pub counters: Counters,
}

impl Outcome {
    /// The groups that left and were not taken apart, or not to the last part.
    #[must_use]
    pub fn kept_together(&self) -> Vec<Vec<usize>> {
        let rest = |(group, removal): (usize, &Removal)| {
            let inner = self.removals.iter().filter(|r| r.of == Some(group) && !r.aside);
            let gone: Vec<usize> = inner.flat_map(|r| r.parts.iter().copied()).collect();
            removal.parts.iter().copied().filter(|part| !gone.contains(part)).collect::<Vec<usize>>()
        };
        let groups = self.removals.iter().enumerate().filter(|(_, removal)| removal.is_group()).map(rest);
        groups.filter(|rest| rest.len() > 1).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_name_parts_and_say_what_was_proved() {
        let name = |part: usize| ["base", "ring", "ball", "pin", "lid"][part].to_owned();
        let text = |reason: Reason, remaining: &[usize]| reason.text(remaining, name);
        assert_eq!(
            text(Reason::Inseparable(Inseparable { parts: [2, 0], proof: SeparationProof::Ball }), &[0, 2]),
            "Parts base and ball remain. It is proved that ball and base never come apart: a ball inside ball fits through \
             no opening of base."
        );
        let linked = Inseparable { parts: [0, 1], proof: SeparationProof::Linked };
        assert!(
            text(Reason::Inseparable(linked), &[0, 1, 2, 3])
                .starts_with("Parts base, ring, ball and pin remain. ")
        );
        let exhausted = text(Reason::Exhausted, &[0, 1, 2, 3, 4]);
        assert!(exhausted.starts_with("5 parts remain. The search found no further motion"), "{exhausted}");
        assert_eq!(text(Reason::Limit("cancelled".into()), &[0, 1]), "cancelled");
    }
}
