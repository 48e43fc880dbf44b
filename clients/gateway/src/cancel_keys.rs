//! The plans that can be cancelled by a key.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use tonic::Status;

use crate::pool::lock;
use crate::status::argument;

/// Bytes of the longest key. A UUID has 36, and a name with one in it fits; longer ones only cost memory.
const LONGEST: usize = 256;

/// The keys of the plans under way.
#[derive(Debug, Default)]
pub(crate) struct CancelKeys(Mutex<HashMap<String, Arc<AtomicBool>>>);

/// A plan that can be cancelled, as long as this lives.
#[derive(Debug)]
pub(crate) struct Cancellable {
    keys: Arc<CancelKeys>,
    /// Empty where the request gave none.
    key: String,
    wanted: Arc<AtomicBool>,
}

impl CancelKeys {
    /// Registers a plan; an empty key is none.
    ///
    /// # Errors
    /// The key is too long, or another plan has it.
    pub(crate) fn register(self: &Arc<Self>, key: String) -> Result<Cancellable, Status> {
        let wanted = Arc::new(AtomicBool::new(false));
        if key.len() > LONGEST {
            return Err(argument("cancel_key", format!("it has more than {LONGEST} bytes")));
        }
        if !key.is_empty() {
            match lock(&self.0).entry(key.clone()) {
                Entry::Vacant(place) => place.insert(Arc::clone(&wanted)),
                Entry::Occupied(_) => {
                    return Err(argument(
                        "cancel_key",
                        "another plan under way has this key: choose another",
                    ));
                }
            };
        }
        Ok(Cancellable { keys: Arc::clone(self), key, wanted })
    }

    /// Cancels a plan; false if none has this key.
    pub(crate) fn cancel(&self, key: &str) -> bool {
        let found = lock(&self.0).get(key).map(Arc::clone);
        found.is_some_and(|wanted| {
            wanted.store(true, Ordering::Relaxed);
            true
        })
    }
}

impl Cancellable {
    pub(crate) fn is_cancelled(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }
}

impl Drop for Cancellable {
    fn drop(&mut self) {
        if !self.key.is_empty() {
            lock(&self.keys.0).remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_belongs_to_one_plan_as_long_as_it_lives() {
        let keys = Arc::new(CancelKeys::default());
        let plan = keys.register("a".to_owned()).unwrap();
        let nameless = keys.register(String::new()).unwrap();
        assert!(keys.register("a".to_owned()).unwrap_err().message().contains("cancel_key"));
        assert!(keys.register("x".repeat(257)).is_err());
        assert!(!keys.cancel("b") && !keys.cancel("") && !plan.is_cancelled());
        assert!(keys.cancel("a") && plan.is_cancelled() && !nameless.is_cancelled());
        drop(plan);
        assert!(!keys.cancel("a"));
        assert!(!keys.register("a".to_owned()).unwrap().is_cancelled());
    }
}
