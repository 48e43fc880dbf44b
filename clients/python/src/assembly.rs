//! Assemblies: from files, or from arrays.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use numpy::PyArray2;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sbdp::cache::CacheSettings;
use sbdp::document::SourceDocument;
use sbdp::exchange;
use sbdp::files::{self, IgnorePattern, LoadOptions, StepSettings};
use sbdp::geometry::{SourceAssembly, content_hash};
use sbdp_client::{Assembly as WireAssembly, Change, Handle, Meshes, Subject, Vertices};

use crate::arrays::{ArrayMesh, rows_copy};
use crate::error::{no_such_part, refused};

/// How long Ctrl-C may go unnoticed.
pub(crate) const SLICE: Duration = Duration::from_millis(50);

/// An assembly, its meshes and the names of its parts. It is immutable.
#[pyclass(frozen, module = "sbdp")]
#[derive(Clone)]
pub(crate) struct Assembly {
    pub(crate) data: Arc<Data>,
}

/// What an assembly is made of.
pub(crate) struct Data {
    pub(crate) names: Vec<String>,
    pub(crate) origin: Origin,
    handle: OnceLock<Handle>,
}

pub(crate) enum Origin {
    /// Files, with what plans say about these.
    Files(Box<(SourceAssembly, SourceDocument)>),
    /// Arrays of the caller.
    Arrays(ArrayAssembly),
    /// Another assembly with other meshes for some parts, and further parts.
    Revised(Revision),
}

pub(crate) struct ArrayAssembly {
    name: String,
    units: Option<String>,
    fixed: Vec<String>,
    meshes: Vec<ArrayMesh>,
}

/// Changes of another assembly, by the indices of parts there.
pub(crate) struct Revision {
    base: Arc<Data>,
    replaced: BTreeMap<u32, ArrayMesh>,
    /// They have the last names.
    added: Vec<ArrayMesh>,
}

impl Meshes for Data {
    fn assembly(&self) -> WireAssembly<'_> {
        match &self.origin {
            Origin::Files(files) => exchange::wire_assembly(&files.0),
            Origin::Arrays(arrays) => WireAssembly {
                name: &arrays.name,
                units: arrays.units.as_deref(),
                parts: arrays.meshes.iter().zip(&self.names).map(|(mesh, name)| mesh.part(name)).collect(),
                fixed: arrays.fixed.iter().map(String::as_str).collect(),
            },
            Origin::Revised(revision) => {
                let mut assembly = revision.base.assembly();
                let added = self.names.iter().skip(assembly.parts.len());
                for (place, part) in assembly.parts.iter_mut().enumerate() {
                    if let Some(mesh) = revision.replaced.get(&(place as u32)) {
                        *part = mesh.part(part.name);
                    }
                }
                assembly.parts.extend(revision.added.iter().zip(added).map(|(mesh, name)| mesh.part(name)));
                assembly
            }
        }
    }

    fn handle(&self) -> Handle {
        *self.handle.get_or_init(|| sbdp_client::content_hash(&self.assembly()))
    }
}

impl Data {
    pub(crate) fn new(names: Vec<String>, origin: Origin) -> Self {
        Self { names, origin, handle: OnceLock::new() }
    }

    /// Revisions go by the daemon's handle, which cannot be computed from meshes.
    pub(crate) fn subject(this: &Arc<Self>) -> Subject {
        match &this.origin {
            Origin::Revised(_) => this.handle().into(),
            Origin::Files(_) | Origin::Arrays(_) => Arc::clone(this).into(),
        }
    }

    /// This assembly with other meshes for parts that it has, and with those that it has not. `hand_over` sends the
    /// changes to the daemon and returns the new handle.
    pub(crate) fn revised(
        this: &Arc<Self>,
        parts: Vec<(String, ArrayMesh)>,
        hand_over: impl FnOnce(Handle, &Change<'_>) -> PyResult<Handle>,
    ) -> PyResult<Self> {
        let places: HashMap<&str, u32> = (0..).zip(&this.names).map(|(n, name)| (name.as_str(), n)).collect();
        let (mut names, mut replaced, mut added) = (this.names.clone(), BTreeMap::new(), Vec::new());
        for (name, mesh) in parts {
            match places.get(name.as_str()) {
                Some(place) => drop(replaced.insert(*place, mesh)),
                None => {
                    names.push(name);
                    added.push(mesh);
                }
            }
        }
        let change = Change {
            replaced: replaced.iter().map(|(n, mesh)| (*n, mesh.part(this.name(*n)))).collect(),
            added: added.iter().zip(&names[this.names.len()..]).map(|(mesh, name)| mesh.part(name)).collect(),
            moved: Vec::new(),
        };
        let handle = hand_over(this.handle(), &change)?;
        drop(change);
        let origin = Origin::Revised(Revision { base: Arc::clone(this), replaced, added });
        Ok(Self { names, origin, handle: handle.into() })
    }

    /// The assembly as it was read, if it is from files.
    pub(crate) fn files(&self) -> Option<(&SourceAssembly, &SourceDocument)> {
        match &self.origin {
            Origin::Files(files) => Some((&files.0, &files.1)),
            Origin::Arrays(_) | Origin::Revised(_) => None,
        }
    }

    pub(crate) fn fixed(&self) -> &[String] {
        match &self.origin {
            Origin::Files(files) => &files.0.fixed,
            Origin::Arrays(arrays) => &arrays.fixed,
            Origin::Revised(revision) => revision.base.fixed(),
        }
    }

    /// The number of a part.
    pub(crate) fn part(&self, py: Python<'_>, name: &str) -> PyResult<u32> {
        let found = self.names.iter().position(|n| n == name);
        found.map(|place| place as u32).ok_or_else(|| no_such_part(py, name))
    }

    /// The name of a part.
    pub(crate) fn name(&self, part: u32) -> &str {
        self.names.get(part as usize).map_or("?", String::as_str)
    }
}

#[pymethods]
impl Assembly {
    /// Parts are `(name, vertices, triangles)`, in natural order of the names; `sbdp.assembly` makes these.
    #[new]
    #[pyo3(signature = (parts, units=None, name=String::new(), fixed=Vec::new()))]
    fn new(
        py: Python<'_>,
        parts: Vec<(String, Bound<'_, PyAny>, Bound<'_, PyAny>)>,
        units: Option<String>,
        name: String,
        fixed: Vec<String>,
    ) -> PyResult<Self> {
        let mut parts = parts;
        parts.sort_by(|a, b| files::natural_order(&a.0, &b.0));
        if let Some(twice) = parts.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(PyValueError::new_err(format!("two parts are named `{}`", twice[0].0)));
        }
        let mesh = |(name, vertices, triangles): &(String, _, _)| ArrayMesh::new(name, vertices, triangles);
        let meshes = parts.iter().map(mesh).collect::<PyResult<_>>()?;
        let names: Vec<String> = parts.into_iter().map(|(name, ..)| name).collect();
        if let Some(unknown) = fixed.iter().find(|name| !names.contains(name)) {
            return Err(no_such_part(py, unknown));
        }
        let origin = Origin::Arrays(ArrayAssembly { name, units, fixed, meshes });
        Ok(Self { data: Arc::new(Data::new(names, origin)) })
    }

