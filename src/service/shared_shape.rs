//! A shape with its distance field, shared by all assemblies with that shape.

use std::sync::{Arc, Weak};

use crate::geometry::Shape;
use crate::sdf::{Field, FieldStore};

/// A shape and its field.
#[derive(Debug)]
pub(super) struct SharedShape {
    pub(super) shape: Arc<Shape>,
    pub(super) field: Arc<Field>,
}

impl SharedShape {
    /// A shape whose field is built anew.
    pub(super) fn new(shape: Arc<Shape>) -> Self {
        Self { field: Arc::new(Field::of(&shape.surface)), shape }
    }

    /// A shape whose field may be in a store.
    pub(super) fn stored(shape: Arc<Shape>, fields: Weak<dyn FieldStore>) -> Self {
        Self { field: Arc::new(Field::stored(&shape.surface, fields, *shape.content())), shape }
    }

    pub(super) fn memory(&self) -> usize {
        self.shape.memory() + self.field.memory()
    }
}
