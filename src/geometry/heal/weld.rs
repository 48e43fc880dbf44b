//! Welding: vertices in the same place become one.

use std::hash::BuildHasher;

use hashbrown::hash_table::Entry;
use hashbrown::{DefaultHashBuilder, HashMap, HashTable};
use nalgebra::{Point3, Vector3};

use super::Findings;
use crate::geometry::mesh;

/// Sides of cells in which near vertices are looked for, in tolerances. At half, twice as many cells are looked at for
/// each vertex; at double, eight times as many vertices may have to be looked at in one.
const CELL: f64 = 8.0;

/// Triangles with vertices merged that are no farther apart than `tolerance` (0: equal coordinates only). Each vertex
/// goes to the first before it that is near enough, so chains of close vertices do not collapse.
pub(super) fn weld(
    vertices: &[Point3<f64>],
    triangles: &[[u32; 3]],
    tolerance: f64,
    findings: &mut Findings,
) -> Vec<[u32; 3]> {
    let target = if tolerance == 0.0 { same_places(vertices) } else { near(vertices, tolerance) };
    let merged = target.iter().enumerate().filter(|(i, t)| *i != **t as usize).count();
    findings.add(merged, "duplicate vertex", "merged");
    triangles.iter().map(|t| t.map(|v| target[v as usize])).collect()
}

/// For each vertex the first with equal coordinates.
pub(crate) fn same_places<P: Copy + Into<[f64; 3]>>(vertices: &[P]) -> Vec<u32> {
    // Adding zero makes one zero of both.
    let bits = |v: u32| vertices[v as usize].into().map(|c: f64| (c + 0.0).to_bits());
    // Seeded at random: no file can have coordinates that collide.
    let hasher = DefaultHashBuilder::default();
    let hash = |v: &u32| hasher.hash_one(bits(*v));
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
    let cell = |p: Point3<f64>| (p - lo).map(|c| (c / (CELL * tolerance)).floor() as i64);
    // What is nearer than the tolerance, and what rounding makes of that.
    let reach = Vector3::repeat(tolerance * 1.01);
    // The last vertex that was kept in a cell, and for each kept one the one before it.
    let mut last: HashMap<[i64; 3], u32> = HashMap::with_capacity(vertices.len());
    let mut before = vec![u32::MAX; vertices.len()];
    let mut target = Vec::with_capacity(vertices.len());
    for (index, p) in (0u32..).zip(vertices) {
        let (from, to) = (cell(p - reach), cell(p + reach));
        let mut found = u32::MAX;
        for x in from.x..=to.x {
            for y in from.y..=to.y {
                for z in from.z..=to.z {
                    let mut kept = last.get(&[x, y, z]).copied().unwrap_or(u32::MAX);
                    while let Some(other) = vertices.get(kept as usize) {
                        if (other - p).norm() <= tolerance {
                            found = found.min(kept);
                        }
                        kept = before[kept as usize];
                    }
                }
            }
        }
        if found == u32::MAX {
            before[index as usize] = last.insert(cell(*p).into(), index).unwrap_or(u32::MAX);
            found = index;
        }
        target.push(found);
    }
    target
}
