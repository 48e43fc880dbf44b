//! Cross-sections of surfaces by planes.

use nalgebra::{Point3, Unit, Vector3};

use super::mesh::directed_edges;
use super::surface::{NO_TRIANGLE, Surface};

/// A closed polygon in a plane.
#[derive(Debug, Clone)]
pub struct Contour {
    /// Its corners, one after the other.
    pub points: Vec<Point3<f64>>,
}

impl Contour {
    /// The sides.
    pub fn segments(&self) -> impl Iterator<Item = [&Point3<f64>; 2]> + '_ {
        self.points.iter().zip(self.points.iter().cycle().skip(1)).map(|(a, b)| [a, b])
    }

    /// The largest distance between two of its points.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        let from = |(i, a): (usize, &Point3<f64>)| {
            self.points[i + 1..].iter().map(|b| (b - a).norm_squared()).fold(0.0, f64::max)
        };
        self.points.iter().enumerate().map(from).fold(0.0, f64::max).sqrt()
    }
}

/// Whether a point of a plane (unit normal `normal`) is surrounded by an odd number of some contours in that plane
/// (crossings of a ray in the plane).
#[must_use]
pub fn is_surrounded<'a>(
    contours: impl IntoIterator<Item = &'a Contour>,
    p: &Point3<f64>,
    normal: &Unit<Vector3<f64>>,
) -> bool {
    let [u, v] = across(normal);
    let crosses = |[a, b]: [&Point3<f64>; 2]| {
        let [a, b] = [a, b].map(|q| [u.dot(&(q - p)), v.dot(&(q - p))]);
        (a[1] > 0.0) != (b[1] > 0.0) && a[0] + (b[0] - a[0]) * a[1] / (a[1] - b[1]) > 0.0
    };
    contours.into_iter().flat_map(Contour::segments).filter(|s| crosses(*s)).count() % 2 == 1
}

/// Two unit vectors at right angles to a third and to each other.
#[must_use]
pub fn across(normal: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let least = normal.iamin();
    let u = normal.cross(&Vector3::ith(least, 1.0)).normalize();
    [u, normal.cross(&u)]
}

/// The closed contours in which a plane (at `height` along the unit vector `normal`, all in the surface's frame) cuts a
/// surface. Contours that end at the rim of an open surface are left out.
#[must_use]
pub fn cross_section(surface: &Surface, normal: &Unit<Vector3<f64>>, height: f64) -> Vec<Contour> {
    let over: Vec<f64> = surface.vertices().iter().map(|p| normal.dot(&p.coords) - height).collect();
    // The edges of a triangle that the plane cuts: none, or two. A vertex in the plane counts as below.
    let is_cut = |[a, b]: [u32; 2]| (over[a as usize] > 0.0) != (over[b as usize] > 0.0);
    let cut = |[a, b]: [u32; 2]| {
        let [low, high] = [a, b].map(|v| (over[v as usize], &surface.vertices()[v as usize]));
        low.1 + (high.1 - low.1) * (low.0 / (low.0 - high.0))
    };
    let mut seen = vec![false; surface.triangles().len()];
    let mut contours = Vec::new();
    for first in 0..seen.len() as u32 {
        let (mut triangle, mut points, mut from) = (first, Vec::new(), NO_TRIANGLE);
        while !std::mem::replace(&mut seen[triangle as usize], true) {
            let edges = directed_edges(&surface.triangles()[triangle as usize]);
            let beside = |edge: u8| surface.neighbour(triangle, edge);
            let cuts = (0u8..).zip(edges).filter(|(_, edge)| is_cut(*edge));
            let Some((edge, ends)) = cuts.filter(|(edge, _)| beside(*edge) != from).last() else { break };
            points.push(cut(ends));
            if beside(edge) == NO_TRIANGLE {
                points.clear();
                break;
            }
            (from, triangle) = (triangle, beside(edge));
        }
        if triangle == first && points.len() > 2 {
            contours.push(Contour { points });
        }
    }
    contours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{open_box, surface, tube};

    #[test]
    fn a_tube_has_two_contours_and_an_open_box_one_above_its_floor() {
        let z = Vector3::z_axis();
        let mut contours = cross_section(&surface(tube(1.0, 2.0, [-3.0, 3.0], 24)), &z, 0.7);
        contours.sort_by(|a, b| a.diameter().total_cmp(&b.diameter()));
        let diameters: Vec<f64> = contours.iter().map(Contour::diameter).collect();
        assert!(diameters.iter().zip([2.0, 4.0]).all(|(found, d)| (found - d).abs() < 0.05), "{diameters:?}");
        let surrounded = |x: f64| is_surrounded(&contours, &Point3::new(x, 0.1, 0.7), &z);
        assert!(!surrounded(0.5) && surrounded(1.5) && !surrounded(2.5));
        assert!(is_surrounded(&contours[..1], &Point3::new(0.5, 0.1, 0.7), &z));
        for p in contours.iter().flat_map(|c| &c.points) {
            assert!((p.z - 0.7).abs() < 1e-12);
        }
    }

    #[test]
    fn a_plane_past_a_surface_cuts_nothing_and_one_across_an_open_one_no_closed_contour() {
        let tube = surface(tube(1.0, 2.0, [-3.0, 3.0], 24));
        assert!(cross_section(&tube, &Vector3::z_axis(), 3.5).is_empty());
        assert_eq!(cross_section(&tube, &Vector3::x_axis(), 0.1).len(), 2, "both walls");
        let tray = surface(open_box([-1.0; 3], [1.0; 3]));
        let counts = [Vector3::x_axis(), Vector3::z_axis()].map(|n| cross_section(&tray, &n, 0.3).len());
        assert_eq!(counts, [0, 1]);
    }
}
