//! Healing: from a mesh as given to one whose inside is known.
//!
//! In order: references and coordinates are checked, equal vertices welded, degenerate and
//! repeated triangles dropped, orientation made consistent, shells told apart and turned
//! outward (voids inward). What cannot be made closed keeps its gaps and is signed by winding
//! number. Lengths below [`RELATIVE_TOLERANCE`] of the part's size count as nothing.

mod crossing;
mod degenerate;
mod duplicate;
mod orientation;
mod shells;
mod validate;
mod weld;

#[cfg(test)]
mod tests;

use nalgebra::Point3;

pub(in crate::geometry) use shells::{components, members};

use super::incidence::open_edges;
use super::{GeometryError, Mesh, Solidity, SourcePart};
use crate::termination::{Interrupt, Termination};

/// Lengths below this share of a part's largest extent are rounding, not shape.
const RELATIVE_TOLERANCE: f64 = 1e-9;

/// Coarser weldings that are tried when they close a part that is open otherwise: single
/// precision, far from the origin or written with few digits.
const CLOSING_TOLERANCES: [f64; 2] = [1e-7, 1e-6];

/// A part made usable.
#[derive(Debug, Clone, PartialEq)]
pub struct Healed {
    /// The mesh, in the input's units and frame.
    pub mesh: Mesh,
    /// What was found and what was done about it, in plain words; empty if nothing.
    pub findings: Vec<String>,
}

/// Heals a part.
///
/// # Errors
/// Nothing of it can be used: no triangles, indices out of range, coordinates that are not
/// finite, no volume at all. The error names the file, the part and the reason.
pub fn heal(part: &SourcePart) -> Result<Healed, GeometryError> {
    heal_until(part, &Termination::default())
}

/// The same, unless the termination condition becomes true before it is done.
///
/// # Errors
/// As [`heal`], and the interruption.
pub fn heal_until(part: &SourcePart, termination: &Termination) -> Result<Healed, GeometryError> {
    heal_mesh(part, termination).map_err(|unhealed| match unhealed {
        Unhealed::Interrupted(interrupt) => GeometryError::Interrupted(interrupt),
        Unhealed::Unusable(reason) => {
            GeometryError::Part { origin: part.origin.clone(), part: part.name.clone(), reason }
        }
    })
}

/// Why there is no healed mesh.
enum Unhealed {
    Unusable(String),
    Interrupted(Interrupt),
}

impl From<String> for Unhealed {
    fn from(reason: String) -> Self {
        Self::Unusable(reason)
    }
}

impl From<Interrupt> for Unhealed {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

/// A mesh on its way through healing.
#[derive(Debug, Clone)]
struct Draft {
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    /// Lengths up to here are rounding.
    tolerance: f64,
}

fn heal_mesh(part: &SourcePart, termination: &Termination) -> Result<Healed, Unhealed> {
    let mut findings = Findings::default();
    let draft = validate::usable(&part.mesh, &mut findings)?;
    let mut draft = welded_and_clean(draft, &mut findings, termination)?;
    termination.check()?;
    let mut oriented = orientation::orient(&draft, &mut findings);
    termination.check()?;
    let gaps = open_edges(&oriented.triangles);
    draft.triangles = std::mem::take(&mut oriented.triangles);
    let solidity = if gaps > 0 {
        findings.add(
            gaps,
            "edge",
            "without neighbour: not closed; taken as a wall that nothing crosses, without an inside",
        );
        orientation::face_outward(&mut draft);
        Solidity::Wall
    } else {
        shells::settle(&mut draft, oriented.one_sided, &mut findings, termination)?
    };
    let mesh = compact(draft, solidity);
    Ok(Healed { mesh, findings: findings.list })
}

/// Welds and cleans, coarser where that closes the part.
fn welded_and_clean(
    draft: Draft,
    findings: &mut Findings,
    termination: &Termination,
) -> Result<Draft, Unhealed> {
    let size = draft.tolerance / RELATIVE_TOLERANCE;
    let attempt = |tolerance: f64| -> Result<_, Interrupt> {
        let mut notes = Findings::default();
        termination.check()?;
        let mut attempt = weld::weld(&draft, tolerance, &mut notes);
        termination.check()?;
        degenerate::drop_degenerate(&mut attempt, &mut notes);
        termination.check()?;
        duplicate::drop_repeated(&mut attempt, &mut notes);
        termination.check()?;
        Ok((open_edges(&attempt.triangles), attempt, notes, tolerance))
    };
    // Welding by distance could only harm where equal coordinates close the part already.
    let mut best = attempt(0.0)?;
    for tolerance in [RELATIVE_TOLERANCE].into_iter().chain(CLOSING_TOLERANCES) {
        if best.0 == 0 {
            break;
        }
        let other = attempt(tolerance * size)?;
        if other.0 == 0 || (tolerance == RELATIVE_TOLERANCE && other.0 < best.0) {
            best = other;
        }
    }
    let (_, mut draft, mut notes, tolerance) = best;
    degenerate::split_at_junctions(&mut draft, tolerance, &mut notes);
    findings.list.extend(notes.list);
    if draft.triangles.is_empty() {
        return Err("no triangle has an area; export the part as a solid".to_owned().into());
    }
    Ok(draft)
}

/// Drops vertices that no triangle uses.
fn compact(draft: Draft, solidity: Solidity) -> Mesh {
    let mut renamed = vec![u32::MAX; draft.vertices.len()];
    let mut mesh = Mesh { vertices: Vec::new(), triangles: draft.triangles, solidity };
    for corner in mesh.triangles.iter_mut().flatten() {
        let old = *corner as usize;
        if renamed[old] == u32::MAX {
            renamed[old] = mesh.vertices.len() as u32;
            mesh.vertices.push(draft.vertices[old]);
        }
        *corner = renamed[old];
    }
    mesh
}

/// Notes for people.
#[derive(Debug, Default)]
struct Findings {
    list: Vec<String>,
}

impl Findings {
    /// `count` things (none: nothing to say) and what about them.
    fn add(&mut self, count: usize, thing: &str, what: &str) {
        if count > 0 {
            self.list.push(format!("{count} {} {what}", plural(count, thing)));
        }
    }
}

fn plural(count: usize, thing: &str) -> String {
    match (count, thing.strip_suffix("vertex")) {
        (1, _) => thing.to_owned(),
        (_, Some(start)) => format!("{start}vertices"),
        _ => format!("{thing}s"),
    }
}
