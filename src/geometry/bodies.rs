//! The separate bodies of a surface.

use std::collections::HashMap;
use std::f64::consts::TAU;

use nalgebra::Point3;

use super::heal::{components, members};
use super::incidence::{Side, Sides, open_edges};
use super::mesh::signed_volume;
use super::solid_angle::SolidAngle;
use super::{GeometryError, Mesh, Solidity, SourceMesh, SourcePart, heal};

/// Radians. Triangles around an edge that are nearer than this lie on each other: single precision. At double the same;
/// at half, faces of coordinates with few digits are told apart that are one.
const SAME_ANGLE: f64 = 1e-5;

/// The bodies of a part: each closed shell with the voids in it, in the order of their first triangles. Bodies that touch
/// are told apart, also along a common face. Of a surface that has holes, or whose triangles are not all seen from
/// outside: the same of the healed surface, and each connected piece of an open one.
///
/// # Errors
/// Such a surface cannot be healed.
pub fn bodies(part: &SourcePart) -> Result<Vec<SourceMesh>, GeometryError> {
    let (mesh, links) = match closed(&part.mesh) {
        Some(closed) => closed,
        None => {
            let mesh = heal(part)?.mesh;
            let links = sharing_vertices(&mesh);
            (mesh, links)
        }
    };
    let mut shells: Vec<Vec<u32>> =
        members(&components(mesh.triangles.len(), links.into_iter())).into_values().collect();
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
    let vertices = mesh.vertices.iter().map(|v| [v.x, v.y, v.z]).collect();
    let all = SourceMesh { vertices, triangles: mesh.triangles };
    Ok(shells.iter().map(|shell| all.some(shell)).collect())
}

/// Whether every edge of a surface lies between two triangles, once vertices in the same place count as one.
#[must_use]
pub fn is_closed(mesh: &SourceMesh) -> bool {
    welded(mesh).is_some_and(|triangles| open_edges(&triangles) == 0)
}

/// The triangles with the first vertex in each place in the stead of all there; none if a vertex does not exist.
fn welded(mesh: &SourceMesh) -> Option<Vec<[u32; 3]>> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertices.len());
    // Adding zero makes one zero of both.
    let key = |v: &[f64; 3]| v.map(|c| (c + 0.0).to_bits());
    let welded: Vec<u32> =
        (0..).zip(&mesh.vertices).map(|(i, v)| *first.entry(key(v)).or_insert(i)).collect();
    let weld = |v: u32| welded.get(v as usize).copied();
    let triangles = mesh.triangles.iter().map(|&[a, b, c]| Some([weld(a)?, weld(b)?, weld(c)?]));
    triangles.filter(|t| t.is_none_or(|[a, b, c]| a != b && b != c && c != a)).collect()
}

