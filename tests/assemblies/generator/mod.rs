//! Generates the small assemblies. Contact faces of neighbours come from the same numbers, so
//! that they match to the digit; shafts have clearance.

mod fasteners;
mod formats;
mod grid;
mod machines;
mod shapes;
mod solid;
mod thread;

use solid::Solid;

/// An assembly: its name, what it is for, and its parts in assembled pose (in mm).
pub(crate) struct Assembly {
    name: &'static str,
    notes: &'static str,
    fixed: Option<&'static str>,
    parts: Vec<(String, Solid)>,
}

impl Assembly {
    fn new(name: &'static str, notes: &'static str) -> Self {
        Self { name, notes, fixed: None, parts: Vec::new() }
    }

    fn with(mut self, part: impl Into<String>, solid: Solid) -> Self {
        self.parts.push((part.into(), solid));
        self
    }

    /// The part that stands still.
    fn on(self, fixed: &'static str) -> Self {
        Self { fixed: Some(fixed), ..self }
    }
}

/// Every file: its path in this folder and its content.
#[must_use]
pub(crate) fn all_files() -> Vec<(String, Vec<u8>)> {
    let assemblies = [
        machines::bolt_washer_plate(),
        machines::pin_bolt_cover(),
        machines::l_slot(),
        machines::threaded_bolt_and_nut(),
        machines::linked_rings(),
        machines::bolted_bracket_20(),
        machines::pinned_block(),
        machines::covered_pin(),
    ];
    let mut files: Vec<_> = assemblies.iter().flat_map(formats::obj_folder).collect();
    files.extend(formats::translated_folder(&machines::bolt_washer_plate()));
    files.extend(formats::stl_folder());
    files.extend(formats::glb_scene());
    files
}
