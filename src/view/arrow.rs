//! Arrows along the ways of parts.

use std::f64::consts::TAU;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::raster::{Camera, Canvas, SAMPLES};
use super::{PlanScene, Rgb};
use crate::geometry::Bounds;
use crate::plan::PlanKind;

/// Pieces of equal time of which the line of an arrow consists: of a whole turn, 7.5 degrees each. Chosen: at half, arcs have
/// visible corners; at double, no difference is visible.
const PIECES: usize = 48;
/// Share of a path's length. A path whose points are no further from its chord has a straight arrow. Chosen: at half, play
/// at the begin of a path bends its arrow; at double, small detours are not shown.
const STRAIGHT: f64 = 0.03;
/// Share of the body's diagonal: the shortest straight arrow (an arrow is twice as long as the moving parts). Chosen: at
/// half, a head is as long as its arrow in a picture of the whole; at double, arrows of screws reach over other parts.
const SHORTEST: f64 = 0.18;
/// The same for the longest one. At half, it ends inside long parts; at double, it makes the picture half as large.
const LONGEST: f64 = 0.45;
/// Share of the body's diagonal: the longest arrow along a path with bends, which must reach its last bend. At half, paths
/// out of mazes are cut off; at double, the picture becomes half as large.
const LONGEST_BENT: f64 = 1.3;
/// Radians: a turn from which on an arrow goes around the axis. At half, lids that are tilted out get one; at double, keys
/// that turn by a quarter get none.
const TURN: f64 = TAU / 4.0;
/// Share of a whole turn that such an arrow covers: at half, it does not look like a turn; a whole one hides its own tail.
const AROUND: f64 = 0.75;

/// Pixels: half the width of a shaft. At half, it is as thin as an edge; at double, it hides screws.
const SHAFT: f64 = 3.2;
/// Pixels: length and half the width of a head, about six and three times the half width of the shaft, as in drawings.
const HEAD: [f64; 2] = [21.0, 10.5];
/// Pixels: width of the white border around an arrow. At half, it is lost on dark parts; at double, it covers thin parts.
const BORDER: f64 = 1.8;
/// The colour of the border.
const PAPER: Rgb = [255, 255, 255];

/// An arrow in space.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Arrow {
    /// From its tail to its head.
    pub(super) points: Vec<Point3<f64>>,
    /// Whether it goes around an axis.
    pub(super) is_turn: bool,
    /// Whose parts go there.
    pub(super) step: usize,
}

