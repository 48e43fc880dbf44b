//! A field that is built when it is first looked at: parts that leave straight never meet one.

use std::io::{self, Write};
use std::ops::Deref;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, Weak};

use crate::geometry::Surface;
use crate::termination::{Interrupt, Termination};

use super::build::Threads;
use super::grid::Grid;

/// A file is written again when this share of its bricks is new: so all of what is ever written for a field is
/// a few times its size.
const NEW_BRICKS: usize = 8;

/// Where fields are found that were built before this process began.
pub trait FieldStore: std::fmt::Debug + Send + Sync {
    /// The field of the surface of a shape with some content, if it is there.
    fn field(&self, surface: &Arc<Surface>, content: &[u8; 32]) -> Option<Grid>;
}

/// A distance field in its shape's frame. What it says does not depend on when and by whom it was built.
#[derive(Debug)]
pub struct Field {
    surface: Arc<Surface>,
    /// Where it may be found, and the content of the shape. It does not keep the store: that has fields that
    /// wait to be written.
    store: Option<(Weak<dyn FieldStore>, [u8; 32])>,
    grid: OnceLock<Grid>,
    /// How many of the bricks that this process measured are in a file.
    written: AtomicUsize,
}

impl Field {
    /// The field of a surface, to be built when it is first looked at.
    #[must_use]
    pub fn of(surface: &Arc<Surface>) -> Self {
        Self::new(surface, None)
    }

    /// The same, unless it is found in a store then, by the content of its shape.
    #[must_use]
    pub fn stored(surface: &Arc<Surface>, store: Weak<dyn FieldStore>, content: [u8; 32]) -> Self {
        Self::new(surface, Some((store, content)))
    }

    fn new(surface: &Arc<Surface>, store: Option<(Weak<dyn FieldStore>, [u8; 32])>) -> Self {
        Self { surface: Arc::clone(surface), store, grid: OnceLock::new(), written: AtomicUsize::new(0) }
    }

    /// The field of a surface, built.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn build(surface: &Arc<Surface>, termination: &Termination) -> Result<Self, Interrupt> {
        let field = Self::of(surface);
        field.prepare(termination)?;
        Ok(field)
    }

    /// Builds the field, unless it is there, in parallel on the current rayon pool.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn prepare(&self, termination: &Termination) -> Result<(), Interrupt> {
        self.built(Threads::All, termination).map(|_| ())
    }

    /// Builds the field, unless it is there, on this thread alone: one that waited for others would begin with
    /// their work, and come back to its own only at the end of that.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn prepare_here(&self, termination: &Termination) -> Result<(), Interrupt> {
        self.built(Threads::This, termination).map(|_| ())
    }

    /// Two that ask at the same time may both build it: neither waits for the other.
    fn built(&self, threads: Threads, termination: &Termination) -> Result<&Grid, Interrupt> {
        if let Some(grid) = self.grid.get() {
            return Ok(grid);
        }
        let grid = match self.found() {
            Some(grid) => grid,
            None => Grid::build(&self.surface, threads, termination)?,
        };
        Ok(self.grid.get_or_init(|| grid))
    }

    fn found(&self) -> Option<Grid> {
        let (store, content) = self.store.as_ref()?;
        store.upgrade()?.field(&self.surface, content)
    }

    /// Whether it was built.
    #[must_use]
    pub fn is_built(&self) -> bool {
        self.grid.get().is_some()
    }

    /// Bytes in memory, of what was looked at so far; what is mapped is not counted.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.grid.get().map_or(0, Grid::memory)
    }

    /// Bricks that are in no file.
    #[must_use]
    pub fn unwritten(&self) -> usize {
        let filled = self.grid.get().map_or(0, Grid::filled);
        filled.saturating_sub(self.written.load(Ordering::Relaxed))
    }

    /// Whether a new file is due: enough bricks are in no file, or the file is damaged.
    #[must_use]
    pub fn is_worth_writing(&self) -> bool {
        let Some(grid) = self.grid.get() else { return false };
        let (unwritten, (stored, damaged)) = (self.unwritten(), grid.in_its_file());
        let written = stored + self.written.load(Ordering::Relaxed);
        unwritten > 0 && (damaged || unwritten * NEW_BRICKS >= written)
    }

    /// Writes the grid with its measured bricks, under the hash of all that they depend on; the number of bricks that
    /// this process measured. [`Field::is_written`] must be called when the file has its name.
    ///
    /// # Errors
    /// The system refused; or it is not built.
    pub fn write(&self, key: &[u8; 32], out: &mut impl Write) -> io::Result<usize> {
        let grid = self.grid.get().ok_or_else(|| io::Error::other("a field that is not built"))?;
        let filled = grid.filled();
        grid.write(key, out)?;
        Ok(filled)
    }

    /// Records that `filled` of the bricks that this process measured are in a file now.
    pub fn is_written(&self, filled: usize) {
        self.written.fetch_max(filled, Ordering::Relaxed);
    }
}

/// The first use builds the grid, if it was not prepared before, and waits until it is built.
impl Deref for Field {
    type Target = Grid;

    #[inline]
    fn deref(&self) -> &Grid {
        if let Some(grid) = self.grid.get() {
            return grid;
        }
        self.built(Threads::This, &Termination::default()).unwrap_or_else(|_| unreachable!("nothing ends it"))
    }
}
