//! A distinct mesh with all that is derived from it alone. Equal parts share one.

use std::sync::{Arc, OnceLock};

use nalgebra::{Point3, Vector3};

use crate::budgets::THICKNESS_POINTS;
use crate::termination::{Interrupt, Poll, Termination};

use super::content_hash::mesh_hash;
use super::hull::hull_vertices;
use super::inner_points::SurfacePoint;
use super::own_frame::OwnFrame;
use super::samples::{Sited, sited, sited_within};
use super::{
    Bounds, ConvexEdges, Faces, MassProperties, Mesh, OrientedSamples, PatchTree, SampleTree, Spacing,
    Surface,
};

/// Nodes of the tree of patches between two looks at the termination condition.
const PATCH_POLL: u32 = 64;

/// A mesh in its own frame (origin at the middle of its box, lengths of the planning frame).
#[derive(Debug, Clone)]
pub struct Shape {
    /// The triangles.
    pub surface: Arc<Surface>,
    /// Vertices of the convex hull.
    pub hull: Vec<Point3<f64>>,
    /// Centre of mass and radius of gyration.
    pub mass: MassProperties,
    /// Largest distance of a vertex from the centre of mass.
    pub reach: f64,
    /// Built when they are asked for, as what follows.
    oriented: OnceLock<OrientedSamples>,
    convex_edges: OnceLock<ConvexEdges>,
    samples: OnceLock<SampleTree>,
    patches: OnceLock<PatchTree>,
    faces: OnceLock<Faces>,
    inner_points: OnceLock<Vec<Point3<f64>>>,
    thickness: OnceLock<f64>,
    content: OnceLock<[u8; 32]>,
}

impl Shape {
    /// The shape of a part's mesh (planning frame) in a frame of its own.
    ///
    /// # Errors
    /// The termination condition became true before there was one.
    pub(super) fn within(mesh: Mesh, frame: &OwnFrame, termination: &Termination) -> Result<Self, Interrupt> {
        Self::of(frame.framed(mesh), termination)
    }

    /// Derives everything from a mesh that is not said to be derived later.
    ///
    /// # Errors
    /// The termination condition became true before that was done.
    pub fn of(mesh: Mesh, termination: &Termination) -> Result<Self, Interrupt> {
        termination.check()?;
        let hull = hull_vertices(&mesh.vertices);
        termination.check()?;
        let shape = Self::over(Surface::deferred(mesh), hull, OnceLock::new());
        shape.surface.prepare();
        termination.check()?;
        shape.convex_edges();
        Ok(shape)
    }

    /// A shape of which the hull and the content are known: all else is derived when it is asked for. Of most
    /// parts that is little, where what was found out about them is remembered.
    #[must_use]
    pub(crate) fn known(mesh: Mesh, hull: Vec<Point3<f64>>, content: [u8; 32]) -> Self {
        Self::over(Surface::deferred(mesh), hull, OnceLock::from(content))
    }

