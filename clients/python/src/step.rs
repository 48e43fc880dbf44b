//! A step of a plan.

use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::PyArray2;
use pyo3::exceptions::PyBufferError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyTuple;
use sbdp_client::{Step as ClientStep, StepEnd};

use crate::arrays::{path_copy, path_view};
use crate::assembly::Data;

/// A step that may be taken back: one that is read in place ends when the next one is requested.
pub(crate) type Lent = Arc<Mutex<Option<ClientStep>>>;

/// Parts that move as one rigid body.
#[pyclass(frozen, module = "sbdp")]
pub(crate) struct Step {
    lent: Lent,
    data: Arc<Data>,
    /// Counts the arrays that are views; none if arrays are copies.
    views: Option<Arc<AtomicUsize>>,
    path: PyOnceLock<Py<PyArray2<f64>>>,
}

impl Step {
    pub(crate) fn new(step: ClientStep, data: &Arc<Data>, views: Option<Arc<AtomicUsize>>) -> (Self, Lent) {
        let lent = Arc::new(Mutex::new(Some(step)));
        let this = Self { lent: Arc::clone(&lent), data: Arc::clone(data), views, path: PyOnceLock::new() };
        (this, lent)
    }

    pub(crate) fn step(&self) -> PyResult<ClientStep> {
        let lent = self.lent.lock().unwrap_or_else(PoisonError::into_inner);
        let over =
            "this step was read in place, and ended when the next one was asked for; copy what you keep";
        lent.clone().ok_or_else(|| PyBufferError::new_err(over))
    }
}

#[pymethods]
impl Step {
    #[getter]
    fn number(&self) -> PyResult<u32> {
        Ok(self.step()?.view().number)
    }

    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.step()?.view().parts.iter().map(|&part| self.data.name(part)))
    }

    #[getter]
    fn of(&self) -> PyResult<Option<u32>> {
        Ok(self.step()?.view().of)
    }

    #[getter]
    fn ends(&self) -> PyResult<&'static str> {
        Ok(match self.step()?.view().ends {
            StepEnd::Out => "out",
            StepEnd::Aside => "aside",
            StepEnd::In => "in",
        })
    }

    #[getter]
    fn motion(&self) -> PyResult<&'static str> {
        Ok(if self.step()?.view().rotates { "rotation" } else { "translation" })
    }

    #[getter]
    fn path<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let step = self.step()?;
        match &self.views {
            // Not kept here: the caller must be able to let it go.
            Some(views) => path_view(py, &step, views),
            None => {
                let path = self.path.get_or_try_init(py, || path_copy(py, &step).map(Bound::unbind))?;
                Ok(path.bind(py).clone())
            }
        }
    }

    #[getter]
    fn verified_depth(&self) -> PyResult<f64> {
        Ok(self.step()?.view().verified_depth)
    }

    #[getter]
    fn requires<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.step()?.view().requires)
    }

    #[getter]
    fn wave(&self) -> PyResult<u32> {
        Ok(self.step()?.view().wave)
    }

    #[getter]
    fn direction(&self) -> PyResult<Option<(f64, f64, f64)>> {
        Ok(self.step()?.view().direction.map(|[x, y, z]| (x, y, z)))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (number, parts) = (self.number()?, self.parts(py)?);
        Ok(format!("<sbdp.Step {number}: {} {}>", parts.repr()?, self.ends()?))
    }
}
