//! A bounded first-in-first-out queue of jobs. It holds no locks; `workers` shares it.

use std::collections::VecDeque;

/// Why a job was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rejected {
    /// As many wait as may wait.
    Full,
    /// Nothing is taken any more.
    Closed,
}

/// The queue.
#[derive(Debug)]
pub(crate) struct RequestQueue<J> {
    waiting: VecDeque<J>,
    limit: usize,
    closed: bool,
}

impl<J> RequestQueue<J> {
    pub(crate) fn new(limit: usize) -> Self {
        Self { waiting: VecDeque::new(), limit, closed: false }
    }

    pub(crate) fn push(&mut self, job: J) -> Result<(), Rejected> {
        if self.closed {
            return Err(Rejected::Closed);
        }
        if self.waiting.len() >= self.limit {
            return Err(Rejected::Full);
        }
        self.waiting.push_back(job);
        Ok(())
    }

    pub(crate) fn pop(&mut self) -> Option<J> {
        self.waiting.pop_front()
    }

    /// Takes back what still waits and fits; false if nothing did.
    pub(crate) fn withdraw(&mut self, fits: impl Fn(&J) -> bool) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|job| !fits(job));
        self.waiting.len() < before
    }

    /// From now on nothing is taken; what waits may still be popped.
    pub(crate) fn close(&mut self) {
        self.closed = true;
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed
    }

    pub(crate) fn len(&self) -> usize {
        self.waiting.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_keeps_its_limit_and_order_and_loses_nothing(
            limit in 1_usize..6,
            steps in proptest::collection::vec(0_u8..10, 0..80),
        ) {
            let mut queue = RequestQueue::new(limit);
            let mut model: Vec<u32> = Vec::new();
            for (number, step) in (0_u32..).zip(steps) {
                match step {
                    0..=4 => {
                        let expected = if model.len() < limit { Ok(()) } else { Err(Rejected::Full) };
                        prop_assert_eq!(queue.push(number), expected);
                        if expected.is_ok() {
                            model.push(number);
                        }
                    }
                    5..=7 => {
                        let expected = (!model.is_empty()).then(|| model.remove(0));
                        prop_assert_eq!(queue.pop(), expected);
                    }
                    _ => {
                        let before = model.len();
                        model.retain(|n| n % 3 != 0);
                        prop_assert_eq!(queue.withdraw(|n| n % 3 == 0), model.len() < before);
                    }
                }
                prop_assert_eq!(queue.len(), model.len());
            }
        }
    }

    #[test]
    fn a_closed_queue_takes_nothing_but_gives_what_it_has() {
        let mut queue = RequestQueue::new(3);
        queue.push(1).unwrap();
        queue.close();
        assert_eq!(queue.push(2), Err(Rejected::Closed));
        assert_eq!((queue.pop(), queue.pop()), (Some(1), None));
    }
}
