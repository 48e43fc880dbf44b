//! What is likely not meant: sizes that no assembly has in its unit, and parts far from all others.

use nalgebra::Point3;

use super::units::metres;
use crate::geometry::{Bounds, SourceAssembly, SourceMesh};

/// Metres. A longer assembly is likely in another unit: a ship is not. At half, large ships are doubted.
const LONGEST: f64 = 1e3;
/// Metres. A shorter one likewise: the smallest gear trains are a tenth of a millimetre long. At double, these are doubted.
const SHORTEST: f64 = 2e-5;
/// How many times the longest side of the largest part a part may be from the nearest other one. Parts of one assembly
/// touch or nearly do; drawings of exploded views keep parts within a few sides. At half, such views are doubted.
const FARTHEST: f64 = 10.0;

/// Doubts about an assembly as it was read, in sentences.
pub(super) fn doubts(assembly: &SourceAssembly) -> Vec<String> {
    let bounds: Vec<Bounds> = assembly.parts.iter().map(|part| bounds(&part.mesh)).collect();
    let longest = bounds.iter().fold(Bounds::EMPTY, |all, b| all.union(b)).extents().max();
    let largest = bounds.iter().map(|b| b.extents().max()).fold(0.0, f64::max);
    let mut doubts = Vec::new();
    doubts.extend(size(longest, assembly.units.as_deref()));
    for (number, part) in assembly.parts.iter().enumerate() {
        let mut nearest = f64::INFINITY;
        // Most parts are near most others: the first one settles it.
        for (_, other) in bounds.iter().enumerate().filter(|(other, _)| *other != number) {
            nearest = nearest.min(gap(&bounds[number], other));
            if nearest <= FARTHEST * largest {
                break;
            }
        }
        if nearest.is_finite() && nearest > FARTHEST * largest {
            let times = nearest / largest;
            let advice = "check where it stands, and in which unit";
            doubts.push(format!(
                "`{}` is {times:.0} times as far from all other parts as the largest part is long: {advice}",
                part.name
            ));
        }
    }
    doubts
}

fn size(longest: f64, units: Option<&str>) -> Option<String> {
    // Without a unit, most files are in millimetres; the doubt says so.
    let (unit, metres) = match units {
        Some(unit) => (unit, metres(unit)?),
        None => ("mm (no unit is given)", 1e-3),
    };
    let length = longest * metres;
    let is_odd = longest.is_finite() && longest > 0.0 && !(SHORTEST..=LONGEST).contains(&length);
    is_odd.then(|| {
        format!("the assembly is {length:.1e} m long if its unit is {unit}: check the unit (`units`)")
    })
}

/// The box of the vertices that triangles use.
fn bounds(mesh: &SourceMesh) -> Bounds {
    let used = mesh.triangles.iter().flatten().filter_map(|&v| mesh.vertices.get(v as usize));
    used.fold(Bounds::EMPTY, |bounds, v| bounds.with_point(&Point3::from(*v)))
}

/// How far two boxes are apart along the axis that separates them most.
fn gap(a: &Bounds, b: &Bounds) -> f64 {
    (0..3).map(|i| (a.min[i] - b.max[i]).max(b.min[i] - a.max[i])).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::cuboid;
    use crate::geometry::SourcePart;

    fn assembly(units: Option<&str>, boxes: &[(f64, f64)]) -> SourceAssembly {
        let part = |(i, &(at, size)): (usize, &(f64, f64))| SourcePart {
            name: format!("{i}"),
            origin: String::new(),
            mesh: cuboid([at; 3], [at + size; 3]),
        };
        let parts = boxes.iter().enumerate().map(part).collect();
        SourceAssembly { units: units.map(str::to_owned), parts, ..SourceAssembly::default() }
    }

    #[test]
    fn sizes_and_places_that_no_assembly_has_are_doubted() {
        let usual = [(0.0, 10.0), (10.0, 5.0)];
        for (units, boxes, expected) in [
            (Some("mm"), &usual[..], None),
            (None, &usual[..], None),
            (Some("furlong"), &usual[..], None),
            (Some("m"), &[(0.0, 600e3)][..], Some("6.0e5 m long if its unit is m")),
            (None, &[(0.0, 1e-3)][..], Some("no unit is given")),
            (Some("mm"), &[(0.0, 1.0), (1.0, 1.0), (1000.0, 1.0)][..], Some("`2` is 998 times")),
        ] {
            let found = doubts(&assembly(units, boxes)).join("; ");
            assert_eq!(found.is_empty(), expected.is_none(), "{found}");
            assert!(found.contains(expected.unwrap_or_default()), "{found}");
        }
    }
}
