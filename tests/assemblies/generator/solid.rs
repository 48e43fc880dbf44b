//! A closed surface that is put together from flat faces.

use std::collections::HashMap;

use earcut::Earcut;

/// A point.
pub(super) type Point = [f64; 3];

/// Triangles, counter-clockwise from outside, over shared vertices.
#[derive(Default, Clone)]
pub(super) struct Solid {
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[usize; 3]>,
    index: HashMap<[i64; 3], usize>,
}

impl Solid {
    /// The vertex at a point, on a raster of a millionth: what is written is what is welded.
    fn vertex(&mut self, p: Point) -> usize {
        let key = p.map(|c| (c * 1e6).round() as i64);
        *self.index.entry(key).or_insert_with(|| {
            self.vertices.push(key.map(|c| c as f64 / 1e6));
            self.vertices.len() - 1
        })
    }

    /// A triangle.
    pub(super) fn triangle(&mut self, corners: [Point; 3]) {
        let [a, b, c] = corners.map(|p| self.vertex(p));
        if a != b && b != c && c != a {
            self.triangles.push([a, b, c]);
        }
    }

    /// A flat face: its outline counter-clockwise from outside, and holes.
    pub(super) fn face(&mut self, outline: &[Point], holes: &[Vec<Point>]) {
        let [drop, u, v] = face_axes(outline);
        let mut points = outline.to_vec();
        let mut starts: Vec<usize> = Vec::new();
        for hole in holes {
            starts.push(points.len());
            points.extend(hole);
        }
        let flat: Vec<[f64; 2]> = points.iter().map(|p| [p[u], p[v]]).collect();
        let mut ears: Vec<usize> = Vec::new();
        Earcut::new().earcut_slice(&flat, &starts, &mut ears);
        let outward = normal(outline)[drop];
        for ear in ears.chunks_exact(3) {
            let corners = [points[ear[0]], points[ear[1]], points[ear[2]]];
            let [a, b, c] = corners;
            self.triangle(if normal(&corners)[drop] * outward > 0.0 { [a, b, c] } else { [a, c, b] });
        }
    }

    /// The band between two loops of equally many points. Outside is to the right when one
    /// walks along the loops with `to` overhead: a counter-clockwise outline and its copy above.
    pub(super) fn band(&mut self, from: &[Point], to: &[Point]) {
        for i in 0..from.len() {
            let j = (i + 1) % from.len();
            self.triangle([from[i], from[j], to[j]]);
            self.triangle([from[i], to[j], to[i]]);
        }
    }

    /// A strip of quads between two rows of points; outside as in [`Self::band`].
    pub(super) fn strip(&mut self, from: &[Point], to: &[Point]) {
        for (f, t) in from.windows(2).zip(to.windows(2)) {
            self.triangle([f[0], f[1], t[1]]);
            self.triangle([f[0], t[1], t[0]]);
        }
    }

    /// All points moved by a rigid motion.
    #[must_use]
    pub(super) fn mapped(&self, motion: impl Fn(Point) -> Point) -> Self {
        let mut solid = Self::default();
        for t in &self.triangles {
            solid.triangle(t.map(|v| motion(self.vertices[v])));
        }
        solid
    }

    /// Moved by an offset.
    #[must_use]
    pub(super) fn moved(&self, by: Point) -> Self {
        self.mapped(|p| [p[0] + by[0], p[1] + by[1], p[2] + by[2]])
    }
}

/// The axis along which a face is flattest, and the other two.
fn face_axes(outline: &[Point]) -> [usize; 3] {
    let n = normal(outline).map(f64::abs);
    let drop = (0..3).fold(0, |best, k| if n[k] > n[best] { k } else { best });
    [drop, (drop + 1) % 3, (drop + 2) % 3]
}

/// Newell's normal, of twice the area.
fn normal(outline: &[Point]) -> Point {
    let edge = |i: usize| (outline[i], outline[(i + 1) % outline.len()]);
    std::array::from_fn(|k| {
        let (l, m) = ((k + 1) % 3, (k + 2) % 3);
        (0..outline.len()).map(edge).map(|(p, q)| (p[l] - q[l]) * (p[m] + q[m])).sum()
    })
}
