//! What belongs to the process that made it. A forked child has a copy of it, and must neither use nor release it: the
//! memory behind it is shared with the daemon in the parent's name.

use std::ops::Deref;

/// The number of this process.
pub(crate) fn pid() -> u32 {
    // The one of the standard library is remembered by some C libraries across a fork.
    rustix::process::getpid().as_raw_nonzero().get().unsigned_abs()
}

/// A value that is dropped only in the process that made it.
#[derive(Debug)]
pub(crate) struct ProcessBound<T> {
    value: Option<T>,
    pid: u32,
}

impl<T> ProcessBound<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { value: Some(value), pid: pid() }
    }
}

impl<T> Deref for ProcessBound<T> {
    type Target = T;

    fn deref(&self) -> &T {
        match &self.value {
            Some(value) => value,
            None => unreachable!("it is taken out in `drop` alone"),
        }
    }
}

impl<T> Drop for ProcessBound<T> {
    fn drop(&mut self) {
        if self.pid != pid() {
            std::mem::forget(self.value.take());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_value_is_dropped_by_its_own_process_alone() {
        let value = Arc::new(());
        drop(ProcessBound::new(Arc::clone(&value)));
        assert_eq!(Arc::strong_count(&value), 1);
        drop(ProcessBound { value: Some(Arc::clone(&value)), pid: pid() + 1 });
        assert_eq!(Arc::strong_count(&value), 2);
    }
}
