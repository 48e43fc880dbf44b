//! An admitted assembly: healed parts in the planning frame, equal parts sharing one shape.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use super::congruence::congruence;
use super::heal::heal;
use super::{Bounds, GeometryError, Mesh, Pose, Shape, SourceAssembly};

/// A part of an assembly.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Index of its shape.
    pub shape: usize,
    /// Where the shape stands in the planning frame when assembled.
    pub planning_from_shape: Pose,
    /// Box of the assembled part in the planning frame.
    pub bounds: Bounds,
}

/// Parts in the planning frame.
#[derive(Debug, Clone)]
pub struct Assembly {
    /// A name for people.
    pub name: String,
    /// Unit of length of the input.
    pub units: Option<String>,
    /// Lengths in the planning frame are those of the input times this power of two.
    pub scale: f64,
    /// The parts, in natural order of their names.
    pub parts: Vec<Part>,
    /// The distinct shapes.
    pub shapes: Vec<Arc<Shape>>,
    /// Indices of parts that the input declares fixed.
    pub fixed: Vec<usize>,
    /// What healing found, with the part it is about.
    pub findings: Vec<(usize, String)>,
}

impl Assembly {
    /// Heals the parts and brings them into the planning frame.
    ///
    /// # Errors
    /// A part's mesh cannot be used, there is no part, or a name that is declared fixed is none.
    pub fn new(source: &SourceAssembly) -> Result<Self, GeometryError> {
        let refuse = |reason: String| GeometryError::Assembly { origin: source.name.clone(), reason };
        if source.parts.is_empty() {
            return Err(refuse("the assembly has no parts; add at least one mesh".into()));
        }
        let healed = source.parts.par_iter().map(heal).collect::<Result<Vec<_>, _>>()?;
        let mut findings = Vec::new();
        let mut meshes = Vec::new();
        for (i, h) in healed.into_iter().enumerate() {
            findings.extend(h.findings.into_iter().map(|f| (i, f)));
            meshes.push(h.mesh);
        }
        let scale = planning_scale(&meshes);
        for vertex in meshes.iter_mut().flat_map(|m| &mut m.vertices) {
            *vertex *= scale;
        }
        findings.extend(odd_sizes(&meshes));
        let names: Vec<_> = source.parts.iter().map(|p| p.name.clone()).collect();
        let (shapes, parts) = share_shapes(meshes, names);
        let fixed = source
            .fixed
            .iter()
            .map(|name| {
                parts
                    .iter()
                    .position(|p| &p.name == name)
                    .ok_or_else(|| refuse(format!("`fixed` names part `{name}`, which does not exist")))
            })
            .collect::<Result<_, _>>()?;
        let (name, units) = (source.name.clone(), source.units.clone());
        Ok(Self { name, units, scale, parts, shapes, fixed, findings })
    }

    /// The shape of a part.
    #[must_use]
    pub fn shape(&self, part: usize) -> &Arc<Shape> {
        &self.shapes[self.parts[part].shape]
    }

    /// The middle of the assembled part's box, in the planning frame: the point that moves on a
    /// line between waypoints.
    #[must_use]
    pub fn centre(&self, part: usize) -> Point3<f64> {
        self.parts[part].bounds.centre()
    }

    /// Longest side of the box of all parts.
    #[must_use]
    pub fn longest_side(&self) -> f64 {
        self.parts.iter().fold(Bounds::EMPTY, |b, p| b.union(&p.bounds)).extents().max()
    }
}

/// Parts so much larger than all others that their unit of length is likely another one.
fn odd_sizes(meshes: &[Mesh]) -> Option<(usize, String)> {
    const SUSPICIOUS: f64 = 100.0;
    let size = |m: &Mesh| Bounds::of(&m.vertices).extents().max();
    let mut sizes: Vec<(f64, usize)> = meshes.iter().map(size).zip(0..).collect();
    sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let [(largest, part), (next, _), ..] = sizes[..] else { return None };
    let ratio = largest / next;
    (ratio > SUSPICIOUS).then(|| {
        (
            part,
            format!(
                "{ratio:.0} times as large as the next largest part: check that all parts have the same unit"
            ),
        )
    })
}

/// The power of two that brings the longest side of the box of all parts into (5, 10].
fn planning_scale(meshes: &[Mesh]) -> f64 {
    let bounds = meshes.iter().fold(Bounds::EMPTY, |b, m| b.union(&Bounds::of(&m.vertices)));
    let longest = bounds.extents().max();
    let mut scale = 2f64.powf((10.0 / longest).log2().floor());
    // The logarithm may round across a power of two.
    while longest * scale > 10.0 {
        scale /= 2.0;
    }
    while longest * scale <= 5.0 {
        scale *= 2.0;
    }
    scale
}

fn share_shapes(meshes: Vec<Mesh>, names: Vec<String>) -> (Vec<Arc<Shape>>, Vec<Part>) {
    // The mesh of each shape, as its first part gave it, and the middle of its box.
    let mut originals: Vec<(usize, Point3<f64>)> = Vec::new();
    let mut parts = Vec::new();
    for (i, (mesh, name)) in meshes.iter().zip(names).enumerate() {
        let bounds = Bounds::of(&mesh.vertices);
        let copy = originals
            .iter()
            .enumerate()
            .find_map(|(k, (j, centre))| Some((k, centre, congruence(&meshes[*j], mesh)?)));
        let (shape, planning_from_shape) = match copy {
            Some((k, centre, pose)) => (k, pose * Pose::translation(centre.x, centre.y, centre.z)),
            None => {
                let c = bounds.centre();
                originals.push((i, c));
                (originals.len() - 1, Pose::translation(c.x, c.y, c.z))
            }
        };
        parts.push(Part { name, shape, planning_from_shape, bounds });
    }
    let shapes = originals
        .par_iter()
        .map(|(i, centre)| {
            let mesh = &meshes[*i];
            let vertices = mesh.vertices.iter().map(|v| v - centre.coords).collect();
            Arc::new(Shape::new(&Mesh { vertices, ..mesh.clone() }))
        })
        .collect();
    (shapes, parts)
}
