//! Answers as they were sent, by the bytes of the question: what was answered before a restart is answered
//! after it without loading the assembly.

use super::records::AnswerRecord;
use super::{Cache, Digest, Key, Kind};

impl Cache {
    /// The messages that answered a question; the last one ends the answer.
    #[must_use]
    pub fn answer(&self, question: &[u8]) -> Option<Vec<Vec<u8>>> {
        let AnswerRecord { messages } = self.get(&key(question))?;
        (!messages.is_empty()).then_some(messages)
    }

    /// Remembers the messages that answered a question, on disk.
    pub fn remember_answer(&self, question: &[u8], messages: Vec<Vec<u8>>) {
        if self.is_on_disk() {
            self.put(key(question), &AnswerRecord { messages });
        }
    }
}

fn key(question: &[u8]) -> Key {
    Digest::new().hash(blake3::hash(question).as_bytes()).key(Kind::Answer)
}
