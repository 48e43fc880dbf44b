//! Any bytes as a field's file, for fuzzing.

use std::sync::Arc;

use nalgebra::Point3;

use super::{Bricks, CHECKSUM_AT, Checksum, Grid, HEADER, Range, Tables, checksum};
use crate::cache::Mapping;
use crate::geometry::Surface;
use crate::sdf::Field;

const KEY: [u8; 32] = [0; 32];

/// Places across the box of a surface of unit size, and beyond.
fn places() -> impl Iterator<Item = Point3<f64>> {
    (0..64).map(|i| Point3::from([i & 3, i >> 2 & 3, i >> 4].map(|n| 0.45 * f64::from(n) - 0.2)))
}

/// Reads bytes as the file of a surface's field: as they are, and with the checksums that they should have,
/// which a stranger can compute and no chance finds. What was read, in words.
pub(crate) fn read_as_field(surface: &Arc<Surface>, bytes: &[u8]) -> String {
    format!("{}; mended: {}", read(surface, bytes), read(surface, &mended(bytes)))
}

/// The file of a surface's field as it should be, with some of its bricks.
pub(crate) fn a_field_file(surface: &Arc<Surface>) -> Vec<u8> {
    let field = Field::of(surface);
    let _told: Vec<_> = places().step_by(11).map(|place| field.estimate(&place)).collect();
    let mut bytes = Vec::new();
    // Memory takes all that is written, and the field is built.
    let _filled = field.write(&KEY, &mut bytes);
    bytes
}

fn read(surface: &Arc<Surface>, bytes: &[u8]) -> String {
    let intact = super::is_intact(&KEY, bytes);
    let Ok(mapping) = Mapping::of_copy(bytes) else { return "no bytes".to_owned() };
    let Some(grid) = Grid::stored(surface, &KEY, mapping) else { return "refused".to_owned() };
    let told = |p: &Point3<f64>| {
        let inside = grid.sample(p).value < 0.0 || grid.estimate(p).value < 0.0;
        u32::from(inside) + grid.likely_nearest(p).map_or(0, |triangle| 1 + triangle)
    };
    let told: u32 = places().map(|p| told(&p)).sum();
    let (stored, damaged) = grid.in_its_file();
    let of = if damaged { "damaged bricks" } else { "bricks" };
    format!(
        "{of}, {}: {stored} and {} more say {told}",
        if intact { "intact" } else { "not all" },
        grid.filled()
    )
}

/// The same with right checksums, as far as what they are of is there.
fn mended(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let Some(file) = Tables::laid_out(&bytes) else { return bytes };
    let (bricks, Range { start: end, .. }) = (file.bricks, file.padding());
    let Bricks { filled, checksums_at, .. } = bricks;
    for stored in 0..if bricks.end() <= bytes.len() { filled } else { 0 } {
        let sum = checksum([bricks.bytes(&bytes, stored)]);
        let at = checksums_at + stored as usize * size_of::<Checksum>();
        bytes[at..at + sum.len()].copy_from_slice(&sum);
    }
    let sum = checksum([&bytes[..CHECKSUM_AT], &bytes[HEADER..end]]);
    bytes[CHECKSUM_AT..HEADER].copy_from_slice(&sum);
    bytes
}
