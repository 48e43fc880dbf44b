//! The assemblies in memory, up to a budget in bytes; the least recently used are evicted. Equal shapes with their
//! fields, and joined hulls, are shared by all assemblies.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use serde::{Deserialize, Serialize};

use super::AssemblyId;
use super::entry::Entry;
use super::shared_shape::SharedShape;
use crate::geometry::{Assembly, Shape};
use crate::lru::Lru;
use crate::scene::JoinedHulls;
use crate::sdf::FieldStore;

/// How many assemblies and shapes are in memory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoreStatistics {
    /// Assemblies.
    pub assemblies: u64,
    /// Distinct shapes.
    pub shapes: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Assemblies that were evicted since the start.
    pub evictions: u64,
    /// Shapes of new assemblies that were there already, since the start.
    pub shared: u64,
}

/// The assemblies.
#[derive(Debug)]
pub(super) struct AssemblyStore {
    budget: usize,
    /// Bytes of the budget that records and responses take.
    left: AtomicUsize,
    hulls: Arc<JoinedHulls>,
    fields: Weak<dyn FieldStore>,
    held: Mutex<StoreState>,
}

#[derive(Debug, Default)]
struct StoreState {
    entries: Lru<AssemblyId, Entry>,
    shapes: HashMap<[u8; 32], CountedShape>,
    /// The bytes of each entry without its shapes, as last measured.
    own: HashMap<AssemblyId, usize>,
    bytes: usize,
    evictions: u64,
    shared: u64,
}

/// A shape that entries have.
#[derive(Debug)]
struct CountedShape {
    shared: Arc<SharedShape>,
    entries: usize,
    /// As last measured.
    bytes: usize,
}

impl AssemblyStore {
    /// Nothing yet; `budget` in bytes.
    pub(super) fn new(budget: usize, hulls: JoinedHulls, fields: Weak<dyn FieldStore>) -> Self {
        Self { budget, left: AtomicUsize::new(0), hulls: Arc::new(hulls), fields, held: Mutex::default() }
    }

    /// An assembly. It counts as used.
    pub(super) fn get(&self, id: AssemblyId) -> Option<Arc<Entry>> {
        self.held().entries.get(&id)
    }

    /// A shape that some assembly has, by its content.
    pub(super) fn shape(&self, content: &[u8; 32]) -> Option<Arc<Shape>> {
        self.held().shapes.get(content).map(|counted| Arc::clone(&counted.shared.shape))
    }

    /// Adds an assembly, with the known shapes in place of equal ones. If another thread added it before, that entry
    /// stays.
    pub(super) fn insert(&self, id: AssemblyId, mut assembly: Assembly) -> Arc<Entry> {
        // Hash before the lock is taken.
        let contents: Vec<[u8; 32]> = assembly.shapes.iter().map(|shape| *shape.content()).collect();
        let mut held = self.held();
        if let Some(entry) = held.entries.get(&id) {
            return entry;
        }
        let known = held.shared;
        let shapes: Vec<_> = contents
            .iter()
            .zip(&assembly.shapes)
            .map(|(content, shape)| held.share(content, shape, &self.fields))
            .collect();
        let known = held.shared - known;
        assembly.shapes = shapes.iter().map(|shared| Arc::clone(&shared.shape)).collect();
        let entry = Arc::new(Entry::new(assembly, shapes, known, Arc::clone(&self.hulls)));
        held.entries.insert(id, Arc::clone(&entry));
        drop(held);
        self.settle(id, &entry);
        entry
    }

    /// Reads the joined hulls that were used last before this process began.
    pub(super) fn recall_hulls(&self) {
        self.hulls.recall_recent();
    }

    /// Sets the bytes of the budget that records and responses take. It has effect at the next `settle`.
    pub(super) fn leave(&self, bytes: usize) {
        self.left.store(bytes, Ordering::Relaxed);
    }

    /// Measures the memory of an assembly, and evicts others if the budget is exceeded. Called after each use.
    pub(super) fn settle(&self, id: AssemblyId, entry: &Entry) {
        // Measured before the lock is taken: other threads do not wait for it.
        let own = entry.memory();
        let shapes: Vec<usize> = entry.shapes.iter().map(|shape| shape.memory()).collect();
        let mut held = self.held();
        held.note(id, entry, own, &shapes);
        held.make_room(self.budget.saturating_sub(self.left.load(Ordering::Relaxed)));
    }

    /// All shapes, by their contents.
    pub(super) fn shapes(&self) -> Vec<Arc<SharedShape>> {
        self.held().shapes.values().map(|counted| Arc::clone(&counted.shared)).collect()
    }

    pub(super) fn statistics(&self) -> StoreStatistics {
        let held = self.held();
        StoreStatistics {
            assemblies: held.entries.len() as u64,
            shapes: held.shapes.len() as u64,
            bytes: held.bytes as u64,
            evictions: held.evictions,
            shared: held.shared,
        }
    }

    /// After a panic of a thread that held the lock, only the sums may be wrong.
    fn held(&self) -> MutexGuard<'_, StoreState> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl StoreState {
    fn share(
        &mut self,
        content: &[u8; 32],
        shape: &Arc<Shape>,
        fields: &Weak<dyn FieldStore>,
    ) -> Arc<SharedShape> {
        let known = self.shapes.len();
        let counted = self.shapes.entry(*content).or_insert_with(|| CountedShape {
            shared: Arc::new(SharedShape::stored(Arc::clone(shape), Weak::clone(fields))),
            entries: 0,
            bytes: 0,
        });
        counted.entries += 1;
        let shared = Arc::clone(&counted.shared);
        self.shared += u64::from(self.shapes.len() == known);
        shared
    }

    /// Records the bytes of an assembly: its own, and those of each shape.
    fn note(&mut self, id: AssemblyId, entry: &Entry, own: usize, shapes: &[usize]) {
        // It may have been evicted, and added again, while it was measured.
        if !self.entries.peek(&id).is_some_and(|known| std::ptr::eq(Arc::as_ptr(known), entry)) {
            return;
        }
        self.bytes += own;
        self.bytes -= self.own.insert(id, own).unwrap_or(0);
        for (shape, bytes) in entry.shapes.iter().zip(shapes) {
            if let Some(counted) = self.shapes.get_mut(shape.shape.content()) {
                self.bytes += bytes;
                self.bytes -= std::mem::replace(&mut counted.bytes, *bytes);
            }
        }
    }

    fn make_room(&mut self, budget: usize) {
        if self.bytes <= budget {
            return;
        }
        let Self { entries, shapes, own, bytes, evictions, .. } = self;
        entries.evict(|id, entry| {
            *evictions += 1;
            *bytes -= own.remove(&id).unwrap_or(0);
            for shape in &entry.shapes {
                let content = shape.shape.content();
                let Some(counted) = shapes.get_mut(content) else { continue };
                counted.entries -= 1;
                if counted.entries == 0 {
                    *bytes -= counted.bytes;
                    shapes.remove(content);
                }
            }
            *bytes > budget
        });
    }
}
