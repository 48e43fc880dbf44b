//! What is remembered of assemblies: what each was made of (`source`), and what healing made of that (`healed`); and how
//! the keys of all stages have poses and boxes.

mod healed;
mod source;

pub(crate) use healed::{HEALED, SHAPE, healed_assembly, remember_healed};
pub(crate) use source::{
    AssemblySource, SOURCE, has_source, recent_sources, remember_given, remember_revised, source_of,
};

use crate::cache::Digest;

use super::{Bounds, Pose};

/// Adds a pose to a key, bit by bit.
pub(crate) fn add_pose(digest: &mut Digest, pose: &Pose) {
    digest.numbers(pose.translation.vector.iter().copied()).numbers(pose.rotation.coords.iter().copied());
}

/// Adds a box to a key, bit by bit.
pub(crate) fn add_bounds(digest: &mut Digest, bounds: &Bounds) {
    digest.numbers(bounds.min.iter().chain(bounds.max.iter()).copied());
}
