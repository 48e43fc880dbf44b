#![doc = include_str!("FORMAT.md")]

use std::io::{self, Write};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use bytemuck::{Pod, Zeroable};

use super::grid::{BrickNodes, Grid, MOST_SLOTS, NearBrick};
use super::nodes::Nodes;
use super::stored::{Bricks, Checksum, NOT_STORED, StoredBricks, checksum};
use crate::cache::Mapping;
use crate::geometry::Surface;

const MAGIC: [u8; 4] = *b"SBDF";
const VERSION: u32 = 1;
/// Bricks begin at a multiple of this.
const ALIGNMENT: usize = 64;
const CHECKSUM_AT: usize = 80;
/// The file's beginning, in the order of `FORMAT.md`.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 4],
    version: u32,
    key: [u8; 32],
    cell: f64,
    dims: [u32; 3],
    triangles: u32,
    near: u32,
    pairs: u32,
    filled: u32,
    open: u32,
    checksum: Checksum,
}

const HEADER: usize = size_of::<Header>();
const _: () = assert!(HEADER == CHECKSUM_AT + size_of::<Checksum>(), "as FORMAT.md draws it");
const _: () = assert!(cfg!(target_endian = "little"), "bricks are used as they lie in the file");

/// A brick that the band touches.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct NearEntry {
    brick: u32,
    triangles_end: u32,
    stored: u32,
}

/// A file whose header and tables are as they were written.
struct Tables<'f> {
    header: Header,
    far: &'f [u8],
    near: &'f [u8],
    pairs: &'f [u8],
    insides: &'f [u8],
    bricks: Bricks,
}

impl<'f> Tables<'f> {
    /// `None` where anything is not as `FORMAT.md` says, bricks aside.
    fn of(bytes: &'f [u8], key: &[u8; 32]) -> Option<Self> {
        let file = Self::laid_out(bytes)?;
        let Header { magic, version, key: theirs, .. } = file.header;
        let Range { start, end } = file.padding();
        let ours = magic == MAGIC && version == VERSION && theirs == *key;
        let intact = bytes.len() == file.bricks.end()
            && bytes[start..end].iter().all(|&b| b == 0)
            && file.header.checksum == checksum([&bytes[..CHECKSUM_AT], &bytes[HEADER..start]]);
        (ours && intact).then_some(file)
    }

    /// Where tables are, going by what a header says; `None` if they are not all there.
    fn laid_out(bytes: &'f [u8]) -> Option<Self> {
        let header: Header = bytemuck::pod_read_unaligned(bytes.get(..HEADER)?);
        let Header { dims, triangles, near, pairs, filled, open, .. } = header;
        let slots = dims.iter().try_fold(1, |n: usize, &d| n.checked_mul(d as usize))?;
        if slots > MOST_SLOTS || open > 1 {
            return None;
        }
        let mut end = HEADER;
        // Counts have 32 bits: no sum or product of them overflows.
        let mut table = |count: usize, size: usize| {
            let from = end;
            end += count * size;
            bytes.get(from..end)
        };
        let far = table(slots, size_of::<f32>())?;
        let near = table(near as usize, size_of::<NearEntry>())?;
        let pairs = table(pairs as usize, size_of::<u32>())?;
        let checksums = table(filled as usize, size_of::<Checksum>())?;
        let insides = table(slots * open as usize, 1)?;
        let checksums_at = end - insides.len() - checksums.len();
        let bricks = Bricks { filled, triangles, checksums_at, at: end.next_multiple_of(ALIGNMENT) };
        (bricks.at <= bytes.len()).then_some(Self { header, far, near, pairs, insides, bricks })
    }

    /// Between the tables and the bricks.
    fn padding(&self) -> Range<usize> {
        let Bricks { filled, checksums_at, at, .. } = self.bricks;
        checksums_at + filled as usize * size_of::<Checksum>() + self.insides.len()..at
    }

    /// The triangles near all bricks, unless one is not there.
    fn triangles(&self) -> Option<Vec<u32>> {
        let pairs: Vec<u32> = bytemuck::pod_collect_to_vec(self.pairs);
        pairs.iter().all(|&t| t < self.header.triangles).then_some(pairs)
    }

    /// The bricks that the band touches, unless they are out of order or name what is not there.
    fn near(&self) -> Option<Vec<NearBrick>> {
        let Header { pairs, filled, .. } = self.header;
        let slots = (self.far.len() / size_of::<f32>()) as u32;
        let entries: Vec<NearEntry> = bytemuck::pod_collect_to_vec(self.near);
        let (mut next, mut start) = (0, 0);
        let near = entries.into_iter().map(|NearEntry { brick, triangles_end, stored }| {
            let sound = (next..slots).contains(&brick)
                && (start..=pairs).contains(&triangles_end)
                && (stored < filled || stored == NOT_STORED);
            let triangles = [std::mem::replace(&mut start, triangles_end), triangles_end];
            next = brick.saturating_add(1);
            sound.then(|| NearBrick { brick, triangles, stored, nodes: OnceLock::new() })
        });
        near.collect()
    }

