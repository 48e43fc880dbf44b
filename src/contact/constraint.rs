//! Linear constraints on the motion of a body.

use nalgebra::Vector6;

/// One constraint a·w ≥ −b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VelocityConstraint {
    pub(crate) a: Vector6<f64>,
    pub(crate) b: f64,
    /// The part that the constraint comes from.
    pub(crate) other: usize,
}
