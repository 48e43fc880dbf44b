//! The assemblies.

use super::Assembly;
use super::fasteners::{ROUND, bolt, nut, washer};
use super::grid::grid;
use super::shapes::{at, ngon, prism, rectangle, reversed, ring};
use super::solid::{Point, Solid};
use super::thread::{Ridge, TURN};

/// A bolt through a washer and a plate.
pub(super) fn bolt_washer_plate() -> Assembly {
    let bore = ngon(ROUND, 5.1, [0.0; 2], 0.0);
    let plate = prism(&rectangle([-30.0, -20.0], [30.0, 20.0], 0.0), &[bore], 0.0, 10.0);
    Assembly::new("bolt-washer-plate", "the bolt leaves upward first, or takes its washer's place with it")
        .with("plate", plate)
        .with("washer", washer(5.1, 10.0, 10.0, 12.0))
        .with("bolt", bolt(5.0, 9.0, -5.0, 12.0, 18.0))
}

/// The worked example of the paper, on a base that the cover caps.
pub(super) fn pin_bolt_cover() -> Assembly {
    let base = grid(&[[[-30.0, -30.0, 0.0], [30.0, 30.0, 20.0]]], &[[[-6.1, -6.1, 0.0], [6.1, 6.1, 20.0]]]);
    let cover = grid(
        &[[[-34.0, -34.0, 10.0], [34.0, 34.0, 30.0]]],
        &[[[-30.1, -30.1, 10.0], [30.1, 30.1, 20.0]], [[-6.1, -6.1, 10.0], [6.1, 6.1, 30.0]]],
    );
    let bolt = grid(
        &[[[-6.0, -6.0, -16.0], [6.0, 6.0, 30.0]], [[-11.0, -11.0, 30.0], [11.0, 11.0, 38.0]]],
        &[[[-11.0, -2.1, -10.1], [11.0, 2.1, -5.9]]],
    );
    let pin = grid(&[[[-16.0, -2.0, -10.0], [16.0, 2.0, -6.0]]], &[]);
    Assembly::new("pin-bolt-cover", "the pin locks the bolt, the bolt locks the cover: pin, bolt, cover")
        .with("base", base)
        .with("cover", cover)
        .with("bolt", bolt)
        .with("pin", pin)
        .on("base")
}

/// A T-headed pin in an L-shaped undercut slot: along the slot, then up through the opening.
pub(super) fn l_slot() -> Assembly {
    let block = grid(
        &[[[-20.0, -20.0, 0.0], [40.0, 20.0, 24.0]]],
        &[
            // The channel for the head, the slot for the shank, and the way out.
            [[-8.1, -8.1, 6.0], [30.1, 8.1, 14.1]],
            [[-4.1, -4.1, 14.1], [30.1, 4.1, 24.0]],
            [[13.9, -8.1, 14.1], [30.1, 8.1, 24.0]],
        ],
    );
    let pin = grid(&[[[-8.0, -8.0, 6.0], [8.0, 8.0, 14.0]], [[-4.0, -4.0, 14.0], [4.0, 4.0, 40.0]]], &[]);
    Assembly::new("l-slot", "two straight moves: along the slot, then up")
        .with("block", block)
        .with("t-pin", pin)
        .on("block")
}

/// A bolt and a nut with a coarse thread: a straight pull meets the ridge, more than one turn
/// frees the nut.
pub(super) fn threaded_bolt_and_nut() -> Assembly {
    let male =
        Ridge { base: 4.0, crest: 5.0, base_width: 1.6, crest_width: 0.6, pitch: 3.0, start: 3.0, turns: 4 };
    // In the middle of the gap, 0.15 from the bolt's flanks along the axis and along the radius.
    let female = Ridge {
        base: 5.15,
        crest: 4.15,
        base_width: 2.25,
        crest_width: 1.25,
        pitch: 3.0,
        start: 10.5,
        turns: 1,
    };
    Assembly::new("threaded-bolt-and-nut", "a straight pull collides; more than one turn frees the nut")
        .with("bolt", threaded_bolt(&male))
        .with("nut", threaded_nut(&female, 8.5, 15.5))
}