    /// Per brick of the grid, if the surface is open, whether its middle is inside, where that was asked.
    fn insides(&self) -> Option<Vec<OnceLock<bool>>> {
        let inside = |known: &u8| match known {
            0 => Some(OnceLock::new()),
            1 => Some(OnceLock::from(false)),
            2 => Some(OnceLock::from(true)),
            _ => None,
        };
        self.insides.iter().map(inside).collect()
    }
}

impl Grid {
    /// The grid of a surface as a file has it; `None` if that is damaged, or another's.
    #[must_use]
    pub fn stored(surface: &Arc<Surface>, key: &[u8; 32], mapping: Mapping) -> Option<Self> {
        let Some((grid, bricks)) = Self::read(surface, key, &mapping) else {
            mapping.is_damaged();
            return None;
        };
        Some(Self { file: Some(Arc::new(StoredBricks::new(mapping, bricks))), ..grid })
    }

    fn read(surface: &Arc<Surface>, key: &[u8; 32], bytes: &[u8]) -> Option<(Self, Bricks)> {
        let file = Tables::of(bytes, key)?;
        let Header { cell, dims, triangles, open, .. } = file.header;
        // Otherwise the sizes of the grid would overflow.
        if !(cell.is_normal() && surface.bounds().extents().max() < cell * MOST_SLOTS as f64) {
            return None;
        }
        let mut grid = Self::empty(surface, cell)?;
        let same = grid.dims == dims.map(|n| n as usize)
            && triangles as usize == surface.triangles().len()
            && (open == 1) == surface.is_open();
        if !same {
            return None;
        }
        grid.far = bytemuck::pod_collect_to_vec(file.far);
        grid.far_inside = file.insides()?;
        grid.triangles = file.triangles()?;
        grid.near = file.near()?;
        for (slot, near) in grid.near.iter().enumerate() {
            grid.slots[near.brick as usize] = slot as u32;
        }
        Some((grid, file.bricks))
    }

    /// Writes the grid and the bricks that were filled.
    pub(super) fn write(&self, key: &[u8; 32], out: &mut impl Write) -> io::Result<()> {
        // Bricks that are measured from now on go into a later file.
        let known: Vec<Option<&Nodes>> = self.near.iter().map(|near| self.known(near)).collect();
        let mut filled = 0;
        let entry = |(near, known): (&NearBrick, &Option<&Nodes>)| {
            let stored = if known.is_some() { filled } else { NOT_STORED };
            filled += u32::from(known.is_some());
            NearEntry { brick: near.brick, triangles_end: near.triangles[1], stored }
        };
        let entries: Vec<NearEntry> = self.near.iter().zip(&known).map(entry).collect();
        let bricks = || known.iter().flatten().map(|nodes| bytemuck::bytes_of::<Nodes>(nodes));
        let checksums: Vec<Checksum> = bricks().map(|bytes| checksum([bytes])).collect();
        let inside = |known: &OnceLock<bool>| known.get().map_or(0, |inside| 1 + u8::from(*inside));
        let insides: Vec<u8> = self.far_inside.iter().map(inside).collect();
        let tables: [&[u8]; 5] = [
            bytemuck::cast_slice(&self.far),
            bytemuck::cast_slice(&entries),
            bytemuck::cast_slice(&self.triangles),
            bytemuck::cast_slice(&checksums),
            &insides,
        ];
        let header = self.header(key, filled, tables);
        out.write_all(bytemuck::bytes_of(&header))?;
        tables.iter().try_for_each(|table| out.write_all(table))?;
        let end = HEADER + tables.iter().map(|table| table.len()).sum::<usize>();
        out.write_all(&[0; ALIGNMENT][..end.next_multiple_of(ALIGNMENT) - end])?;
        bricks().try_for_each(|brick| out.write_all(brick))
    }

    fn header(&self, key: &[u8; 32], filled: u32, tables: [&[u8]; 5]) -> Header {
        let header = Header {
            magic: MAGIC,
            version: VERSION,
            key: *key,
            cell: self.cell,
            dims: self.dims.map(|n| n as u32),
            triangles: self.surface.triangles().len() as u32,
            near: self.near.len() as u32,
            pairs: self.triangles.len() as u32,
            filled,
            open: u32::from(self.surface.is_open()),
            checksum: [0; 16],
        };
        let head = &bytemuck::bytes_of(&header)[..CHECKSUM_AT];
        Header { checksum: checksum(std::iter::once(head).chain(tables)), ..header }
    }

    /// The nodes of a brick, if they were filled, here or before.
    fn known<'g>(&self, near: &'g NearBrick) -> Option<&'g Nodes> {
        if near.nodes.get().is_none()
            && let Some(stored) = self.in_file(near)
        {
            // Another thread that set it meanwhile found the same nodes.
            let _filled = near.nodes.set(BrickNodes::Stored(stored));
        }
        near.nodes.get().map(|held| &**held)
    }
}

/// Whether all of a file is as it was written.
#[must_use]
pub fn is_intact(key: &[u8; 32], bytes: &[u8]) -> bool {
    let Some(file) = Tables::of(bytes, key) else { return false };
    let tables = file.triangles().is_some() && file.near().is_some() && file.insides().is_some();
    tables && (0..file.bricks.filled).all(|stored| file.bricks.is_intact(bytes, stored))
}

pub(crate) mod hostile;
#[cfg(test)]
mod tests;
