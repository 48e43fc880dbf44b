//! The tier in memory: payloads up to a budget in bytes; the least recently used are evicted.

use std::sync::Arc;

use super::key::RecordKey;
use super::kind::{ByKind, RecordKind};
use crate::lru::{self, Lru};

/// Payloads by key. A payload that is in use is never evicted.
#[derive(Debug)]
pub(super) struct Memory {
    budget: usize,
    bytes: usize,
    usage: ByKind<KindUsage>,
    payloads: Lru<RecordKey, [u8]>,
}

/// How much there is of a kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct KindUsage {
    pub(super) entries: u64,
    /// Of payloads.
    pub(super) bytes: u64,
}

impl KindUsage {
    fn add(&mut self, payload: &[u8]) {
        self.entries += 1;
        self.bytes += payload.len() as u64;
    }

    fn take(&mut self, payload: &[u8]) {
        self.entries -= 1;
        self.bytes -= payload.len() as u64;
    }
}

impl Memory {
    pub(super) fn new(budget: usize) -> Self {
        Self { budget, bytes: 0, usage: ByKind::default(), payloads: Lru::default() }
    }

    pub(super) fn get(&mut self, key: &RecordKey) -> Option<Arc<[u8]>> {
        self.payloads.get(key)
    }

    /// Keeps a payload, in place of one with the same key; the kinds of the payloads that were evicted for it.
    pub(super) fn put(&mut self, key: RecordKey, payload: Arc<[u8]>) -> Vec<&'static RecordKind> {
        self.remove(&key);
        let cost = cost(&payload);
        if cost > self.budget {
            return Vec::new();
        }
        let evicted = self.make_room(cost);
        self.bytes += cost;
        self.usage[key.kind()].add(&payload);
        self.payloads.insert(key, payload);
        evicted
    }

    /// Whether there is a payload. This is no use of it.
    pub(super) fn has(&self, key: &RecordKey) -> bool {
        self.payloads.peek(key).is_some()
    }

    pub(super) fn remove(&mut self, key: &RecordKey) {
        if let Some(payload) = self.payloads.remove(key) {
            self.bytes -= cost(&payload);
            self.usage[key.kind()].take(&payload);
        }
    }

    fn make_room(&mut self, needed: usize) -> Vec<&'static RecordKind> {
        let Self { budget, bytes, usage, payloads } = self;
        let mut evicted = Vec::new();
        if *bytes + needed > *budget {
            payloads.evict(|key, payload| {
                *bytes -= cost(&payload);
                usage[key.kind()].take(&payload);
                evicted.push(key.kind());
                *bytes + needed > *budget
            });
        }
        evicted
    }

    pub(super) fn usage(&self, kind: &RecordKind) -> KindUsage {
        self.usage[kind]
    }

    /// In bytes.
    pub(super) fn budget(&self) -> usize {
        self.budget
    }

    /// Bytes of the payloads, with keys and overhead.
    pub(super) fn bytes(&self) -> usize {
        self.bytes
    }

    pub(super) fn clear(&mut self) {
        *self = Self::new(self.budget);
    }
}

/// Bytes that a payload takes, with its key and the overhead, which is the larger share for most.
fn cost(payload: &[u8]) -> usize {
    cost_of(payload.len())
}

const fn cost_of(length: usize) -> usize {
    Lru::<RecordKey, [u8]>::OVERHEAD + lru::shared(length)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::tests::KINDS;
    use super::*;

    fn key(n: u8) -> RecordKey {
        RecordKey::new(KINDS[usize::from(n) % 2], [n; 32])
    }

    fn payload(length: usize) -> Arc<[u8]> {
        vec![0; length].into()
    }

    #[test]
    fn the_least_recently_used_leave() {
        let mut memory = Memory::new(3 * cost_of(100));
        for n in 0..3 {
            assert!(memory.put(key(n), payload(100)).is_empty());
        }
        drop(memory.get(&key(0)));
        assert_eq!(memory.put(key(3), payload(100)), [key(1).kind()]);
        let there: Vec<bool> = (0..4).map(|n| memory.get(&key(n)).is_some()).collect();
        assert_eq!(there, [true, false, true, true]);
    }

    #[test]
    fn what_is_in_use_stays() {
        let mut memory = Memory::new(2 * cost_of(100));
        memory.put(key(0), payload(100));
        let held = memory.get(&key(0));
        memory.put(key(1), payload(100));
        memory.put(key(2), payload(100));
        assert!(held.is_some() && memory.get(&key(0)).is_some() && memory.get(&key(1)).is_none());
    }

    #[test]
    fn what_is_larger_than_the_budget_is_not_kept() {
        let mut memory = Memory::new(cost_of(100));
        memory.put(key(0), payload(10));
        assert!(memory.put(key(1), payload(113)).is_empty());
        assert!(memory.get(&key(1)).is_none() && memory.get(&key(0)).is_some());
    }

    proptest! {
        /// Against a list in order of use.
        #[test]
        fn it_holds_what_a_plain_list_would(steps in prop::collection::vec((0u8..12, 0usize..400, any::<bool>()), 1..200)) {
            let budget = 5 * cost_of(200);
            let mut memory = Memory::new(budget);
            let mut model: Vec<(RecordKey, usize)> = Vec::new();
            for (n, length, put) in steps {
                let known = model.iter().position(|(k, _)| *k == key(n));
                if put {
                    known.map(|at| model.remove(at));
                    let used = |m: &[(RecordKey, usize)]| m.iter().map(|(_, l)| cost_of(*l)).sum::<usize>();
                    if cost_of(length) <= budget {
                        while used(&model) + cost_of(length) > budget {
                            model.remove(0);
                        }
                        model.push((key(n), length));
                    }
                    memory.put(key(n), payload(length));
                    prop_assert_eq!(memory.bytes(), used(&model));
                } else {
                    let found = memory.get(&key(n)).map(|p| p.len());
                    prop_assert_eq!(found, known.map(|at| model[at].1));
                    if let Some(at) = known {
                        let entry = model.remove(at);
                        model.push(entry);
                    }
                }
                prop_assert!(memory.bytes() <= budget);
                let held = KINDS.map(|kind| memory.usage(kind));
                let (entries, bytes) = held.iter().fold((0, 0), |(n, b), h| (n + h.entries, b + h.bytes));
                prop_assert_eq!(entries as usize, model.len());
                prop_assert_eq!(bytes as usize, model.iter().map(|(_, l)| l).sum::<usize>());
            }
        }
    }
}
