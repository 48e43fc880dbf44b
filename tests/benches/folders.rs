//! Which assemblies a benchmark is given: folders as arguments, or in `SBDP_MESHES`.

use std::path::{Path, PathBuf};

/// The folders of the assemblies; a folder that has folders in it stands for these.
pub(crate) fn given() -> Vec<PathBuf> {
    let given = std::env::args().skip(1).filter(|a| !a.starts_with('-')).map(PathBuf::from);
    let listed = std::env::var_os("SBDP_MESHES");
    let folders = given.chain(listed.iter().flat_map(std::env::split_paths)).collect::<Vec<_>>();
    folders.iter().flat_map(|f| assemblies(f)).collect()
}

/// The name of an assembly's folder.
pub(crate) fn name(folder: &Path) -> String {
    folder.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

fn assemblies(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut inner: Vec<_> = entries.filter(|p| p.is_dir()).collect();
    inner.sort();
    if inner.is_empty() { vec![folder.to_owned()] } else { inner }
}
