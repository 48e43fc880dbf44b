//! Planning again while an assembly is being taken apart.

use std::sync::Arc;

use pyo3::prelude::*;
use sbdp_client::Session as ClientSession;

use crate::assembly::Data;
use crate::options::{parts, pose, seconds};
use crate::signals::Signals;
use crate::step::Step;
use crate::stream::PlanStream;

/// What has happened to an assembly, and plans for the rest.
#[pyclass(module = "sbdp")]
pub(crate) struct Session {
    session: ClientSession,
    data: Arc<Data>,
    signals: Signals,
}

impl Session {
    pub(crate) fn new(session: ClientSession, data: &Arc<Data>, signals: Signals) -> Self {
        Self { session, data: Arc::clone(data), signals }
    }
}

#[pymethods]
impl Session {
    /// Records that these parts are out.
    fn executed(&mut self, parts_: &Bound<'_, PyAny>) -> PyResult<()> {
        self.session.executed(&parts(&self.data, parts_)?);
        Ok(())
    }

    /// Records that a step of the last plan was done.
    fn performed(&mut self, step: &Step) -> PyResult<()> {
        self.session.performed(&step.step()?);
        Ok(())
    }

    /// Records that this part does not move.
    fn stuck(&mut self, py: Python<'_>, part: &str) -> PyResult<()> {
        self.session.stuck(self.data.part(py, part)?);
        Ok(())
    }

    /// Records that this part moves again.
    fn freed(&mut self, py: Python<'_>, part: &str) -> PyResult<()> {
        self.session.freed(self.data.part(py, part)?);
        Ok(())
    }

    /// Records that this part stands elsewhere.
    fn moved(&mut self, py: Python<'_>, part: &str, pose_: &Bound<'_, PyAny>) -> PyResult<()> {
        self.session.moved(self.data.part(py, part)?, pose(pose_)?);
        Ok(())
    }

    /// Plans how the rest comes apart.
    #[pyo3(signature = (timeout=None, *, views=false))]
    fn replan(
        &mut self,
        py: Python<'_>,
        timeout: Option<Bound<'_, PyAny>>,
        views: bool,
    ) -> PyResult<PlanStream> {
        if let Some(timeout) = timeout {
            self.session.options_mut().timeout = seconds("timeout", &timeout)?;
        }
        let session = &mut self.session;
        let stream = py.detach(|| session.replan()).map_err(|error| self.signals.raised(py, &error))?;
        Ok(PlanStream::new(stream, &self.data, self.signals.clone(), views))
    }
}
