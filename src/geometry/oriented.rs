//! Samples of a surface that know which way the surface faces there.

use nalgebra::{Point3, Vector3};

use super::Surface;
use super::samples::{Site, Sited};
use super::surface::NO_TRIANGLE;

/// cos of the angle below which two normals are one (about a tenth of a degree).
const SAME: f64 = 0.999_998;

/// Points of a surface, each with the unit normals of the faces that meet there.
#[derive(Debug, Clone, Default)]
pub struct OrientedSamples {
    points: Vec<Point3<f64>>,
    /// Where each point's normals begin, and where the last one's end.
    starts: Vec<u32>,
    normals: Vec<Vector3<f64>>,
}

impl OrientedSamples {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.points) + size_of_val(&*self.starts) + size_of_val(&*self.normals)
    }

    pub(super) fn new(surface: &Surface, sited: &[Sited]) -> Self {
        let mut out = Self { starts: vec![0], ..Self::default() };
        for (point, site) in sited {
            let first = out.normals.len();
            faces_at(surface, *site, |t| {
                let normal = surface.face_normal(t);
                if out.normals[first..].iter().all(|n| n.dot(&normal) < SAME) {
                    out.normals.push(normal);
                }
            });
            out.points.push(*point);
            out.starts.push(out.normals.len() as u32);
        }
        out.points.shrink_to_fit();
        out.starts.shrink_to_fit();
        out.normals.shrink_to_fit();
        out
    }

    /// All points with their normals.
    pub fn iter(&self) -> impl Iterator<Item = (&Point3<f64>, &[Vector3<f64>])> {
        let ranges = self.starts.iter().zip(self.starts.iter().skip(1));
        self.points.iter().zip(ranges.map(|(a, b)| &self.normals[*a as usize..*b as usize]))
    }
}

fn faces_at(surface: &Surface, site: Site, mut visit: impl FnMut(u32)) {
    match site {
        Site::Face(t) => visit(t),
        Site::Edge(t, e) => {
            visit(t);
            let other = surface.neighbour(t, e);
            if other != NO_TRIANGLE {
                visit(other);
            }
        }
        Site::Vertex(v) => surface.fan(v).iter().copied().for_each(visit),
    }
}

#[cfg(test)]
mod tests {
    use crate::fixtures::{cuboid, healed, shape_of};

    #[test]
    fn corners_edges_and_faces_of_a_box_have_three_two_and_one_normals() {
        let shape = shape_of(&healed(cuboid([-1.0; 3], [1.0; 3])));
        let mut seen = [0; 4];
        for (p, normals) in shape.oriented.iter() {
            let on = (0..3).filter(|&a| (p[a].abs() - 1.0).abs() < 1e-12).count();
            assert_eq!(normals.len(), on, "at {p}");
            assert!(normals.iter().all(|n| (n.dot(&p.coords) - 1.0).abs() < 1e-12));
            seen[on] += 1;
        }
        assert_eq!((seen[0], seen[3]), (0, 8));
        assert!(seen[1] > 6 && seen[2] > 12 && seen.iter().sum::<usize>() == shape.samples.points().len());
    }
}
