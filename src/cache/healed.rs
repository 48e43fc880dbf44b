//! Assemblies as they were taken in, by their handles: healed, in the planning frame, equal parts as one shape.
//! A daemon that starts again need not heal and compare again what it had. Shapes are records of their own, by
//! content, so that assemblies share them on disk as they do in memory.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use super::records::{HealedPartRecord, HealedRecord, ShapeRecord, pose_of, pose_record};
use super::{Cache, Digest, Key, Kind, source};
use crate::geometry::{Assembly, Bounds, Mesh, Part, Shape, Solidity};

impl Cache {
    /// The assembly of a handle as this build took it in, if it is on disk with all of its shapes; those that
    /// are `known` by their content are not read.
    #[must_use]
    pub fn healed(
        &self,
        handle: &[u8; 32],
        known: impl Fn(&[u8; 32]) -> Option<Arc<Shape>> + Sync,
    ) -> Option<Assembly> {
        let key = assembly_key(handle);
        // That it is not there, as of what was never taken in, is no miss.
        let record: HealedRecord = if self.contains(&key) { self.get(&key)? } else { return None };
        let shape = |content: &[u8; 32]| {
            let read = || shape(self.get(&shape_key(content))?, content).map(Arc::new);
            known(content).or_else(read)
        };
        let shapes = record.shapes.par_iter().map(shape).collect::<Option<Vec<_>>>()?;
        // What it was made of is in use with it.
        self.touch(source::key(handle));
        assembly(record, shapes)
    }

    /// Remembers an assembly as it was taken in, unless it is there.
    pub fn remember_healed(&self, handle: &[u8; 32], assembly: &Assembly) {
        if !self.is_on_disk() {
            return;
        }
        for shape in &assembly.shapes {
            let key = shape_key(shape.content());
            if !self.contains(&key) {
                self.put(key, &shape_record(shape));
            }
        }
        let key = assembly_key(handle);
        if !self.contains(&key) {
            self.put(key, &assembly_record(assembly));
        }
    }
}

/// What healing makes of a source depends on the build: so does this key.
fn assembly_key(handle: &[u8; 32]) -> Key {
    Digest::new().hash(handle).key(Kind::Healed)
}

fn shape_key(content: &[u8; 32]) -> Key {
    Digest::new().hash(content).key(Kind::Shape)
}

fn points(of: &[Point3<f64>]) -> Vec<[f64; 3]> {
    of.iter().map(|p| p.coords.into()).collect()
}

fn shape_record(shape: &Shape) -> ShapeRecord {
    let Mesh { vertices, triangles, solidity } = shape.mesh();
    let winding = *solidity == Solidity::Winding;
    let (vertices, triangles) = (points(vertices), triangles.clone());
    ShapeRecord { vertices, triangles, winding, hull: points(&shape.hull) }
}

/// The shape of a record, unless its triangles have corners that are not there.
fn shape(record: ShapeRecord, content: &[u8; 32]) -> Option<Shape> {
    let ShapeRecord { vertices, triangles, winding, hull } = record;
    let count = vertices.len() as u64;
    let whole = !triangles.is_empty() && triangles.iter().flatten().all(|&v| u64::from(v) < count);
    let solidity = if winding { Solidity::Winding } else { Solidity::Closed };
    let of = |points: Vec<[f64; 3]>| points.into_iter().map(Point3::from).collect::<Vec<_>>();
    whole.then(|| Shape::known(Mesh { vertices: of(vertices), triangles, solidity }, of(hull), *content))
}

fn assembly_record(assembly: &Assembly) -> HealedRecord {
    let part = |part: &Part| HealedPartRecord {
        name: part.name.clone(),
        shape: part.shape as u32,
        planning_from_shape: pose_record(&part.planning_from_shape),
        bounds: [part.bounds.min.into(), part.bounds.max.into()],
        moved: pose_record(&part.moved),
    };
    HealedRecord {
        name: assembly.name.clone(),
        units: assembly.units.clone(),
        scale: assembly.scale,
        parts: assembly.parts.iter().map(part).collect(),
        shapes: assembly.shapes.iter().map(|shape| *shape.content()).collect(),
        fixed: assembly.fixed.iter().map(|&part| part as u32).collect(),
        findings: assembly.findings.iter().map(|(part, found)| (*part as u32, found.clone())).collect(),
    }
}

