//! The bricks of a field's file, checked one by one when they are first looked at.

use std::mem::offset_of;
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::nodes::{FAR_NODE, Nodes};
use crate::cache::Mapping;

/// Marks a brick of which the file has no nodes.
pub(super) const NOT_STORED: u32 = u32::MAX;

pub(super) type Checksum = [u8; 16];

/// Where the bricks of a file and their checksums are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bricks {
    pub(super) filled: u32,
    /// The number of triangles that nodes may name.
    pub(super) triangles: u32,
    pub(super) checksums_at: usize,
    pub(super) at: usize,
}

impl Bricks {
    /// Where the file ends.
    pub(super) fn end(&self) -> usize {
        self.at + self.filled as usize * size_of::<Nodes>()
    }

    #[inline]
    pub(super) fn bytes<'f>(&self, file: &'f [u8], stored: u32) -> &'f [u8] {
        let at = self.at + stored as usize * size_of::<Nodes>();
        &file[at..at + size_of::<Nodes>()]
    }

    /// Whether a brick is as it was written, and names triangles that there are.
    pub(super) fn is_intact(&self, file: &[u8], stored: u32) -> bool {
        let at = self.checksums_at + stored as usize * size_of::<Checksum>();
        let bytes = self.bytes(file, stored);
        let (_, nearest) = bytes.split_at(offset_of!(Nodes, nearest));
        let (nearest, _) = nearest.as_chunks();
        let known = |&t: &[u8; 4]| matches!(u32::from_le_bytes(t), t if t < self.triangles || t == FAR_NODE);
        file[at..at + size_of::<Checksum>()] == checksum([bytes]) && nearest.iter().all(known)
    }
}

/// A file of which the header and the tables were checked.
#[derive(Debug)]
pub(super) struct StoredBricks {
    mapping: Mapping,
    bricks: Bricks,
    /// Whether a damaged brick was found.
    damaged: AtomicBool,
}

impl StoredBricks {
    pub(super) fn new(mapping: Mapping, bricks: Bricks) -> Self {
        Self { mapping, bricks, damaged: AtomicBool::new(false) }
    }

    fn is_intact(&self, stored: u32) -> bool {
        let intact = self.bricks.is_intact(&self.mapping, stored);
        // Reported once: the file is replaced as a whole.
        if !intact && !self.damaged.swap(true, Ordering::Relaxed) {
            self.mapping.is_damaged();
        }
        intact
    }

    /// Whether a damaged brick was found.
    pub(super) fn is_damaged(&self) -> bool {
        self.damaged.load(Ordering::Relaxed)
    }

    /// Bricks in the file.
    pub(super) fn count(&self) -> usize {
        self.bricks.filled as usize
    }
}

/// A brick of a file, checked.
#[derive(Debug)]
pub(super) struct StoredNodes {
    file: Arc<StoredBricks>,
    stored: u32,
}

impl StoredNodes {
    /// The brick at a place in a file, if it is there and as it was written.
    pub(super) fn of(file: &Arc<StoredBricks>, stored: u32) -> Option<Self> {
        let there = stored != NOT_STORED && file.is_intact(stored);
        there.then(|| Self { file: Arc::clone(file), stored })
    }
}

impl Deref for StoredNodes {
    type Target = Nodes;

    #[inline]
    fn deref(&self) -> &Nodes {
        let StoredBricks { mapping, bricks, .. } = &*self.file;
        bytemuck::from_bytes(bricks.bytes(mapping, self.stored))
    }
}

pub(super) fn checksum<'b>(pieces: impl IntoIterator<Item = &'b [u8]>) -> Checksum {
    let mut hasher = blake3::Hasher::new();
    for piece in pieces {
        hasher.update(piece);
    }
    let mut sum = [0; 16];
    sum.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    sum
}
