//! Plans for people: in motion as a GLB scene or a page, in words, and blocking graphs as pictures.
//!
//! Data flow: a plan's JSON ([`read_plan`]) and the assembly that it is about → [`PlanScene`], parts with meshes
//! and a timeline → [`glb`] or [`page`]. [`steps`] tells the plan alone in words; [`picture`] draws
//! blocking graphs, which [`layout`] arranges. No planning module depends on anything here.
//!
//! Frames: a scene is in the input's units and frame. Every part has a *node frame*, whose origin is the
//! middle of the part's box: that point moves on a line between waypoints of a plan, and the rotation slerps,
//! which is what glTF does between key frames.

mod arrow;
mod colour;
mod document;
mod equal_parts;
mod explode;
pub mod glb;
mod handling;
mod illustration;
pub mod instructions;
pub mod layout;
mod moves;
pub mod page;
pub mod picture;
mod quotient;
mod raster;
mod scene;
mod shading;
pub mod sheet;
pub mod steps;
mod verdict;
mod viewpoint;
mod words;

pub use colour::{PALETTE, Rgb};
pub use document::read_plan;
pub(crate) use equal_parts::equal_parts;
pub(crate) use handling::tool_name;
pub use illustration::{Illustration, illustrations};
pub use instructions::{Instruction, Instructions};
pub use scene::{DrawnPart, Keyframe, Placement, PlanScene, SceneGroup, ScenePart, SceneStep, Up};
pub(crate) use verdict::{blockers, verdict};
pub(crate) use words::{direction, part_word, part_words};

/// Why a plan cannot be shown.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ViewError {
    /// The text is no plan.
    #[error("not a plan (JSON `{schema}`, as `sbdp plan --json` writes it): {reason}", schema = crate::document::SCHEMA)]
    NoPlan {
        /// What is wrong with it.
        reason: String,
    },
    /// Plan and meshes do not belong together.
    #[error("the plan does not fit the assembly `{assembly}`: {reason}")]
    Mismatch {
        /// The assembly's name.
        assembly: String,
        /// What differs.
        reason: String,
    },
    /// A scene is too large for the format.
    #[error("cannot write the scene: {0}")]
    TooLarge(String),
}