/// The assembly of a record, unless it names shapes or parts that it does not have.
fn assembly(record: HealedRecord, shapes: Vec<Arc<Shape>>) -> Option<Assembly> {
    let HealedRecord { name, units, scale, parts, fixed, findings, .. } = record;
    let count = parts.len();
    let number = |part: u32| Some(part as usize).filter(|&part| part < count);
    let part = |part: HealedPartRecord| {
        let shape = Some(part.shape as usize).filter(|&shape| shape < shapes.len())?;
        let [min, max] = part.bounds.map(Point3::from);
        Some(Part {
            name: part.name,
            shape,
            planning_from_shape: pose_of(&part.planning_from_shape),
            bounds: Bounds { min, max },
            moved: pose_of(&part.moved),
        })
    };
    Some(Assembly {
        name,
        units,
        scale,
        parts: parts.into_iter().map(part).collect::<Option<_>>()?,
        fixed: fixed.into_iter().map(number).collect::<Option<_>>()?,
        findings: findings
            .into_iter()
            .map(|(part, found)| Some((number(part)?, found)))
            .collect::<Option<_>>()?,
        shapes,
    })
}

#[cfg(test)]
mod tests {
    use super::super::CacheSettings;
    use super::*;
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
        Cache::open(&settings).unwrap()
    }

    fn told(assembly: &Assembly) -> String {
        let Assembly { name, units, scale, parts, shapes, fixed, findings } = assembly;
        let shapes: Vec<_> =
            shapes.iter().map(|s| (s.mesh(), &s.hull, s.mass, s.samples().points())).collect();
        format!("{name} {units:?} {scale} {parts:?} {shapes:?} {fixed:?} {findings:?}")
    }

    #[test]
    fn what_was_taken_in_is_found_again_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let assembly = taken_in();
        assert!(!assembly.findings.is_empty() && assembly.shapes.len() == 4);
        let cache = kept(folder.path());
        assert!(cache.healed(&HANDLE, |_| None).is_none());
        cache.remember_healed(&HANDLE, &assembly);
        drop(cache);
        let cache = kept(folder.path());
        let found = cache.healed(&HANDLE, |_| None).unwrap();
        assert_eq!(told(&found), told(&assembly));
        for shape in &found.shapes {
            assert_eq!(shape.content(), shape_of(shape.mesh()).content());
        }
        let shared = cache.healed(&HANDLE, |of| assembly.shapes.iter().find(|s| s.content() == of).cloned());
        assert!(shared.unwrap().shapes.iter().zip(&assembly.shapes).all(|(a, b)| Arc::ptr_eq(a, b)));
    }

    #[test]
    fn an_assembly_without_one_of_its_shapes_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let (assembly, cache) = (taken_in(), kept(folder.path()));
        cache.remember_healed(&HANDLE, &assembly);
        cache.flush();
        let lost = &assembly.shapes[2];
        assert!(cache.disk.as_ref().unwrap().remove(&[shape_key(lost.content())]));
        assert!(cache.healed(&HANDLE, |_| None).is_none());
        assert!(cache.healed(&HANDLE, |of| (of == lost.content()).then(|| Arc::clone(lost))).is_some());
        // What is there is not written again, what is not is.
        cache.remember_healed(&HANDLE, &assembly);
        cache.flush();
        assert!(cache.healed(&HANDLE, |_| None).is_some());
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
        assert!(broken(&|r| r.parts[1].shape = 4));
        assert!(broken(&|r| r.fixed = vec![5]));
        assert!(broken(&|r| r.findings.push((5, String::new()))));
        let record = shape_record(&whole.shapes[0]);
        let of = |record| shape(record, &HANDLE);
        assert!(
            of(record.clone()).is_some() && of(ShapeRecord { triangles: vec![], ..record.clone() }).is_none()
        );
        assert!(
            of(ShapeRecord { triangles: vec![[0, 1, 8]], ..record }).is_none(),
            "a plate has eight corners"
        );
    }
}
