use std::sync::Arc;
use std::sync::atomic::Ordering;

use nalgebra::{Point3, Vector3};

use super::Field;
use super::build::Threads;
use super::grid::{EMPTY, Grid};
use super::nodes::{BAND, BRICK, CELLS, FAR_NODE, NODES};
use crate::fixtures::{ball, cuboid, l_shape, moved, open_box, spread, surface, winding_surface};
use crate::geometry::{Pose, Surface};
use crate::termination::{Interrupt, Termination};

fn field(surface: &Surface) -> Grid {
    Grid::build(&Arc::new(surface.clone()), Threads::All, &Termination::default()).unwrap()
}

/// Closed solids of the kinds that parts are made of, none on the grid's planes.
fn solids() -> Vec<(&'static str, Surface)> {
    let off = Pose::new(Vector3::new(0.013, -0.037, 0.021), Vector3::zeros());
    let turned = Pose::new(Vector3::new(0.4, -1.3, 0.7), Vector3::new(0.3, -0.5, 0.2));
    vec![
        ("box", surface(moved(cuboid([-1.0, -1.5, -1.2], [1.0, 1.5, 1.2]), &off))),
        ("ball", surface(moved(ball(4), &off))),
        ("L", surface(moved(l_shape(), &turned))),
        ("plate", surface(moved(cuboid([0.0; 3], [2.0, 1.0, 0.02]), &turned))),
    ]
}

/// Points in the solid's box and up to `margin` of its sizes around it.
fn around(surface: &Surface, margin: f64, count: usize) -> impl Iterator<Item = Point3<f64>> {
    let b = surface.bounds().grown(surface.bounds().extents().max() * margin);
    spread(b.min.into(), b.max.into(), count)
}

/// All nodes: position, stored value, nearest triangle.
fn nodes(field: &Grid) -> impl Iterator<Item = (Point3<f64>, f64, u32)> + '_ {
    let [nx, ny, _] = field.dims;
    let with_nodes = field.slots.iter().enumerate().filter(|(_, s)| **s != EMPTY);
    with_nodes.flat_map(move |(brick, &slot)| {
        let corner = [brick % nx, brick / nx % ny, brick / (nx * ny)].map(|i| i * CELLS);
        (0..BRICK).map(move |i| {
            let at = [i % NODES, i / NODES % NODES, i / (NODES * NODES)];
            let steps = Vector3::from_fn(|a, _| (corner[a] + at[a]) as f64);
            let nodes = field.nodes(slot);
            (field.origin + steps * field.cell, f64::from(nodes.values[i]), nodes.nearest[i])
        })
    })
}

#[test]
fn nodes_in_the_band_hold_the_exact_distance() {
    for (name, s) in solids() {
        let f = field(&s);
        let mut count = 0;
        for (p, value, _) in nodes(&f).filter(|n| n.2 != FAR_NODE) {
            let exact = s.signed_distance(&p);
            let rounding = exact.abs() * f64::from(f32::EPSILON) + 1e-12;
            assert!((value - exact).abs() <= rounding, "{name}: {value} for {exact} at {p}");
            assert!(exact.abs() <= BAND * f.cell, "{name}: {exact} is not in the band");
            count += 1;
        }
        assert!(count > 1000, "{name}: {count} nodes");
    }
}

#[test]
fn nodes_outside_the_band_hold_its_width_with_the_right_sign() {
    for (name, s) in solids() {
        let f = field(&s);
        let band = BAND * f.cell;
        for (p, value, _) in nodes(&f).filter(|n| n.2 == FAR_NODE).step_by(7) {
            let exact = s.signed_distance(&p);
            assert!(exact.abs() >= band * (1.0 - 1e-12), "{name}: {exact} is in the band at {p}");
            assert_eq!(value, band.copysign(exact), "{name}: at {p}, {exact} away");
        }
    }
}

