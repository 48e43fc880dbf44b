//! A map that evicts the values that were used least recently.
//!
//! There may be some hundred thousand small values, so the overhead of an entry counts: entries are in one vector, linked
//! in the order of use by their indices (*places*), and the hash table has nothing but places.

use std::borrow::Borrow;
use std::hash::{BuildHasher, Hash, RandomState};
use std::sync::Arc;

use hashbrown::HashTable;

/// Values by key. The owner decides when to evict.
#[derive(Debug)]
pub(crate) struct Lru<K, V: ?Sized> {
    hasher: RandomState,
    /// Places by the hash of the key.
    places: HashTable<u32>,
    slots: Vec<Slot<K, V>>,
    /// Slots without an entry.
    free: Vec<u32>,
    oldest: u32,
    newest: u32,
}

#[derive(Debug)]
struct Slot<K, V: ?Sized> {
    entry: Option<(K, Arc<V>)>,
    /// The places of the entries that were used before and after this one.
    older: u32,
    newer: u32,
}

/// No slot.
const NONE: u32 = u32::MAX;

/// Bytes of a place in a hash table that has just grown: its own and a control byte, with 7 of 16 buckets in use.
const IN_TABLE: usize = (size_of::<u32>() + 1) * 16 / 7;

/// Bytes that the allocator takes, about, for `bytes` behind an [`Arc`]: with its two counts, in steps of 16.
pub(crate) const fn shared(bytes: usize) -> usize {
    (bytes + 2 * size_of::<usize>()).next_multiple_of(16)
}

impl<K, V: ?Sized> Default for Lru<K, V> {
    fn default() -> Self {
        let (hasher, places) = (RandomState::new(), HashTable::new());
        Self { hasher, places, slots: Vec::new(), free: Vec::new(), oldest: NONE, newest: NONE }
    }
}

impl<K: Clone + Eq + Hash, V: ?Sized> Lru<K, V> {
    /// Bytes that an entry takes, about, without its value and without what its key points at. Unused capacity of the
    /// vector was never touched, so it takes no memory.
    pub(crate) const OVERHEAD: usize = size_of::<Slot<K, V>>() + IN_TABLE;

    /// The value of a key. This is a use of it.
    pub(crate) fn get<Q: Eq + Hash + ?Sized>(&mut self, key: &Q) -> Option<Arc<V>>
    where
        K: Borrow<Q>,
    {
        let place = self.place(key)?;
        if place != self.newest {
            self.unlink(place);
            self.link_newest(place);
        }
        self.value(place).cloned()
    }

    /// The value of a key. This is no use of it.
    pub(crate) fn peek<Q: Eq + Hash + ?Sized>(&self, key: &Q) -> Option<&Arc<V>>
    where
        K: Borrow<Q>,
    {
        self.value(self.place(key)?)
    }

    /// Keeps a value; the one that it replaces.
    pub(crate) fn insert(&mut self, key: K, value: Arc<V>) -> Option<Arc<V>> {
        let before = self.remove(&key);
        let hash = self.hasher.hash_one(&key);
        let slot = Slot { entry: Some((key, value)), older: NONE, newer: NONE };
        let place = if let Some(place) = self.free.pop() {
            self.slots[place as usize] = slot;
            place
        } else {
            self.slots.push(slot);
            (self.slots.len() - 1) as u32
        };
        self.link_newest(place);
        let Self { hasher, places, slots, .. } = self;
        places.insert_unique(hash, place, |&at| hash_at(hasher, slots, at));
        before
    }

    pub(crate) fn remove<Q: Eq + Hash + ?Sized>(&mut self, key: &Q) -> Option<Arc<V>>
    where
        K: Borrow<Q>,
    {
        let Self { hasher, places, slots, .. } = self;
        let found = places.find_entry(hasher.hash_one(key), |&at| has_key(slots, at, key)).ok()?;
        let place = found.remove().0;
        self.unlink(place);
        self.free.push(place);
        self.slots[place as usize].entry.take().map(|(_, value)| value)
    }

    /// Evicts values, the least recently used first, while `more` returns true for the one just evicted. Values that
    /// are in use elsewhere stay.
    pub(crate) fn evict(&mut self, mut more: impl FnMut(K, Arc<V>) -> bool) {
        let mut next = self.oldest;
        while let Some(slot) = self.slots.get(next as usize) {
            next = slot.newer;
            let Some((key, value)) = &slot.entry else { continue };
            if Arc::strong_count(value) > 1 {
                continue;
            }
            let key = key.clone();
            let Some(value) = self.remove(&key) else { continue };
            if !more(key, value) {
                return;
            }
        }
    }

