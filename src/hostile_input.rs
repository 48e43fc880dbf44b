//! One entry to everything that reads foreign bytes, for `tests/fuzz`, which searches for bytes that
//! make it panic, hang or grow. Nothing else depends on it.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::WireError;
use sbdp_ipc::plan::{PlanRequest, StepsView};
use sbdp_ipc::revision;
use sbdp_ipc::status::Status;
use sbdp_ipc::summary::SummaryView;

use crate::cache::can_be_read;
use crate::config::Config;
use crate::daemon::uploaded_assembly;
use crate::files::{self, Split};
use crate::geometry::{self, Assembly, SourceAssembly, SourceMesh, SourcePart, Surface};
use crate::sdf;
use crate::service::RECORD_KINDS;
use crate::view::{self, PlanScene, Up, read_plan};

/// A reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reader {
    /// All messages of the wire but meshes.
    Messages,
    /// Uploads and revisions, not further than into source meshes.
    Meshes,
    /// Uploads, admitted as by the daemon.
    Admission,
    /// OBJ files.
    Obj,
    /// STL files.
    Stl,
    /// glTF and GLB scenes.
    Gltf,
    /// PLY files.
    Ply,
    /// OFF files.
    Off,
    /// The main model of 3MF files.
    ThreeMf,
    /// OBJ files, healed.
    Healing,
    /// `assembly.json`, `assembly.toml` and `translation.json`.
    Manifest,
    /// The daemon's configuration.
    Config,
    /// Records of the cache.
    Records,
    /// Files of distance fields.
    Fields,
    /// `daemon.json`.
    Endpoint,
    /// Plans as JSON, as instructions and as pictures.
    Plan,
    /// What a converter of STEP files writes to stdout.
    StepReport,
}

impl Reader {
    /// All of them.
    pub const ALL: [Self; 17] = [
        Self::Messages,
        Self::Meshes,
        Self::Admission,
        Self::Obj,
        Self::Stl,
        Self::Gltf,
        Self::Ply,
        Self::Off,
        Self::ThreeMf,
        Self::Healing,
        Self::Manifest,
        Self::Config,
        Self::Records,
        Self::Fields,
        Self::Endpoint,
        Self::Plan,
        Self::StepReport,
    ];

    /// Reads bytes. Returns the outcome in words, which differ for different paths through the reader.
    #[must_use]
    pub fn read(self, bytes: &[u8]) -> String {
        match self {
            Self::Messages => messages(bytes),
            Self::Meshes => meshes(bytes),
            Self::Admission => admission(bytes),
            Self::Obj => file("a.obj", bytes),
            Self::Stl => file("a.stl", bytes),
            Self::Gltf => file("a.gltf", bytes),
            Self::Ply => file("a.ply", bytes),
            Self::Off => file("a.off", bytes),
            Self::ThreeMf => {
                files::threemf_archive(bytes).map_or_else(|e| e, |archive| file("a.3mf", &archive))
            }
            Self::Healing => match files::parse_file("a.obj", bytes, Some(Split::None)) {
                Ok(assembly) => admitted(&assembly),
                Err(reason) => reason,
            },
            Self::Manifest => {
                String::from_utf8(bytes.to_vec()).map_or_else(|e| e.to_string(), |t| files::parse_notes(&t))
            }
            Self::Config => String::from_utf8(bytes.to_vec()).map_or_else(|e| e.to_string(), |t| config(&t)),
            Self::Records => records(bytes),
            Self::Fields => SOLID.as_ref().map_or_else(String::new, |solid| sdf::read_as_field(solid, bytes)),
            Self::Endpoint => {
                said(serde_json::from_slice::<sbdp_ipc::endpoint::Endpoint>(bytes).map_err(|e| e.to_string()))
            }
            Self::Plan => String::from_utf8(bytes.to_vec()).map_or_else(|e| e.to_string(), |t| plan(&t)),
            Self::StepReport => said(files::parse_step_report(bytes)),
        }
    }
}

/// Of this are the fields.
static SOLID: LazyLock<Option<Arc<Surface>>> = LazyLock::new(|| {
    let part = SourcePart { name: "a".into(), origin: "a.obj".into(), mesh: tetrahedron() };
    Some(Arc::new(Surface::new(&geometry::heal(&part).ok()?.mesh)))
});