/// The welded surface, and which triangles continue each other across edges so that solid lies between the two; none
/// if some edge has not as many triangles in one direction as in the other.
fn closed(mesh: &SourceMesh) -> Option<(Mesh, Vec<[u32; 2]>)> {
    let vertices: Vec<Point3<f64>> = mesh.vertices.iter().map(|v| Point3::from(*v)).collect();
    let triangles = welded(mesh)?;
    let mut mesh = Mesh { vertices, triangles, solidity: Solidity::Winding };
    if mesh.volume() < 0.0 {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let mut links = Vec::with_capacity(3 * mesh.triangles.len() / 2);
    for (edge, sides) in Sides::of(&mesh.triangles).iter() {
        if 2 * sides.iter().filter(|side| side.upwards).count() != sides.len() {
            return None;
        }
        match sides {
            [a, b] => links.push([a.triangle, b.triangle]),
            _ => links.extend(around(&mesh, edge, sides)),
        }
    }
    Some((mesh, links))
}

/// Pairs of the triangles around an edge. Seen against the edge, solid lies clockwise of a triangle that travels it
/// upwards, and counter-clockwise of one that travels it downwards: each of these goes with the next one that ends its
/// solid. Where two lie on each other, one solid ends before the other begins.
fn around(mesh: &Mesh, [a, b]: [u32; 2], sides: &[Side]) -> Vec<[u32; 2]> {
    let [from, to] = [a, b].map(|v| mesh.vertices[v as usize]);
    let along = (to - from).try_normalize(0.0).unwrap_or_default();
    let across = |side: &Side| {
        let corners = mesh.triangles[side.triangle as usize];
        let third = corners.into_iter().find(|v| *v != a && *v != b).unwrap_or(a);
        let to_third = mesh.vertices[third as usize] - from;
        to_third - along * along.dot(&to_third)
    };
    let zero = sides.first().map(across).unwrap_or_default();
    let angle = |side: &Side| {
        let direction = across(side);
        let angle = along.dot(&zero.cross(&direction)).atan2(zero.dot(&direction)).rem_euclid(TAU);
        // The same place from both sides of zero.
        if TAU - angle < SAME_ANGLE { 0.0 } else { angle }
    };
    let mut sorted: Vec<(f64, &Side)> = sides.iter().map(|side| (angle(side), side)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    for i in 1..sorted.len() {
        if sorted[i].0 - sorted[i - 1].0 < SAME_ANGLE {
            sorted[i].0 = sorted[i - 1].0;
        }
    }
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.upwards.cmp(&a.1.upwards)));
    let mut begun = Vec::new();
    let mut pairs = Vec::new();
    // Twice around: solid may lie across the zero.
    let mut is_paired = vec![false; sorted.len()];
    for i in (0..sorted.len()).chain(0..sorted.len()) {
        let side = sorted[i].1;
        if is_paired[i] {
            continue;
        }
        if !side.upwards {
            begun.push(i);
        } else if let Some(beginning) = begun.pop() {
            pairs.push([sorted[beginning].1.triangle, side.triangle]);
            (is_paired[beginning], is_paired[i]) = (true, true);
        }
    }
    pairs
}

/// Triangles that share a vertex.
fn sharing_vertices(mesh: &Mesh) -> Vec<[u32; 2]> {
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
    pairs
}

fn volume(mesh: &Mesh, shell: &[u32]) -> f64 {
    let about = mesh.vertices[mesh.triangles[shell[0] as usize][0] as usize];
    signed_volume(&mesh.vertices, shell.iter().map(|&t| mesh.triangles[t as usize]), &about)
}

fn winds_around(mesh: &Mesh, shell: &[u32], point: &Point3<f64>) -> bool {
    let mut angle = SolidAngle::default();
    shell.iter().for_each(|&t| angle.add_triangle(point, &mesh.corners(t as usize)));
    // Half of the whole solid angle, as far from "around" as from "beside".
    angle.sum().abs() > TAU
}

impl SourceMesh {
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
    fn bodies_that_touch_are_told_apart() {
        let boxes = [
            cuboid([0.0; 3], [1.0; 3]),
            // On a common face, along a common edge, at a common corner.
            cuboid([0.0, 0.0, 1.0], [1.0, 1.0, 2.0]),
            cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]),
            cuboid([-1.0; 3], [0.0; 3]),
        ];
        for inverted in [false, true] {
            let mut all = joined(boxes.clone());
            if inverted {
                all.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let found = bodies(&part(all)).unwrap();
            assert_eq!(found.len(), 4);
            for (body, given) in found.iter().zip(&boxes) {
                let corners = |mesh: &SourceMesh| {
                    let mut corners = mesh.vertices.clone();
                    corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
                    corners
                };
                assert_eq!(corners(body), corners(given));
            }
        }
        // With holes, what hangs together is a body.
        let open = joined([open_box([0.0; 3], [1.0; 3]), open_box([3.0; 3], [4.0; 3])]);
        assert_eq!(bodies(&part(open)).unwrap().len(), 2);
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