#[test]
fn every_nearest_triangle_is_one_of_the_nearest() {
    for (name, s) in solids() {
        for (p, value, t) in nodes(&field(&s)).filter(|n| n.2 != FAR_NODE).step_by(3) {
            let d = s.closest_on(t, &p).distance;
            assert!((d - value.abs()).abs() <= d * 1e-6 + 1e-12, "{name}: triangle {t} at {p}");
        }
    }
}

#[test]
fn a_lower_bound_never_overstates_the_distance() {
    for (name, s) in solids() {
        let f = field(&s);
        for margin in [0.02, 0.3, 20.0] {
            for p in around(&s, margin, 4000) {
                let exact = s.signed_distance(&p);
                let e = f.estimate(&p);
                assert!(e.lower_bound <= exact.abs() + 1e-9, "{name}: {e:?} for {exact} at {p}");
            }
        }
    }
}

#[test]
fn a_bound_far_outside_is_that_of_the_box() {
    let s = surface(cuboid([-1.0; 3], [1.0; 3]));
    let e = field(&s).estimate(&Point3::new(1e6, 0.0, 0.0));
    assert_eq!((e.lower_bound, e.value), (1e6 - 1.0, 1e6 - 1.0));
}

#[test]
fn the_sign_is_right_inside_and_outside() {
    for (name, s) in solids() {
        let f = field(&s);
        for p in around(&s, 0.2, 8000) {
            let exact = s.signed_distance(&p);
            if exact.abs() > f.error_bound() {
                let e = f.estimate(&p);
                assert_eq!(e.value < 0.0, exact < 0.0, "{name}: {e:?} for {exact} at {p}");
            }
        }
    }
}

#[test]
fn empty_bricks_inside_are_inside() {
    // A hollow box: outside, inside the wall, and in the void there are bricks without nodes.
    let mut shell = cuboid([-3.0; 3], [3.0; 3]);
    let void = cuboid([-1.0; 3], [1.0; 3]);
    let base = shell.vertices.len() as u32;
    shell.vertices.extend(&void.vertices);
    shell.triangles.extend(void.triangles.iter().map(|t| [t[0] + base, t[2] + base, t[1] + base]));
    let s = surface(shell);
    let f = field(&s);
    for (at, inside) in [(0.0, false), (2.0, true), (-2.0, true), (3.3, false)] {
        let p = Point3::new(at, 0.11, 0.07);
        assert_eq!(s.signed_distance(&p) < 0.0, inside, "{p}");
        let e = f.estimate(&p);
        assert_eq!(e.value < 0.0, inside, "{e:?} at {p}");
        assert_eq!(e.value, e.lower_bound, "{p} should be in an empty brick");
    }
}

#[test]
fn a_triangle_is_proposed_everywhere_near_the_surface() {
    for (name, s) in solids() {
        let f = field(&s);
        for p in around(&s, 0.1, 8000) {
            let exact = s.signed_distance(&p).abs();
            let guess = f.likely_nearest(&p);
            if let Some(guess) = guess {
                // Its node is less than a cell's diagonal away.
                let distance = s.closest_on(guess, &p).distance;
                assert!(
                    distance <= exact + 2.0 * 3f64.sqrt() * f.cell,
                    "{name}: {distance} for {exact} at {p}"
                );
            }
            // All corners of the cell are in the band then.
            if exact < (BAND - 3f64.sqrt()) * f.cell {
                assert!(guess.is_some(), "{name}: nothing at {p}, {exact} away");
            }
        }
    }
}

#[test]
fn interpolation_in_the_band_is_within_the_error_bound() {
    for (name, s) in solids() {
        let f = field(&s);
        let reach = (BAND - 3f64.sqrt()) * f.cell;
        let mut count = 0;
        for (corner, _, _) in nodes(&f).filter(|n| n.2 != FAR_NODE).step_by(5) {
            for p in spread(corner.into(), (corner + Vector3::repeat(f.cell)).into(), 2) {
                let exact = s.signed_distance(&p);
                if exact.abs() < reach {
                    let value = f.estimate(&p).value;
                    assert!((value - exact).abs() <= f.error_bound(), "{name}: {value} for {exact} at {p}");
                    count += 1;
                }
            }
        }
        assert!(count > 1000, "{name}: {count} points");
    }
}

