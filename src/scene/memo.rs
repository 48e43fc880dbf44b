//! What modules above the scene derive from it and keep with it.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// One value of each type. Copies share the values.
#[derive(Clone, Default)]
pub struct Memo {
    values: Arc<Mutex<HashMap<TypeId, Arc<dyn Any + Send + Sync>>>>,
}

impl Memo {
    /// The value of a type; a default one is made on first use.
    #[must_use]
    pub fn of<T: Any + Default + Send + Sync>(&self) -> Arc<T> {
        // A value is inserted whole: a thread that panicked while it held the lock left the map as it was.
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let value = values.entry(TypeId::of::<T>()).or_insert_with(|| Arc::new(T::default()));
        Arc::clone(value).downcast().unwrap_or_default()
    }
}

impl fmt::Debug for Memo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Memo").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn copies_share_one_value_of_each_type() {
        let memo = Memo::default();
        memo.clone().of::<AtomicUsize>().fetch_add(3, Ordering::Relaxed);
        assert_eq!(memo.of::<AtomicUsize>().load(Ordering::Relaxed), 3);
        assert!(memo.of::<Mutex<Vec<u8>>>().lock().unwrap().is_empty());
        assert_eq!(Memo::default().of::<AtomicUsize>().load(Ordering::Relaxed), 0);
    }
}
