//! Responses as they were sent, by the bytes of the question: after a restart, a repeated question is answered without
//! the assembly.

use serde::{Deserialize, Serialize};

use crate::cache::{Cache, Digest, RecordKey, RecordKind, Storage, Validity};

/// A plan as it was sent. The daemon encodes it.
pub(crate) static ANSWER: RecordKind =
    RecordKind::of::<AnswerRecord>(9, "answer", Storage::IndexedDisk, SOURCES);
const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_DAEMON"));

/// A plan in the messages that it was sent in; the last one ends it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct AnswerRecord {
    /// The request as it is encoded, without what does not change the answer. Only where it leads to the record's key is
    /// the record this build's.
    question: Vec<u8>,
    messages: Vec<Vec<u8>>,
}

/// A question, and the messages that answered it; the last one ends the answer.
pub(crate) type AnsweredQuestion = (Vec<u8>, Vec<Vec<u8>>);

/// The messages that answered a question; the last one ends the answer.
pub(crate) fn remembered_answer(cache: &Cache, question: &[u8]) -> Option<Vec<Vec<u8>>> {
    let AnswerRecord { messages, .. } = cache.get(&key(question))?;
    (!messages.is_empty()).then_some(messages)
}

/// Remembers the messages that answered a question, on disk.
pub(crate) fn remember_answer(cache: &Cache, question: &[u8], messages: Vec<Vec<u8>>) {
    if cache.is_on_disk() {
        cache.put(key(question), &AnswerRecord { question: question.to_vec(), messages });
    }
}

/// The answers on disk that were used last, with their questions, at most `most` and of at most `bytes`; the last one used
/// comes last. They count as used.
pub(crate) fn recent_answers(cache: &Cache, most: usize, bytes: u64) -> Vec<AnsweredQuestion> {
    let ours = |(listed, AnswerRecord { question, messages }): (RecordKey, AnswerRecord)| {
        (key(&question) == listed && !messages.is_empty()).then(|| {
            cache.touch(listed);
            (question, messages)
        })
    };
    cache.recent(&ANSWER, most, bytes).into_iter().filter_map(ours).collect()
}

fn key(question: &[u8]) -> RecordKey {
    Digest::new().hash(blake3::hash(question).as_bytes()).key(&ANSWER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CacheSettings;

    #[test]
    fn the_last_answers_are_found_with_their_questions_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let open = || Cache::open(&settings, &[&ANSWER]).unwrap();
        let questions = [b"first".to_vec(), b"second".to_vec(), b"third".to_vec()];
        let messages = |n: u8| vec![vec![n; 1000], vec![n]];
        let cache = open();
        for (question, n) in questions.iter().zip(0..) {
            remember_answer(&cache, question, messages(n));
            cache.flush();
        }
        // As another build would have asked: the question is not the one of the key.
        cache.put(key(b"else"), &AnswerRecord { question: b"other".to_vec(), messages: messages(9) });
        drop(cache);
        let cache = open();
        let of = |n: usize| (questions[n].clone(), messages(n as u8));
        assert_eq!(recent_answers(&cache, 4, 1 << 20), [of(0), of(1), of(2)]);
        assert_eq!(recent_answers(&cache, 3, 1 << 20), [of(1), of(2)], "the other build's was one of them");
        assert_eq!(recent_answers(&cache, 4, 2500), [of(2)], "bytes are counted");
        assert!(recent_answers(&cache, 0, 1 << 20).is_empty());
        assert_eq!(remembered_answer(&cache, &questions[0]), Some(messages(0)));
        assert!(recent_answers(&Cache::in_memory(1 << 20, &[&ANSWER]), 4, 1 << 20).is_empty());
    }
}
