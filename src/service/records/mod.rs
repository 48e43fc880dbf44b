//! What the service remembers of searches (`plan`) and of messages (`answer`), and the list of all that is remembered.

mod answer;
mod plan;

pub(crate) use answer::{AnsweredQuestion, recent_answers, remember_answer, remembered_answer};
pub(super) use plan::{PlanAnswer, PlanQuestion, remember_plan, remembered_plan};

use crate::blocking_graph::BLOCKING;
use crate::cache::RecordKind;
use crate::geometry::{HEALED, SHAPE, SOURCE};
use crate::plan::{OVERLAP, VERDICT};
use crate::scene::HULL;
use crate::sdf::FIELD;
use crate::simulation::{MOTION, SWEPT, TOUCHING, WITNESS};
use answer::ANSWER;
use plan::PLAN;

/// All kinds of records, in the order of their numbers: what a cache for a [`Service`](super::Service) is opened with.
pub static RECORD_KINDS: [&RecordKind; 14] = [
    &OVERLAP, &BLOCKING, &WITNESS, &MOTION, &VERDICT, &PLAN, &TOUCHING, &SOURCE, &ANSWER, &SHAPE, &HEALED,
    &HULL, &SWEPT, &FIELD,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Validity;

    /// A kind with a number or a name of another one would take the other's records for its own.
    #[test]
    fn numbers_and_names_of_kinds_are_unique() {
        for (i, kind) in RECORD_KINDS.into_iter().enumerate() {
            assert_eq!(usize::from(kind.number), i + 1);
            assert_eq!(RECORD_KINDS.iter().position(|k| k.name == kind.name), Some(i));
        }
    }

    /// Answers depend on all that the daemon does with a plan, up to the wire; clients keep the handles of sources.
    #[test]
    fn kinds_are_invalidated_with_the_stage_that_computes_them() {
        let stages: [(&str, &[&RecordKind]); 9] = [
            (env!("SBDP_SOURCES_GEOMETRY"), &[&SHAPE, &HEALED]),
            (env!("SBDP_SOURCES_SDF"), &[&FIELD]),
            (env!("SBDP_SOURCES_SCENE"), &[&HULL]),
            (env!("SBDP_SOURCES_CONTACT"), &[]),
            (env!("SBDP_SOURCES_SIMULATION"), &[&WITNESS, &MOTION, &TOUCHING, &SWEPT]),
            (env!("SBDP_SOURCES_BLOCKING_GRAPH"), &[&BLOCKING]),
            (env!("SBDP_SOURCES_PLAN"), &[&OVERLAP, &VERDICT]),
            (env!("SBDP_SOURCES_SERVICE"), &[&PLAN]),
            (env!("SBDP_SOURCES_DAEMON"), &[&ANSWER]),
        ];
        for (i, (hash, kinds)) in stages.into_iter().enumerate() {
            assert_eq!(
                stages.iter().position(|(other, _)| *other == hash),
                Some(i),
                "two stages have one hash"
            );
            assert!(kinds.iter().all(|kind| kind.validity == Validity::Sources(hash)), "{kinds:?}");
        }
        let by_sources = stages.iter().map(|(_, kinds)| kinds.len()).sum::<usize>();
        assert!(by_sources + 1 == RECORD_KINDS.len() && matches!(SOURCE.validity, Validity::Format(_)));
    }
}
