//! Any bytes as a file's records, for fuzzing.

use super::format::{Record, decode, opened};
use super::kind::{Key, Kind};
use super::records::{
    AnswerRecord, BlockingRecord, HealedRecord, HullRecord, MotionRecord, OverlapRecord, PlanRecord,
    ShapeRecord, SourceRecord, SweptRecord, TouchingRecord, VerdictRecord, WitnessRecord,
};

/// Reads bytes as an envelope and as the payload of every kind; the kinds that they can be read as.
pub(crate) fn read_as_records(bytes: &[u8]) -> Vec<Kind> {
    fn reads<R: Record>(payload: &[u8]) -> bool {
        decode::<R>(payload).is_some()
    }
    let is_record = |kind: Kind| {
        let payload = opened(&Key::new(kind, [0; 32]), bytes).unwrap_or(bytes);
        match kind {
            Kind::Overlap => reads::<OverlapRecord>(payload),
            Kind::Blocking => reads::<BlockingRecord>(payload),
            Kind::Witness => reads::<WitnessRecord>(payload),
            Kind::Motion => reads::<MotionRecord>(payload),
            Kind::Verdict => reads::<VerdictRecord>(payload),
            Kind::Plan => reads::<PlanRecord>(payload),
            Kind::Touching => reads::<TouchingRecord>(payload),
            Kind::Source => reads::<SourceRecord>(payload),
            Kind::Answer => reads::<AnswerRecord>(payload),
            Kind::Shape => reads::<ShapeRecord>(payload),
            Kind::Healed => reads::<HealedRecord>(payload),
            Kind::Hull => reads::<HullRecord>(payload),
            Kind::Swept => reads::<SweptRecord>(payload),
            Kind::Field => crate::sdf::is_intact(&[0; 32], bytes),
        }
    };
    Kind::ALL.into_iter().filter(|kind| is_record(*kind)).collect()
}