#[test]
fn a_cancelled_build_ends_with_the_reason() {
    let termination = Termination::default();
    termination.cancel_flag().store(true, Ordering::Relaxed);
    let built = Field::of(&Arc::new(surface(cuboid([0.0; 3], [1.0; 3]))));
    for end in [built.prepare(&termination), built.prepare_here(&termination)] {
        assert_eq!(end.err(), Some(Interrupt::Cancelled));
    }
    assert!(!built.is_built());
}

#[test]
fn the_size_of_a_field_is_bounded() {
    let long = field(&surface(cuboid([-5.0, -5.0, 0.0], [5.0, 5.0, 1e-3])));
    long.fill();
    assert!(long.bricks() <= 8192 && long.memory() < 100 << 20, "{} bricks", long.bricks());
}

#[test]
fn an_open_box_is_signed_by_winding_number() {
    let s = surface(open_box([-1.0; 3], [1.0; 3]));
    assert!(s.is_open());
    let f = field(&s);
    for p in spread([-0.9, -0.9, -0.9], [0.9, 0.9, 0.2], 2000) {
        assert!(f.estimate(&p).value < 0.0, "{:?} inside at {p}", f.estimate(&p));
        assert!(f.estimate(&p).lower_bound <= s.signed_distance(&p).abs() + 1e-9);
    }
    for p in spread([-1.3, -1.3, -1.3], [1.3, 1.3, -1.1], 2000) {
        assert!(f.estimate(&p).value > 0.0, "{:?} below at {p}", f.estimate(&p));
    }
    for (p, value, _) in nodes(&f).step_by(5) {
        let w = s.winding(&p).unwrap();
        if value != 0.0 && (w - 0.5).abs() > 0.02 {
            assert_eq!(value < 0.0, w > 0.5, "winding {w} at {p}");
        }
    }
}

#[test]
fn a_closed_solid_signed_by_winding_number_has_the_same_field() {
    for mesh in [l_shape(), ball(3)] {
        let (by_normal, by_winding) = (field(&surface(mesh.clone())), field(&winding_surface(mesh)));
        for ((p, v, _), (q, w, _)) in nodes(&by_normal).zip(nodes(&by_winding)) {
            assert!(p == q && v.abs() == w.abs(), "{v} and {w} at {p}");
            assert!(v.abs() < 1e-9 || v == w, "{v} and {w} at {p}");
        }
    }
}

#[test]
fn empty_bricks_around_an_open_box_are_outside() {
    let s = surface(open_box([-1.1; 3], [1.1; 3]));
    let f = field(&s);
    for p in spread([-1.45; 3], [-1.3, 1.45, 1.45], 500) {
        assert!(f.estimate(&p).value > 0.0, "{:?} beside at {p}", f.estimate(&p));
    }
    let p = Point3::new(0.11, 0.07, 0.0);
    assert!(f.estimate(&p).value < 0.0, "{:?} in the middle", f.estimate(&p));
}

#[test]
fn bricks_hold_the_same_in_whichever_order_they_are_filled() {
    for (name, s) in solids().into_iter().chain([("open", surface(open_box([-1.0; 3], [1.0; 3])))]) {
        let (all, looked_at) = (field(&s), field(&s));
        all.fill();
        let before = looked_at.memory();
        let points: Vec<_> = around(&s, 0.05, 3000).collect();
        let _: f64 = points.iter().rev().map(|p| looked_at.value(p)).sum();
        assert!(looked_at.memory() > before, "{name}: nothing was filled");
        for p in &points {
            assert_eq!(all.sample(p), looked_at.sample(p), "{name}: at {p}");
        }
        for (a, b) in nodes(&all).zip(nodes(&looked_at)) {
            assert_eq!(a, b, "{name}");
        }
        assert_eq!(all.memory(), looked_at.memory(), "{name}");
    }
}

