//! Values by key in the order of their last use, from which those that nobody uses leave first.

use std::borrow::Borrow;
use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;
use std::sync::Arc;

/// Values by key. How much of what they take is too much is for their owner to say.
#[derive(Debug)]
pub(crate) struct Lru<K, V: ?Sized> {
    /// Counts uses.
    clock: u64,
    entries: HashMap<K, Entry<V>>,
    /// By the use that was the last.
    order: BTreeMap<u64, K>,
}

#[derive(Debug)]
struct Entry<V: ?Sized> {
    value: Arc<V>,
    used: u64,
}

impl<K, V: ?Sized> Default for Lru<K, V> {
    fn default() -> Self {
        Self { clock: 0, entries: HashMap::new(), order: BTreeMap::new() }
    }
}

impl<K: Clone + Eq + Hash, V: ?Sized> Lru<K, V> {
    /// The value of a key, which is used by this.
    pub(crate) fn get<Q: Eq + Hash + ?Sized>(&mut self, key: &Q) -> Option<Arc<V>>
    where
        K: Borrow<Q>,
    {
        let entry = self.entries.get_mut(key)?;
        self.clock += 1;
        if let Some(key) = self.order.remove(&entry.used) {
            self.order.insert(self.clock, key);
        }
        entry.used = self.clock;
        Some(Arc::clone(&entry.value))
    }

    /// The value of a key, which is not used by this.
    pub(crate) fn peek<Q: Eq + Hash + ?Sized>(&self, key: &Q) -> Option<&Arc<V>>
    where
        K: Borrow<Q>,
    {
        self.entries.get(key).map(|entry| &entry.value)
    }

    /// Keeps a value; the one that it takes the place of.
    pub(crate) fn insert(&mut self, key: K, value: Arc<V>) -> Option<Arc<V>> {
        let before = self.remove(&key);
        self.clock += 1;
        self.order.insert(self.clock, key.clone());
        self.entries.insert(key, Entry { value, used: self.clock });
        before
    }

    pub(crate) fn remove<Q: Eq + Hash + ?Sized>(&mut self, key: &Q) -> Option<Arc<V>>
    where
        K: Borrow<Q>,
    {
        let entry = self.entries.remove(key)?;
        self.order.remove(&entry.used);
        Some(entry.value)
    }

    /// Lets values go, the least recently used first, for as long as `more` says so when it is given
    /// the last one. What somebody else holds stays.
    pub(crate) fn evict(&mut self, mut more: impl FnMut(K, Arc<V>) -> bool) {
        let mut from = 0;
        while let Some((&used, key)) = self.order.range(from..).next() {
            from = used + 1;
            let key = key.clone();
            let in_use = self.entries.get(&key).is_some_and(|e| Arc::strong_count(&e.value) > 1);
            if in_use {
                continue;
            }
            let Some(value) = self.remove(&key) else { continue };
            if !more(key, value) {
                return;
            }
        }
    }

    #[cfg(test)]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&K, &Arc<V>)> {
        self.entries.iter().map(|(key, entry)| (key, &entry.value))
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }
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
        assert!(lru.peek(&2).is_some() && lru.len() == 1 && lru.order.len() == 1);
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
}
