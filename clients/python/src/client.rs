//! A client of the daemon.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sbdp_client::{Change, Client as SharedClient, ClientError, ConnectOptions, Handle};

use crate::arrays::ArrayMesh;
use crate::assembly::{Assembly, Data};
use crate::options::options;
use crate::session::Session;
use crate::signals::Signals;
use crate::stream::PlanStream;

/// A connection to the daemon. Threads may share it; it receives one plan at a time.
#[pyclass(frozen, module = "sbdp")]
pub(crate) struct Client {
    client: Mutex<Option<SharedClient>>,
    signals: Signals,
}

fn time(name: &str, seconds: f64) -> PyResult<Duration> {
    let time = Duration::try_from_secs_f64(seconds);
    time.map_err(|_| PyValueError::new_err(format!("{name}: {seconds} is no time in seconds")))
}

impl Client {
    fn client(&self) -> PyResult<SharedClient> {
        let client = self.client.lock().unwrap_or_else(PoisonError::into_inner).clone();
        client.ok_or_else(|| PyValueError::new_err("this client was closed"))
    }

    /// Runs a call without holding the interpreter lock.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        question: impl Send + FnOnce(&SharedClient) -> Result<T, ClientError>,
    ) -> PyResult<T> {
        let client = self.client()?;
        py.detach(|| question(&client)).map_err(|error| self.signals.raised(py, &error))
    }
}

#[pymethods]
impl Client {
    #[new]
    #[pyo3(signature = (runtime_dir=None, *, timeout=10.0, upload_timeout=300.0, reconnect=10.0, busy_wait=0.0))]
    fn new(
        py: Python<'_>,
        runtime_dir: Option<PathBuf>,
        timeout: f64,
        upload_timeout: f64,
        reconnect: f64,
        busy_wait: f64,
    ) -> PyResult<Self> {
        let signals = Signals::default();
        let options = ConnectOptions {
            runtime_dir,
            timeout: time("timeout", timeout)?,
            upload_timeout: time("upload_timeout", upload_timeout)?,
            reconnect: time("reconnect", reconnect)?,
            busy_wait: time("busy_wait", busy_wait)?,
            interrupt: Some(signals.interrupt()),
            ..ConnectOptions::default()
        };
        let client = py.detach(|| SharedClient::connect_with(options)).map_err(|e| signals.raised(py, &e))?;
        Ok(Self { client: Mutex::new(Some(client)), signals })
    }

    /// Uploads an assembly; plans do this automatically.
    fn upload(&self, py: Python<'_>, assembly: &Assembly) -> PyResult<Vec<u8>> {
        let data = Arc::clone(&assembly.data);
        let upload = |client: &SharedClient| client.upload(&sbdp_client::Meshes::assembly(&*data));
        Ok(self.ask(py, upload)?.0.to_vec())
    }

    /// Uploads the changes of an assembly; `sbdp.revise` makes the parts.
    fn revise(
        &self,
        py: Python<'_>,
        base: &Assembly,
        parts: Vec<(String, Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    ) -> PyResult<Assembly> {
        let mesh = |(name, vertices, triangles): (String, Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let mesh = ArrayMesh::new(&name, &vertices, &triangles)?;
            Ok((name, mesh))
        };
        let parts = parts.into_iter().map(mesh).collect::<PyResult<_>>()?;
        let hand_over =
            |base: Handle, change: &Change<'_>| self.ask(py, |client| client.revise(base, change));
        let data = Arc::new(Data::revised(&base.data, parts, hand_over)?);
        Ok(Assembly { data })
    }

    /// Whether the daemon knows an assembly.
    fn knows(&self, py: Python<'_>, assembly: &Assembly) -> PyResult<bool> {
        let data = Arc::clone(&assembly.data);
        self.ask(py, |client| client.knows(sbdp_client::Meshes::handle(&*data)))
    }

    /// Requests a plan.
    #[pyo3(signature = (assembly, /, *, views=false, **keywords))]
    fn plan(
        &self,
        py: Python<'_>,
        assembly: &Assembly,
        views: bool,
        keywords: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PlanStream> {
        let data = &assembly.data;
        let options = options(py, data, keywords)?;
        let stream = self.ask(py, |client| client.plan(Data::subject(data), &options))?;
        Ok(PlanStream::new(stream, data, self.signals.clone(), views))
    }

    /// Begins a session.
    #[pyo3(signature = (assembly, /, **keywords))]
    fn session(
        &self,
        py: Python<'_>,
        assembly: &Assembly,
        keywords: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Session> {
        let data = &assembly.data;
        let options = options(py, data, keywords)?;
        let session = self.client()?.session(Data::subject(data), options);
        let session = session.map_err(|error| self.signals.raised(py, &error))?;
        Ok(Session::new(session, data, self.signals.clone()))
    }

    /// All metrics of the daemon.
    fn metrics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.ask(py, SharedClient::metrics)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    #[getter]
    fn pid(&self) -> PyResult<u32> {
        Ok(self.client()?.pid())
    }

    #[getter]
    fn restarts(&self) -> PyResult<u32> {
        Ok(self.client()?.restarts())
    }

    /// Closes the connection, once no stream uses it.
    fn close(&self) {
        drop(self.client.lock().unwrap_or_else(PoisonError::into_inner).take());
    }

    fn __enter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __exit__(&self, _class: &Bound<'_, PyAny>, _error: &Bound<'_, PyAny>, _trace: &Bound<'_, PyAny>) {
        self.close();
    }
}
