//! What a file is, by its name and by its first bytes.

use std::path::Path;

/// A format with a reader here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    /// Wavefront OBJ.
    Obj,
    /// STL, binary or text.
    Stl,
    /// glTF or GLB.
    Gltf,
    /// PLY, binary or text.
    Ply,
    /// OFF, as text.
    Off,
    /// 3MF.
    ThreeMf,
    /// STEP (ISO 10303-21).
    Step,
}

impl Format {
    /// The format that the extension says.
    pub(super) fn of(path: &Path) -> Option<Self> {
        match extension(path).as_str() {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            "ply" => Some(Self::Ply),
            "off" => Some(Self::Off),
            "3mf" => Some(Self::ThreeMf),
            "step" | "stp" | "p21" => Some(Self::Step),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Obj => "an OBJ file",
            Self::Stl => "an STL file",
            Self::Gltf => "a glTF file",
            Self::Ply => "a PLY file",
            Self::Off => "an OFF file",
            Self::ThreeMf => "a 3MF file",
            Self::Step => "a STEP file",
        }
    }
}

/// The extension in small letters; empty if there is none.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_ascii_lowercase())
}

/// What to do with a file of geometry that has no reader here, by its extension.
pub(super) fn advice(path: &Path) -> Option<&'static str> {
    Some(match extension(path).as_str() {
        "stpz" => "unpack it, as by `gunzip -S .stpz FILE`, and name it .step",
        "iges" | "igs" => "IGES is not a mesh: open it in a CAD program and export GLB, or each part as STL",
        "brep" | "brp" | "fcstd" => "open it in FreeCAD, select the parts and export them as glTF (.glb)",
        "sldasm" | "sldprt" | "ipt" | "iam" | "f3d" | "f3z" | "catpart" | "catproduct" | "prt" | "asm"
        | "x_t" | "x_b" | "sat" | "sab" | "smt" | "smb" | "jt" | "3dm" | "skp" | "dwg" | "dxf" => {
            "this is a file of a CAD program: export the assembly from there as GLB, or each part as STL"
        }
        "amf" => "open it in a slicer and export it as 3MF, or each part as STL",
        "dae" | "fbx" | "blend" | "3ds" | "x3d" | "wrl" | "usd" | "usda" | "usdc" | "usdz" => {
            "open it in Blender or MeshLab and export GLB, or each part as STL"
        }
        "urdf" | "xacro" | "sdf" | "mjcf" => {
            "a robot's description names mesh files: give the folder of these, placed as assembled, or a GLB"
        }
        "zip" | "gz" | "7z" | "rar" | "tar" | "xz" | "bz2" | "zst" => "unpack it and give the folder",
        _ => return None,
    })
}

/// Files beside an assembly that hold no geometry: pictures, notes, materials.
pub(super) fn is_companion(path: &Path) -> bool {
    const COMPANIONS: [&str; 24] = [
        "mtl", "png", "jpg", "jpeg", "gif", "bmp", "tga", "tif", "tiff", "webp", "ktx", "ktx2", "dds", "hdr",
        "exr", "svg", "txt", "md", "rst", "pdf", "html", "csv", "license", "log",
    ];
    let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().to_ascii_lowercase());
    COMPANIONS.contains(&extension(path).as_str()) || ["license", "readme", "notice"].contains(&name.as_str())
}

/// What a file's bytes are, if they cannot be what its name says; with what to do.
pub(super) fn mismatch(format: Format, bytes: &[u8]) -> Option<String> {
    let expected = format.name();
    if bytes.is_empty() {
        return Some("the file is empty (0 bytes); export it again".into());
    }
    let start = bytes.trim_ascii_start();
    let begins =
        |text: &str| start.get(..text.len()).is_some_and(|s| s.eq_ignore_ascii_case(text.as_bytes()));
    if begins("version https://git-lfs") {
        let advice = "get the file itself with `git lfs pull`";
        return Some(format!("this is a Git LFS pointer, not the file that it stands for; {advice}"));
    }
    if begins("<!doctype html") || begins("<html") {
        return Some(format!("this is HTML, a web page, and not {expected}; download the file itself"));
    }
    if begins("<?xml") || begins("<collada") {
        return Some(format!("this is XML and not {expected}; export the part again"));
    }
    let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
    if utf16 && (format != Format::Stl || !super::stl::is_binary_by_length(bytes)) {
        return Some("this is text as UTF-16; save it as UTF-8 (or plain ASCII)".into());
    }
    let magic = [
        (&b"PK\x03\x04"[..], "a ZIP archive", "unpack it, or rename it to .3mf if it is one"),
        (b"\x1f\x8b", "compressed by gzip", "unpack it"),
        (b"glTF", "a GLB file", "rename it to .glb"),
        (b"ISO-10303-21", "a STEP file", "rename it to .step"),
        (b"ply\n", "a PLY file", "rename it to .ply"),
        (b"ply\r\n", "a PLY file", "rename it to .ply"),
        (b"Kaydara FBX", "an FBX file", "export it as GLB"),
        (b"%PDF", "a PDF file", "export the part as a mesh"),
    ];
    let found = magic.iter().find(|(magic, ..)| bytes.starts_with(magic))?;
    let (_, what, advice) = found;
    let own = [
        (Format::Gltf, &b"glTF"[..]),
        (Format::Step, b"ISO-10303-21"),
        (Format::ThreeMf, b"PK\x03\x04"),
        (Format::Ply, b"ply\n"),
        (Format::Ply, b"ply\r\n"),
    ];
    if own.contains(&(format, found.0)) || super::stl::is_binary_by_length(bytes) {
        return None;
    }
    Some(format!("this is {what} and not {expected}; {advice}"))
}
