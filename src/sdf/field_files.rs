//! Distance fields in a cache: a file for each, as `FORMAT.md` draws it. A field depends on its shape alone. Its file is
//! mapped when the field is first needed, and written again when enough bricks were filled that are not in it.

use std::io::{self, Write};
use std::sync::Arc;

use super::{Field, FieldStore, Grid, is_intact};
use crate::cache::{Cache, Digest, FileSource, RecordKey, RecordKind, Storage, Validity};
use crate::geometry::Surface;

/// The distance field of a shape.
pub(crate) static FIELD: RecordKind = RecordKind {
    number: 14,
    name: "field",
    storage: Storage::Files { folder: "fields", extension: "sdf" },
    validity: Validity::Sources(env!("SBDP_SOURCES_SDF")),
    is_content: is_intact,
};

impl FieldStore for Cache {
    fn field(&self, surface: &Arc<Surface>, content: &[u8; 32]) -> Option<Grid> {
        let key = key(content);
        self.mapped(&key, |mapping| Grid::stored(surface, key.hash(), mapping))
    }
}

impl FileSource for Field {
    fn memory(&self) -> usize {
        Self::memory(self)
    }

    fn is_unwritten(&self) -> bool {
        self.unwritten() > 0
    }

    fn write(&self, hash: &[u8; 32], mut out: &mut dyn Write) -> io::Result<usize> {
        Self::write(self, hash, &mut out)
    }

    fn is_written(&self, filled: usize) {
        Self::is_written(self, filled);
    }
}

/// Writes the field of a shape with some content, if it was built and enough of it is in no file yet. The field counts
/// as used.
pub(crate) fn keep_field(cache: &Cache, content: &[u8; 32], field: &Arc<Field>) {
    if field.is_built() {
        cache.keep_file(key(content), Arc::<Field>::clone(field), field.is_worth_writing());
    }
}

/// The same at the end, when a little is enough: waits until there is room for it.
pub(crate) fn keep_rest_of_field(cache: &Cache, content: &[u8; 32], field: &Arc<Field>) {
    cache.keep_file_at_end(key(content), Arc::<Field>::clone(field), field.unwritten() > 0);
}

fn key(content: &[u8; 32]) -> RecordKey {
    Digest::new().hash(content).key(&FIELD)
}

#[cfg(test)]
mod tests;
