//! Assemblies as healing left them, by their handles: in the planning frame, equal parts with one shape. So a daemon that
//! starts again does not heal and compare again. Shapes are records of their own, by content: assemblies share them on
//! disk as they do in memory.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::source::source_key;
use crate::cache::{Cache, Digest, RecordKey, RecordKind, Storage, Validity};
use crate::geometry::{Assembly, Mesh, Repetition, Shape};

const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_GEOMETRY"));
/// A healed mesh in its own frame.
pub(crate) static SHAPE: RecordKind =
    RecordKind::of::<ShapeRecord>(10, "shape", Storage::IndexedDisk, SOURCES);
/// An assembly of such shapes.
pub(crate) static HEALED: RecordKind =
    RecordKind::of::<HealedRecord>(11, "healed", Storage::IndexedDisk, SOURCES);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct ShapeRecord {
    mesh: Mesh,
    /// Vertices of the convex hull.
    hull: Vec<Point3<f64>>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct HealedRecord {
    /// Without its shapes.
    assembly: Assembly,
    /// The contents of the shapes.
    shapes: Vec<[u8; 32]>,
}

/// The healed assembly of a handle, if it is on disk with all of its shapes. Shapes that are `known` by their content
/// are not read.
pub(crate) fn healed_assembly(
    cache: &Cache,
    handle: &[u8; 32],
    known: impl Fn(&[u8; 32]) -> Option<Arc<Shape>> + Sync,
) -> Option<Assembly> {
    let key = assembly_key(handle);
    // An assembly that was never healed is no miss.
    let record: HealedRecord = if cache.contains(&key) { cache.get(&key)? } else { return None };
    let shape = |content: &[u8; 32]| {
        let read = || shape(cache.get(&shape_key(content))?, content).map(Arc::new);
        known(content).or_else(read)
    };
    let shapes = record.shapes.par_iter().map(shape).collect::<Option<Vec<_>>>()?;
    // The source is in use with the assembly.
    cache.touch(source_key(handle));
    assembly(record, shapes)
}

/// Remembers a healed assembly, unless it is there.
pub(crate) fn remember_healed(cache: &Cache, handle: &[u8; 32], assembly: &Assembly) {
    if !cache.is_on_disk() {
        return;
    }
    for shape in &assembly.shapes {
        let key = shape_key(shape.content());
        if !cache.contains(&key) {
            cache.put(key, &shape_record(shape));
        }
    }
    let key = assembly_key(handle);
    if !cache.contains(&key) {
        cache.put(key, &assembly_record(assembly));
    }
}

fn assembly_key(handle: &[u8; 32]) -> RecordKey {
    Digest::new().hash(handle).key(&HEALED)
}

fn shape_key(content: &[u8; 32]) -> RecordKey {
    Digest::new().hash(content).key(&SHAPE)
}

fn shape_record(shape: &Shape) -> ShapeRecord {
    ShapeRecord { mesh: shape.mesh().clone(), hull: shape.hull.clone() }
}

/// The shape of a record, unless its triangles have corners that it does not have.
fn shape(ShapeRecord { mesh, hull }: ShapeRecord, content: &[u8; 32]) -> Option<Shape> {
    let Mesh { vertices, triangles, .. } = &mesh;
    let is_corner = |&v: &u32| (v as usize) < vertices.len();
    let is_whole = !triangles.is_empty() && triangles.iter().flatten().all(is_corner);
    is_whole.then(|| Shape::known(mesh, hull, *content))
}

fn assembly_record(assembly: &Assembly) -> HealedRecord {
    let shapes = assembly.shapes.iter().map(|shape| *shape.content()).collect();
    HealedRecord { assembly: assembly.clone(), shapes }
}

/// The assembly of a record, unless it names shapes or parts that it does not have.
fn assembly(HealedRecord { assembly, .. }: HealedRecord, shapes: Vec<Arc<Shape>>) -> Option<Assembly> {
    let Assembly { parts, fixed, findings, repetitions, .. } = &assembly;
    let is_part = |part: &usize| *part < parts.len();
    let is_whole = parts.iter().all(|part| part.shape < shapes.len())
        && fixed.iter().all(is_part)
        && findings.iter().all(|(part, _)| is_part(part))
        && repetitions.iter().flat_map(Repetition::parts).all(|part| is_part(&part));
    is_whole.then_some(Assembly { shapes, ..assembly })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CacheSettings;
    use crate::fixtures::{block_on_plate, l_shape, moved, open_box, shape_of, source};
    use crate::geometry::Pose;

    const HANDLE: [u8; 32] = [5; 32];

    /// Copies, an open mesh, a fixed part, a part that was moved, and something that healing found.
    fn taken_in() -> Assembly {
        let turned = Pose::new([0.1, 0.2, 3.0].into(), [0.4, 0.0, 0.1].into());
        let [plate, block] = block_on_plate();
        let tray = open_box([-1.0, -1.0, 2.0], [1.0, 1.0, 3.0]);
        let mut source = source([plate, block, l_shape(), moved(l_shape(), &turned), tray]);
        source.units = Some("mm".to_owned());
        source.fixed = vec!["0".to_owned()];
        let mut assembly = Assembly::new(&source).unwrap();
        assembly.parts[1].moved = turned;
        assembly
    }

    fn kept(folder: &std::path::Path) -> Cache {
        let settings = CacheSettings { folder: Some(folder.to_owned()), ..CacheSettings::default() };
        Cache::open(&settings, &[&HEALED, &SHAPE]).unwrap()
    }

    fn text(assembly: &Assembly) -> String {
        let Assembly { name, units, scale, parts, shapes, fixed, findings, repetitions } = assembly;
        let shapes: Vec<_> =
            shapes.iter().map(|s| (s.mesh(), &s.hull, s.mass, s.samples().points())).collect();
        format!("{name} {units:?} {scale} {parts:?} {shapes:?} {fixed:?} {findings:?} {repetitions:?}")
    }

    #[test]
    fn what_was_taken_in_is_found_again_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let assembly = taken_in();
        assert!(!assembly.findings.is_empty() && assembly.shapes.len() == 4);
        let cache = kept(folder.path());
        assert!(healed_assembly(&cache, &HANDLE, |_| None).is_none());
        remember_healed(&cache, &HANDLE, &assembly);
        drop(cache);
        let cache = kept(folder.path());
        let found = healed_assembly(&cache, &HANDLE, |_| None).unwrap();
        assert_eq!(text(&found), text(&assembly));
        for shape in &found.shapes {
            assert_eq!(shape.content(), shape_of(shape.mesh()).content());
        }
        let shared = healed_assembly(&cache, &HANDLE, |of| {
            assembly.shapes.iter().find(|s| s.content() == of).cloned()
        });
        assert!(shared.unwrap().shapes.iter().zip(&assembly.shapes).all(|(a, b)| Arc::ptr_eq(a, b)));
    }

    #[test]
    fn an_assembly_without_one_of_its_shapes_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let (assembly, cache) = (taken_in(), kept(folder.path()));
        remember_healed(&cache, &HANDLE, &assembly);
        cache.flush();
        let lost = &assembly.shapes[2];
        cache.remove(&[shape_key(lost.content())]);
        assert!(healed_assembly(&cache, &HANDLE, |_| None).is_none());
        assert!(
            healed_assembly(&cache, &HANDLE, |of| (of == lost.content()).then(|| Arc::clone(lost))).is_some()
        );
        // Only what is not there is written again.
        remember_healed(&cache, &HANDLE, &assembly);
        cache.flush();
        assert!(healed_assembly(&cache, &HANDLE, |_| None).is_some());
    }

    #[test]
    fn a_record_that_names_what_it_does_not_have_is_none() {
        let whole = taken_in();
        let broken = |change: &dyn Fn(&mut HealedRecord)| {
            let mut record = assembly_record(&whole);
            change(&mut record);
            assembly(record, whole.shapes.clone()).is_none()
        };
        assert!(!broken(&|_| {}));
        assert!(broken(&|r| r.assembly.parts[1].shape = 4));
        assert!(broken(&|r| r.assembly.fixed = vec![5]));
        assert!(broken(&|r| r.assembly.findings.push((5, String::new()))));
        assert!(broken(&|r| r.assembly.repetitions.push(Repetition::Copies(vec![1, 5]))));
        let record = shape_record(&whole.shapes[0]);
        let of = |record| shape(record, &HANDLE);
        let with = |triangles| {
            let ShapeRecord { mesh, hull } = record.clone();
            of(ShapeRecord { mesh: Mesh { triangles, ..mesh }, hull })
        };
        assert!(of(record.clone()).is_some() && with(vec![]).is_none());
        assert!(with(vec![[0, 1, 8]]).is_none(), "a plate has eight corners");
    }
}
