//! Answers as they were sent, by the bytes of the question: what was answered before a restart is answered
//! after it without loading the assembly.

use super::records::AnswerRecord;
use super::{Cache, Digest, Key, Kind, format};

/// A question, and the messages that answered it; the last one ends the answer.
pub type AnsweredQuestion = (Vec<u8>, Vec<Vec<u8>>);

impl Cache {
    /// The messages that answered a question; the last one ends the answer.
    #[must_use]
    pub fn answer(&self, question: &[u8]) -> Option<Vec<Vec<u8>>> {
        let AnswerRecord { messages, .. } = self.get(&key(question))?;
        (!messages.is_empty()).then_some(messages)
    }

    /// Remembers the messages that answered a question, on disk.
    pub fn remember_answer(&self, question: &[u8], messages: Vec<Vec<u8>>) {
        if self.is_on_disk() {
            self.put(key(question), &AnswerRecord { question: question.to_vec(), messages });
        }
    }

    /// The answers on disk that were used last, with their questions, no more than so many with so many bytes in
    /// all; the last one used comes last. They count as used.
    #[must_use]
    pub fn recent_answers(&self, most: usize, bytes: u64) -> Vec<AnsweredQuestion> {
        let read = |(listed, payload): (Key, Vec<u8>)| {
            let AnswerRecord { question, messages } = format::decode(&payload)?;
            // Another build's answers lie under other keys.
            (key(&question) == listed && !messages.is_empty()).then(|| {
                self.touch(listed);
                (question, messages)
            })
        };
        self.recent(Kind::Answer, most, bytes).into_iter().filter_map(read).collect()
    }
}

fn key(question: &[u8]) -> Key {
    Digest::new().hash(blake3::hash(question).as_bytes()).key(Kind::Answer)
}

#[cfg(test)]
mod tests {
    use super::super::CacheSettings;
    use super::*;

    #[test]
    fn what_was_answered_last_is_told_with_its_question_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let questions = [b"first".to_vec(), b"second".to_vec(), b"third".to_vec()];
        let messages = |n: u8| vec![vec![n; 1000], vec![n]];
        let cache = Cache::open(&settings).unwrap();
        for (question, n) in questions.iter().zip(0..) {
            cache.remember_answer(question, messages(n));
            cache.flush();
        }
        // As another build would have asked: the question is not the one of the key.
        cache.put(key(b"else"), &AnswerRecord { question: b"other".to_vec(), messages: messages(9) });
        drop(cache);
        let cache = Cache::open(&settings).unwrap();
        let of = |n: usize| (questions[n].clone(), messages(n as u8));
        assert_eq!(cache.recent_answers(4, 1 << 20), [of(0), of(1), of(2)]);
        assert_eq!(cache.recent_answers(3, 1 << 20), [of(1), of(2)], "the other build's was one of them");
        assert_eq!(cache.recent_answers(4, 2500), [of(2)], "bytes are counted");
        assert!(cache.recent_answers(0, 1 << 20).is_empty());
        assert_eq!(cache.answer(&questions[0]), Some(messages(0)));
        assert!(Cache::in_memory(1 << 20).recent_answers(4, 1 << 20).is_empty());
    }
}
