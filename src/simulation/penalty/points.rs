//! The points at which contact acts: all vertices after long edges were halved.
//!
//! The longest edge of a triangle is halved until all are short enough (M.-C. Rivara 1984): two
//! triangles halve a common edge at the same points, and slivers are cut across only. Four-way
//! splits, as mesh libraries make them, give the same on square faces and many more on slivers.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::Point3;

use crate::geometry::{SampleTree, Shape, Surface};

/// The vertices of a surface and, on edges and faces, further points so that no edge is longer
/// than `longest`. Each point once.
pub(super) fn contact_points(surface: &Surface, longest: f64) -> Vec<Point3<f64>> {
    let mut points = ContactPoints::default();
    for v in surface.vertices() {
        points.add(*v);
    }
    let mut stack = Vec::new();
    for t in 0..surface.triangles().len() as u32 {
        stack.push(surface.corners(t));
        while let Some(corners) = stack.pop() {
            let squared = |e: usize| (corners[(e + 1) % 3] - corners[e]).norm_squared();
            let e = (1..3).fold(0, |best, e| if squared(e) > squared(best) { e } else { best });
            if squared(e) <= longest * longest {
                continue;
            }
            let [a, b, c] = [corners[e], corners[(e + 1) % 3], corners[(e + 2) % 3]];
            // The same bits from either side of the edge: addition commutes.
            let middle = Point3::from((a.coords + b.coords) * 0.5);
            points.add(middle);
            stack.extend([[a, middle, c], [middle, b, c]]);
        }
    }
    points.list
}

#[derive(Default)]
struct ContactPoints {
    list: Vec<Point3<f64>>,
    known: HashSet<[u64; 3]>,
}

impl ContactPoints {
    fn add(&mut self, p: Point3<f64>) {
        // Adding zero makes one of the two zeros.
        if self.known.insert([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())) {
            self.list.push(p);
        }
    }
}

/// The contact points of shapes met before, for as long as these live.
#[derive(Debug, Default)]
pub(super) struct PointCache {
    known: Mutex<Vec<KnownPoints>>,
}

#[derive(Debug)]
struct KnownPoints {
    /// Keeps the address from being given to another shape.
    shape: Weak<Shape>,
    longest: f64,
    points: Arc<SampleTree>,
}

impl PointCache {
    /// The contact points of a shape.
    pub(super) fn of(&self, shape: &Arc<Shape>, longest: f64) -> Arc<SampleTree> {
        if let Some(points) = self.find(shape, longest) {
            return points;
        }
        // Not under the lock: others may want other shapes meanwhile. Two may make the same.
        let points = Arc::new(SampleTree::over(contact_points(&shape.surface, longest)));
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|k| k.shape.strong_count() > 0);
        known.push(KnownPoints { shape: Arc::downgrade(shape), longest, points: Arc::clone(&points) });
        points
    }

    fn find(&self, shape: &Arc<Shape>, longest: f64) -> Option<Arc<SampleTree>> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let same =
            |k: &&KnownPoints| std::ptr::eq(k.shape.as_ptr(), Arc::as_ptr(shape)) && k.longest == longest;
        known.iter().find(same).map(|k| Arc::clone(&k.points))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, healed, l_shape, shape_of, surface};

    #[test]
    fn a_box_has_points_at_the_spacing_and_each_once() {
        let s = surface(cuboid([0.0; 3], [2.0, 1.0, 0.25]));
        let points = contact_points(&s, 0.5);
        for (i, p) in points.iter().enumerate() {
            assert!(s.signed_distance(p).abs() < 1e-12, "{p} is off the surface");
            assert!(points[i + 1..].iter().all(|q| (q - p).norm() > 1e-9), "{p} is there twice");
        }
        // Along an edge of length 2: every 0.5.
        let along = points.iter().filter(|p| p.y == 0.0 && p.z == 0.0).map(|p| p.x);
        let mut along: Vec<f64> = along.collect();
        along.sort_by(f64::total_cmp);
        assert_eq!(along, [0.0, 0.5, 1.0, 1.5, 2.0]);
    }

    #[test]
    fn no_point_of_the_surface_is_farther_from_a_contact_point_than_an_edge_is_long() {
        let s = surface(cuboid([0.0; 3], [3.0, 2.0, 0.1]));
        for longest in [0.5, 0.2] {
            let points = contact_points(&s, longest);
            for p in crate::fixtures::spread([0.0, 0.0, 0.1], [3.0, 2.0, 0.1], 500) {
                let d = points.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
                assert!(d <= longest, "{d} from {p}");
            }
        }
    }

    #[test]
    fn fine_meshes_keep_their_vertices_alone() {
        let s = surface(ball(3));
        assert_eq!(contact_points(&s, 0.5).len(), s.vertices().len());
    }

    #[test]
    fn a_cache_gives_each_shape_its_own_points_and_forgets_the_dead() {
        let cache = PointCache::default();
        let shape = |mesh| Arc::new(shape_of(&healed(mesh)));
        let (a, b) = (shape(l_shape()), shape(cuboid([0.0; 3], [1.0; 3])));
        let [of_a, of_b] = [&a, &b].map(|s| cache.of(s, 0.5));
        assert!(Arc::ptr_eq(&of_a, &cache.of(&a, 0.5)) && Arc::ptr_eq(&of_b, &cache.of(&b, 0.5)));
        assert!(of_a.points().len() != of_b.points().len());
        assert!(cache.of(&a, 0.25).points().len() > of_a.points().len());
        drop(a);
        let c = shape(l_shape());
        assert!(!Arc::ptr_eq(&of_a, &cache.of(&c, 0.5)));
        assert_eq!(cache.known.lock().unwrap().len(), 2);
    }
}