/// The arrows of a step, and the time at which its parts are drawn: when they begin to move out, or shortly before they are
/// in, so that their way in is in the picture. `size` is the diagonal of the body that they leave or get into.
pub(super) fn arrows_of(scene: &PlanScene, step: usize, size: f64) -> (f64, Vec<Arrow>) {
    let own = &scene.steps[step];
    let time = |i: usize| own.begins + (own.ends - own.begins) * i as f64 / PIECES as f64;
    let bounds = |time: f64| {
        let own = own.parts.iter().map(|&part| scene.bounds_at(part, &scene.parts[part].placement(time)));
        own.fold(Bounds::EMPTY, |all, bounds| all.union(&bounds))
    };
    let middle = |time: f64| {
        let centres = own.parts.iter().map(|&part| scene.parts[part].placement(time).centre.coords);
        Point3::from(centres.sum::<Vector3<f64>>() / own.parts.len().max(1) as f64)
    };
    // Outwards, whatever the plan: from where the parts stand in the body.
    let is_assembly = scene.kind == PlanKind::Assembly;
    let times: Vec<f64> = (0..=PIECES).map(|i| time(if is_assembly { PIECES - i } else { i })).collect();
    let way: Vec<Point3<f64>> = times.iter().map(|&time| middle(time)).collect();
    let assembled = bounds(times[0]);
    let diagonal = assembled.extents().norm();
    let size = if size.is_finite() { size.max(diagonal) } else { diagonal };
    let length: f64 = way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let chord = way[PIECES] - way[0];
    let direction = chord.try_normalize(size * 1e-6);
    let reach = (2.0 * diagonal).clamp(SHORTEST * size, LONGEST * size);
    let mut drawn = times[0];
    let mut arrows = Vec::new();
    match direction {
        Some(direction) if is_straight(&way, &chord) => {
            // From where the parts end in this direction.
            let front = 0.5 * direction.abs().dot(&assembled.extents());
            let mut from = way[0] + direction * front;
            if is_assembly {
                let there = way.iter().position(|p| (p - way[0]).norm() >= front + reach).unwrap_or(PIECES);
                drawn = times[there];
                from = way[0];
                let tail = way[there] - direction * front;
                let tail = if (tail - from).dot(&direction) > SHORTEST * size { tail } else { way[there] };
                arrows.push(Arrow { points: vec![tail, from], is_turn: false, step });
            } else {
                let tail = way[0] + direction * surface(scene, step, &way[0], &direction);
                let tip = from + direction * reach;
                arrows.push(Arrow { points: vec![tail, tip], is_turn: false, step });
            }
        }
        _ if length > size * 1e-6 => {
            let mut points = vec![way[0]];
            let mut gone = 0.0;
            for (i, pair) in way.windows(2).enumerate() {
                gone += (pair[1] - pair[0]).norm();
                points.push(pair[1]);
                drawn = if is_assembly { times[i + 1] } else { drawn };
                if gone > LONGEST_BENT * size {
                    break;
                }
            }
            if is_assembly {
                points.reverse();
            }
            arrows.push(Arrow { points, is_turn: false, step });
        }
        _ => {}
    }
    arrows.extend(turn(scene, step, direction, &bounds(drawn)));
    (drawn, arrows)
}

/// How far from a point in a direction the surface of a step's parts lies outermost; 0 if it is not there.
fn surface(scene: &PlanScene, step: usize, from: &Point3<f64>, along: &Vector3<f64>) -> f64 {
    let mut far = 0.0;
    for &part in &scene.steps[step].parts {
        let at = scene.parts[part].placement(scene.steps[step].begins);
        let mesh = &scene.drawn[scene.parts[part].drawn];
        // In the node frame.
        let (origin, along) = (at.rotation.inverse() * (from - at.centre), at.rotation.inverse() * along);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|v| Vector3::from(mesh.positions[v as usize].map(f64::from)));
            let (ab, ac) = (b - a, c - a);
            let normal = along.cross(&ac);
            let volume = ab.dot(&normal);
            let to = origin - a;
            let u = to.dot(&normal) / volume;
            let across = to.cross(&ab);
            let v = along.dot(&across) / volume;
            if volume != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                far = f64::max(far, ac.dot(&across) / volume);
            }
        }
    }
    far
}

fn is_straight(way: &[Point3<f64>], chord: &Vector3<f64>) -> bool {
    let length = chord.norm();
    let off = |p: &Point3<f64>| (p - way[0]).cross(chord).norm() / length;
    let back = way.windows(2).any(|pair| (pair[1] - pair[0]).dot(chord) < -STRAIGHT * length * length);
    !back && way.iter().all(|p| off(p) <= STRAIGHT * length)
}

/// An arrow around the axis about which the parts turn, if they turn about their own middle: at their outer end, in the
/// sense of the turn.
fn turn(scene: &PlanScene, step: usize, out: Option<Vector3<f64>>, bounds: &Bounds) -> Option<Arrow> {
    let own = &scene.steps[step];
    let part = &scene.parts[*own.parts.first()?];
    let pieces = 4 * PIECES;
    let time = |i: usize| own.begins + (own.ends - own.begins) * i as f64 / pieces as f64;
    let mut turned = Vector3::zeros();
    for i in 0..pieces {
        let [a, b] = [time(i), time(i + 1)].map(|time| part.placement(time).rotation);
        turned += (b * a.inverse()).scaled_axis();
    }
    let axis = turned.try_normalize(TURN)?;
    // A part that swings has an arc as its way.
    let side = out.map_or(axis, |out| if out.dot(&axis) < 0.0 { -axis } else { axis });
    if out.is_some_and(|out| out.dot(&axis).abs() < 0.9) {
        return None;
    }
    let extents = bounds.extents();
    let across = extents - axis.abs().component_mul(&extents);
    let radius = 0.5 * across.max();
    let centre = bounds.centre() + side * (0.5 * axis.abs().dot(&extents) * 1.08);
    let begin =
        axis.cross(&if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() }).normalize() * radius * 1.15;
    let point = |i: usize| {
        let angle = TAU * AROUND * i as f64 / PIECES as f64;
        centre + UnitQuaternion::from_scaled_axis(axis * angle) * begin
    };
    Some(Arrow { points: (0..=PIECES).map(point).collect(), is_turn: true, step })
}