fn threaded_bolt(ridge: &Ridge) -> Solid {
    let (low, seat, high) = (-5.0, 0.0, 17.0);
    let (round, hexagon) = (ngon(TURN, ridge.base, [0.0; 2], seat), ngon(6, 8.5, [0.0; 2], low));
    let mut solid = ridge.surface(seat, high);
    solid.face(&at(&round, high), &[]);
    solid.face(&at(&hexagon, seat), &[round]);
    solid.band(&hexagon, &at(&hexagon, seat));
    solid.face(&reversed(&hexagon), &[]);
    solid
}

fn threaded_nut(ridge: &Ridge, low: f64, high: f64) -> Solid {
    let (bore, hexagon) = (ngon(TURN, ridge.base, [0.0; 2], low), ngon(6, 8.5, [0.0; 2], low));
    let mut solid = Solid::default();
    let inside_out = ridge.surface(low, high);
    for t in &inside_out.triangles {
        solid.triangle([t[0], t[2], t[1]].map(|v| inside_out.vertices[v]));
    }
    solid.face(&at(&hexagon, high), &[at(&bore, high)]);
    solid.face(&reversed(&hexagon), &[bore]);
    solid.band(&hexagon, &at(&hexagon, high));
    solid
}

/// A block with a pin through it in a box, in a sleeve that is open at one end: nothing but groups leaves at first.
pub(super) fn pinned_block() -> Assembly {
    let sleeve =
        grid(&[[[-30.0, -21.0, -25.0], [30.0, 30.0, 25.0]]], &[[[-20.5, -20.5, -15.5], [20.5, 30.0, 10.5]]]);
    let housing =
        grid(&[[[-20.0, -20.0, -15.0], [20.0, 20.0, 10.0]]], &[[[-15.0, -15.0, -10.0], [15.0, 15.0, 10.0]]]);
    let block =
        grid(&[[[-14.0, -14.0, -10.0], [14.0, 14.0, 9.0]]], &[[[-14.0, -4.0, -4.0], [14.0, 4.0, 4.0]]]);
    let pin = grid(&[[[-14.0, -3.5, -3.5], [14.0, 3.5, 3.5]]], &[]);
    Assembly::new("pinned-block", "box, block and pin leave the sleeve together, block and pin the box")
        .with("sleeve", sleeve)
        .with("box", housing)
        .with("block", block)
        .with("pin", pin)
        .on("sleeve")
}

/// A pin in a blind hole under a slider that stays in its channel.
pub(super) fn covered_pin() -> Assembly {
    let housing = grid(
        &[[[0.0, 0.0, 0.0], [80.0, 40.0, 30.0]]],
        &[[[10.0, 10.0, 10.0], [70.0, 30.0, 20.0]], [[14.0, 15.0, 5.0], [24.0, 25.0, 30.0]]],
    );
    let slider = grid(&[[[10.5, 10.5, 10.5], [30.0, 29.5, 19.5]]], &[]);
    let pin = grid(&[[[15.0, 16.0, 5.5], [23.0, 24.0, 9.5]]], &[]);
    Assembly::new("covered-pin", "the slider is moved aside and stays, then the pin leaves")
        .with("housing", housing)
        .with("slider", slider)
        .with("pin", pin)
        .on("housing")
}

/// Two closed rings, linked.
pub(super) fn linked_rings() -> Assembly {
    let flat = ring(5.0, 2.0, 24, 12);
    let upright = flat.mapped(|[x, y, z]| [x + 5.0, -z, y]);
    Assembly::new("linked-rings", "no plan exists").with("a", flat).with("b", upright)
}