    /// The shape with all lengths multiplied by a power of two, which loses no bit. All is derived when it is asked for.
    #[must_use]
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let scaled = |points: &[Point3<f64>]| points.iter().map(|p| p * factor).collect();
        let mesh = Mesh { vertices: scaled(&self.mesh().vertices), ..self.mesh().clone() };
        Self::over(Surface::deferred(mesh), scaled(&self.hull), OnceLock::new())
    }

    fn over(surface: Surface, hull: Vec<Point3<f64>>, content: OnceLock<[u8; 32]>) -> Self {
        let mass = surface.mass_properties();
        let reach =
            surface.vertices().iter().map(|v| (v - mass.centre).norm_squared()).fold(0.0, f64::max).sqrt();
        Self {
            surface: Arc::new(surface),
            hull,
            mass,
            reach,
            oriented: OnceLock::new(),
            convex_edges: OnceLock::new(),
            samples: OnceLock::new(),
            patches: OnceLock::new(),
            faces: OnceLock::new(),
            inner_points: OnceLock::new(),
            thickness: OnceLock::new(),
            content,
        }
    }

    /// Derives now what was not yet, but for the tree of samples.
    ///
    /// # Errors
    /// The termination condition became true before all was there.
    pub fn derive(&self, termination: &Termination) -> Result<(), Interrupt> {
        termination.check()?;
        self.surface.prepare();
        self.convex_edges();
        self.faces();
        self.patches(termination).map(|_| ())
    }

    /// The mesh that it was made of, in its frame.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        self.surface.mesh()
    }

    /// Where contact is looked for, with the faces that meet there.
    pub fn oriented(&self) -> &OrientedSamples {
        self.oriented.get_or_init(|| OrientedSamples::new(&self.surface, &self.sited()))
    }

    /// Where it first touches what it is moved against.
    pub fn convex_edges(&self) -> &ConvexEdges {
        self.convex_edges.get_or_init(|| ConvexEdges::new(&self.surface))
    }

    /// The same points in a tree.
    pub fn samples(&self) -> &SampleTree {
        let derive = || match self.oriented.get() {
            Some(oriented) => oriented.iter().map(|(p, _)| *p).collect(),
            // Which way the surface faces there takes longer, and is seldom asked of what is new.
            None => self.sited().into_iter().map(|(p, _)| p).collect(),
        };
        self.samples.get_or_init(|| SampleTree::over(derive()))
    }

    /// The same of those within a box alone, found without the others.
    #[must_use]
    pub fn samples_within(&self, bounds: &Bounds) -> SampleTree {
        let within = sited_within(&self.surface, &spacing(self.surface.bounds()), bounds);
        SampleTree::over(within.into_iter().map(|(p, _)| p).collect())
    }

    fn sited(&self) -> Vec<Sited> {
        sited(&self.surface, &spacing(self.surface.bounds()))
    }

    /// The triangles in a tree of patches.
    ///
    /// # Errors
    /// The termination condition became true before there was one.
    pub fn patches(&self, termination: &Termination) -> Result<&PatchTree, Interrupt> {
        if let Some(tree) = self.patches.get() {
            return Ok(tree);
        }
        let tree = PatchTree::new(&self.surface, &Poll::every(PATCH_POLL, Some(termination)))?;
        Ok(self.patches.get_or_init(|| tree))
    }

    /// Where the surface faces.
    pub fn faces(&self) -> &Faces {
        self.faces.get_or_init(|| Faces::of(&self.surface))
    }

    /// A point inside for each connected piece of the surface, as far as there is one.
    pub fn inner_points(&self) -> &[Point3<f64>] {
        self.inner_points.get_or_init(|| self.surface.inner_points())
    }

    /// The thickness that a quarter of the surface does not exceed: twice the radius of the largest ball that touches it
    /// from inside. Infinite for open surfaces, which have no inside.
    pub fn thickness(&self) -> f64 {
        *self.thickness.get_or_init(|| {
            if self.surface.is_open() {
                return f64::INFINITY;
            }
            let of_ball = |at: SurfacePoint| {
                let centre = self.surface.inner_point(&at)?;
                Some(2.0 * (centre - at.0).norm())
            };
            let points = self.surface.spread_points(THICKNESS_POINTS);
            // Corners have balls of any size: where there is none, a point says nothing.
            let mut found: Vec<f64> = points.filter_map(of_ball).collect();
            found.sort_by(f64::total_cmp);
            found.get(found.len() / 4).copied().unwrap_or(f64::INFINITY)
        })
    }

    /// Bytes in memory, of what was derived so far.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of::<Self>()
            + self.surface.memory()
            + size_of_val(&*self.hull)
            + self.samples.get().map_or(0, SampleTree::memory)
            + self.oriented.get().map_or(0, OrientedSamples::memory)
            + self.convex_edges.get().map_or(0, ConvexEdges::memory)
            + self.patches.get().map_or(0, PatchTree::memory)
            + self.faces.get().map_or(0, Faces::memory)
            + self.inner_points.get().map_or(0, |points| size_of_val(&**points))
    }

    /// The hash of the mesh, on which alone everything here depends.
    pub fn content(&self) -> &[u8; 32] {
        self.content.get_or_init(|| mesh_hash(self.mesh()))
    }

    /// Largest distance of a point of the shape from the line through `centre` along the unit
    /// vector `axis` (both in the shape's frame): how fast turning about it can move a point.
    #[must_use]
    pub fn radius_about(&self, centre: &Point3<f64>, axis: &Vector3<f64>) -> f64 {
        self.hull.iter().map(|p| (p - centre).cross(axis).norm_squared()).fold(0.0, f64::max).sqrt()
    }

    /// The box of the mesh in its own frame.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        self.surface.bounds()
    }
}

