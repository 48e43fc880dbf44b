//! Tools: which socket, wrench or key turns a fastener where it stands, and how far it can swing.
//!
//! Data flow: a [`Fastener`] and what stands around it → `shapes` (a tool on its hexagon) →
//! [`tool_rooms`]: the handle is swept around in arcs, each of which is free if nothing comes near
//! ([`closest_approach`]); then the tool has to get there.

mod shapes;

use std::f64::consts::TAU;

use nalgebra::{Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::contact::{PassedPair, closest_approach};
use crate::fasteners::{Drive, Fastener};
use crate::geometry::{Pose, Shape};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::TOOL_GAP;

use shapes::Tool;
pub use shapes::ToolKind;

/// Arcs around a fastener that are tested as wholes: 5° each, a sixth of what a wrench has to swing by. At half, a run is
/// found only where it has a whole arc of 10°; at double, it takes twice as long.
const ARCS: usize = 72;
/// Pieces of the arcs at the ends of what is free: 0.5° each. At half, swings are too small by up to 2° and not 1°; at
/// double, nobody sees the difference.
const ARC_PIECES: usize = 10;

/// A part that stands around a fastener.
#[derive(Debug, Clone, Copy)]
pub struct SurroundingPart<'a> {
    /// The number of the part.
    pub part: usize,
    /// Its shape.
    pub shape: &'a Shape,
    /// Where it stands, in the planning frame.
    pub pose: Pose,
}

/// The room that a tool has.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolRoom {
    /// The tool.
    pub kind: ToolKind,
    /// The largest angle in radians by which it can swing at one go, to within a degree; 0 if it does not get to the
    /// hexagon, a whole turn if nothing stops it.
    pub swing: f64,
    /// The parts that end the swing, or keep the tool away, ascending.
    pub blocked_by: Vec<usize>,
}

impl ToolRoom {
    /// Whether the tool can turn the fastener on and on.
    #[must_use]
    pub fn is_enough(&self) -> bool {
        self.swing > 0.0 && self.swing >= self.kind.least_swing()
    }
}

/// The room of each tool that fits a fastener, which stands at a pose (shape frame to planning frame) and leaves along
/// `outward` (a unit vector of the planning frame).
///
/// # Errors
/// The termination condition became true.
pub fn tool_rooms(
    fastener: &Fastener,
    pose: &Pose,
    outward: &Unit<Vector3<f64>>,
    obstacles: &[SurroundingPart<'_>],
    termination: &Termination,
) -> Result<Vec<ToolRoom>, Interrupt> {
    let kinds: &[ToolKind] = match fastener.drive {
        Drive::Hexagon => &[ToolKind::Socket, ToolKind::RingSpanner, ToolKind::OpenEndWrench],
        Drive::HexagonSocket => &[ToolKind::HexKey],
    };
    let line = pose.rotation * *fastener.line.direction;
    let sign = if line.dot(outward) < 0.0 { -1.0 } else { 1.0 };
    let [from, to] = fastener.flats;
    let end = if sign > 0.0 { to } else { from };
    let outer = pose * (fastener.line.point + *fastener.line.direction * end);
    let turned = UnitQuaternion::rotation_between(&Vector3::z(), &(line * sign));
    let turned = turned.unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), TAU / 2.0));
    let planning_from_tool = Pose::from_parts(Translation3::from(outer.coords), turned);
    let room = |&kind: &ToolKind| {
        let tool = Tool::new(kind, fastener.across_flats, to - from, termination)?;
        let gap = TOOL_GAP * fastener.across_flats;
        PlacedTool { tool: &tool, planning_from_tool, gap, obstacles, termination }.room()
    };
    kinds.iter().map(room).collect()
}

/// A tool on its hexagon, among parts.
struct PlacedTool<'a> {
    tool: &'a Tool,
    planning_from_tool: Pose,
    gap: f64,
    obstacles: &'a [SurroundingPart<'a>],
    termination: &'a Termination,
}