    #[cfg(test)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&K, &Arc<V>)> {
        self.slots.iter().filter_map(|slot| slot.entry.as_ref()).map(|(key, value)| (key, value))
    }

    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    fn place<Q: Eq + Hash + ?Sized>(&self, key: &Q) -> Option<u32>
    where
        K: Borrow<Q>,
    {
        self.places.find(self.hasher.hash_one(key), |&at| has_key(&self.slots, at, key)).copied()
    }

    fn value(&self, place: u32) -> Option<&Arc<V>> {
        self.slots[place as usize].entry.as_ref().map(|(_, value)| value)
    }

    fn unlink(&mut self, place: u32) {
        let Slot { older, newer, .. } = self.slots[place as usize];
        match self.slots.get_mut(older as usize) {
            Some(slot) => slot.newer = newer,
            None => self.oldest = newer,
        }
        match self.slots.get_mut(newer as usize) {
            Some(slot) => slot.older = older,
            None => self.newest = older,
        }
    }

    fn link_newest(&mut self, place: u32) {
        let older = std::mem::replace(&mut self.newest, place);
        match self.slots.get_mut(older as usize) {
            Some(slot) => slot.newer = place,
            None => self.oldest = place,
        }
        let slot = &mut self.slots[place as usize];
        (slot.older, slot.newer) = (older, NONE);
    }
}

fn has_key<Q: Eq + ?Sized, K: Borrow<Q>, V: ?Sized>(slots: &[Slot<K, V>], place: u32, key: &Q) -> bool {
    slots[place as usize].entry.as_ref().is_some_and(|(at, _)| at.borrow() == key)
}

/// The hash of the key at a place; all places in the table have one.
fn hash_at<K: Hash, V: ?Sized>(hasher: &RandomState, slots: &[Slot<K, V>], place: u32) -> u64 {
    slots[place as usize].entry.as_ref().map_or(0, |(key, _)| hasher.hash_one(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(keys: &[u8]) -> Lru<u8, u8> {
        let mut lru = Lru::default();
        for key in keys {
            lru.insert(*key, Arc::new(*key));
        }
        lru
    }

    fn evicted(lru: &mut Lru<u8, u8>, count: usize) -> Vec<u8> {
        let mut keys = Vec::new();
        lru.evict(|key, _| {
            keys.push(key);
            keys.len() < count
        });
        keys
    }

    #[test]
    fn the_least_recently_used_leave_first() {
        let mut lru = of(&[1, 2, 3, 4]);
        assert_eq!(lru.get(&1).as_deref(), Some(&1));
        assert!(lru.insert(2, Arc::new(9)).is_some_and(|before| *before == 2));
        assert_eq!(evicted(&mut lru, 3), [3, 4, 1]);
        assert!(lru.peek(&2).is_some() && lru.len() == 1 && lru.iter().count() == 1);
    }

    #[test]
    fn what_is_in_use_stays() {
        let mut lru = of(&[1, 2, 3]);
        let held = (lru.get(&1), lru.get(&2));
        assert_eq!(evicted(&mut lru, 9), [3]);
        drop(held);
        assert_eq!(evicted(&mut lru, 9), [1, 2]);
        assert!(lru.iter().next().is_none());
    }

    #[test]
    fn a_new_entry_takes_a_free_place() {
        let mut lru = of(&[1, 2, 3]);
        for key in 4..=250 {
            assert!(lru.remove(&(key - 2)).is_some() && lru.remove(&(key - 2)).is_none());
            lru.insert(key, Arc::new(key));
        }
        assert_eq!(lru.slots.len(), 3);
        assert!(lru.peek(&249).is_some() && lru.peek(&248).is_none());
        assert_eq!(evicted(&mut lru, 9), [1, 249, 250]);
        assert_eq!((lru.oldest, lru.newest, lru.len()), (NONE, NONE, 0));
    }

    proptest::proptest! {
        /// Against a list in order of use.
        #[test]
        fn it_holds_what_a_plain_list_would(
            steps in proptest::collection::vec((0u8..3, 0u8..24), 1..300),
        ) {
            let (mut lru, mut model) = (of(&[]), Vec::new());
            for (step, key) in steps {
                let known = model.iter().position(|k| *k == key);
                let found = match step {
                    0 => lru.get(&key),
                    1 => lru.insert(key, Arc::new(key)),
                    _ => lru.remove(&key),
                };
                proptest::prop_assert_eq!(found.as_deref().copied(), known.map(|at| model[at]));
                if let Some(at) = known {
                    model.remove(at);
                }
                if step == 1 || step == 0 && known.is_some() {
                    model.push(key);
                }
                proptest::prop_assert_eq!(lru.len(), model.len());
            }
            proptest::prop_assert_eq!(evicted(&mut lru, 99), model);
        }
    }
}
