//! The separate bodies of a surface.

use std::collections::HashMap;

use nalgebra::Point3;

use super::heal::{components, members};
use super::incidence::open_edges;
use super::mesh::signed_volume;
use super::solid_angle::SolidAngle;
use super::{GeometryError, Mesh, SourceMesh, SourcePart, heal};

/// The bodies of a part, healed: each closed shell with the voids in it, each connected piece of an open surface, in
/// the order of their first triangles.
///
/// # Errors
/// The part cannot be healed.
pub fn bodies(part: &SourcePart) -> Result<Vec<SourceMesh>, GeometryError> {
    let mesh = heal(part)?.mesh;
    let mut shells = shells(&mesh);
    let voids: Vec<Vec<u32>> = shells.extract_if(.., |shell| volume(&mesh, shell) < 0.0).collect();
    for void in voids {
        let inner = mesh.vertices[mesh.triangles[void[0] as usize][0] as usize];
        let around = shells.iter_mut().filter(|shell| winds_around(&mesh, shell, &inner));
        // The innermost: shells do not cross, so it is the smallest.
        if let Some(body) = around.min_by(|a, b| volume(&mesh, a).total_cmp(&volume(&mesh, b))) {
            body.extend(void);
        } else {
            shells.push(void);
        }
    }
    Ok(shells.iter().map(|shell| SourceMesh::from_some(&mesh, shell)).collect())
}

/// Whether every edge of a surface lies between two triangles, once vertices in the same place count as one.
#[must_use]
pub fn is_closed(mesh: &SourceMesh) -> bool {
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertices.len());
    // Adding zero makes one zero of both.
    let key = |v: &[f64; 3]| v.map(|c| (c + 0.0).to_bits());
    let welded: Vec<u32> =
        (0..).zip(&mesh.vertices).map(|(i, v)| *first.entry(key(v)).or_insert(i)).collect();
    let weld = |v: u32| welded.get(v as usize).copied();
    let triangles: Option<Vec<[u32; 3]>> = mesh
        .triangles
        .iter()
        .map(|&[a, b, c]| Some([weld(a)?, weld(b)?, weld(c)?]))
        .filter(|t| t.is_none_or(|[a, b, c]| a != b && b != c && c != a))
        .collect();
    triangles.is_some_and(|triangles| open_edges(&triangles) == 0)
}

/// The triangles that hang together, by the vertices that they share.
fn shells(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut last: Vec<u32> = vec![u32::MAX; mesh.vertices.len()];
    let mut pairs = Vec::with_capacity(3 * mesh.triangles.len());
    for (number, triangle) in (0..).zip(&mesh.triangles) {
        for &vertex in triangle {
            let before = std::mem::replace(&mut last[vertex as usize], number);
            if before != u32::MAX {
                pairs.push([before, number]);
            }
        }
    }
    members(&components(mesh.triangles.len(), pairs.into_iter())).into_values().collect()
}

fn volume(mesh: &Mesh, shell: &[u32]) -> f64 {
    let about = mesh.vertices[mesh.triangles[shell[0] as usize][0] as usize];
    signed_volume(&mesh.vertices, shell.iter().map(|&t| mesh.triangles[t as usize]), &about)
}

fn winds_around(mesh: &Mesh, shell: &[u32], point: &Point3<f64>) -> bool {
    let mut angle = SolidAngle::default();
    shell.iter().for_each(|&t| angle.add_triangle(point, &mesh.corners(t as usize)));
    // Half of the whole solid angle, as far from "around" as from "beside".
    angle.sum().abs() > std::f64::consts::TAU
}

impl SourceMesh {
    /// Some of the triangles, with the vertices that these use.
    fn from_some(mesh: &Mesh, triangles: &[u32]) -> Self {
        let vertices = mesh.vertices.iter().map(|v| [v.x, v.y, v.z]).collect();
        Self { vertices, triangles: mesh.triangles.clone() }.some(triangles)
    }

    /// Some of the triangles, with the vertices that these use, in their order.
    #[must_use]
    pub fn some(&self, triangles: &[u32]) -> Self {
        let mut renamed: HashMap<u32, u32> = HashMap::new();
        let mut some = Self::default();
        for &triangle in triangles {
            let corners = self.triangles[triangle as usize].map(|vertex| {
                *renamed.entry(vertex).or_insert_with(|| {
                    some.vertices.push(self.vertices[vertex as usize]);
                    (some.vertices.len() - 1) as u32
                })
            });
            some.triangles.push(corners);
        }
        some
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cells, cuboid, joined, open_box};

    fn part(mesh: SourceMesh) -> SourcePart {
        SourcePart { name: "a".into(), origin: "a.obj".into(), mesh }
    }

    #[test]
    fn voids_belong_to_the_body_around_them() {
        let lines: &[f64] = &[-3.0, -1.0, 1.0, 3.0];
        let hollow = cells([lines, lines, lines], |c| c != [1, 1, 1]);
        let ball = cuboid([-0.5; 3], [0.5; 3]);
        let beside = cuboid([4.0; 3], [5.0; 3]);
        let all = joined([joined([hollow.clone(), ball]), beside]);
        let found = bodies(&part(all)).unwrap();
        let counts: Vec<usize> = found.iter().map(|b| b.triangles.len()).collect();
        assert_eq!(counts, [hollow.triangles.len(), 12, 12]);
        assert!(found.iter().all(is_closed));
    }

    #[test]
    fn a_surface_is_closed_if_all_its_edges_are_shared() {
        assert!(is_closed(&cuboid([0.0; 3], [1.0; 3])));
        assert!(!is_closed(&open_box([0.0; 3], [1.0; 3])));
        let mut soup = cuboid([-1.0; 3], [0.0; 3]);
        soup.vertices = soup.triangles.iter().flatten().map(|&v| soup.vertices[v as usize]).collect();
        soup.triangles = (0..soup.vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        soup.vertices[0] = soup.vertices[0].map(|c| if c == 0.0 { -0.0 } else { c });
        assert!(is_closed(&soup));
    }
}
