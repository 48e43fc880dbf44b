//! Assemblies by their handles, as they were given or revised: a daemon that starts again knows what its
//! clients' handles mean.

use super::records::{
    AssemblyRecord, MeshRecord, PartRecord, RevisionRecord, SourceRecord, pose_of, pose_record,
};
use super::{Cache, Key, Kind};
use crate::geometry::{Revision, SourceAssembly, SourceMesh, SourcePart};

/// What an assembly was made of.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// What was given.
    Given(SourceAssembly),
    /// The handle of another assembly, and what differs.
    Revised([u8; 32], Revision),
}

impl Cache {
    /// What the assembly of a handle was made of, if it is on disk.
    #[must_use]
    pub fn source(&self, handle: &[u8; 32]) -> Option<Source> {
        Some(match self.get(&key(handle))? {
            SourceRecord::Given(record) => Source::Given(assembly(record)),
            SourceRecord::Revised(record) => Source::Revised(record.base, revision(record)),
        })
    }

    /// Whether the assembly of a handle is on disk; told without looking there.
    #[must_use]
    pub fn has_source(&self, handle: &[u8; 32]) -> bool {
        self.contains(&key(handle))
    }

    /// Remembers what was given, unless it is there.
    pub fn remember_given(&self, handle: &[u8; 32], source: &SourceAssembly) {
        if self.is_on_disk() && !self.has_source(handle) {
            self.put(key(handle), &SourceRecord::Given(assembly_record(source)));
        }
    }

    /// Remembers how an assembly was revised, unless it is there.
    pub fn remember_revised(&self, handle: &[u8; 32], base: &[u8; 32], revision: &Revision) {
        if self.is_on_disk() && !self.has_source(handle) {
            self.put(key(handle), &SourceRecord::Revised(revision_record(base, revision)));
        }
    }

    /// The handles of the assemblies on disk, those used last first.
    #[must_use]
    pub fn recent_sources(&self, most: usize) -> Vec<[u8; 32]> {
        self.last_used_first(Kind::Source).iter().take(most).map(|l| *l.key.hash()).collect()
    }
}

/// The handle is the hash of the content, whatever build asks.
pub(super) fn key(handle: &[u8; 32]) -> Key {
    Key::new(Kind::Source, *handle)
}

fn mesh_record(mesh: &SourceMesh) -> MeshRecord {
    MeshRecord { vertices: mesh.vertices.clone(), triangles: mesh.triangles.clone() }
}

fn part_record(part: &SourcePart) -> PartRecord {
    PartRecord { name: part.name.clone(), origin: part.origin.clone(), mesh: mesh_record(&part.mesh) }
}

fn assembly_record(source: &SourceAssembly) -> AssemblyRecord {
    AssemblyRecord {
        name: source.name.clone(),
        units: source.units.clone(),
        parts: source.parts.iter().map(part_record).collect(),
        fixed: source.fixed.clone(),
    }
}

fn revision_record(base: &[u8; 32], revision: &Revision) -> RevisionRecord {
    RevisionRecord {
        base: *base,
        replaced: revision.replaced.iter().map(|(part, mesh)| (*part as u32, mesh_record(mesh))).collect(),
        moved: revision.moved.iter().map(|(part, pose)| (*part as u32, pose_record(pose))).collect(),
        added: revision.added.iter().map(part_record).collect(),
    }
}

fn mesh(record: MeshRecord) -> SourceMesh {
    SourceMesh { vertices: record.vertices, triangles: record.triangles }
}

fn part(record: PartRecord) -> SourcePart {
    SourcePart { name: record.name, origin: record.origin, mesh: mesh(record.mesh) }
}

fn assembly(record: AssemblyRecord) -> SourceAssembly {
    SourceAssembly {
        name: record.name,
        units: record.units,
        parts: record.parts.into_iter().map(part).collect(),
        fixed: record.fixed,
    }
}

fn revision(record: RevisionRecord) -> Revision {
    Revision {
        replaced: record.replaced.into_iter().map(|(part, of)| (part as usize, mesh(of))).collect(),
        moved: record.moved.iter().map(|(part, pose)| (*part as usize, pose_of(pose))).collect(),
        added: record.added.into_iter().map(part).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::CacheSettings;
    use super::*;
    use crate::fixtures::{block_on_plate, l_shape, source};
    use crate::geometry::Pose;

    #[test]
    fn what_was_given_and_revised_is_found_again_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let mut given = source(block_on_plate());
        given.units = Some("mm".to_owned());
        given.fixed = vec!["0".to_owned()];
        let added = SourcePart { name: "new".into(), origin: "test".into(), mesh: l_shape() };
        let revision = Revision {
            replaced: vec![(1, l_shape())],
            moved: vec![(0, Pose::new([0.1, 0.2, 0.3].into(), [0.4, 0.0, 0.1].into()))],
            added: vec![added],
        };
        let cache = Cache::open(&settings).unwrap();
        cache.remember_given(&[1; 32], &given);
        cache.remember_revised(&[2; 32], &[1; 32], &revision);
        drop(cache);
        let cache = Cache::open(&settings).unwrap();
        assert!(cache.has_source(&[1; 32]) && cache.has_source(&[2; 32]) && !cache.has_source(&[3; 32]));
        assert_eq!(cache.source(&[1; 32]), Some(Source::Given(given)));
        assert_eq!(cache.source(&[2; 32]), Some(Source::Revised([1; 32], revision)));
        let mut recent = cache.recent_sources(9);
        recent.sort_unstable();
        assert_eq!(recent, [[1; 32], [2; 32]]);
        assert_eq!(cache.recent_sources(1).len(), 1);
        assert_eq!(cache.statistics().memory_bytes, 0, "they are in memory already, otherwise");
        // What left for others is remembered when it comes again.
        assert_eq!(cache.evict(0), 2);
        assert!(cache.source(&[1; 32]).is_none() && !cache.has_source(&[1; 32]));
        cache.remember_given(&[1; 32], &source(block_on_plate()));
        cache.flush();
        assert!(cache.source(&[1; 32]).is_some());
    }
}
