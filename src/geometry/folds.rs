//! Where a closed surface is folded, so that the closest feature does not tell inside from outside.
//!
//! Angle-weighted pseudo-normals (J. A. Bærentzen and H. Aanæs 2005) are right where the surface is
//! a manifold that does not touch itself. Slivers that lie folded on a larger face are as near as
//! that face, and look the other way; edges that more than two faces share have no other side; and
//! at a vertex in which two sheets touch, the normals of both are mixed. There, the winding number
//! decides.

use nalgebra::Vector3;

use super::{Closest, Feature, Mesh, area_normal};

/// cos of the angle between the normals of a fold's two sides, at least.
const FOLDED: f64 = -0.99;
/// The same where a side is thin: its normal is not to be trusted.
const THIN_FOLDED: f64 = -0.5;
/// Height by length of thin triangles.
const THIN: f64 = 1e-2;
/// The bit of a face among those of a triangle; the bits of its edges come first.
const FACE: u8 = 3;

/// What of a surface is folded.
#[derive(Debug, Clone)]
pub(super) struct Folds {
    /// Per triangle: a bit for each edge, and one for the face.
    bits: Vec<u8>,
    vertices: Vec<bool>,
}

impl Folds {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        self.bits.len() + self.vertices.len()
    }

    /// What is folded of a mesh, if anything is; `across` are the neighbours of its triangles, `shared` their edges
    /// that more than two faces share.
    pub(super) fn of(
        mesh: &Mesh,
        normals: &[Vector3<f64>],
        across: &[[u32; 3]],
        shared: &[[bool; 3]],
    ) -> Option<Self> {
        let faces: Vec<bool> = (0..normals.len()).map(|t| is_folded(mesh, normals, across, t)).collect();
        let mut vertices = pinched(mesh, across);
        let mut bits = vec![0u8; normals.len()];
        for (t, corners) in mesh.triangles.iter().enumerate() {
            bits[t] |= u8::from(faces[t]) << FACE;
            for e in 0..3 {
                let other = across[t][e] as usize;
                let edge = faces[t] || faces.get(other) == Some(&true) || shared[t][e];
                bits[t] |= u8::from(edge) << e;
                vertices[corners[e] as usize] |= edge;
                vertices[corners[(e + 1) % 3] as usize] |= edge;
            }
        }
        let any = bits.iter().any(|b| *b != 0) || vertices.contains(&true);
        any.then_some(Self { bits, vertices })
    }

    /// Whether the sign at the closest feature is in doubt; `corners` are its triangle's vertices.
    pub(super) fn doubts(&self, closest: &Closest, corners: &[u32; 3]) -> bool {
        match closest.feature {
            Feature::Face => self.has_face(closest.triangle),
            Feature::Edge(e) => self.bits[closest.triangle as usize] >> e & 1 == 1,
            Feature::Vertex(v) => self.vertices[corners[v as usize] as usize],
        }
    }

    /// Whether a face is folded.
    pub(super) fn has_face(&self, triangle: u32) -> bool {
        self.bits[triangle as usize] >> FACE == 1
    }
}

fn is_folded(mesh: &Mesh, normals: &[Vector3<f64>], across: &[[u32; 3]], t: usize) -> bool {
    let limit = if is_thin(mesh, t) { THIN_FOLDED } else { FOLDED };
    let folds = |other: &u32| normals.get(*other as usize).is_some_and(|n| n.dot(&normals[t]) < limit);
    normals[t] == Vector3::zeros() || across[t].iter().any(folds)
}

fn is_thin(mesh: &Mesh, t: usize) -> bool {
    let [a, b, c] = mesh.triangles[t].map(|i| mesh.vertices[i as usize]);
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    area_normal(&a, &b, &c).norm() < THIN * longest
}

/// Per vertex: whether several sheets meet in it, by going round over the edges.
fn pinched(mesh: &Mesh, across: &[[u32; 3]]) -> Vec<bool> {
    let mut around = vec![0u32; mesh.vertices.len()];
    let mut first = vec![u32::MAX; mesh.vertices.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        for &v in corners {
            around[v as usize] += 1;
            first[v as usize] = first[v as usize].min(t as u32);
        }
    }
    let round = |v: usize| {
        let (mut at, mut count) = (first[v], 0);
        while let Some(corners) = mesh.triangles.get(at as usize) {
            // The edge that begins at the vertex is that over which one leaves.
            let Some(e) = corners.iter().position(|&c| c as usize == v) else { break };
            count += 1;
            at = across[at as usize][e];
            if at == first[v] || count > around[v] {
                break;
            }
        }
        count
    };
    (0..around.len()).map(|v| around[v] > 0 && round(v) != around[v]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::fixtures::{ball, cuboid, joined, l_shape, spread, surface};
    use crate::geometry::{SourceMesh, Surface};

    fn inside_unit_box(p: &Point3<f64>) -> bool {
        p.iter().all(|x| (0.0..1.0).contains(x))
    }

    /// A unit box with a sliver folded on its top: the face's border runs to and fro.
    fn folded_box() -> SourceMesh {
        let mut mesh = cuboid([0.0; 3], [1.0; 3]);
        let top = |i: u32| mesh.vertices[i as usize][2] == 1.0;
        let at = mesh.triangles.iter().position(|t| t.iter().all(|&i| top(i))).unwrap();
        let [a, b, c] = mesh.triangles.swap_remove(at);
        let corner = |i: u32| Vector3::from(mesh.vertices[i as usize]);
        // A point on the face that the triangle's replacement overshoots, and comes back from.
        let (x, y) = (
            corner(a) * 0.5 + corner(b) * 0.3 + corner(c) * 0.2,
            corner(a) * 0.45 + corner(b) * 0.345 + corner(c) * 0.205,
        );
        let n = mesh.vertices.len() as u32;
        mesh.vertices.extend([x, y].map(<[f64; 3]>::from));
        mesh.triangles.extend([[a, b, n], [b, c, n], [c, n + 1, n], [n, n + 1, a], [n + 1, c, a]]);
        mesh
    }

    fn wrong_signs(s: &Surface) -> usize {
        let near = spread([0.2, 0.2, 0.9], [0.8, 0.8, 1.1], 4000);
        near.filter(|p| (s.signed_distance(p) < 0.0) != inside_unit_box(p)).count()
    }

    #[test]
    fn plain_solids_have_no_folds() {
        for mesh in [ball(3), l_shape(), cuboid([0.0; 3], [1.0; 3])] {
            assert!(!surface(mesh).is_folded_anywhere());
        }
    }

    #[test]
    fn signs_are_right_beside_folded_slivers() {
        let s = surface(folded_box());
        assert!(s.is_folded_anywhere() && !s.is_open());
        assert_eq!(wrong_signs(&s), 0);
    }

    #[test]
    fn boxes_that_touch_along_an_edge_have_their_own_insides() {
        let s = surface(joined([cuboid([0.0; 3], [1.0; 3]), cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0])]));
        for p in spread([0.0, 0.0, 0.1], [2.0, 2.0, 0.9], 2000) {
            let inside = (p.x < 1.0) == (p.y < 1.0);
            assert_eq!(s.signed_distance(&p) < 0.0, inside, "{p}");
        }
    }
}
