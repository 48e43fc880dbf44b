//! A distinct mesh with all that is derived from it alone. Equal parts share one.

use nalgebra::{Point3, Vector3};

use super::hull::hull_vertices;
use super::{Bounds, MassProperties, Mesh, SampleTree, Spacing, Surface};

/// A mesh in its own frame (origin at the middle of its box, lengths of the planning frame).
#[derive(Debug, Clone)]
pub struct Shape {
    /// The triangles.
    pub surface: Surface,
    /// Vertices of the convex hull.
    pub hull: Vec<Point3<f64>>,
    /// Where contact is looked for.
    pub samples: SampleTree,
    /// Centre of mass and radius of gyration.
    pub mass: MassProperties,
    /// Largest distance of a vertex from the centre of mass.
    pub reach: f64,
}

impl Shape {
    /// Derives everything from a mesh.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let surface = Surface::new(mesh);
        let mass = surface.mass_properties();
        let reach =
            surface.vertices().iter().map(|v| (v - mass.centre).norm_squared()).fold(0.0, f64::max).sqrt();
        let samples = SampleTree::new(&surface, &spacing(surface.bounds()));
        Self { hull: hull_vertices(surface.vertices()), samples, mass, reach, surface }
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

/// Closer on small parts, so that a pin has as many samples around as a plate has along.
fn spacing(bounds: &Bounds) -> Spacing {
    let size = bounds.extents().max();
    let edge = (size / 40.0).clamp(0.02, 0.1);
    Spacing { edge, blunt_edge: edge * 3.0, face: edge * 4.0 }
}
