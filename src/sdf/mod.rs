//! Signed distance fields: sparse bricks near the surface, conservative bounds elsewhere.
//!
//! A field is made per distinct mesh, in the shape's own frame, when it is first looked at (`field`). Its grid
//! (`grid`) is built from the surface (`build`, `far_field`) or read from a file (`file`; `field_files` keeps
//! them). The nodes of a brick are taken from the file (`stored`) or measured (`brick`; signs of open surfaces:
//! `rim`) when they are first looked at. Values are negative inside.
//! Guarantees: at nodes of the narrow band the stored distance is that of the nearest triangle
//! (exact, then rounded to f32), and that triangle's index is kept, so that an exact distance can be
//! measured against a few triangles instead of interpolated. Everywhere else a field only gives bounds
//! that never overstate the distance.

mod brick;
mod build;
mod facet;
mod far_field;
mod field;
mod field_files;
mod file;
mod grid;
mod nodes;
mod rim;
mod stored;
#[cfg(test)]
mod tests;

pub use field::{Field, FieldStore};
pub(crate) use field_files::{FIELD, keep_field, keep_rest_of_field};
pub(crate) use file::hostile::{a_field_file, read_as_field};
pub use file::is_intact;
pub use grid::{FieldEstimate, FieldSample, Grid};
