//! Boxes, prisms, tubes and rings.

use std::f64::consts::TAU;

use super::solid::{Point, Solid};

/// A regular polygon of `n` corners at height `z`, counter-clockwise from above.
pub(super) fn ngon(n: usize, radius: f64, [x, y]: [f64; 2], z: f64) -> Vec<Point> {
    let corner = |i: usize| {
        let angle = TAU * i as f64 / n as f64;
        [x + radius * angle.cos(), y + radius * angle.sin(), z]
    };
    (0..n).map(corner).collect()
}

/// A rectangle at height `z`, counter-clockwise from above.
pub(super) fn rectangle(lo: [f64; 2], hi: [f64; 2], z: f64) -> Vec<Point> {
    vec![[lo[0], lo[1], z], [hi[0], lo[1], z], [hi[0], hi[1], z], [lo[0], hi[1], z]]
}

/// An outline at another height.
pub(super) fn at(outline: &[Point], z: f64) -> Vec<Point> {
    outline.iter().map(|p| [p[0], p[1], z]).collect()
}

/// An outline seen from the other side.
pub(super) fn reversed(outline: &[Point]) -> Vec<Point> {
    outline.iter().rev().copied().collect()
}

/// An upright prism with holes through it; outlines counter-clockwise from above.
pub(super) fn prism(outline: &[Point], holes: &[Vec<Point>], low: f64, high: f64) -> Solid {
    let mut solid = Solid::default();
    let lows: Vec<_> = holes.iter().map(|h| at(h, low)).collect();
    let highs: Vec<_> = holes.iter().map(|h| at(h, high)).collect();
    solid.face(&at(outline, high), &highs);
    solid.face(&reversed(&at(outline, low)), &lows);
    solid.band(&at(outline, low), &at(outline, high));
    for (low, high) in lows.iter().zip(&highs) {
        solid.band(&reversed(low), &reversed(high));
    }
    solid
}

/// A torus around the z axis.
pub(super) fn ring(radius: f64, tube: f64, around: usize, across: usize) -> Solid {
    let section = |i: usize| -> Vec<Point> {
        let angle = TAU * i as f64 / around as f64;
        let point = |j: usize| {
            let turn = TAU * j as f64 / across as f64;
            let r = radius + tube * turn.cos();
            [r * angle.cos(), r * angle.sin(), tube * turn.sin()]
        };
        (0..across).map(point).collect()
    };
    let mut solid = Solid::default();
    for i in 0..around {
        solid.band(&section((i + 1) % around), &section(i));
    }
    solid
}