impl PlacedTool<'_> {
    fn room(&self) -> Result<ToolRoom, Interrupt> {
        let kind = self.tool.kind;
        if kind == ToolKind::Socket {
            let blocker = self.blocker_of_approach(0.0)?;
            let swing = if blocker.is_none() { TAU } else { 0.0 };
            return Ok(ToolRoom { kind, swing, blocked_by: blocker.into_iter().collect() });
        }
        let step = TAU / ARCS as f64;
        let around: Vec<Pose> =
            (0..=4).map(|k| self.pose(f64::from(k) * TAU / 4.0, &Vector3::zeros())).collect();
        let mut near = Vec::new();
        for obstacle in self.obstacles {
            if self.is_in_the_way(obstacle, &around)? {
                near.push(*obstacle);
            }
        }
        let swung = PlacedTool { obstacles: &near, ..*self };
        let arc = |i: usize| swung.blocker_of_arc([i as f64 * step, (i + 1) as f64 * step]);
        let arcs = (0..ARCS).map(arc).collect::<Result<Vec<_>, _>>()?;
        let Some((first, count)) = longest_free(&arcs) else {
            return Ok(ToolRoom { kind, swing: 0.0, blocked_by: sorted(arcs.into_iter().flatten()) });
        };
        // The middle first: there is the most room on both sides.
        let mut places: Vec<usize> = (0..=count).collect();
        places.sort_by_key(|place| place.abs_diff(count / 2));
        let mut in_the_way = Vec::new();
        for place in places {
            match self.blocker_of_approach((first + place) as f64 * step)? {
                Some(blocker) => in_the_way.push(blocker),
                None => {
                    in_the_way.clear();
                    break;
                }
            }
        }
        if !in_the_way.is_empty() {
            return Ok(ToolRoom { kind, swing: 0.0, blocked_by: sorted(in_the_way) });
        }
        if count == ARCS {
            return Ok(ToolRoom { kind, swing: TAU, blocked_by: Vec::new() });
        }
        let piece = step / ARC_PIECES as f64;
        let (begin, end) = (first as f64 * step, (first + count) as f64 * step);
        let before = swung.free_pieces(|i| [begin - (i + 1) as f64 * piece, begin - i as f64 * piece])?;
        let after = swung.free_pieces(|i| [end + i as f64 * piece, end + (i + 1) as f64 * piece])?;
        let swing = count as f64 * step + (before + after) as f64 * piece;
        let ends = [arcs[(first + ARCS - 1) % ARCS], arcs[(first + count) % ARCS]];
        Ok(ToolRoom { kind, swing, blocked_by: sorted(ends.into_iter().flatten()) })
    }

    /// How many pieces of an arc are free, from its free end on.
    fn free_pieces(&self, piece: impl Fn(usize) -> [f64; 2]) -> Result<usize, Interrupt> {
        for i in 0..ARC_PIECES {
            if self.blocker_of_arc(piece(i))?.is_some() {
                return Ok(i);
            }
        }
        Ok(ARC_PIECES)
    }

    /// What is in the way of the tool on an arc between two angles.
    fn blocker_of_arc(&self, angles: [f64; 2]) -> Result<Option<usize>, Interrupt> {
        self.blocker(&angles.map(|angle| self.pose(angle, &Vector3::zeros())))
    }

    /// What is in the way to the hexagon, with the handle at an angle.
    fn blocker_of_approach(&self, angle: f64) -> Result<Option<usize>, Interrupt> {
        self.blocker(&[self.tool.approach, Vector3::zeros()].map(|shift| self.pose(angle, &shift)))
    }

    fn pose(&self, angle: f64, shift: &Vector3<f64>) -> Pose {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        self.planning_from_tool * turned * Translation3::from(*shift)
    }

    fn blocker(&self, path: &[Pose]) -> Result<Option<usize>, Interrupt> {
        for obstacle in self.obstacles {
            if self.is_in_the_way(obstacle, path)? {
                return Ok(Some(obstacle.part));
            }
        }
        Ok(None)
    }

    /// Whether the tool comes too near to a part on a path of its frame.
    fn is_in_the_way(&self, obstacle: &SurroundingPart<'_>, path: &[Pose]) -> Result<bool, Interrupt> {
        let into = obstacle.pose.inverse();
        let path: Vec<Pose> = path.iter().map(|pose| into * pose).collect();
        let bounds = obstacle.shape.bounds();
        let apart =
            |pose: &Pose| bounds.distance(&pose.translation.vector.into()) - self.tool.reach - self.gap;
        // The origin moves on lines, and no point of one is further from its nearer end than it is long.
        let shift = |ends: &[Pose]| (ends[1].translation.vector - ends[0].translation.vector).norm();
        let length = path.windows(2).map(shift).fold(0.0, f64::max);
        if path.iter().all(|pose| apart(pose) > length) {
            return Ok(false);
        }
        let shapes = [&self.tool.shape, obstacle.shape];
        let pair = PassedPair { shapes, path, centre: Point3::origin() };
        Ok(closest_approach(&[pair], self.gap, self.termination)?.is_some())
    }
}

/// The first and the count of the longest run of free arcs around a circle.
fn longest_free(arcs: &[Option<usize>]) -> Option<(usize, usize)> {
    let n = arcs.len();
    if arcs.iter().all(Option::is_none) {
        return Some((0, n));
    }
    let run = |first: usize| (0..n).take_while(|i| arcs[(first + i) % n].is_none()).count();
    let runs = (0..n).map(|first| (first, run(first))).filter(|(_, count)| *count > 0);
    runs.max_by_key(|&(first, count)| (count, std::cmp::Reverse(first)))
}

fn sorted(parts: impl IntoIterator<Item = usize>) -> Vec<usize> {
    parts.into_iter().collect::<std::collections::BTreeSet<_>>().into_iter().collect()
}

#[cfg(test)]
mod tests;
