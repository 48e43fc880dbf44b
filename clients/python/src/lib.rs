//! The Python module `sbdp._native`: the owned client core, with numpy arrays in and out. What Python can say better, as
//! conversions of meshes and starting a daemon, is beside it in `python/sbdp`.

mod arrays;
mod assembly;
mod client;
mod error;
mod options;
mod plan;
mod session;
mod signals;
mod step;
mod stream;

use pyo3::prelude::*;

/// What the package `sbdp` is made of.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::assembly::{Assembly, load};
    #[pymodule_export]
    use crate::client::Client;
    #[pymodule_export]
    use crate::plan::Plan;
    #[pymodule_export]
    use crate::session::Session;
    #[pymodule_export]
    use crate::step::Step;
    #[pymodule_export]
    use crate::stream::PlanStream;

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
