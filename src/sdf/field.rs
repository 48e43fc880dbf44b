//! A field that is built when it is first looked at: parts that leave straight never meet one.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::geometry::Surface;
use crate::termination::{Interrupt, Termination};

use super::build::Threads;
use super::grid::Grid;

/// A distance field in its shape's frame. What it says does not depend on when and by whom it was built.
#[derive(Debug, Clone)]
pub struct Field {
    surface: Arc<Surface>,
    grid: OnceLock<Grid>,
}

impl Field {
    /// The field of a surface, to be built when it is first looked at.
    #[must_use]
    pub fn of(surface: &Arc<Surface>) -> Self {
        Self { surface: Arc::clone(surface), grid: OnceLock::new() }
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
        self.built(Threads::All, termination)
    }

    /// Builds the field, unless it is there, on this thread alone: one that waited for others would begin with
    /// their work, and come back to its own only at the end of that.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn prepare_here(&self, termination: &Termination) -> Result<(), Interrupt> {
        self.built(Threads::This, termination)
    }

    /// Two that ask at the same time may both build it: neither waits for the other.
    fn built(&self, threads: Threads, termination: &Termination) -> Result<(), Interrupt> {
        if self.grid.get().is_none() {
            let grid = Grid::build(&self.surface, threads, termination)?;
            self.grid.get_or_init(|| grid);
        }
        Ok(())
    }

    /// Whether it was built.
    #[must_use]
    pub fn is_built(&self) -> bool {
        self.grid.get().is_some()
    }

    /// Bytes in memory, of what was looked at so far.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.grid.get().map_or(0, Grid::memory)
    }
}

/// Looking at it builds it: whoever did not make it ready waits for that, as long as it takes.
impl Deref for Field {
    type Target = Grid;

    #[inline]
    fn deref(&self) -> &Grid {
        self.grid.get_or_init(|| {
            let never = Termination::default();
            Grid::build(&self.surface, Threads::This, &never)
                .unwrap_or_else(|_| unreachable!("nothing ends it"))
        })
    }
}
