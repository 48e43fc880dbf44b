//! What must hold of a mesh as given before anything can be done with it.

use nalgebra::{Point3, Vector3};

use super::{Draft, Findings, RELATIVE_TOLERANCE};
use crate::geometry::incidence::Sides;
use crate::geometry::{SourceMesh, mesh};

/// Products of three lengths must stay finite and normal.
const GREATEST_COORDINATE: f64 = 1e90;
const LEAST_EXTENT: f64 = 1e-90;

/// The mesh without unused vertices.
pub(super) fn usable(source: &SourceMesh, findings: &mut Findings) -> Result<Draft, String> {
    if source.vertices.is_empty() {
        return Err("it has no vertices; export the part again".into());
    }
    if source.triangles.is_empty() {
        return Err("it has no triangles; export the part as a triangle mesh".into());
    }
    if source.triangles.len() > Sides::MOST_TRIANGLES {
        return Err(format!("it has more than {} triangles; simplify it", Sides::MOST_TRIANGLES));
    }
    let (vertices, triangles) = used_vertices(source)?;
    findings.add(source.vertices.len() - vertices.len(), "vertex", "that no triangle uses dropped");
    let size = extent(&vertices);
    check_volume(&vertices, size)?;
    Ok(Draft { vertices, triangles, tolerance: size * RELATIVE_TOLERANCE })
}

type Indexed = (Vec<Point3<f64>>, Vec<[u32; 3]>);

fn used_vertices(source: &SourceMesh) -> Result<Indexed, String> {
    let mut renamed = vec![u32::MAX; source.vertices.len()];
    let mut vertices = Vec::with_capacity(source.vertices.len());
    let mut triangles = source.triangles.clone();
    for (number, triangle) in triangles.iter_mut().enumerate() {
        for corner in triangle {
            let old = *corner as usize;
            let Some(new) = renamed.get_mut(old) else {
                let count = source.vertices.len();
                return Err(format!(
                    "triangle {number} uses vertex {old}, but there are {count} (counted from 0); export the part again"
                ));
            };
            if *new == u32::MAX {
                *new = vertices.len() as u32;
                vertices.push(checked(old, source.vertices[old])?);
            }
            *corner = *new;
        }
    }
    Ok((vertices, triangles))
}

fn checked(index: usize, [x, y, z]: [f64; 3]) -> Result<Point3<f64>, String> {
    if ![x, y, z].iter().all(|c| c.is_finite()) {
        return Err(format!("vertex {index} is not finite ({x}, {y}, {z}); export the part again"));
    }
    if [x, y, z].iter().any(|c| c.abs() > GREATEST_COORDINATE) {
        return Err(format!("vertex {index} lies beyond 1e90 ({x}, {y}, {z}); choose a larger unit"));
    }
    // Adding zero makes −0 into 0, so that equal coordinates have equal bits.
    Ok(Point3::new(x + 0.0, y + 0.0, z + 0.0))
}

fn extent(vertices: &[Point3<f64>]) -> f64 {
    let (lo, hi) = mesh::bounds(vertices);
    (hi - lo).amax()
}

/// Points that all lie in one plane bound no volume.
fn check_volume(vertices: &[Point3<f64>], size: f64) -> Result<(), String> {
    let flat = |what: &str| Err(format!("no volume: all its points lie {what}; export the part as a solid"));
    if size < LEAST_EXTENT {
        return flat("in one place");
    }
    let least = size * RELATIVE_TOLERANCE;
    let Some(a) = vertices.first() else { return flat("in one place") };
    let (_, along) = farthest(vertices, |p| (p - a).norm());
    let direction = (along - a).try_normalize(0.0).unwrap_or_else(Vector3::x);
    let (off_line, aside) = farthest(vertices, |p| (p - a).cross(&direction).norm());
    if off_line <= least {
        return flat("on one line");
    }
    let normal = direction.cross(&(aside - a)).try_normalize(0.0).unwrap_or_else(Vector3::x);
    let (off_plane, _) = farthest(vertices, |p| (p - a).dot(&normal).abs());
    if off_plane <= least { flat("in one plane") } else { Ok(()) }
}

fn farthest(vertices: &[Point3<f64>], measure: impl Fn(&Point3<f64>) -> f64) -> (f64, Point3<f64>) {
    vertices
        .iter()
        .map(|p| (measure(p), *p))
        .fold((-1.0, Point3::origin()), |best, next| if next.0 > best.0 { next } else { best })
}
