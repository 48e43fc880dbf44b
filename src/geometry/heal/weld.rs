//! Welding: vertices in the same place become one.

use std::collections::HashMap;
use std::hash::BuildHasher;

use hashbrown::hash_table::Entry;
use hashbrown::{DefaultHashBuilder, HashTable};
use nalgebra::Point3;

use super::Findings;
use crate::geometry::mesh;

/// Triangles with vertices merged that are no farther apart than `tolerance` (0: equal coordinates only). Each vertex
/// goes to the first before it that is near enough, so chains of close vertices do not collapse.
pub(super) fn weld(
    vertices: &[Point3<f64>],
    triangles: &[[u32; 3]],
    tolerance: f64,
    findings: &mut Findings,
) -> Vec<[u32; 3]> {
    let target = if tolerance == 0.0 { exact(vertices) } else { near(vertices, tolerance) };
    let merged = target.iter().enumerate().filter(|(i, t)| *i != **t as usize).count();
    findings.add(merged, "duplicate vertex", "merged");
    triangles.iter().map(|t| t.map(|v| target[v as usize])).collect()
}

fn exact(vertices: &[Point3<f64>]) -> Vec<u32> {
    let bits = |v: u32| vertices[v as usize].coords.map(f64::to_bits);
    // Seeded at random: no file can have coordinates that collide.
    let hasher = DefaultHashBuilder::default();
    let hash = |v: &u32| hasher.hash_one(<[u64; 3]>::from(bits(*v)));
    // Numbers alone: a table of coordinates would be several times as large as the mesh.
    let mut first: HashTable<u32> = HashTable::with_capacity(vertices.len());
    let place = |v: u32| match first.entry(hash(&v), |other| bits(*other) == bits(v), hash) {
        Entry::Occupied(known) => *known.get(),
        Entry::Vacant(place) => *place.insert(v).get(),
    };
    (0..vertices.len() as u32).map(place).collect()
}

fn near(vertices: &[Point3<f64>], tolerance: f64) -> Vec<u32> {
    let (lo, _) = mesh::bounds(vertices);
    let cell = |p: &Point3<f64>| (p - lo).map(|c| (c / (2.0 * tolerance)) as i64);
    let mut kept: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(vertices.len());
    let mut target = Vec::with_capacity(vertices.len());
    for (index, p) in (0u32..).zip(vertices) {
        let home = cell(p);
        let close = |i: &u32| (vertices[*i as usize] - p).norm() <= tolerance;
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
