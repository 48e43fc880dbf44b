//! Benchmarks that ask daemons of their own, as clients do.
//!
//! `server` starts daemons and ends them, `asking` plans to the end. `latency` (beside `raw_peer`, which
//! only copies) asks the same again, `replan` what changed, `restart` a daemon that was started again;
//! `churn` and `load` (and its soak) watch what a daemon holds while many things are asked.

mod asking;
mod churn;
mod latency;
mod load;
mod raw_peer;
mod replan;
mod restart;
mod server;

pub use churn::{Churn, ChurnRequest, ChurnSample, churn};
pub use latency::{Latency, LatencyRequest, Percentiles, latency};
pub use load::{
    DaemonFigures, Kind, KindFigures, Load, LoadClient, LoadRequest, Phase, ProcessFootprint, Role, Soak,
    SoakRequest, load, load_client, soak,
};
pub use raw_peer::serve as serve_raw;
pub use replan::{Cost, ReplanRecord, replan};
pub use restart::{Restart, restart};

use super::BenchError;
