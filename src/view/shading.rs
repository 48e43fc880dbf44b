//! From a healed mesh to what is drawn: normals that are smooth across faint edges and part at sharp ones,
//! and the sharp edges as lines.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

/// cos of the angle between faces from which on their edge is sharp (30 degrees).
const SHARP: f64 = 0.866;
/// Normals are told apart to this many steps per unit.
const STEPS: f64 = 1000.0;

/// A mesh with a normal per vertex: vertices on sharp edges are there once per side.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Shaded {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) normals: Vec<Vector3<f64>>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Sharp edges, as pairs of vertices.
    pub(super) edges: Vec<[u32; 2]>,
}

/// Shades a mesh whose triangles are counter-clockwise from outside and not degenerate.
pub(super) fn shaded(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> Shaded {
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let flat: Vec<Vector3<f64>> = triangles.iter().map(|t| face_normal(&corners(t))).collect();
    let mut around: Vec<Vec<(usize, f64)>> = vec![Vec::new(); vertices.len()];
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            around[t[k] as usize].push((i, angle_at(&corners(t), k)));
        }
    }
    let mut out = Shaded::default();
    let mut known: HashMap<(u32, [i32; 3]), u32> = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        let triangle = t.map(|v| {
            let near = around[v as usize].iter().filter(|(f, _)| flat[*f].dot(&flat[i]) > SHARP);
            let normal = near.map(|(f, angle)| flat[*f] * *angle).sum::<Vector3<f64>>();
            let normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or(flat[i]);
            let key = (v, [0, 1, 2].map(|a| (normal[a] * STEPS).round() as i32));
            *known.entry(key).or_insert_with(|| {
                out.positions.push(vertices[v as usize]);
                out.normals.push(normal);
                out.positions.len() as u32 - 1
            })
        });
        out.triangles.push(triangle);
    }
    out.edges = sharp_edges(triangles, &flat, &out.triangles);
    out
}

/// The edges where faces meet at an angle, or that do not have two faces. Their ends are named by the
/// vertices that the first face has there.
fn sharp_edges(triangles: &[[u32; 3]], flat: &[Vector3<f64>], drawn: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut faces: HashMap<[u32; 2], Vec<usize>> = HashMap::new();
    let ends = |t: &[u32; 3], k: usize| [t[k], t[(k + 1) % 3]];
    let key = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    for (i, t) in triangles.iter().enumerate() {
        (0..3).for_each(|k| faces.entry(key(ends(t, k))).or_default().push(i));
    }
    let is_sharp = |of: &[usize]| !matches!(of, [a, b] if flat[*a].dot(&flat[*b]) > SHARP);
    let mut edges = Vec::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let of = &faces[&key(ends(t, k))];
            if of.first() == Some(&i) && is_sharp(of) {
                edges.push(ends(&drawn[i], k));
            }
        }
    }
    edges
}

fn face_normal([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z)
}

fn angle_at(corners: &[Point3<f64>; 3], k: usize) -> f64 {
    let [a, b, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
    (b - a).angle(&(c - a))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::fixtures::cuboid;

    #[test]
    fn a_box_has_twelve_sharp_edges_and_flat_faces() {
        let mesh = cuboid([0.0; 3], [1.0, 2.0, 3.0]);
        let vertices: Vec<_> = mesh.vertices.iter().map(|v| Point3::from(*v)).collect();
        let s = shaded(&vertices, &mesh.triangles);
        assert_eq!((s.positions.len(), s.edges.len(), s.triangles.len()), (24, 12, 12));
        assert!(s.normals.iter().all(|n| n.amax() > 0.999_999));
        for [a, b] in &s.edges {
            let d = s.positions[*a as usize] - s.positions[*b as usize];
            assert_eq!(d.iter().filter(|x| **x != 0.0).count(), 1, "{d}");
        }
    }

    #[test]
    fn a_tube_is_smooth_around_and_open_at_its_ends() {
        let n = 24u32;
        let ring = |z: f64| {
            (0..n)
                .map(move |i| f64::from(i) * TAU / f64::from(n))
                .map(move |a| Point3::new(a.cos(), a.sin(), z))
        };
        let vertices: Vec<_> = ring(0.0).chain(ring(1.0)).collect();
        let triangles: Vec<_> =
            (0..n).flat_map(|i| [[i, (i + 1) % n, i + n], [(i + 1) % n, (i + 1) % n + n, i + n]]).collect();
        let s = shaded(&vertices, &triangles);
        assert_eq!((s.positions.len(), s.edges.len()), (48, 48), "its rims are edges, its side has none");
        for (p, normal) in s.positions.iter().zip(&s.normals) {
            assert!(normal.dot(&Vector3::new(p.x, p.y, 0.0)) > 0.99, "{normal} at {p}");
        }
    }
}
