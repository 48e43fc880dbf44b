//! Schedules: when which arm (a worker's hand, a robot's arm) carries out which step of a plan.
//!
//! Data flow: how long moving takes ([`MotionTimes`]) and what a step sweeps → [`Operation`] → [`schedule`]: list
//! scheduling. Whenever an arm is free, the operation begins that the longest chain of others waits for (R. L. Graham,
//! "Bounds on multiprocessing timing anomalies", 1969). What has to be held needs arms, too. Or [`stations`]: the steps of a
//! plan in its order, cut into as many pieces as a line has stations.

mod list_scheduling;
mod stations;
mod times;

pub use list_scheduling::{Held, Operation, Schedule, ScheduleError, ScheduledOperation, schedule};
pub use stations::stations;
pub use times::MotionTimes;

#[cfg(test)]
mod tests;
