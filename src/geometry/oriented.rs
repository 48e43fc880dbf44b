//! Samples of a surface that know which way the surface faces there.

use nalgebra::{Point3, Vector3};

use super::leading::{Groups, LeadingItem};
use super::samples::{Site, Sited};
use super::surface::NO_TRIANGLE;
use super::{Bounds, Pose, Surface};

/// cos of the angle below which two normals are one (about a tenth of a degree).
const SAME: f64 = 0.999_998;

/// Points of a surface, each with the unit normals of the faces that meet there; of a wall, of both their sides.
#[derive(Debug, Clone, Default)]
pub struct OrientedSamples {
    points: Vec<Point3<f64>>,
    /// Where each point's normals begin, and where the last one's end.
    starts: Vec<u32>,
    normals: Vec<Vector3<f64>>,
    groups: Groups,
}

impl OrientedSamples {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.points)
            + size_of_val(&*self.starts)
            + size_of_val(&*self.normals)
            + self.groups.memory()
    }

    pub(super) fn new(surface: &Surface, sited: &[Sited]) -> Self {
        let mut out = Self { starts: vec![0], ..Self::default() };
        for (point, site) in sited {
            let first = out.normals.len();
            faces_at(surface, *site, |t| {
                let normal = surface.face_normal(t);
                let senses: &[f64] = if surface.is_wall() { &[1.0, -1.0] } else { &[1.0] };
                for normal in senses.iter().map(|sense| normal * *sense) {
                    if out.normals[first..].iter().all(|n| n.dot(&normal) < SAME) {
                        out.normals.push(normal);
                    }
                }
            });
            out.points.push(*point);
            out.starts.push(out.normals.len() as u32);
        }
        out.points.shrink_to_fit();
        out.starts.shrink_to_fit();
        out.normals.shrink_to_fit();
        let item = |i: u32| {
            let (point, normals) = out.at(i);
            LeadingItem::new([point], normals)
        };
        out.groups = Groups::new(&(0..out.points.len() as u32).map(item).collect::<Vec<_>>());
        out
    }

    pub(super) fn at(&self, i: u32) -> (&Point3<f64>, &[Vector3<f64>]) {
        let [from, to] = [i, i + 1].map(|i| self.starts[i as usize] as usize);
        (&self.points[i as usize], &self.normals[from..to])
    }

    /// Those points of which any may lie in a box with a pose and have a normal with more than `steepness`
    /// along a direction, in no order that matters: groups of which none can are left out as a whole.
    pub fn leading<'s>(
        &'s self,
        box_from_self: &'s Pose,
        within: &'s Bounds,
        direction: &'s Vector3<f64>,
        steepness: f64,
    ) -> impl Iterator<Item = (&'s Point3<f64>, &'s [Vector3<f64>])> {
        self.groups.leading(box_from_self, within, direction, steepness).map(|i| self.at(i))
    }

    /// All points with their normals.
    pub fn iter(&self) -> impl Iterator<Item = (&Point3<f64>, &[Vector3<f64>])> {
        (0..self.points.len() as u32).map(|i| self.at(i))
    }
}

pub(super) fn faces_at(surface: &Surface, site: Site, mut visit: impl FnMut(u32)) {
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
    use nalgebra::Vector3;

    use super::super::{Bounds, Pose};
    use crate::fixtures::{ball, cuboid, healed, l_shape, shape_of, spread};

    /// Against looking at each point.
    #[test]
    fn all_points_that_lead_within_a_box_are_told() {
        let turn = Pose::new(Vector3::new(0.4, -1.3, 0.7), Vector3::new(0.3, -0.5, 0.2));
        let (mut told, mut all) = (0, 0);
        for shape in [ball(4), l_shape(), cuboid([-1.0, -2.0, -0.1], [1.0, 2.0, 0.1])].map(healed) {
            let samples = shape_of(&shape).oriented().clone();
            for (at, pose) in
                spread([-2.0; 3], [2.0; 3], 30).zip([turn, Pose::identity()].into_iter().cycle())
            {
                let within = Bounds { min: at, max: at + Vector3::new(1.0, 0.3, 2.0) };
                let along = at.coords.normalize();
                let leads = |(p, normals): &(&_, &[Vector3<f64>])| {
                    within.contains(&(pose * *p)) && normals.iter().any(|n| n.dot(&along) > 1e-3)
                };
                let mut expected: Vec<_> = samples.iter().filter(leads).map(|(p, _)| p as *const _).collect();
                let some = || samples.leading(&pose, &within, &along, 1e-3);
                let mut found: Vec<_> = some().filter(leads).map(|(p, _)| p as *const _).collect();
                expected.sort_unstable();
                found.sort_unstable();
                assert_eq!(found, expected);
                (told, all) = (told + some().count(), all + samples.iter().count());
            }
        }
        assert!(told > 0 && told * 4 < all, "{told} of {all}");
    }

    #[test]
    fn corners_edges_and_faces_of_a_box_have_three_two_and_one_normals() {
        let shape = shape_of(&healed(cuboid([-1.0; 3], [1.0; 3])));
        let mut seen = [0; 4];
        for (p, normals) in shape.oriented().iter() {
            let on = (0..3).filter(|&a| (p[a].abs() - 1.0).abs() < 1e-12).count();
            assert_eq!(normals.len(), on, "at {p}");
            assert!(normals.iter().all(|n| (n.dot(&p.coords) - 1.0).abs() < 1e-12));
            seen[on] += 1;
        }
        assert_eq!((seen[0], seen[3]), (0, 8));
        assert!(seen[1] > 6 && seen[2] > 12 && seen.iter().sum::<usize>() == shape.samples().points().len());
    }
}
