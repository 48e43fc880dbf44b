//! What is remembered of measured depths: of pairs as assembled (`overlap`), and of paths (`verdict`).

mod overlap;
mod verdict;

pub(crate) use overlap::{OVERLAP, overlap_key};
pub(crate) use verdict::VERDICT;
pub use verdict::{KnownVerdicts, VerdictQuestion};

use crate::cache::Validity;

const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_PLAN"));
