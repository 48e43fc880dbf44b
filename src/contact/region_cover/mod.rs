//! Region covers: a surface in pieces, each in a convex region that another surface does not enter.

pub(crate) mod cell;
pub(crate) mod cells;
pub(crate) mod depth;
pub(crate) mod facing;
pub(crate) mod finder;
pub(crate) mod holds;
mod kept;

use crate::termination::Interrupt;

pub use kept::KeptCells;

/// Why no answer can be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Halt {
    /// The termination condition became true.
    Interrupted(Interrupt),
    /// A piece is in no region, deeper than granted, or the surfaces are too complicated.
    Lost,
    /// Something is in the way of what was wished.
    Blocked,
}

impl From<Interrupt> for Halt {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}
