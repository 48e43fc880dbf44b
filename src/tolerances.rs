//! The table of tolerances and budgets. Lengths are in the planning frame, where the assembly's longest side is in
//! (5, 10]; angles in radians; shares without a unit.

/// A pair may get this much deeper than its allowance, in the planning frame.
pub(crate) const DEPTH_TOLERANCE: f64 = 3e-4;
/// The same half-way between two poses of a motion that turns.
pub(crate) const BULGE_TOLERANCE: f64 = 2.0 * DEPTH_TOLERANCE;
/// Longest step in free space, in the planning frame.
pub(crate) const FREE_STEP: f64 = 0.5;
/// A plane nearer than this is touched.
pub(crate) const TOUCHED: f64 = 1e-6;
/// So far outside its region, beyond what is granted, a piece may be where it begins: flat sides leave
/// out a little of what is free, and where parts stand assembled nothing is entered.
pub(crate) const HELD_AT_FIRST: f64 = 1e-3;
/// The same for what was not as far outside before. A corner of the measured surface gets deeper into a face
/// than that gets into the corner, a few times: still within what the engine declares.
pub(crate) const HELD: f64 = DEPTH_TOLERANCE / 2.0;
/// Deeper than this, as a share of the limit, points help in refining a motion that is refused.
pub(crate) const HELPFUL: f64 = 1.0 / 2.0;
