//! Healing: from a mesh as given to one whose inside is known.
//!
//! In order: references and coordinates are checked, equal vertices welded, degenerate and
//! repeated triangles dropped, orientation made consistent, shells told apart and turned
//! outward (voids inward). What cannot be made closed keeps its gaps and is signed by winding
//! number. Lengths below [`RELATIVE_TOLERANCE`] of the part's size count as nothing.

mod box_tree;
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
pub(crate) use weld::same_places;

use super::incidence::Sides;
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
    let (mut draft, mut sides) = welded_and_clean(draft, &mut findings, termination)?;
    termination.check()?;
    let one_sided = orientation::orient(&mut draft, &mut sides, &mut findings);
    termination.check()?;
    let gaps = sides.open_edges();
    let solidity = if gaps > 0 {
        findings.add(
            gaps,
            "edge",
            "without neighbour: not closed; taken as a wall that nothing crosses, without an inside",
        );
        orientation::face_outward(&mut draft);
        Solidity::Wall
    } else {
        shells::settle(&mut draft, sides, one_sided, &mut findings, termination)?
    };
    let mesh = compact(draft, solidity);
    Ok(Healed { mesh, findings: findings.list })
}

/// A way to weld and clean a part.
struct Attempt {
    triangles: Vec<[u32; 3]>,
    sides: Sides,
    gaps: usize,
    notes: Findings,
    tolerance: f64,
}

/// Welds and cleans, coarser where that closes the part.
fn welded_and_clean(
    mut draft: Draft,
    findings: &mut Findings,
    termination: &Termination,
) -> Result<(Draft, Sides), Unhealed> {
    let size = draft.tolerance / RELATIVE_TOLERANCE;
    let given = std::mem::take(&mut draft.triangles);
    let mut last_welded = Vec::new();
    let mut attempt = |tolerance: f64| -> Result<_, Interrupt> {
        let mut notes = Findings::default();
        termination.check()?;
        draft.triangles = weld::weld(&draft.vertices, &given, tolerance, &mut notes);
        termination.check()?;
        // The same comes out of what was not welded further.
        if draft.triangles == last_welded {
            return Ok(None);
        }
        last_welded.clone_from(&draft.triangles);
        degenerate::drop_degenerate(&mut draft, &mut notes);
        termination.check()?;
        let sides = duplicate::drop_repeated(&mut draft, &mut notes);
        termination.check()?;
        let (triangles, gaps) = (std::mem::take(&mut draft.triangles), sides.open_edges());
        Ok(Some(Attempt { triangles, sides, gaps, notes, tolerance }))
    };
    // Welding by distance could only harm where equal coordinates close the part already.
    let no_triangle = || "no triangle has an area; export the part as a solid".to_owned();
    let mut best = attempt(0.0)?.ok_or_else(no_triangle)?;
    for tolerance in [RELATIVE_TOLERANCE].into_iter().chain(CLOSING_TOLERANCES) {
        if best.gaps == 0 {
            break;
        }
        let Some(other) = attempt(tolerance * size)? else { continue };
        if other.gaps == 0 || (tolerance == RELATIVE_TOLERANCE && other.gaps < best.gaps) {
            best = other;
        }
    }
    let Attempt { triangles, mut sides, gaps, mut notes, tolerance } = best;
    draft.triangles = triangles;
    if gaps > 0 {
        sides = degenerate::split_at_junctions(&mut draft, sides, tolerance, &mut notes);
    }
    findings.list.extend(notes.list);
    if draft.triangles.is_empty() {
        return Err(no_triangle().into());
    }
    Ok((draft, sides))
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
