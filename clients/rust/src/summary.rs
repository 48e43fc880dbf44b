//! The summary that ends a plan.

use sbdp_ipc::bytes::Malformed;
use sbdp_ipc::plan::Waypoint;
use sbdp_ipc::summary::report::Report;
use sbdp_ipc::summary::{STATUSES, Stats, SummaryView};

/// How planning ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanStatus {
    /// Every requested part is out.
    Complete,
    /// A budget was spent; the steps are the best so far.
    Partial,
    /// It is proved that some parts cannot come off.
    Infeasible,
    /// The deadline passed.
    Timeout,
    /// The request was cancelled.
    Cancelled,
    /// The search found nothing more to try, and nothing was proved.
    Exhausted,
}

impl PlanStatus {
    const ALL: [Self; 6] =
        [Self::Complete, Self::Partial, Self::Infeasible, Self::Timeout, Self::Cancelled, Self::Exhausted];

    /// Its name, as in the JSON contract.
    #[must_use]
    pub fn name(self) -> &'static str {
        STATUSES[self as usize]
    }
}

/// The base: the parts that stay, and that the rest is taken off.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Base {
    /// The parts.
    pub parts: Vec<u32>,
    /// Why they were chosen, in a few words; `None` where the request named them.
    pub reason: Option<String>,
}

/// Why a part that remains did not move.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Blocked {
    /// The part.
    pub part: u32,
    /// The parts that block it.
    pub by: Vec<u32>,
    /// The action, as `+x`.
    pub action: String,
}

/// Parts that can begin to move together where nothing leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeGroup {
    /// The parts.
    pub parts: Vec<u32>,
    /// The unit vector along which they begin, in the input's frame.
    pub direction: [f64; 3],
}

/// A pair that overlaps at the assembled pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The two parts, smaller number first.
    pub parts: [u32; 2],
    /// How deep, in the input's units.
    pub depth: f64,
}

/// A finding about the input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The part that it is about, if any.
    pub part: Option<u32>,
    /// What was found, and what was done about it.
    pub message: String,
}

/// Everything about a plan except its steps. Part numbers are indices into `parts`.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Whether it is an assembly plan.
    pub assembly: bool,
    /// How planning ended.
    pub status: PlanStatus,
    /// Why it is not complete.
    pub reason: Option<String>,
    /// The planner's name.
    pub planner: String,
    /// The engine's name.
    pub engine: String,
    /// The unit of length.
    pub units: Option<String>,
    /// How many steps there were.
    pub steps: u32,
    /// Part names.
    pub parts: Vec<String>,
    /// Parts that had been removed before.
    pub removed: Vec<u32>,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<u32>>,
    /// Parts that may not move.
    pub fixed: Vec<u32>,
    /// Parts that were to stay unless others could not leave otherwise.
    pub keep: Vec<u32>,
    /// The parts that the rest is taken off, or built up on. Empty where parts are fixed and no base was named, or
    /// where all others had to leave too.
    pub base: Base,
    /// Parts that are in the assembly at the end (in an assembly plan: from the start).
    pub remaining: Vec<u32>,
    /// Groups that left together and were not taken apart: this was not required, or no way was found.
    pub kept_together: Vec<Vec<u32>>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<FreeGroup>,
    /// Parts that did not begin where their mesh was given, and where they began: the rigid motion of the mesh. Parts
    /// of an assembly plan that wait are among them.
    pub poses: Vec<(u32, Waypoint)>,
    /// What blocks the parts that should have come off.
    pub blocked: Vec<Blocked>,
    /// Overlaps at the assembled pose.
    pub overlaps: Vec<Overlap>,
    /// Findings about the input.
    pub warnings: Vec<Warning>,
    /// What the plan means where it is carried out, if the request asked for it.
    pub report: Option<Report>,
    /// Counters and times.
    pub stats: Stats,
}

impl Summary {
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let view = SummaryView::new(bytes)?;
        let owned = |text: &str| text.to_owned();
        let status = PlanStatus::ALL.into_iter().find(|s| s.name() == view.status());
        Ok(Self {
            assembly: view.is_assembly(),
            status: status.unwrap_or(PlanStatus::Partial),
            reason: view.reason().map(owned),
            planner: view.planner().to_owned(),
            engine: view.engine().to_owned(),
            units: view.units().map(owned),
            steps: view.steps(),
            parts: view.part_names().map(owned).collect(),
            removed: view.removed().to_vec(),
            targets: view.targets().map(<[u32]>::to_vec),
            fixed: view.fixed().to_vec(),
            keep: view.keep().to_vec(),
            base: Base { parts: view.base().to_vec(), reason: view.base_reason().map(owned) },
            remaining: view.remaining().to_vec(),
            kept_together: view.kept_together().map(<[u32]>::to_vec).collect(),
            free_together: view.free_together().map(free_group).collect(),
            poses: view.poses().iter().map(|p| (p.part, p.motion)).collect(),
            blocked: view.blocked().map(blocked).collect(),
            overlaps: view.overlaps().iter().map(|o| Overlap { parts: o.parts, depth: o.depth }).collect(),
            warnings: view.warnings().map(|(part, m)| Warning { part, message: m.to_owned() }).collect(),
            report: view.report().to_report(),
            stats: view.stats(),
        })
    }

    /// A part's name.
    #[must_use]
    pub fn part_name(&self, part: u32) -> &str {
        self.parts.get(part as usize).map_or("?", String::as_str)
    }
}

fn free_group(group: sbdp_ipc::summary::FreeGroup<'_>) -> FreeGroup {
    FreeGroup { parts: group.parts.to_vec(), direction: group.direction }
}

fn blocked(b: sbdp_ipc::summary::Blocked<'_>) -> Blocked {
    Blocked { part: b.part, by: b.by.to_vec(), action: b.action.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sbdp_ipc::bytes::AlignedBytes;
    use sbdp_ipc::summary::SummaryParts;

    #[test]
    fn groups_come_as_they_were_sent() {
        let sent = SummaryParts {
            parts: vec!["a", "b", "c"],
            kept_together: vec![vec![0, 1], vec![1, 2]],
            free_together: vec![(vec![0, 2], [0.0, 0.0, -1.0])],
            ..SummaryParts::default()
        };
        let summary = Summary::decode(AlignedBytes::copy_of(&sent.encode()).as_slice()).unwrap();
        assert_eq!(summary.kept_together, sent.kept_together);
        let group = FreeGroup { parts: vec![0, 2], direction: [0.0, 0.0, -1.0] };
        assert_eq!(summary.free_together, [group]);
    }
}