/// Closer on small parts, so that a pin has as many samples around as a plate has along. Only parts that are scaled for
/// the search of a much smaller one are larger than 100: their samples are a thousandth of the longest side apart. At half
/// that number small parts stand between two samples; at double, such a part takes four times the memory.
fn spacing(bounds: &Bounds) -> Spacing {
    let size = bounds.extents().max();
    let edge = (size / 40.0).clamp(0.02, (size / 1000.0).max(0.1));
    Spacing { vertex: Some(edge), edge, blunt_edge: edge * 3.0, face: edge * 4.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, healed, l_shape, shape_of};

    #[test]
    fn a_box_has_its_corners_as_hull_and_reach() {
        let shape = shape_of(&healed(cuboid([-1.0, -2.0, -0.5], [1.0, 2.0, 0.5])));
        assert_eq!(shape.hull.len(), 8);
        assert!((shape.reach - (1.0f64 + 4.0 + 0.25).sqrt()).abs() < 1e-12);
        assert_eq!(shape.bounds().extents(), Vector3::new(2.0, 4.0, 1.0));
    }

    #[test]
    fn a_tree_of_patches_that_was_cut_short_is_made_anew() {
        let shape = shape_of(&healed(ball(3)));
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(shape.patches(&termination).err(), Some(Interrupt::Cancelled));
        let tree = shape.patches(&Termination::default()).unwrap();
        let all = tree.root().map_or(0, |root| tree.triangles(root).len());
        assert_eq!(all, shape.surface.triangles().len());
    }

    #[test]
    fn the_radius_about_an_axis_is_that_of_the_farthest_corner() {
        let shape = shape_of(&healed(cuboid([-1.0, -2.0, -0.5], [1.0, 2.0, 0.5])));
        let about = |c: [f64; 3], axis: Vector3<f64>| shape.radius_about(&Point3::from(c), &axis);
        assert!((about([0.0; 3], Vector3::z()) - 5f64.sqrt()).abs() < 1e-12);
        assert!((about([0.0; 3], Vector3::y()) - 1.25f64.sqrt()).abs() < 1e-12);
        assert!((about([1.0, 2.0, 9.0], Vector3::z()) - 20f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_part_has_the_same_shape_wherever_it_stands() {
        let ball = healed(ball(3));
        let content = |by: f64| {
            let vertices = ball.vertices.iter().map(|v| v + Vector3::new(by, -by / 3.0, by * by)).collect();
            let moved = Mesh { vertices, ..ball.clone() };
            let frame = OwnFrame::as_given(&moved);
            *Shape::within(moved, &frame, &Termination::default()).unwrap().content()
        };
        let there = [0.1, 1.0 / 3.0, -2.7].map(content);
        assert_eq!(there, [content(0.0); 3]);
    }

    #[test]
    fn no_vertex_is_beyond_the_reach_or_an_axis_radius() {
        for mesh in [ball(3), l_shape()] {
            let shape = shape_of(&healed(mesh));
            let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
            let radius = shape.radius_about(&shape.mass.centre, &axis);
            for v in shape.surface.vertices() {
                let arm = v - shape.mass.centre;
                assert!(arm.norm() <= shape.reach + 1e-12 && arm.cross(&axis).norm() <= radius + 1e-9);
            }
        }
    }

    #[test]
    fn small_parts_are_sampled_closer() {
        let edge =
            |size: f64| spacing(&Bounds { min: Point3::origin(), max: Point3::new(size, 0.1, 0.1) }).edge;
        assert!(edge(0.1) < edge(2.0) && edge(2.0) < edge(10.0));
        assert_eq!((edge(1e-6), edge(100.0), edge(1e4)), (0.02, 0.1, 10.0));
    }
}
