//! Client of the sbdp daemon: sends meshes and receives disassembly plans through shared memory. `README.md` describes
//! everything that a client can do.
//!
//! # Plan
//! ```no_run
//! use sbdp_client::{Assembly, Client, Event, PlanOptions};
//! # fn main() -> Result<(), sbdp_client::ClientError> {
//! # let assembly = Assembly::default();
//! let client = Client::connect()?;                  // `sbdpd` is running
//! let handle = client.upload(&assembly)?;           // known content is not sent again
//! let mut stream = client.plan(handle, &PlanOptions::default())?;
//! while let Some(event) = stream.next_event()? {    // steps as they are found
//!     match event {
//!         Event::Progress(progress) => eprintln!("{progress:?}"),
//!         Event::Step(step) => println!("parts {:?} along {:?}", step.view().parts, step.view().path),
//!         Event::Trace(lines) => print!("{lines}"),
//!         Event::Restarted => println!("another daemon: the steps come again"),
//!         Event::Done(summary) => println!("{}", summary.status.name()),
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! [`PlanStream::plan_to_end`] waits for the whole [`Plan`].
//!
//! # Plan again after a change
//! [`PlanOptions`] names parts that are removed, locked, wanted or moved. [`Client::revise`] changes meshes:
//!
//! ```no_run
//! use sbdp_client::{Change, Client, Handle, Part, PlanOptions, Vertices};
//! # fn main() -> Result<(), sbdp_client::ClientError> {
//! # let (client, handle) = (Client::connect()?, Handle([0; 32]));
//! # let (vertices, triangles) = (vec![[0.0; 3]], vec![[0; 3]]);
//! let longer = Part { name: "bolt", vertices: Vertices::F64(&vertices), triangles: &triangles };
//! let changed = client.revise(handle, &Change { replaced: vec![(3, longer)], ..Change::default() })?;
//! let plan = client.plan(changed, &PlanOptions::default())?.plan_to_end()?;
//! # Ok(())
//! # }
//! ```
//!
//! # Carry out a plan
//! A [`Session`] records what was done and what failed, and plans the rest from there:
//!
//! ```no_run
//! use std::time::Duration;
//!
//! use sbdp_client::{Client, Handle, PlanOptions};
//! # fn main() -> Result<(), sbdp_client::ClientError> {
//! # let (client, handle) = (Client::connect()?, Handle([0; 32]));
//! let options = PlanOptions { timeout: Some(Duration::from_millis(50)), ..PlanOptions::default() };
//! let mut session = client.session(handle, options)?;
//! let plan = session.replan()?.plan_to_end()?;
//! session.performed(&plan.steps[0]);
//! session.stuck(plan.steps[1].view().parts[0]);     // the rest is planned without it
//! let rest = session.replan()?.plan_to_end()?;
//! # Ok(())
//! # }
//! ```
//!
//! All calls block, with timeouts. The message of every [`ClientError`] says what to do.

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
pub use sbdp_ipc::plan::{Gravity, Reports, Steady, StepEnd, StepView, Waypoint};
pub use sbdp_ipc::status::Status;
pub use sbdp_ipc::summary::Stats;
pub use sbdp_ipc::summary::report::{self, Report};
pub use session::Session;
pub use step::Step;
pub use stream::{Event, PlanStream, Progress, Stage, Tried};
pub use subject::{Meshes, Subject};
pub use summary::{Base, Blocked, FreeGroup, Overlap, PlanStatus, Summary, Warning};
pub use upload::Change;
