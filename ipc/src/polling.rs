//! Polling for a short time before going to sleep.
//!
//! Waking a process takes the system 10 to 60 µs, depending on how deeply the processor slept. An answer from memory
//! takes less. So a thread that expects something soon polls first, and yields to other threads between two polls. It
//! stops where that does not pay: after fruitless polls it polls more and more rarely, and where others need the
//! processors it pauses, because a thread that yields to a busy one may get the processor back only after milliseconds.

use std::time::{Duration, Instant};

/// The usual polling time: about as long as it takes to be woken.
pub const USUAL: Duration = Duration::from_micros(50);

/// Exponential back-off: after n fruitless polls in a row, the next 2ⁿ − 1 waits do not poll, up to this number.
const LONGEST_OMISSION: u32 = 255;
/// A yield that took longer than this gave the processor to a thread with work to do.
const CONTESTED: Duration = Duration::from_micros(500);
/// The pause after that; doubled each time it turns out to be too short.
const SHORTEST_REST: Duration = Duration::from_millis(25);
const LONGEST_REST: Duration = Duration::from_secs(1);

/// Whether and how long to poll before sleeping.
#[derive(Debug)]
pub struct Polling {
    limit: Duration,
    /// Waits without polling after the last fruitless poll.
    omission: u32,
    /// How many of these are still to come.
    omitted: u32,
    rest: Duration,
    rest_until: Option<Instant>,
}

impl Polling {
    /// Polls for up to this long before each sleep; zero for never.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self { limit, omission: 0, omitted: 0, rest: SHORTEST_REST, rest_until: None }
    }

    /// Polls until `is_there` returns true, for a short time or not at all. Returns whether it did.
    pub fn look(&mut self, is_there: impl FnMut() -> bool) -> bool {
        self.look_by(Instant::now, std::thread::yield_now, is_there)
    }

    fn look_by(
        &mut self,
        mut now: impl FnMut() -> Instant,
        mut give_way: impl FnMut(),
        mut is_there: impl FnMut() -> bool,
    ) -> bool {
        if self.limit.is_zero() {
            return false;
        }
        if self.omitted > 0 {
            self.omitted -= 1;
            return false;
        }
        let start = now();
        if self.rest_until.is_some_and(|end| start < end) {
            return false;
        }
        let mut looked = start;
        loop {
            let found = is_there();
            let time = now();
            if time - looked > CONTESTED {
                self.rest_from(start, time);
                return found;
            }
            if time - start > self.limit {
                self.omission = (self.omission * 2 + 1).min(LONGEST_OMISSION);
                self.omitted = self.omission;
                return found;
            }
            if found {
                self.omission = 0;
                return true;
            }
            looked = time;
            give_way();
        }
    }

    /// Pauses; twice as long as before if the last pause has only just ended.
    fn rest_from(&mut self, start: Instant, time: Instant) {
        let again = self.rest_until.is_some_and(|end| start < end + self.rest);
        self.rest = if again { (self.rest * 2).min(LONGEST_REST) } else { SHORTEST_REST };
        self.rest_until = Some(time + self.rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock in which each poll, with what other threads do meanwhile, takes a given time.
    struct World {
        time: Instant,
        looks: u32,
    }

    impl World {
        fn new() -> Self {
            Self { time: Instant::now(), looks: 0 }
        }

        /// The result if the condition holds at the poll with this number, from 1, and the number of polls.
        fn look(&mut self, polling: &mut Polling, look_us: u64, there_at: u32) -> (bool, u32) {
            let (time, looks) = (std::cell::Cell::new(self.time), std::cell::Cell::new(0));
            let found = polling.look_by(
                || time.get(),
                || time.set(time.get() + Duration::from_micros(look_us)),
                || {
                    looks.set(looks.get() + 1);
                    looks.get() >= there_at
                },
            );
            (self.time, self.looks) = (time.get(), looks.get());
            (found, self.looks)
        }
    }

    #[test]
    fn it_is_found_within_the_limit() {
        let (mut world, mut polling) = (World::new(), Polling::new(USUAL));
        for _ in 0..100 {
            assert_eq!(world.look(&mut polling, 2, 5), (true, 5));
        }
    }

    #[test]
    fn zero_never_looks() {
        let (mut world, mut polling) = (World::new(), Polling::new(Duration::ZERO));
        assert_eq!(world.look(&mut polling, 2, 1), (false, 0));
    }

    #[test]
    fn what_does_not_come_in_time_is_looked_for_more_and_more_rarely_until_it_comes_in_time_once() {
        let (mut world, mut polling) = (World::new(), Polling::new(USUAL));
        let mut pauses = Vec::new();
        let mut pause = 0;
        while pauses.len() < 12 {
            match world.look(&mut polling, 2, u32::MAX) {
                (false, 0) => pause += 1,
                (false, looks) => {
                    assert_eq!(looks, 27, "the limit of 50 µs is passed after 26 steps of 2");
                    pauses.push(std::mem::take(&mut pause));
                }
                (true, _) => panic!("nothing was there"),
            }
        }
        assert_eq!(pauses, [0, 1, 3, 7, 15, 31, 63, 127, 255, 255, 255, 255]);
        while world.look(&mut polling, 2, 1) == (false, 0) {}
        assert_eq!(world.look(&mut polling, 2, u32::MAX).1, 27);
        assert_eq!(world.look(&mut polling, 2, 1), (false, 0));
        assert_eq!(world.look(&mut polling, 2, 1), (true, 1));
    }

    #[test]
    fn it_rests_where_others_work_and_longer_if_they_still_do() {
        let (mut world, mut polling) = (World::new(), Polling::new(USUAL));
        let rests: Vec<_> = (0..8)
            .map(|_| {
                assert_eq!(world.look(&mut polling, 4000, 2), (true, 2), "what came meanwhile is there");
                let start = world.time;
                while world.look(&mut polling, 4000, 1) == (false, 0) {
                    world.time += Duration::from_millis(1);
                }
                world.time - start
            })
            .map(|rest| rest.as_millis())
            .collect();
        assert_eq!(rests, [25, 50, 100, 200, 400, 800, 1000, 1000]);
        world.time += Duration::from_secs(5);
        assert_eq!(world.look(&mut polling, 4000, 2), (true, 2));
        world.time += SHORTEST_REST;
        assert_eq!(world.look(&mut polling, 2, 2), (true, 2), "a new contest begins with the shortest rest");
    }
}