    #[getter]
    fn name(&self) -> &str {
        self.data.assembly().name
    }

    #[getter]
    fn units(&self) -> Option<&str> {
        self.data.assembly().units
    }

    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.data.names)
    }

    #[getter]
    fn fixed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.data.fixed())
    }

    #[getter]
    fn groups(&self) -> Vec<(String, Vec<String>)> {
        let files = self.data.files().map(|(assembly, _)| &assembly.groups[..]);
        files.unwrap_or_default().iter().map(|g| (g.name.clone(), g.parts.clone())).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.data.files().map(|(assembly, _)| assembly.notes.clone()).unwrap_or_default()
    }

    #[getter]
    fn handle(&self, py: Python<'_>) -> Vec<u8> {
        py.detach(|| self.data.handle()).0.to_vec()
    }

    /// Copies of a part's vertices, float64, and triangles, uint32.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn mesh<'py>(
        &self,
        py: Python<'py>,
        part: &str,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>)> {
        let assembly = self.data.assembly();
        let part = assembly.parts[self.data.part(py, part)? as usize];
        let vertices = match part.vertices {
            Vertices::F64(wide) => rows_copy(py, wide)?,
            Vertices::F32(_) => rows_copy(py, &part.vertices.iter().collect::<Vec<_>>())?,
        };
        Ok((vertices, rows_copy(py, part.triangles)?))
    }

    fn __len__(&self) -> usize {
        self.data.names.len()
    }

    fn __repr__(&self) -> String {
        format!("<sbdp.Assembly `{}` of {} parts>", self.name(), self.data.names.len())
    }
}

/// Reads an assembly as the command line does.
#[pyfunction]
#[pyo3(signature = (path, *, split=None, ignore=Vec::new(), deflection=None, converter=None))]
pub(crate) fn load(
    py: Python<'_>,
    path: PathBuf,
    split: Option<&str>,
    ignore: Vec<String>,
    deflection: Option<f64>,
    converter: Option<PathBuf>,
) -> PyResult<Assembly> {
    let wrong = PyValueError::new_err::<String>;
    let split = split.map(str::parse).transpose().map_err(wrong)?;
    let ignore =
        ignore.iter().map(|text| text.parse()).collect::<Result<Vec<IgnorePattern>, _>>().map_err(wrong)?;
    if deflection.is_some_and(|length| !(length.is_finite() && length > 0.0)) {
        return Err(PyValueError::new_err("deflection: give a length above 0, in mm"));
    }
    let usual = StepSettings::default();
    let step = StepSettings {
        converter,
        deflection: deflection.unwrap_or(usual.deflection),
        cache_folder: CacheSettings::default_folder(),
        ..usual
    };
    let options = LoadOptions { split, ignore: ignore.clone(), step: Some(step) };
    let (sender, receiver) = channel();
    let receiver = Mutex::new(receiver);
    let file = path.clone();
    // A thread of its own, so that Ctrl-C is heard: what it reads then is for nobody, and it ends by itself.
    std::thread::spawn(move || drop(sender.send(files::load(&file, &options))));
    let assembly = loop {
        let next = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(SLICE);
        match py.detach(next) {
            Ok(read) => break read.map_err(|error| refused(py, &error))?,
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(format!("reading {} failed", path.display())));
            }
        }
    };
    let content = sbdp::document::content_of(&content_hash(&assembly), &sbdp::geometry::Revision::default());
    let source = sbdp::document::source(&path, content, split, &ignore, deflection);
    let names = assembly.parts.iter().map(|part| part.name.clone()).collect();
    Ok(Assembly { data: Arc::new(Data::new(names, Origin::Files(Box::new((assembly, source))))) })
}
