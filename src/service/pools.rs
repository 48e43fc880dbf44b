//! Thread pools that are reused from one request to the next: to start a pool takes as long as to replan a small change.

use std::sync::{Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::ServiceError;

/// At most this many idle pools are kept.
const MOST_IDLE: usize = 4;

/// Idle pools, with the number of threads that was asked for.
#[derive(Debug, Default)]
pub(super) struct Pools {
    idle: Mutex<Vec<(usize, ThreadPool)>>,
}

impl Pools {
    /// Does some work on a pool of `threads` threads (0: all processors) of its own.
    ///
    /// # Errors
    /// The threads could not be started.
    pub(super) fn on<T: Send>(
        &self,
        threads: usize,
        work: impl FnOnce() -> T + Send,
    ) -> Result<T, ServiceError> {
        let pool = self.taken(threads)?;
        // A pool in which something panicked is not put back.
        let done = pool.install(work);
        self.put_back(threads, pool);
        Ok(done)
    }

    fn taken(&self, threads: usize) -> Result<ThreadPool, ServiceError> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        // The pool that was used last: its memory is probably still in the processors' caches.
        if let Some(at) = idle.iter().rposition(|(of, _)| *of == threads) {
            return Ok(idle.remove(at).1);
        }
        drop(idle);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|e| ServiceError::Threads(e.to_string()))
    }

    fn put_back(&self, threads: usize, pool: ThreadPool) {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let oldest = (idle.len() >= MOST_IDLE).then(|| idle.remove(0));
        idle.push((threads, pool));
        drop(idle);
        // The drop ends its threads, outside the lock.
        drop(oldest);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::thread::{self, ThreadId};

    use super::*;

    fn workers(pools: &Pools, threads: usize) -> Vec<ThreadId> {
        pools.on(threads, || rayon::broadcast(|_| thread::current().id())).unwrap()
    }

    #[test]
    fn the_next_request_works_on_the_same_threads_and_another_number_on_others() {
        let pools = Pools::default();
        let first = workers(&pools, 2);
        assert_eq!(first.len(), 2);
        assert_eq!(workers(&pools, 3).len(), 3);
        assert_eq!(workers(&pools, 2), first);
    }

    #[test]
    fn requests_at_the_same_time_work_on_threads_of_their_own() {
        let (pools, both) = (&Pools::default(), &Barrier::new(2));
        let work = || {
            pools.on(1, || {
                both.wait();
                thread::current().id()
            })
        };
        let [one, other] = thread::scope(|scope| {
            [scope.spawn(work), scope.spawn(work)].map(|thread| thread.join().unwrap().unwrap())
        });
        assert_ne!(one, other);
    }

    #[test]
    fn only_some_idle_threads_are_kept() {
        let pools = Pools::default();
        let first = workers(&pools, 1);
        for threads in 2..=MOST_IDLE + 1 {
            workers(&pools, threads);
        }
        assert_eq!(pools.idle.lock().unwrap().len(), MOST_IDLE);
        assert_ne!(workers(&pools, 1), first);
    }
}