#[test]
fn a_field_that_nobody_looked_at_holds_no_nodes() {
    let f = field(&surface(ball(4)));
    let nodes = f.bricks() * BRICK * 8;
    assert!(f.memory() < nodes / 4, "{} bytes before", f.memory());
    f.fill();
    assert!(f.memory() > nodes, "{} bytes after", f.memory());
}

#[test]
fn the_bound_of_an_empty_brick_holds_in_all_of_it() {
    let open = [("open", surface(open_box([-1.0; 3], [1.0; 3])))];
    for (name, s) in solids().into_iter().chain(open) {
        let f = field(&s);
        let side = f.cell * CELLS as f64;
        let mut tight = 0.0f64;
        for brick in (0..f.slots.len()).filter(|&b| f.slots[b] == EMPTY) {
            let (low, bound) = (f.brick_min(brick), f.far(brick));
            for corner in 0..8 {
                let p = low + Vector3::from_fn(|a, _| f64::from(corner >> a & 1) * side);
                let exact = s.signed_distance(&p);
                assert!(bound.abs() <= exact.abs() + 1e-9, "{name}: {bound} for {exact} at {p}");
                assert!(s.is_open() || (bound < 0.0) == (exact < 0.0), "{name}: {bound} for {exact} at {p}");
                tight = tight.max(bound.abs() / exact.abs());
            }
        }
        assert!(tight > 0.3, "{name}: no bound is nearer to the distance than {tight} of it");
    }
}

/// A box with a second vertex next to one corner: triangles too thin for single precision.
fn box_with_slivers() -> Surface {
    let mut mesh = cuboid([-1.0, -1.5, -1.2], [1.0, 1.5, 1.2]);
    let [a, b, _] = mesh.triangles[0];
    let middle = mesh.vertices.len() as u32;
    let [from, to] = [a, b].map(|i| Vector3::from(mesh.vertices[i as usize]));
    mesh.vertices.push((from + (to - from) * 1e-7).into());
    let split = |t: &[u32; 3]| {
        let side = (0..3).find(|&e| [t[e], t[(e + 1) % 3]] == [a, b] || [t[e], t[(e + 1) % 3]] == [b, a]);
        match side.map(|e| [t[e], t[(e + 1) % 3], t[(e + 2) % 3]]) {
            Some([u, v, w]) => vec![[u, middle, w], [middle, v, w]],
            None => vec![*t],
        }
    };
    mesh.triangles = mesh.triangles.iter().flat_map(split).collect();
    surface(mesh)
}

#[test]
fn slivers_do_not_disturb_the_distance() {
    let s = box_with_slivers();
    assert!(!s.is_open() && s.triangles().len() == 14, "{s:?}");
    for (p, value, t) in nodes(&field(&s)) {
        let exact = s.signed_distance(&p);
        if t != FAR_NODE {
            assert!((value - exact).abs() <= exact.abs() * 1e-6 + 1e-12, "{value} for {exact} at {p}");
        } else {
            assert_eq!(value < 0.0, exact < 0.0, "at {p}");
        }
    }
}

#[test]
fn a_ball_with_holes_is_signed_as_each_winding_number_says() {
    let mut mesh = ball(4);
    let count = mesh.triangles.len();
    mesh.triangles = (0..count).filter(|i| i % 97 != 5).map(|i| mesh.triangles[i]).collect();
    let s = surface(mesh);
    assert!(s.is_open());
    let mut inside = 0;
    for (p, value, _) in nodes(&field(&s)).step_by(2) {
        let w = s.winding(&p).unwrap();
        if value != 0.0 && (w - 0.5).abs() > 0.02 {
            assert_eq!(value < 0.0, w > 0.5, "winding {w} at {p}, {value} away");
            inside += usize::from(value < 0.0);
        }
    }
    assert!(inside > 1000, "{inside} nodes inside");
}
