//! From which side a picture is taken.

use nalgebra::{Point3, Rotation3, Unit, Vector3};

use super::raster::{Camera, Layer};
use super::{DrawnPart, Placement, Up};

/// Pixels of the images by which views are compared. At half, a screw in a large frame has no pixel; at double, the choice
/// takes four times as long.
const PROBE: [usize; 2] = [128, 96];
/// Views per turn about the direction up, …
const AROUND: usize = 8;
/// … each from these heights (degrees above the horizon).
const HEIGHTS: [f64; 3] = [27.0, 52.0, -27.0];

/// Weights of a view's merits, each between 0 and 1. What is seen of the moving parts counts most; then, that their way is
/// seen at its length; that it comes towards the viewer; that the view is the usual one; and that it is from above. At half
/// of `SEEN`, screws are seen from the side where their heads are hidden; at double of `USUAL`, bottom covers are shown
/// from above.
const SEEN: f64 = 1.0;
/// The weight of what is seen where a picture is about all of its parts: hardly one may be hidden.
const SEEN_OF_ALL: f64 = 2.5;
const LENGTH: f64 = 0.7;
const TOWARDS: f64 = 0.25;
const USUAL: f64 = 0.2;
const ABOVE: f64 = 0.3;
/// Faces of boxes along the axes are seen evenly from every second view; the others are for what hides there.
const EVEN: f64 = 0.12;
/// A view is changed only if another one is better by this.
const BETTER: f64 = 0.35;

/// A mesh where it stands; and whether it is one of those that the picture is about.
pub(super) struct Posed<'a> {
    pub(super) mesh: &'a DrawnPart,
    pub(super) at: Placement,
    pub(super) is_subject: bool,
}

/// Unit direction up.
pub(super) fn upwards(up: Up) -> Vector3<f64> {
    match up {
        Up::Y => Vector3::y(),
        Up::Z => Vector3::z(),
    }
}

/// The directions to the viewer among which one is chosen. The first is the usual one: from the front, right and above, as
/// the page begins with.
pub(super) fn views(up: Up) -> Vec<Vector3<f64>> {
    let (z, front, right) = match up {
        Up::Z => (Vector3::z(), -Vector3::y(), Vector3::x()),
        Up::Y => (Vector3::y(), Vector3::z(), Vector3::x()),
    };
    let level = (front + right * 0.75).normalize();
    let view = |height: f64, turn: usize| {
        let angle = std::f64::consts::TAU * turn as f64 / AROUND as f64;
        let around = Rotation3::from_axis_angle(&Unit::new_unchecked(z), angle) * level;
        around * height.to_radians().cos() + z * height.to_radians().sin()
    };
    HEIGHTS.iter().flat_map(|&height| (0..AROUND).map(move |turn| view(height, turn))).collect()
}

