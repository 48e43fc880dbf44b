//! A whole plan.

use std::sync::{Arc, OnceLock};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyTuple;
use sbdp::document::PlanDocument;
use sbdp_client::{Plan as ClientPlan, Step as ClientStep, Summary};

use crate::assembly::Data;
use crate::step::Step;

/// A finished plan.
#[pyclass(frozen, module = "sbdp")]
pub(crate) struct Plan {
    plan: ClientPlan,
    data: Arc<Data>,
    steps: PyOnceLock<Py<PyTuple>>,
    json: OnceLock<String>,
}

/// The document of a plan, as the command line writes it.
pub(crate) fn document(summary: &Summary, steps: &[ClientStep], data: &Data) -> PlanDocument {
    let document = summary.document(steps);
    match data.files() {
        Some((assembly, source)) => sbdp::document::with_files(document, assembly, source.clone()),
        None => document,
    }
}

/// That document as JSON, in a line.
pub(crate) fn json(document: &PlanDocument) -> PyResult<String> {
    let json = document.to_json();
    json.map(|text| text + "\n").map_err(|error| PyRuntimeError::new_err(error.to_string()))
}

impl Plan {
    pub(crate) fn new(plan: ClientPlan, data: &Arc<Data>) -> Self {
        Self { plan, data: Arc::clone(data), steps: PyOnceLock::new(), json: OnceLock::new() }
    }
}

#[pymethods]
impl Plan {
    #[getter]
    fn status(&self) -> &'static str {
        self.plan.summary.status.name()
    }

    #[getter]
    fn reason(&self) -> Option<&str> {
        self.plan.summary.reason.as_deref()
    }

    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.plan.summary.parts)
    }

    #[getter]
    fn remaining<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.plan.summary.remaining.iter().map(|&part| self.plan.summary.part_name(part)))
    }

    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let made = self.steps.get_or_try_init(py, || {
            let steps = self.plan.steps.iter().map(|step| Step::new(step.clone(), &self.data, None).0);
            let steps: Vec<Bound<'py, Step>> = steps.map(|s| Bound::new(py, s)).collect::<PyResult<_>>()?;
            PyTuple::new(py, steps).map(Bound::unbind)
        })?;
        Ok(made.bind(py).clone())
    }

    /// The steps that move a part.
    fn steps_of<'py>(&self, py: Python<'py>, part: &str) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let number = self.data.part(py, part)?;
        let moves = self.plan.steps.iter().map(|step| step.view().parts.contains(&number));
        let steps = self.steps(py)?;
        Ok(steps.iter().zip(moves).filter_map(|(step, moves)| moves.then_some(step)).collect())
    }

    /// The plan as the command line writes it.
    fn to_json(&self, py: Python<'_>) -> PyResult<&str> {
        if let Some(json) = self.json.get() {
            return Ok(json);
        }
        let text = py.detach(|| json(&document(&self.plan.summary, &self.plan.steps, &self.data)))?;
        Ok(self.json.get_or_init(|| text))
    }

    /// The same as a dictionary.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.to_json(py)?,))
    }

    fn __len__(&self) -> usize {
        self.plan.steps.len()
    }

    fn __repr__(&self) -> String {
        format!("<sbdp.Plan {} in {} steps>", self.status(), self.plan.steps.len())
    }
}