/// A file of a distance field for [`Reader::Fields`], as it should be.
#[must_use]
pub fn field_file() -> Vec<u8> {
    SOLID.as_ref().map_or_else(Vec::new, sdf::a_field_file)
}

/// The kinds of records that bytes can be read as.
fn records(bytes: &[u8]) -> String {
    let kinds = RECORD_KINDS.into_iter().filter(|kind| can_be_read(kind, bytes));
    format!("{:?}", kinds.collect::<Vec<_>>())
}

fn said<T>(result: Result<T, String>) -> String {
    result.map_or_else(|reason| reason, |_| "fine".to_owned())
}

/// A file, taken apart in every way.
fn file(name: &str, bytes: &[u8]) -> String {
    let read = |split| match files::parse_file(name, bytes, split) {
        Ok(assembly) => assembly.notes.join("; "),
        Err(reason) => reason,
    };
    let words = [None, Some(Split::Objects), Some(Split::Bodies), Some(Split::None)].map(read);
    if words.iter().all(String::is_empty) { "fine".to_owned() } else { words.join("; ") }
}

fn messages(bytes: &[u8]) -> String {
    let copy = AlignedBytes::copy_of(bytes);
    let bytes = copy.as_slice();
    let request = said(PlanRequest::decode(bytes).map_err(|e| e.to_string()));
    let error = said(WireError::decode(bytes).map_err(|e| e.to_string()));
    let status = said(Status::decode(bytes).map_err(|e| e.to_string()));
    let steps = said(StepsView::new(bytes).map_err(|e| e.to_string()).map(|steps| {
        steps.iter().map(|s| s.path.len() + s.requires.len()).sum::<usize>();
    }));
    let summary = said(SummaryView::new(bytes).map_err(|e| e.to_string()).map(|view| {
        let _ = (view.part_names().count(), view.blocked().count(), view.warnings().count());
        let _ = (view.reason(), view.units(), view.planner(), view.engine(), view.status());
    }));
    [request, error, status, steps, summary].join("; ")
}

fn meshes(bytes: &[u8]) -> String {
    let copy = AlignedBytes::copy_of(bytes);
    let upload = said(uploaded_assembly(&copy).map_err(|e| e.message));
    let revision = revision::Revision::decode(copy.as_slice());
    let revision = said(revision.map_err(|e| e.to_string()).map(|r| r.added.len() + r.replaced.len()));
    format!("{upload}; {revision}")
}

/// Healing many triangles takes time for any sender; here are few.
const FEW: usize = 300;

fn admission(bytes: &[u8]) -> String {
    match uploaded_assembly(&AlignedBytes::copy_of(bytes)) {
        Ok(source) => admitted(&source),
        Err(error) => error.message,
    }
}

fn admitted(source: &SourceAssembly) -> String {
    if source.parts.iter().map(|p| p.mesh.triangles.len()).sum::<usize>() > FEW {
        return "many triangles".to_owned();
    }
    said(Assembly::new(source).map_err(|e| e.to_string()))
}

fn config(text: &str) -> String {
    said(Config::parse(text, Path::new("config.toml")).map_err(|e| e.to_string()))
}

/// Plans of more parts are read, but not drawn.
const FEW_PARTS: usize = 8;

/// A plan as instructions, and drawn with a tetrahedron for every part.
fn plan(text: &str) -> String {
    let plan = match read_plan(text) {
        Ok(plan) => plan,
        Err(error) => return error.to_string(),
    };
    let words = view::steps::markdown(&view::Instructions::of(&plan, None));
    if plan.parts.len() > FEW_PARTS || words.is_empty() {
        return "many parts".to_owned();
    }
    let part = |name: &String| SourcePart { name: name.clone(), origin: "a.obj".into(), mesh: tetrahedron() };
    let parts = plan.parts.iter().map(part).collect();
    let assembly = Assembly::new(&SourceAssembly { parts, ..SourceAssembly::default() });
    said(assembly.map_err(|e| e.to_string()).and_then(|assembly| {
        let scene = PlanScene::new(&assembly, Up::Z, &plan).map_err(|e| e.to_string())?;
        view::page::page(&scene, &view::Instructions::of(&plan, None), &plan.parts, &[])
            .map_err(|e| e.to_string())?;
        view::glb::glb(&scene).map_err(|e| e.to_string())
    }))
}

fn tetrahedron() -> SourceMesh {
    SourceMesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    }
}
