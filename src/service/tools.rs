//! Which tools turn the fasteners that a plan takes off.

use nalgebra::{Unit, Vector3};
use rayon::prelude::*;

use crate::fasteners::Drive;
use crate::geometry::{Assembly, Pose, scaled_pose};
use crate::termination::{Interrupt, Termination};
use crate::tools::{SurroundingPart, ToolRoom, tool_rooms};

use super::clearance::PassingStep;
use super::statics::fasteners;

/// A fastener that a step takes off, and the tools for it.
#[derive(Debug, Clone, PartialEq)]
pub struct FastenerTools {
    /// The number of the part.
    pub part: usize,
    /// What turns it.
    pub drive: Drive,
    /// The size of its tools: the width across its flats, in the input's units.
    pub across_flats: f64,
    /// The tools that fit, each with the room that it has while the others stand.
    pub rooms: Vec<ToolRoom>,
}

/// For each of some steps the fastener that it moves by itself, if it does, with its tools.
pub(super) fn answer(
    assembly: &Assembly,
    steps: &[PassingStep],
    termination: &Termination,
) -> Result<Vec<Option<FastenerTools>>, Interrupt> {
    let fasteners = fasteners(assembly);
    let tools = |step: &PassingStep| {
        let [(part, motion)] = step.moving[..] else { return Ok(None) };
        let Some(fastener) = &fasteners[assembly.parts[part].shape] else { return Ok(None) };
        let Some(outward) = outward(step) else { return Ok(None) };
        let placed = |part: usize, motion| {
            scaled_pose(motion, assembly.scale) * assembly.parts[part].planning_from_shape
        };
        let obstacles: Vec<SurroundingPart<'_>> = step
            .standing
            .iter()
            .map(|(part, motion)| SurroundingPart {
                part: *part,
                shape: assembly.shape(*part),
                pose: placed(*part, motion),
            })
            .collect();
        let rooms = tool_rooms(fastener, &placed(part, &motion), &outward, &obstacles, termination)?;
        let across_flats = fastener.across_flats / assembly.scale;
        Ok(Some(FastenerTools { part, drive: fastener.drive, across_flats, rooms }))
    };
    steps.par_iter().map(tools).collect()
}

/// The direction in which a step's parts leave: from where they stand to the far end of the path.
fn outward(step: &PassingStep) -> Option<Unit<Vector3<f64>>> {
    let shift = |pose: &Pose| pose.translation.vector;
    let far = step.path.iter().map(shift).max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    Unit::try_new(far, 0.0)
}
