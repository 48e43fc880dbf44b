//! A plan as it comes in.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Poll;
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyBufferError, PyTimeoutError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sbdp_client::{
    ClientError, Event, Plan as ClientPlan, PlanStream as ClientStream, Progress, Stage, Step as ClientStep,
    Summary,
};

use crate::assembly::{Data, SLICE};
use crate::options::seconds;
use crate::plan::{Plan, document, json};
use crate::signals::Signals;
use crate::step::{Lent, Step};

/// Steps as they are found. It is an iterator, and closing it cancels the request.
#[pyclass(module = "sbdp")]
pub(crate) struct PlanStream {
    /// None once it is closed. Nobody waits for the lock: all use is exclusive, which Python does not know.
    stream: Option<Mutex<ClientStream>>,
    data: Arc<Data>,
    signals: Signals,
    /// Counts the arrays that are views; none if steps are copied.
    views: Option<Arc<AtomicUsize>>,
    /// The last step that was yielded, if it is read in place.
    lent: Option<Lent>,
    /// The copied steps so far.
    steps: Vec<ClientStep>,
    summary: Option<Summary>,
    plan: Option<Py<Plan>>,
    progress: Option<Progress>,
    restarts: u32,
}

/// The next event.
enum Next {
    Step(ClientStep),
    Nothing,
    Over,
}

impl PlanStream {
    pub(crate) fn new(stream: ClientStream, data: &Arc<Data>, signals: Signals, views: bool) -> Self {
        Self {
            stream: Some(Mutex::new(if views { stream.in_place() } else { stream })),
            data: Arc::clone(data),
            signals,
            views: views.then(Arc::default),
            lent: None,
            steps: Vec::new(),
            summary: None,
            plan: None,
            progress: None,
            restarts: 0,
        }
    }

    /// Ends what was read in place: no view of it may exist.
    fn take_back(&mut self) -> PyResult<()> {
        if let Some(views) = &self.views
            && views.load(Ordering::Relaxed) > 0
        {
            let text =
                "a view of the last step is still held: copy what you keep, and let it go before asking on";
            return Err(PyBufferError::new_err(text));
        }
        if let Some(lent) = self.lent.take() {
            lent.lock().unwrap_or_else(PoisonError::into_inner).take();
        }
        Ok(())
    }

    /// Waits for the next step, until `until` or for ever.
    fn next(&mut self, py: Python<'_>, until: Option<Instant>) -> PyResult<Next> {
        self.take_back()?;
        loop {
            let Some(stream) = &mut self.stream else { return Ok(Next::Over) };
            let stream = stream.get_mut().unwrap_or_else(PoisonError::into_inner);
            let left = until.map(|until| until.saturating_duration_since(Instant::now()));
            let polled = py.detach(|| stream.poll_event(left.map_or(SLICE, |left| left.min(SLICE))));
            let event = match polled {
                Ok(Poll::Ready(event)) => event,
                Ok(Poll::Pending) => {
                    py.check_signals()?;
                    if left.is_some_and(|left| left <= SLICE) {
                        return Ok(Next::Nothing);
                    }
                    continue;
                }
                Err(error) => {
                    if !matches!(error, ClientError::ViewsHeld) {
                        self.stream = None;
                    }
                    return Err(self.signals.raised(py, &error));
                }
            };
            match event {
                Some(Event::Progress(progress)) => self.progress = Some(progress),
                Some(Event::Step(step)) => return Ok(Next::Step(step)),
                Some(Event::Trace(_)) => {}
                Some(Event::Restarted) => {
                    self.steps.clear();
                    self.restarts += 1;
                }
                Some(Event::Done(summary)) => {
                    self.summary = Some(summary);
                    self.stream = None;
                    return Ok(Next::Over);
                }
                None => {
                    self.stream = None;
                    return Ok(Next::Over);
                }
            }
        }
    }

    /// The step as Python has it.
    fn yielded<'py>(&mut self, py: Python<'py>, step: ClientStep) -> PyResult<Bound<'py, Step>> {
        if self.views.is_none() {
            self.steps.push(step.clone());
        }
        let (made, lent) = Step::new(step, &self.data, self.views.clone());
        if self.views.is_some() {
            self.lent = Some(lent);
        }
        Bound::new(py, made)
    }
}

