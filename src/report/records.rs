//! The answers of the service as the plan's contract has them. Parts go by their numbers, angles are in degrees.

use sbdp_ipc::summary::report::{Clearance, Closest, Fastener, Stability, TOOLS, Tool, Unstable};

use crate::service::{FastenerTools, PartClearance, StepClearance};
use crate::statics;
use crate::tools::ToolRoom;

fn numbers(parts: &[usize]) -> Vec<u32> {
    parts.iter().map(|&part| part as u32).collect()
}

/// How the parts of a state stand.
#[must_use]
pub fn stability_record(found: &statics::Stability) -> Stability {
    let unstable = |unstable: &statics::Unstable| Unstable {
        falls: unstable.falls.iter().map(|fall| (fall.part as u32, fall.direction)).collect(),
        hold: unstable.hold.iter().map(|set| numbers(set)).collect(),
        needs_clamping: unstable.needs_clamping,
    };
    Stability {
        needs_friction: found.needs_friction,
        unstable: found.unstable.iter().map(unstable).collect(),
        unknown: numbers(&found.unknown),
    }
}

/// How near a step passes other parts.
#[must_use]
pub fn clearance_record(found: &StepClearance) -> Clearance {
    Clearance { touching: numbers(&found.touching), closest: found.closest.as_ref().map(closest_record) }
}

/// How near one part passes another.
#[must_use]
pub fn closest_record(found: &PartClearance) -> Closest {
    Closest {
        moving: found.moving as u32,
        standing: found.standing as u32,
        distance: found.distance,
        at_least: found.at_least,
        assembled: found.assembled,
        segment: found.segment as u32,
        share: found.share,
        points: found.points.map(|points| points.map(|point| point.coords.into())),
    }
}

/// The tools that turn a fastener.
#[must_use]
pub fn fastener_record(found: &FastenerTools) -> Fastener {
    let tool = |room: &ToolRoom| Tool {
        tool: TOOLS.iter().position(|name| *name == room.kind.name()).map_or(u32::MAX, |index| index as u32),
        swing: room.swing.to_degrees(),
        needs: room.kind.least_swing().to_degrees(),
        fits: room.is_enough(),
        blocked_by: numbers(&room.blocked_by),
    };
    Fastener { size: found.across_flats, tools: found.rooms.iter().map(tool).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::ToolKind;

    /// The wire has the index of the name.
    #[test]
    fn each_tool_has_a_number() {
        let kinds = [ToolKind::Socket, ToolKind::RingSpanner, ToolKind::OpenEndWrench, ToolKind::HexKey];
        assert_eq!(kinds.map(ToolKind::name), TOOLS);
    }
}
