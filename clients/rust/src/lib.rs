//! Client of the sbdp daemon: hands meshes over and reads plans in shared memory.
//!
//! ```no_run
//! use sbdp_client::{Assembly, Client, Event, PlanOptions};
//! # fn main() -> Result<(), sbdp_client::ClientError> {
//! # let assembly = Assembly::default();
//! let client = Client::connect()?;
//! let handle = client.upload(&assembly)?;
//! let mut stream = client.plan(handle, &PlanOptions::default())?;
//! while let Some(event) = stream.next_event()? {
//!     match event {
//!         Event::Progress(progress) => eprintln!("{progress:?}"),
//!         Event::Step(step) => {
//!             let step = step.view();
//!             println!("parts {:?} along {} waypoints", step.parts, step.path.len());
//!         }
//!         Event::Trace(lines) => print!("{lines}"),
//!         Event::Restarted => println!("another daemon: the steps come again"),
//!         Event::Done(summary) => println!("{}", summary.status.name()),
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Everything blocks, with timeouts; every [`ClientError`] says what to do.

mod client;
mod connection;
mod content_hash;
mod document;
mod error;
mod exchange;
mod interrupt;
mod message;
mod options;
mod patience;
mod plan;
mod process_bound;
mod session;
mod step;
mod stream;
mod subject;
mod summary;
mod upload;

pub use client::Client;
pub use content_hash::content_hash;
pub use error::ClientError;
pub use interrupt::Interrupt;
pub use options::{
    ActionSet, ConnectOptions, Engine, Handle, PenaltyParameter, PlanOptions, Planner, Staging,
    StaticAnalysis,
};
pub use plan::Plan;
pub use sbdp_ipc::document::PlanDocument;
pub use sbdp_ipc::error::ErrorCode;
pub use sbdp_ipc::geometry::{Assembly, Part, Vertices};
pub use sbdp_ipc::plan::{StepEnd, StepView, Waypoint};
pub use sbdp_ipc::status::Status;
pub use sbdp_ipc::summary::Stats;
pub use session::Session;
pub use step::Step;
pub use stream::{Event, PlanStream, Progress, Stage};
pub use subject::{Meshes, Subject};
pub use summary::{Base, Blocked, FreeGroup, Overlap, PlanStatus, Summary, Warning};
pub use upload::Change;