impl Arrow {
    /// Draws it over all that is there, with a border in the colour of the paper.
    pub(super) fn draw(&self, canvas: &mut Canvas, camera: &Camera, colour: Rgb) {
        let points: Vec<[f64; 2]> =
            self.points.iter().map(|p| camera.project(p)).map(|[x, y, _]| [x, y]).collect();
        let shape = |grown: f64| ArrowShape::new(&points, grown * SAMPLES as f64);
        for (grown, colour) in [(BORDER, PAPER), (0.0, colour)] {
            if let Some(ArrowShape { shaft, width, head }) = shape(grown) {
                line(canvas, &shaft, width, colour);
                canvas.polygon(&head, colour);
            }
        }
    }
}

/// An arrow in the image (samples).
struct ArrowShape {
    shaft: Vec<[f64; 2]>,
    width: f64,
    head: [[f64; 2]; 3],
}

impl ArrowShape {
    /// The head is at the end of the line, along its last stretch as long as the head. None if all points are one.
    fn new(points: &[[f64; 2]], grown: f64) -> Option<Self> {
        let [length, half] = HEAD.map(|h| h * SAMPLES as f64);
        let tip = *points.last()?;
        let far = |p: &[f64; 2]| (p[0] - tip[0]).hypot(p[1] - tip[1]);
        let before = points.iter().rposition(|p| far(p) >= length).unwrap_or(0);
        let from = points[before];
        let distance = far(&from);
        if distance < 1e-6 {
            return None;
        }
        let along = [(tip[0] - from[0]) / distance, (tip[1] - from[1]) / distance];
        let across = [-along[1], along[0]];
        let base = [tip[0] - along[0] * length, tip[1] - along[1] * length];
        let wing = |side: f64| {
            let by = side * (half + 1.6 * grown);
            [base[0] + across[0] * by - along[0] * grown, base[1] + across[1] * by - along[1] * grown]
        };
        let point = [tip[0] + along[0] * 2.2 * grown, tip[1] + along[1] * 2.2 * grown];
        let mut shaft = points[..=before].to_vec();
        shaft.push([base[0] + along[0] * 2.0, base[1] + along[1] * 2.0]);
        if far(&points[0]) < length {
            shaft.clear();
        }
        Some(Self { shaft, width: SHAFT * SAMPLES as f64 + grown, head: [point, wing(1.0), wing(-1.0)] })
    }
}

/// Draws a line with round joints; `width` is half of it (samples).
pub(super) fn line(canvas: &mut Canvas, points: &[[f64; 2]], width: f64, colour: Rgb) {
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        if length < 1e-9 {
            continue;
        }
        let [x, y] = [-(b[1] - a[1]) / length * width, (b[0] - a[0]) / length * width];
        let corners =
            [[a[0] + x, a[1] + y], [b[0] + x, b[1] + y], [b[0] - x, b[1] - y], [a[0] - x, a[1] - y]];
        canvas.polygon(&corners, colour);
    }
    let sides = 16;
    for p in points {
        let corner = |k: usize| {
            let angle = TAU * k as f64 / sides as f64;
            [p[0] + width * angle.cos(), p[1] + width * angle.sin()]
        };
        canvas.polygon(&(0..sides).map(corner).collect::<Vec<_>>(), colour);
    }
}