/// How good each of the views is for a picture about some of the parts that go along some ways (from the first point of
/// each to the last).
pub(super) fn merits(posed: &[Posed<'_>], ways: &[Vec<Point3<f64>>], up: Up) -> Vec<f64> {
    let corners: Vec<Point3<f64>> = posed.iter().flat_map(|p| corners(p.mesh, &p.at)).collect();
    let all = views(up);
    let usual = all[0];
    let is_all = posed.iter().all(|p| p.is_subject);
    let merit = |(k, back): (usize, &Vector3<f64>)| {
        let camera = Camera::fitting(back, &upwards(up), &corners, PROBE, 0.02);
        let [mut alone, mut rest] = [Layer::new(&camera), Layer::new(&camera)];
        for Posed { mesh, at, is_subject } in posed {
            let layer = if *is_subject { &mut alone } else { &mut rest };
            layer.surface(&camera, mesh, at, 0);
        }
        let whole = alone.count(|_| true);
        let seen = match is_all {
            true => seen(posed, &camera) * SEEN_OF_ALL / SEEN,
            false => 1.0 - alone.covered_by(&rest) as f64 / whole.max(1) as f64,
        };
        let even = if k % 2 == 0 { EVEN } else { 0.0 };
        let (length, towards) = along(ways, back);
        let above = if back.dot(&upwards(up)) > 0.0 { ABOVE } else { 0.0 };
        SEEN * seen
            + LENGTH * length
            + TOWARDS * towards
            + USUAL * (1.0 + back.dot(&usual)) / 2.0
            + above
            + even
    };
    all.iter().enumerate().map(merit).collect()
}

/// The mean share of the parts that is seen of each.
fn seen(posed: &[Posed<'_>], camera: &Camera) -> f64 {
    let mut all = Layer::new(camera);
    let mut whole = Vec::new();
    for (k, Posed { mesh, at, .. }) in posed.iter().enumerate() {
        all.surface(camera, mesh, at, k as u32);
        let mut own = Layer::new(camera);
        own.surface(camera, mesh, at, 0);
        whole.push(own.count(|_| true));
    }
    let share =
        |(k, whole): (usize, &usize)| all.count(|part| part == k as u32) as f64 / (*whole).max(1) as f64;
    whole.iter().enumerate().map(share).sum::<f64>() / posed.len().max(1) as f64
}

/// The view of each of some pictures in a row, by the merits of the views for each: the best, but the one of the picture
/// before if that is nearly as good.
pub(super) fn chosen(merits: &[Vec<f64>]) -> Vec<usize> {
    let mut current: Option<usize> = None;
    let choose = |own: &Vec<f64>| {
        // Of equals the first.
        let best =
            (0..own.len()).fold(0, |best, view| if own[view] > own[best] + 1e-9 { view } else { best });
        let view = current.filter(|&view| own[view] + BETTER >= own[best]).unwrap_or(best);
        current = Some(view);
        view
    };
    merits.iter().map(choose).collect()
}

/// The means of what share of a way's length is seen from a direction, and of how far it comes towards the viewer.
fn along(ways: &[Vec<Point3<f64>>], back: &Vector3<f64>) -> (f64, f64) {
    let chord = |way: &Vec<Point3<f64>>| (way.last()? - way.first()?).try_normalize(1e-12);
    let chords: Vec<Vector3<f64>> = ways.iter().filter_map(chord).collect();
    let mean =
        |of: &dyn Fn(&Vector3<f64>) -> f64| chords.iter().map(of).sum::<f64>() / chords.len().max(1) as f64;
    (mean(&|chord| chord.cross(back).norm()), mean(&|chord| chord.dot(back).max(0.0)))
}

/// The corners of a mesh's box in its node frame.
pub(super) fn corners(mesh: &DrawnPart, at: &Placement) -> [Point3<f64>; 8] {
    let of = |pick: fn(f32, f32) -> f32, a: usize| {
        f64::from(mesh.positions.iter().map(|p| p[a]).reduce(pick).unwrap_or(0.0))
    };
    let ends = [0, 1, 2].map(|a| [of(f32::min, a), of(f32::max, a)]);
    let corner = |k: usize| {
        at.centre + at.rotation * Vector3::new(ends[0][k & 1], ends[1][k >> 1 & 1], ends[2][k >> 2])
    };
    [0, 1, 2, 3, 4, 5, 6, 7].map(corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_is_kept_unless_another_is_clearly_better() {
        let merits = [vec![1.0, 0.9], vec![1.0, 1.3], vec![0.5, 1.3], vec![1.2, 1.0]];
        assert_eq!(chosen(&merits), [0, 0, 1, 1]);
    }

    #[test]
    fn ways_are_seen_from_the_side_where_they_lead() {
        let way = vec![Point3::origin(), Point3::new(0.0, 0.0, 2.0)];
        let (length, towards) = along(std::slice::from_ref(&way), &Vector3::z());
        assert_eq!((length, towards), (0.0, 1.0));
        let (length, towards) = along(&[way], &-Vector3::x());
        assert_eq!((length, towards), (1.0, 0.0));
    }

    #[test]
    fn the_usual_view_is_from_above() {
        for up in [Up::Y, Up::Z] {
            let views = views(up);
            assert_eq!(views.len(), AROUND * HEIGHTS.len());
            assert!(views[0].dot(&upwards(up)) > 0.3 && views.iter().all(|v| (v.norm() - 1.0).abs() < 1e-12));
        }
    }
}
