//! Schedules: when which arm (a worker's hand, a robot's arm) carries out which step of a plan.
//!
//! Data flow: how long moving takes ([`MotionTimes`]) and what a step sweeps → [`Operation`] → [`schedule`]: list
//! scheduling. Whenever an arm is free, the operation begins that the longest chain of others waits for (R. L. Graham,
//! "Bounds on multiprocessing timing anomalies", 1969). What has to be held needs arms, too.

mod list_scheduling;
mod times;

pub use list_scheduling::{Held, Operation, Schedule, ScheduleError, ScheduledOperation, schedule};
pub use times::MotionTimes;

#[cfg(test)]
mod tests;