/// Two angle brackets on a base with a plate across their backs, six bolts with nuts: twenty
/// parts.
pub(super) fn bolted_bracket_20() -> Assembly {
    let mut assembly = Assembly::new(
        "bolted-bracket-20",
        "base, two brackets, back plate, six bolts with nuts, four washers",
    );
    let bore = |x: f64, y: f64| ngon(ROUND, 3.1, [x, y], 0.0);
    let feet: Vec<[f64; 2]> = BRACKETS.iter().flat_map(|x| [[x - 12.0, 25.0], [x + 12.0, 25.0]]).collect();
    let holes: Vec<Vec<Point>> = feet.iter().map(|[x, y]| bore(*x, *y)).collect();
    let base = prism(&rectangle([-60.0, -20.0], [60.0, 50.0], 0.0), &holes, 0.0, 10.0);
    let across: Vec<Vec<Point>> = BRACKETS.iter().map(|x| bore(*x, -42.0)).collect();
    let back = prism(&rectangle([-55.0, -58.0], [55.0, -22.0], 0.0), &across, -8.0, 0.0).mapped(laid_down);
    assembly = assembly.with("base", base).on("base").with("back", back);
    for (number, x) in (1..).zip(BRACKETS) {
        assembly = assembly
            .with(format!("bracket-{number}"), bracket(x))
            .with(
                format!("back-bolt-{number}"),
                bolt(3.0, 5.5, -15.0, 6.0, 10.0).moved([x, -42.0, 0.0]).mapped(laid_down),
            )
            .with(
                format!("back-nut-{number}"),
                nut(3.1, 5.5, -13.0, -8.0).moved([x, -42.0, 0.0]).mapped(laid_down),
            );
    }
    for (number, [x, y]) in (1..).zip(feet) {
        assembly = assembly
            .with(format!("bolt-{number}"), bolt(3.0, 5.5, -8.0, 17.5, 22.0).moved([x, y, 0.0]))
            .with(format!("washer-{number}"), washer(3.1, 7.0, 16.0, 17.5).moved([x, y, 0.0]))
            .with(format!("nut-{number}"), nut(3.1, 5.5, -5.0, 0.0).moved([x, y, 0.0]));
    }
    assembly
}

const BRACKETS: [f64; 2] = [-32.0, 32.0];

/// A quarter turn about the x axis: what was up looks along y, what was along −y stands up.
fn laid_down([x, y, z]: Point) -> Point {
    [x, z, -y]
}

/// An L of plate 6 thick, 40 wide: two bores in the foot, one in the upright.
fn bracket(x: f64) -> Solid {
    let (left, right) = (x - 20.0, x + 20.0);
    let profile = [[0.0, 10.0], [40.0, 10.0], [40.0, 16.0], [6.0, 16.0], [6.0, 60.0], [0.0, 60.0]];
    let side = |x: f64| -> Vec<Point> { profile.iter().map(|[y, z]| [x, *y, *z]).collect() };
    let mut solid = Solid::default();
    solid.face(&side(right), &[]);
    solid.face(&reversed(&side(left)), &[]);
    let vertical = [x - 12.0, x + 12.0].map(|x| ngon(ROUND, 3.1, [x, 25.0], 0.0));
    let horizontal: Vec<Point> = ngon(ROUND, 3.1, [x, -42.0], 0.0).into_iter().map(laid_down).collect();
    let back = |y: f64| -> Vec<Point> { horizontal.iter().map(|p| [p[0], y, p[2]]).collect() };
    for (k, [y, z]) in profile.into_iter().enumerate() {
        let [next_y, next_z] = profile[(k + 1) % profile.len()];
        let outline = [[left, y, z], [left, next_y, next_z], [right, next_y, next_z], [right, y, z]];
        let holes = match k {
            0 => vertical.iter().map(|h| at(h, 10.0)).collect(),
            2 => vertical.iter().map(|h| at(h, 16.0)).collect(),
            3 => vec![back(6.0)],
            5 => vec![back(0.0)],
            _ => Vec::new(),
        };
        solid.face(&outline, &holes);
    }
    for hole in &vertical {
        solid.band(&reversed(&at(hole, 10.0)), &reversed(&at(hole, 16.0)));
    }
    solid.band(&reversed(&back(0.0)), &reversed(&back(6.0)));
    solid
}
