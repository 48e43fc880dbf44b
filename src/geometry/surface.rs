//! A mesh prepared for exact distance questions: closest points, signs, local planes.
//!
//! Sign: for closed meshes by the angle-weighted pseudo-normal of the closest feature
//! (J. A. Bærentzen and H. Aanæs 2005), which is exact for closed, outward oriented meshes that do
//! not cross or touch themselves; for all others by winding number > 0.5, and so where a closed one
//! is folded (`folds`). What that needs of a mesh: `derived`. Where segments meet it:
//! `segments`. Winding numbers: `winding`.

mod derived;
mod segments;
mod winding;

use nalgebra::{Point3, Vector3, center};

use super::rim::{Rim, WINDING_DOUBT};
use super::triangle::{Closest, Feature, closest_on_triangle};
use super::triangle_tree::{TriangleTree, Visitor};
use super::{Bounds, Mesh, Solidity};
use derived::{Adjacency, Derived, Opening};

/// No triangle.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;

/// The point of a surface nearest to another point, and the signed distance (negative inside).
#[derive(Debug, Clone, Copy)]
pub struct SignedClosest {
    /// The nearest point.
    pub closest: Closest,
    /// The signed distance.
    pub signed: f64,
}

/// A triangle surface with its adjacency, normals and bounding-volume hierarchy.
#[derive(Clone)]
pub struct Surface {
    mesh: Mesh,
    bounds: Bounds,
    derived: Derived,
}

impl std::fmt::Debug for Surface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Surface({} vertices, {} triangles)", self.mesh.vertices.len(), self.mesh.triangles.len())
    }
}

