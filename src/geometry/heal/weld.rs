//! Welding: vertices in the same place become one.

use std::collections::HashMap;

use nalgebra::Point3;

use super::{Draft, Findings};
use crate::geometry::mesh;

/// Merges vertices no farther apart than `tolerance` (0: equal coordinates only). Each goes
/// to the first before it that is near enough, so chains of close vertices do not collapse.
pub(super) fn weld(draft: &Draft, tolerance: f64, findings: &mut Findings) -> Draft {
    let target = if tolerance == 0.0 { exact(draft) } else { near(draft, tolerance) };
    let merged = target.iter().enumerate().filter(|(i, t)| *i != **t as usize).count();
    findings.add(merged, "duplicate vertex", "merged");
    let triangles = draft.triangles.iter().map(|t| t.map(|v| target[v as usize])).collect();
    Draft { vertices: draft.vertices.clone(), triangles, tolerance: draft.tolerance }
}

fn exact(draft: &Draft) -> Vec<u32> {
    let mut first = HashMap::with_capacity(draft.vertices.len());
    let bits = |p: &Point3<f64>| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()];
    (0u32..).zip(&draft.vertices).map(|(i, p)| *first.entry(bits(p)).or_insert(i)).collect()
}

fn near(draft: &Draft, tolerance: f64) -> Vec<u32> {
    let (lo, _) = mesh::bounds(&draft.vertices);
    let cell = |p: &Point3<f64>| (p - lo).map(|c| (c / (2.0 * tolerance)) as i64);
    let mut kept: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(draft.vertices.len());
    let mut target = Vec::with_capacity(draft.vertices.len());
    for (index, p) in (0u32..).zip(&draft.vertices) {
        let home = cell(p);
        let close = |i: &u32| (draft.vertices[*i as usize] - p).norm() <= tolerance;
        let around = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])));
        let cells = around.filter_map(|d: [i64; 3]| kept.get(&[home.x + d[0], home.y + d[1], home.z + d[2]]));
        let found = cells.flatten().copied().filter(close).min();
        if found.is_none() {
            kept.entry([home.x, home.y, home.z]).or_default().push(index);
        }
        target.push(found.unwrap_or(index));
    }
    target
}