#[pymethods]
impl PlanStream {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, Step>>> {
        match self.next(py, None)? {
            Next::Step(step) => self.yielded(py, step).map(Some),
            Next::Nothing | Next::Over => Ok(None),
        }
    }

    /// The next step if it arrives within a time, otherwise None.
    #[pyo3(signature = (timeout=0.0))]
    fn poll<'py>(&mut self, py: Python<'py>, timeout: f64) -> PyResult<Option<Bound<'py, Step>>> {
        let within = Duration::try_from_secs_f64(timeout);
        let within = within.map_err(|_| PyValueError::new_err("timeout: no time in seconds"))?;
        match self.next(py, Instant::now().checked_add(within))? {
            Next::Step(step) => self.yielded(py, step).map(Some),
            Next::Nothing | Next::Over => Ok(None),
        }
    }

    /// Waits for the end, and returns the whole plan.
    #[pyo3(signature = (timeout=None))]
    fn result(slf: &Bound<'_, Self>, timeout: Option<Bound<'_, PyAny>>) -> PyResult<Py<Plan>> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut()?;
        if this.views.is_some() {
            let text = "a plan whose steps are read in place is not kept; leave out views=True";
            return Err(PyBufferError::new_err(text));
        }
        if let Some(plan) = &this.plan {
            return Ok(plan.clone_ref(py));
        }
        let within = timeout.map(|timeout| seconds("timeout", &timeout)).transpose()?.flatten();
        let until = within.and_then(|within| Instant::now().checked_add(within));
        loop {
            match this.next(py, until)? {
                Next::Step(step) => this.steps.push(step),
                Next::Nothing => return Err(PyTimeoutError::new_err("the plan has not come to its end yet")),
                Next::Over => break,
            }
        }
        let Some(summary) = this.summary.clone() else {
            return Err(PyValueError::new_err("the stream was closed before the plan had come to its end"));
        };
        let plan = ClientPlan { steps: std::mem::take(&mut this.steps), summary, trace: String::new() };
        let plan = Py::new(py, Plan::new(plan, &this.data))?;
        this.plan = Some(plan.clone_ref(py));
        Ok(plan)
    }

    /// The plan's document without its steps, once it has ended; None before.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(summary) = &self.summary else { return Ok(None) };
        let text = json(&document(summary, &[], &self.data))?;
        py.import("json")?.call_method1("loads", (text,)).map(Some)
    }

    #[getter]
    fn status(&self) -> Option<&'static str> {
        self.summary.as_ref().map(|summary| summary.status.name())
    }

    /// Whether nothing more will come.
    #[getter]
    fn done(&self) -> bool {
        self.stream.is_none()
    }

    #[getter]
    fn restarts(&self) -> u32 {
        self.restarts
    }

    #[getter]
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(progress) = self.progress else { return Ok(None) };
        let dict = PyDict::new(py);
        let stage = match progress.stage {
            Stage::Sdf => "sdf",
            Stage::Search => "search",
            Stage::Transfer => "transfer",
        };
        dict.set_item("stage", stage)?;
        dict.set_item("done", progress.done)?;
        dict.set_item("total", progress.total)?;
        dict.set_item("simulations", progress.simulations)?;
        dict.set_item("part", progress.tried.map(|tried| tried.part))?;
        dict.set_item("turns", progress.tried.is_some_and(|tried| tried.turns))?;
        Ok(Some(dict))
    }

    /// Asks the daemon to stop. The plan so far still arrives.
    fn cancel(&mut self) {
        if let Some(stream) = &mut self.stream {
            stream.get_mut().unwrap_or_else(PoisonError::into_inner).cancel();
        }
    }

    /// Ends the request.
    fn close(&mut self) {
        self.stream = None;
    }

    fn __enter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __exit__(&mut self, _class: &Bound<'_, PyAny>, _error: &Bound<'_, PyAny>, _trace: &Bound<'_, PyAny>) {
        self.close();
    }
}