impl Surface {
    /// Prepares a healed mesh.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let surface = Self::deferred(mesh.clone());
        surface.prepare();
        surface
    }

    /// A healed mesh, to be prepared when more than its triangles is asked for. That depends on the mesh alone.
    #[must_use]
    pub fn deferred(mesh: Mesh) -> Self {
        Self { bounds: Bounds::of(&mesh.vertices), mesh, derived: Derived::default() }
    }

    /// Prepares it now, unless that was done.
    pub fn prepare(&self) {
        self.derived.all(&self.mesh);
    }

    #[inline]
    fn adjacency(&self) -> &Adjacency {
        self.derived.adjacency(&self.mesh)
    }

    #[inline]
    fn tree(&self) -> &TriangleTree {
        self.derived.tree(&self.mesh)
    }

    fn opening(&self) -> &Opening {
        self.derived.opening(&self.mesh)
    }

    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of_val(&*self.mesh.vertices) + size_of_val(&*self.mesh.triangles) + self.derived.memory()
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The vertices.
    #[must_use]
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.mesh.vertices
    }

    /// The triangles.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.mesh.triangles
    }

    /// The box of all vertices.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The corners of a triangle.
    #[must_use]
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Point3<f64>; 3] {
        self.mesh.triangles[triangle as usize].map(|i| self.mesh.vertices[i as usize])
    }

    /// The corners of a triangle, and the middles of its sides.
    #[must_use]
    pub fn corners_and_middles(&self, triangle: u32) -> [Point3<f64>; 6] {
        let [a, b, c] = self.corners(triangle);
        [a, b, c, center(&a, &b), center(&b, &c), center(&c, &a)]
    }

    /// The unit normal of a triangle (zero if degenerate).
    #[must_use]
    #[inline]
    pub fn face_normal(&self, triangle: u32) -> Vector3<f64> {
        self.derived.face_normals(&self.mesh)[triangle as usize]
    }

    /// The triangle across edge `edge` of `triangle`, or `u32::MAX` where there is none.
    #[must_use]
    #[inline]
    pub fn neighbour(&self, triangle: u32, edge: u8) -> u32 {
        self.adjacency().neighbours[triangle as usize][edge as usize]
    }

    /// Whether inside and outside are told apart by winding number.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.mesh.solidity != Solidity::Closed
    }

    /// Whether a triangle is folded on another: then being above its face does not mean outside.
    #[must_use]
    #[inline]
    pub fn is_folded(&self, triangle: u32) -> bool {
        self.adjacency().folds.as_ref().is_some_and(|folds| folds.has_face(triangle))
    }

    #[cfg(test)]
    pub(super) fn is_folded_anywhere(&self) -> bool {
        self.adjacency().folds.is_some()
    }

    /// The edges at which it has holes. There are none where it only crosses itself: winding numbers change at
    /// the surface alone then.
    #[must_use]
    pub fn rim(&self) -> Option<&Rim> {
        self.opening().rim.as_ref()
    }

    /// Whether it has holes. Then it is a wall, which nothing crosses from either side.
    #[must_use]
    pub fn is_wall(&self) -> bool {
        self.mesh.solidity == Solidity::Wall
    }

    /// Whether points of another surface count as inside of this one. A wall has no inside: what meets a solid is
    /// measured by the depth of the wall's points in the solid. Of two walls neither is a solid: there winding numbers
    /// tell inside from outside.
    #[must_use]
    pub fn has_inside_for(&self, other: &Self) -> bool {
        !self.is_wall() || other.is_wall()
    }

    /// Whether all that a straight line of at most `radius` joins with `p`, without meeting the surface, is
    /// outside as `p` is. Not if it cannot be told.
    #[must_use]
    pub fn stays_outside(&self, p: &Point3<f64>, radius: f64) -> bool {
        if !self.is_open() {
            return self.signed_distance(p) > 0.0;
        }
        let margin = 0.5 - WINDING_DOUBT - self.winding_number(p);
        margin > 0.0 && self.rim().is_none_or(|rim| rim.slope(p, radius) * radius < margin)
    }

    /// The winding number at `p`, where signs come from it.
    #[must_use]
    pub fn winding(&self, p: &Point3<f64>) -> Option<f64> {
        self.is_open().then(|| self.winding_number(p))
    }

    /// The closest point on one triangle.
    #[must_use]
    #[inline]
    pub fn closest_on(&self, triangle: u32, p: &Point3<f64>) -> Closest {
        let [a, b, c] = self.corners(triangle);
        let (point, feature) = closest_on_triangle(p, &a, &b, &c);
        Closest { triangle, feature, point, distance: (p - point).norm() }
    }

    /// The closest surface point nearer than `reach`, if there is one.
    #[must_use]
    pub fn closest(&self, p: &Point3<f64>, reach: f64) -> Option<Closest> {
        self.tree().closest(p, reach, |t| self.closest_on(t, p))
    }

    /// The closest surface point, given any triangle that is likely to be near: much quicker than
    /// without.
    #[must_use]
    pub fn closest_from(&self, p: &Point3<f64>, guess: u32) -> Closest {
        let near = self.closest_on(guess, p);
        self.closest(p, near.distance).unwrap_or(near)
    }

    /// The same with the signed distance.
    #[must_use]
    pub fn signed_closest(&self, p: &Point3<f64>, guess: u32) -> SignedClosest {
        let closest = self.closest_from(p, guess);
        SignedClosest { signed: self.signed(p, &closest), closest }
    }

    /// Shows `visitor` the triangles within its reach of `p`, nearest first.
    pub(super) fn nearest_first(&self, p: &Point3<f64>, visitor: &mut impl Visitor) {
        self.tree().nearest_first(p, visitor);
    }

    /// Signed distance given the closest point: negative inside.
    #[must_use]
    pub fn signed(&self, p: &Point3<f64>, closest: &Closest) -> f64 {
        let corners = &self.mesh.triangles[closest.triangle as usize];
        let inside = match (self.is_open(), &self.adjacency().folds) {
            (true, _) => self.winding_number(p) > 0.5,
            (false, Some(folds)) if folds.doubts(closest, corners) => self.winding_number(p) > 0.5,
            _ => self.pseudo_normal(closest).dot(&(p - closest.point)) < 0.0,
        };
        if inside { -closest.distance } else { closest.distance }
    }

    /// Signed distance to the surface.
    #[must_use]
    pub fn signed_distance(&self, p: &Point3<f64>) -> f64 {
        self.closest(p, f64::INFINITY).map_or(f64::INFINITY, |c| self.signed(p, &c))
    }

    /// The angle-weighted pseudo-normal of the feature a closest point lies on (not normalised).
    #[must_use]
    pub fn pseudo_normal(&self, closest: &Closest) -> Vector3<f64> {
        let own = self.face_normal(closest.triangle);
        match closest.feature {
            Feature::Face => own,
            Feature::Edge(e) => match self.neighbour(closest.triangle, e) {
                NO_TRIANGLE => own,
                other => own + self.face_normal(other),
            },
            Feature::Vertex(v) => {
                self.adjacency().vertex_normals
                    [self.mesh.triangles[closest.triangle as usize][v as usize] as usize]
            }
        }
    }

    /// The unit normals of the faces that meet in the feature a closest point lies on.
    pub fn feature_normals(&self, closest: &Closest, mut visit: impl FnMut(Vector3<f64>)) {
        match closest.feature {
            Feature::Face => visit(self.face_normal(closest.triangle)),
            Feature::Edge(e) => {
                visit(self.face_normal(closest.triangle));
                let other = self.neighbour(closest.triangle, e);
                if other != NO_TRIANGLE {
                    visit(self.face_normal(other));
                }
            }
            Feature::Vertex(v) => {
                for &t in self.fan(self.mesh.triangles[closest.triangle as usize][v as usize]) {
                    visit(self.face_normal(t));
                }
            }
        }
    }

    /// The triangles around a vertex.
    #[must_use]
    pub fn fan(&self, vertex: u32) -> &[u32] {
        let i = vertex as usize;
        let Adjacency { fan, fan_start, .. } = self.adjacency();
        &fan[fan_start[i] as usize..fan_start[i + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{ball, cuboid, joined, l_shape, moved, open_box, spread, surface};
    use crate::geometry::Pose;

    static SOLIDS: LazyLock<Vec<Surface>> = LazyLock::new(|| {
        let turn = Pose::rotation(Vector3::new(0.3, -0.5, 0.2));
        vec![
            surface(ball(3)),
            surface(l_shape()),
            surface(moved(l_shape(), &turn)),
            surface(open_box([0.0; 3], [1.0; 3])),
        ]
    });

    fn brute_force(s: &Surface, p: &Point3<f64>) -> f64 {
        (0..s.triangles().len() as u32).map(|t| s.closest_on(t, p).distance).fold(f64::INFINITY, f64::min)
    }

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-3.0..3.0f64).prop_map(Point3::from)
    }

    proptest! {
        #[test]
        fn the_closest_point_is_that_of_all_triangles(p in point(), guess in 0u32..10) {
            for s in SOLIDS.iter() {
                let best = brute_force(s, &p);
                let found = s.closest(&p, f64::INFINITY).unwrap();
                prop_assert!((found.distance - best).abs() < 1e-12, "{} for {best}", found.distance);
                prop_assert!((p - found.point).norm() - found.distance < 1e-12);
                prop_assert!((s.closest_from(&p, guess).distance - best).abs() < 1e-12);
                prop_assert!((s.signed_distance(&p).abs() - best).abs() < 1e-12);
            }
        }

        #[test]
        fn only_what_is_within_reach_is_found(p in point(), reach in 0.0..3.0f64) {
            for s in SOLIDS.iter() {
                let best = brute_force(s, &p);
                prop_assume!((best - reach).abs() > 1e-9);
                prop_assert_eq!(s.closest(&p, reach).is_some(), best < reach);
            }
        }

        #[test]
        fn the_sign_is_right_on_a_solid_with_a_reentrant_edge(p in point()) {
            let inside = (0.0..2.0).contains(&p.x)
                && (0.0..2.0).contains(&p.y)
                && (0.0..1.0).contains(&p.z)
                && !(p.x > 1.0 && p.y > 1.0);
            let d = SOLIDS[1].signed_distance(&p);
            prop_assume!(d.abs() > 1e-9);
            prop_assert_eq!(d < 0.0, inside, "{}", d);
        }
    }

    #[test]
    fn the_sign_is_right_at_points_closest_to_edges_and_vertices() {
        let s = surface(l_shape());
        for (p, d) in [
            ([-0.1, -0.1, 0.5], 0.1 * 2f64.sqrt()),
            ([2.1, -0.1, 1.1], 0.1 * 3f64.sqrt()),
            // Beside the reentrant edge: outside in the notch, inside diagonally behind it.
            ([1.1, 1.2, 0.5], 0.1),
            ([0.9, 0.9, 0.5], -0.1 * 2f64.sqrt()),
            ([0.95, 0.95, 0.5], -0.05 * 2f64.sqrt()),
        ] {
            let found = s.signed_distance(&Point3::from(p));
            assert!((found - d).abs() < 1e-12, "{found} for {d} at {p:?}");
        }
    }

    #[test]
    fn neighbours_are_mutual_and_fans_are_complete() {
        for s in &SOLIDS[..3] {
            for t in 0..s.triangles().len() as u32 {
                for e in 0..3 {
                    let other = s.neighbour(t, e);
                    assert!((0..3).any(|f| s.neighbour(other, f) == t), "{t} and {other}");
                }
                assert!(s.triangles()[t as usize].iter().all(|&v| s.fan(v).contains(&t)));
            }
            let total: usize = (0..s.vertices().len() as u32).map(|v| s.fan(v).len()).sum();
            assert_eq!(total, 3 * s.triangles().len());
        }
    }

    #[test]
    fn a_feature_has_the_normals_of_its_faces() {
        let s = surface(cuboid([0.0; 3], [1.0; 3]));
        for (p, distinct) in [([0.5, 0.4, 2.0], 1), ([0.3, 2.0, 2.0], 2), ([2.0, 2.0, 2.0], 3)] {
            let c = s.closest(&Point3::from(p), f64::INFINITY).unwrap();
            let mut normals: Vec<Vector3<f64>> = Vec::new();
            s.feature_normals(&c, |n| {
                if normals.iter().all(|m| (m - n).norm() > 1e-9) {
                    normals.push(n);
                }
            });
            assert_eq!(normals.len(), distinct, "{normals:?} at {p:?}");
        }
    }

    #[test]
    fn only_what_does_not_close_has_a_rim() {
        assert!(surface(open_box([0.0; 3], [1.0; 3])).rim().is_some());
        assert!(surface(cuboid([0.0; 3], [1.0; 3])).rim().is_none());
        let both = surface(joined([cuboid([0.0; 3], [2.0; 3]), cuboid([1.0; 3], [3.0; 3])]));
        assert!(both.is_open() && both.rim().is_none(), "it crosses itself, but closes");
        for (x, outside) in [(1.5, false), (2.5, false), (3.5, true), (-0.5, true)] {
            let p = Point3::new(x, x, x);
            assert_eq!(both.stays_outside(&p, 0.1), outside, "{p}");
        }
    }

    #[test]
    fn an_open_surface_is_signed_by_winding_number() {
        let s = surface(open_box([0.0; 3], [1.0; 3]));
        assert!(s.is_open());
        for p in spread([0.05; 3], [0.95, 0.95, 0.6], 500) {
            assert!(s.signed_distance(&p) < 0.0, "{p}");
        }
        for p in spread([-2.0, -2.0, -2.0], [3.0, 3.0, -0.05], 500) {
            assert!(s.signed_distance(&p) > 0.0, "{p}");
        }
    }
}
