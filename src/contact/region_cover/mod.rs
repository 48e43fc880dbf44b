//! Region covers: a surface in pieces, each in a convex region that another surface does not enter.
//!
//! A piece whose corners are in its region is outside the other solid, whole: a few planes say for all of its points
//! what samples say for each one. Where no region holds a piece, it is split ([`cover`]), down to bits of triangles.
//! The pieces of a surface ([`surface_pair`]) and the regions ([`FreeRegion`](crate::geometry::FreeRegion)) are the same
//! for all three models of motion:
//!
//! | model | motion of the surface | bound |
//! |---|---|---|
//! | [`shift`] | translations of any length | how far each piece may be shifted (linear in the shift) |
//! | [`rigid`] | from pose to pose, turns included | which pieces have left their regions, and the contacts there |
//! | [`path`] | a whole path, between its poses too | the depth on the way |

pub(crate) mod path;
pub(crate) mod pieces;
pub(crate) mod rigid;
pub(crate) mod shift;
pub(crate) mod surface_pair;

use crate::termination::Interrupt;

pub use shift::ShiftCoverCache;

/// Covers pieces, the last one first: `attempt` covers the piece it is given, or pushes the parts to cover instead, the
/// next one last.
pub(crate) fn cover<P, E>(
    pieces: Vec<P>,
    mut attempt: impl FnMut(P, &mut Vec<P>) -> Result<(), E>,
) -> Result<(), E> {
    let mut rest = pieces;
    while let Some(next) = rest.pop() {
        attempt(next, &mut rest)?;
    }
    Ok(())
}

/// Why no answer can be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Halt {
    /// The termination condition became true.
    Interrupted(Interrupt),
    /// A piece is in no region, deeper than allowed, or the surfaces are too complicated.
    Lost,
    /// Something is in the way of the wanted motion.
    Blocked,
}

impl From<Interrupt> for Halt {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}
