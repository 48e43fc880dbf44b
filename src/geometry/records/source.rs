//! What the assembly of a handle was made of: what was given, or a revision of another assembly. So a daemon that starts
//! again knows the handles of its clients.

use serde::{Deserialize, Serialize};

use crate::cache::{Cache, RecordKey, RecordKind, Storage, Validity};
use crate::geometry::{Revision, SourceAssembly};

/// By handle, which is the hash of the content. Clients keep handles, so all builds read these records: a change of the
/// format, which a test has in bytes, raises its version.
pub(crate) static SOURCE: RecordKind =
    RecordKind::of::<AssemblySource>(8, "source", Storage::IndexedDisk, Validity::Format(2));

/// What an assembly was made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum AssemblySource {
    /// What was given.
    Given(SourceAssembly),
    /// The handle of another assembly, and what differs.
    Revised([u8; 32], Revision),
}

/// What the assembly of a handle was made of, if it is on disk.
pub(crate) fn source_of(cache: &Cache, handle: &[u8; 32]) -> Option<AssemblySource> {
    cache.get(&source_key(handle))
}

/// Whether [`source_of`] finds something, without a look at the disk.
pub(crate) fn has_source(cache: &Cache, handle: &[u8; 32]) -> bool {
    cache.contains(&source_key(handle))
}

/// Remembers what was given, unless it is there.
pub(crate) fn remember_given(cache: &Cache, handle: &[u8; 32], source: &SourceAssembly) {
    remember(cache, handle, || AssemblySource::Given(source.clone()));
}

/// Remembers how an assembly was revised, unless it is there.
pub(crate) fn remember_revised(cache: &Cache, handle: &[u8; 32], base: &[u8; 32], revision: &Revision) {
    remember(cache, handle, || AssemblySource::Revised(*base, revision.clone()));
}

fn remember(cache: &Cache, handle: &[u8; 32], source: impl FnOnce() -> AssemblySource) {
    if cache.is_on_disk() && !has_source(cache, handle) {
        cache.put(source_key(handle), &source());
    }
}

/// The handles of the assemblies on disk, those used last first.
pub(crate) fn recent_sources(cache: &Cache, most: usize) -> Vec<[u8; 32]> {
    cache.last_used_first(&SOURCE).iter().take(most).map(|l| *l.key.hash()).collect()
}

pub(super) fn source_key(handle: &[u8; 32]) -> RecordKey {
    RecordKey::new(&SOURCE, *handle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::{CacheSettings, payload};
    use crate::fixtures::{block_on_plate, l_shape, source};
    use crate::geometry::{Pose, SourceMesh, SourcePart};

    #[test]
    fn what_was_given_and_revised_is_found_again_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let open = || Cache::open(&settings, &[&SOURCE]).unwrap();
        let mut given = source(block_on_plate());
        given.units = Some("mm".to_owned());
        given.fixed = vec!["0".to_owned()];
        let added = SourcePart { name: "new".into(), origin: "test".into(), mesh: l_shape() };
        let revision = Revision {
            replaced: vec![(1, l_shape())],
            moved: vec![(0, Pose::new([0.1, 0.2, 0.3].into(), [0.4, 0.0, 0.1].into()))],
            added: vec![added],
        };
        let cache = open();
        remember_given(&cache, &[1; 32], &given);
        remember_revised(&cache, &[2; 32], &[1; 32], &revision);
        drop(cache);
        let cache = open();
        assert!(
            has_source(&cache, &[1; 32]) && has_source(&cache, &[2; 32]) && !has_source(&cache, &[3; 32])
        );
        assert_eq!(source_of(&cache, &[1; 32]), Some(AssemblySource::Given(given)));
        assert_eq!(source_of(&cache, &[2; 32]), Some(AssemblySource::Revised([1; 32], revision)));
        let mut recent = recent_sources(&cache, 9);
        recent.sort_unstable();
        assert_eq!(recent, [[1; 32], [2; 32]]);
        assert_eq!(recent_sources(&cache, 1).len(), 1);
        assert_eq!(cache.statistics().memory_bytes, 0, "assemblies themselves are");
        // What was evicted is remembered when it comes again.
        assert_eq!(cache.evict(0), 2);
        assert!(source_of(&cache, &[1; 32]).is_none() && !has_source(&cache, &[1; 32]));
        remember_given(&cache, &[1; 32], &source(block_on_plate()));
        cache.flush();
        assert!(source_of(&cache, &[1; 32]).is_some());
    }

    /// Bytes written down once: if they change, the version of the format has to be raised.
    #[test]
    fn the_format_is_the_one_of_its_version() {
        assert_eq!(SOURCE.validity, Validity::Format(2));
        let (number, numbers) =
            (|n: u64| n.to_le_bytes().to_vec(), |x: &[f64]| bytemuck::cast_slice(x).to_vec());
        let text = |text: &str| [number(text.len() as u64), text.into()].concat();
        let mesh = SourceMesh { vertices: vec![[1.0, 2.0, 3.0]], triangles: vec![[4, 5, 6]] };
        let in_bytes =
            [number(1), numbers(&[1.0, 2.0, 3.0]), number(1), vec![4, 0, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0]];
        let (part, moved) = (
            SourcePart { name: "part".into(), origin: "file".into(), mesh },
            Pose::translation(1.0, 2.0, 3.0),
        );
        let (mesh_bytes, pose) = (in_bytes.concat(), numbers(&[0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0]));
        let part_bytes = [text("part"), text("file"), mesh_bytes.clone()].concat();
        let given = [
            vec![0; 4],
            text("name"),
            vec![1],
            text("mm"),
            number(1),
            part_bytes.clone(),
            number(1),
            text("0"),
        ];
        let replaced = [number(1), number(8), mesh_bytes].concat();
        let revised =
            [vec![1, 0, 0, 0], vec![7; 32], replaced, number(1), number(9), pose, number(1), part_bytes];
        let revision = Revision {
            replaced: vec![(8, part.mesh.clone())],
            moved: vec![(9, moved)],
            added: vec![part.clone()],
        };
        // The base is not recorded.
        let (fixed, base) = (vec!["0".to_owned()], vec!["0".to_owned()]);
        let source = SourceAssembly {
            name: "name".into(),
            units: Some("mm".into()),
            parts: vec![part],
            fixed,
            base,
            ..SourceAssembly::default()
        };
        assert_eq!(payload(&AssemblySource::Given(source)), Some(given.concat()));
        assert_eq!(payload(&AssemblySource::Revised([7; 32], revision)), Some(revised.concat()));
    }
}
