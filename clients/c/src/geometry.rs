//! Assemblies in C.

use std::ffi::c_char;
use std::sync::Arc;

use sbdp_client::{Assembly, Handle, Meshes, Part, Vertices, content_hash};

use crate::border::{Failure, SbdpError, behind, enter, free, give, not_null, out};
use crate::code::SbdpCode;
use crate::input::{Versioned, array, required_text, text, versioned};

/// The name of an assembly: the hash of its content.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpHandle {
    /// The hash.
    pub bytes: [u8; 32],
}

impl From<SbdpHandle> for Handle {
    fn from(handle: SbdpHandle) -> Self {
        Self(handle.bytes)
    }
}

impl From<Handle> for SbdpHandle {
    fn from(handle: Handle) -> Self {
        Self { bytes: handle.0 }
    }
}

/// A part: a closed mesh at its assembled pose. The arrays are read only during the call, and written once, into shared
/// memory.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpPart {
    /// Its name, unique in the assembly, in UTF-8.
    pub name: *const c_char,
    /// Vertices in double precision, x, y, z each; or null.
    pub vertices_f64: *const f64,
    /// Vertices in single precision, where those in double precision are null.
    pub vertices_f32: *const f32,
    /// How many vertices: a third of the numbers.
    pub vertex_count: usize,
    /// Three vertices each, counter-clockwise from outside.
    pub triangles: *const u32,
    /// How many triangles: a third of the numbers.
    pub triangle_count: usize,
}

/// An assembly. Part numbers are indices into its list of parts; list them in natural order of their names.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpAssembly {
    /// `sizeof` this struct. Fields beyond it count as zero.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// A name for display, or null. It is not part of the content.
    pub name: *const c_char,
    /// The unit of length, as `mm`, or null.
    pub units: *const c_char,
    /// The parts.
    pub parts: *const SbdpPart,
    /// How many.
    pub part_count: usize,
    /// Names of parts that may not move.
    pub fixed: *const *const c_char,
    /// How many.
    pub fixed_count: usize,
}

// SAFETY: it begins with its size, and has but numbers and pointers.
unsafe impl Versioned for SbdpAssembly {}

/// # Safety
/// Everything that the part points to is valid and does not change.
pub(crate) unsafe fn read_part<'a>(part: &SbdpPart, index: usize) -> Result<Part<'a>, Failure> {
    let field = |name| format!("parts[{index}].{name}");
    // SAFETY: so the caller promises.
    unsafe {
        let name = required_text(part.name, &field("name"))?;
        let vertices = match (part.vertices_f64.is_null(), part.vertices_f32.is_null()) {
            (_, true) => {
                Vertices::F64(array(part.vertices_f64.cast(), part.vertex_count, &field("vertices_f64"))?)
            }
            (true, false) => {
                Vertices::F32(array(part.vertices_f32.cast(), part.vertex_count, &field("vertices_f32"))?)
            }
            (false, false) => {
                let told = "has vertices in double and in single precision: set one to null";
                return Err(Failure::argument(format!("`parts[{index}]` (`{name}`) {told}")));
            }
        };
        let triangles = array(part.triangles.cast(), part.triangle_count, &field("triangles"))?;
        Ok(Part { name, vertices, triangles })
    }
}

/// # Safety
/// Everything that the assembly points to is valid and does not change.
pub(crate) unsafe fn read_assembly<'a>(assembly: *const SbdpAssembly) -> Result<Assembly<'a>, Failure> {
    // SAFETY: so the caller promises.
    unsafe {
        not_null(assembly, "assembly")?;
        let given = versioned(assembly, "assembly")?;
        let parts = array(given.parts, given.part_count, "assembly->parts")?;
        let fixed = array(given.fixed, given.fixed_count, "assembly->fixed")?;
        Ok(Assembly {
            name: text(given.name, "assembly->name")?.unwrap_or_default(),
            units: text(given.units, "assembly->units")?,
            parts: parts.iter().enumerate().map(|(n, p)| read_part(p, n)).collect::<Result<_, _>>()?,
            fixed: fixed.iter().map(|n| required_text(*n, "assembly->fixed[]")).collect::<Result<_, _>>()?,
        })
    }
}

