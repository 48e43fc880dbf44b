//! Polygons of more than three corners, as OBJ, PLY and OFF files have them.

use earcut::Earcut;
use nalgebra::{Point3, Vector3};

/// Splits polygons into triangles; keeps its working memory from one to the next.
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { earcut: Earcut::new() }
    }
}

impl Triangulator {
    /// Adds the triangles of a polygon: of convex ones a fan, of concave ones ears in the plane that fits best. All of
    /// `polygon` must be places in `vertices`.
    pub(super) fn add(&mut self, vertices: &[[f64; 3]], polygon: &[u32], triangles: &mut Vec<[u32; 3]>) {
        let points: Vec<Point3<f64>> = polygon.iter().map(|&v| Point3::from(vertices[v as usize])).collect();
        let normal = polygon_normal(&points);
        if polygon.len() <= 3 || is_convex(&points, &normal) {
            triangles.extend((2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]));
            return;
        }
        let (u, v) = plane_axes(&normal);
        let flat: Vec<[f64; 2]> = points.iter().map(|p| [p.coords.dot(&u), p.coords.dot(&v)]).collect();
        let mut ears: Vec<u32> = Vec::new();
        self.earcut.earcut_slice(&flat, &[], &mut ears);
        for ear in ears.chunks_exact(3) {
            let [a, b, c] = [ear[0], ear[1], ear[2]].map(|i| i as usize);
            let keeps_turn = (points[b] - points[a]).cross(&(points[c] - points[a])).dot(&normal) >= 0.0;
            let (b, c) = if keeps_turn { (b, c) } else { (c, b) };
            triangles.push([polygon[a], polygon[b], polygon[c]]);
        }
    }
}

/// Newell's normal: right also for concave and slightly warped polygons.
fn polygon_normal(points: &[Point3<f64>]) -> Vector3<f64> {
    let Some(first) = points.first() else { return Vector3::zeros() };
    points.windows(2).map(|w| (w[0] - first).cross(&(w[1] - first))).sum()
}

fn is_convex(points: &[Point3<f64>], normal: &Vector3<f64>) -> bool {
    let n = points.len();
    (0..n).all(|i| {
        let (a, b, c) = (points[i], points[(i + 1) % n], points[(i + 2) % n]);
        // A straight corner would make a fan from it degenerate: ear clipping handles it.
        (b - a).cross(&(c - b)).dot(normal) > 0.0
    })
}

fn plane_axes(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let unit = normal.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let away = if unit.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = away.cross(&unit).normalize();
    (u, unit.cross(&u))
}
