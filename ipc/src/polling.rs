//! Looking for what is waited for, for a moment, before going to sleep.
//!
//! To wake a process takes the system 10 to 60 µs, depending on how deep the processor had gone to sleep;
//! what an answer from memory takes is less. So whoever expects something at once first looks by itself, and
//! lets others run between two looks. Where that does not pay it stops by itself: where nothing comes in
//! time it looks more and more rarely, and where others need the processors it rests, for a thread that
//! gives way to a busy one may get the processor back after milliseconds only.

use std::time::{Duration, Instant};

/// For how long is looked, unless told otherwise: about what it takes to be woken.
pub const USUAL: Duration = Duration::from_micros(50);

/// After one wait that was in vain the next 1 is not begun by looking, then 3, 7 and so on up to this.
const LONGEST_OMISSION: u32 = 255;
/// Who gets the processor back no sooner than this gave way to somebody with work to do.
const CONTESTED: Duration = Duration::from_micros(500);
/// The rest after that; twice as long each time it turns out to have been too short.
const SHORTEST_REST: Duration = Duration::from_millis(25);
const LONGEST_REST: Duration = Duration::from_secs(1);

/// Whether and how long to look before sleeping.
#[derive(Debug)]
pub struct Polling {
    limit: Duration,
    /// Waits that are not begun by looking, after the last in vain.
    omission: u32,
    /// Those of them that are still to come.
    omitted: u32,
    rest: Duration,
    rest_until: Option<Instant>,
}

impl Polling {
    /// Looks for so long before each sleep; zero for never.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self { limit, omission: 0, omitted: 0, rest: SHORTEST_REST, rest_until: None }
    }

    /// Looks until `is_there`, for a moment or not at all; whether it is there.
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

    /// Rests; longer than the last time if that has just been.
    fn rest_from(&mut self, start: Instant, time: Instant) {
        let again = self.rest_until.is_some_and(|end| start < end + self.rest);
        self.rest = if again { (self.rest * 2).min(LONGEST_REST) } else { SHORTEST_REST };
        self.rest_until = Some(time + self.rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock by which a look, with what others do meanwhile, takes so long.
    struct World {
        time: Instant,
        looks: u32,
    }

    impl World {
        fn new() -> Self {
            Self { time: Instant::now(), looks: 0 }
        }

        /// What looking says if it is there at the look with this number, from 1, and how often it looked.
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