/// Meshes that the library keeps, and uploads whenever the daemon does not know them, for example after a restart.
pub struct SbdpMeshes {
    pub(crate) kept: Arc<KeptMeshes>,
}

/// A copy of an assembly.
pub(crate) struct KeptMeshes {
    name: String,
    units: Option<String>,
    parts: Vec<KeptPart>,
    fixed: Vec<String>,
    handle: Handle,
}

struct KeptPart {
    name: String,
    vertices: KeptVertices,
    triangles: Vec<[u32; 3]>,
}

enum KeptVertices {
    F64(Vec<[f64; 3]>),
    F32(Vec<[f32; 3]>),
}

impl KeptMeshes {
    fn new(assembly: &Assembly<'_>) -> Self {
        let part = |part: &Part<'_>| KeptPart {
            name: part.name.to_owned(),
            vertices: match part.vertices {
                Vertices::F64(v) => KeptVertices::F64(v.to_vec()),
                Vertices::F32(v) => KeptVertices::F32(v.to_vec()),
            },
            triangles: part.triangles.to_vec(),
        };
        Self {
            name: assembly.name.to_owned(),
            units: assembly.units.map(str::to_owned),
            parts: assembly.parts.iter().map(part).collect(),
            fixed: assembly.fixed.iter().map(|&name| name.to_owned()).collect(),
            handle: content_hash(assembly),
        }
    }
}

impl Meshes for KeptMeshes {
    fn assembly(&self) -> Assembly<'_> {
        fn part(KeptPart { name, vertices, triangles }: &KeptPart) -> Part<'_> {
            let vertices = match vertices {
                KeptVertices::F64(v) => Vertices::F64(v),
                KeptVertices::F32(v) => Vertices::F32(v),
            };
            Part { name, vertices, triangles }
        }
        Assembly {
            name: &self.name,
            units: self.units.as_deref(),
            parts: self.parts.iter().map(part).collect(),
            fixed: self.fixed.iter().map(String::as_str).collect(),
        }
    }

    fn handle(&self) -> Handle {
        self.handle
    }
}

/// Copies an assembly, for `sbdp_client_plan_meshes`, which uploads it when necessary.
///
/// # Safety
/// `assembly` is valid with everything that it points to; `meshes` and `error` are null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_meshes_copy(
    assembly: *const SbdpAssembly,
    meshes: *mut *mut SbdpMeshes,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let meshes = out(meshes, "meshes")?;
            let kept = Arc::new(KeptMeshes::new(&read_assembly(assembly)?));
            *meshes = give(SbdpMeshes { kept });
            Ok(())
        })
    }
}

/// The handle of meshes.
///
/// # Safety
/// `meshes` is one of this library's; `handle` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_meshes_handle(
    meshes: *const SbdpMeshes,
    handle: *mut SbdpHandle,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let meshes = behind(meshes, "meshes")?;
            write_handle(handle, meshes.kept.handle)
        })
    }
}

/// # Safety
/// The pointer is null or can be written.
pub(crate) unsafe fn write_handle(pointer: *mut SbdpHandle, handle: Handle) -> Result<(), Failure> {
    not_null(pointer, "handle")?;
    // SAFETY: so the caller promises.
    unsafe { pointer.write(handle.into()) };
    Ok(())
}

/// Frees meshes. Plans and sessions about them remain valid.
///
/// # Safety
/// `meshes` is null, or points to null or to meshes of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_meshes_free(meshes: *mut *mut SbdpMeshes) {
    // SAFETY: so the caller promises.
    unsafe { free(meshes) }
}
