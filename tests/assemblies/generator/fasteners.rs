//! Bolts, nuts and washers without thread, upright at the origin.

use super::shapes::{at, ngon, prism, reversed};
use super::solid::Solid;

/// Corners of round outlines. Shafts and bores have equally many, at equal angles: their
/// facets are parallel, and the clearance is the same all round.
pub(super) const ROUND: usize = 16;

/// A bolt with its hexagonal head on top: the shank from `low` to `seat`, the head from there
/// to `top`.
pub(super) fn bolt(shank: f64, head: f64, low: f64, seat: f64, top: f64) -> Solid {
    let (round, hexagon) = (ngon(ROUND, shank, [0.0; 2], low), ngon(6, head, [0.0; 2], seat));
    let mut solid = Solid::default();
    solid.face(&at(&hexagon, top), &[]);
    solid.band(&hexagon, &at(&hexagon, top));
    solid.face(&reversed(&hexagon), &[at(&round, seat)]);
    solid.band(&round, &at(&round, seat));
    solid.face(&reversed(&round), &[]);
    solid
}

/// A hexagonal nut.
pub(super) fn nut(bore: f64, head: f64, low: f64, high: f64) -> Solid {
    prism(&ngon(6, head, [0.0; 2], low), &[ngon(ROUND, bore, [0.0; 2], low)], low, high)
}

/// A washer.
pub(super) fn washer(bore: f64, outer: f64, low: f64, high: f64) -> Solid {
    prism(&ngon(ROUND, outer, [0.0; 2], low), &[ngon(ROUND, bore, [0.0; 2], low)], low, high)
}
