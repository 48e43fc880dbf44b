//! What a scene says beyond the core of the standard: which extensions it needs, and units in `extras`.

use gltf::json::Root;
use serde_json::Value;

use super::super::units::known_unit;

/// Extensions that are read.
const READ: [&str; 2] = ["KHR_mesh_quantization", INSTANCING];
/// Several poses for one node's mesh.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// How the names of extensions begin that leave geometry alone: looks, lights, sounds, motion, notes, coarser copies.
const WITHOUT_GEOMETRY: [&str; 14] = [
    "KHR_materials_",
    "EXT_materials_",
    "ADOBE_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_audio",
    "KHR_animation_",
    "KHR_xmp",
    "MSFT_lod",
    "KHR_interactivity",
    "KHR_physics_",
];

/// Checks that all required extensions are read or leave geometry alone, and takes them off the list, for the crate
/// accepts hardly any.
///
/// # Errors
/// One changes what the geometry is.
pub(super) fn check_required(root: &mut Root) -> Result<(), String> {
    for name in std::mem::take(&mut root.extensions_required) {
        let is_harmless =
            READ.contains(&name.as_str()) || WITHOUT_GEOMETRY.iter().any(|w| name.starts_with(w));
        if is_harmless {
            continue;
        }
        return Err(if name.contains("draco") {
            "its meshes are compressed by Draco, which is not read; export without compression (in Blender: untick \
             Data > Compression)"
                .into()
        } else if name.contains("meshopt") {
            "its meshes are compressed by meshopt, which is not read; export without compression (gltfpack: without \
             -c and -cc)"
                .into()
        } else {
            let name = super::super::text::printable(&name);
            format!("it requires the extension `{name}`, which is not known here; export without it")
        });
    }
    Ok(())
}

/// The unit of length that some `extras` name, as it is written here.
///
/// # Errors
/// A word that is no unit known here.
pub(super) fn unit(extras: &gltf::json::Extras) -> Result<Option<String>, String> {
    let Some(value) = extras.as_ref().and_then(|e| serde_json::from_str::<Value>(e.get()).ok()) else {
        return Ok(None);
    };
    let named =
        ["unit", "units", "length_unit", "lengthUnit"].into_iter().find_map(|key| value.get(key)?.as_str());
    named.map(|word| known_unit(word).map(str::to_owned).ok_or_else(|| word.to_owned())).transpose()
}
