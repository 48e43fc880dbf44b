//! Changes of a known assembly: parts that stand elsewhere, have another mesh, or are
//! new. The rest keeps its shapes with all that was derived from them, and its frame.

use std::sync::Arc;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::congruence::congruence;
use super::own_frame::OwnFrame;
use super::repeated::{KnownRepetitions, repetitions};
use super::{
    Assembly, Bounds, GeometryError, Mesh, Part, Pose, Shape, SourceAssembly, SourceMesh, SourcePart,
    heal_until, transformed, waypoint_from_pose,
};
use crate::termination::Termination;

/// Names the byte stream that is hashed; a changed stream gets a new tag.
const TAG: &[u8] = b"sbdp-revision/1";
/// The longest side of a revised assembly, in the planning frame: beyond, its scale would be wrong.
const LONGEST_SIDE: std::ops::RangeInclusive<f64> = 1.25..=40.0;

/// The changes. Parts are named by their indices in the assembly.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Revision {
    /// Parts with another mesh, given at the assembled pose (input units and frame).
    pub replaced: Vec<(usize, SourceMesh)>,
    /// Parts that stand elsewhere: the rigid motion of the (new) mesh from where it was (input units
    /// and frame).
    pub moved: Vec<(usize, Pose)>,
    /// Further parts; they get the indices after all others.
    pub added: Vec<SourcePart>,
}

impl Revision {
    /// Whether nothing changes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.replaced.is_empty() && self.moved.is_empty() && self.added.is_empty()
    }

    /// The handle of the changed assembly, from the handle `base`.
    #[must_use]
    pub fn content_hash(&self, base: &[u8; 32]) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(TAG).update(base);
        let number = |hasher: &mut blake3::Hasher, n: usize| {
            hasher.update(&(n as u64).to_le_bytes());
        };
        let mesh = |hasher: &mut blake3::Hasher, mesh: &SourceMesh| {
            number(hasher, mesh.vertices.len());
            hasher.update(bytemuck::cast_slice(&mesh.vertices));
            number(hasher, mesh.triangles.len());
            hasher.update(bytemuck::cast_slice(&mesh.triangles));
        };
        number(&mut hasher, self.replaced.len());
        for (part, with) in &self.replaced {
            number(&mut hasher, *part);
            mesh(&mut hasher, with);
        }
        number(&mut hasher, self.moved.len());
        for (part, pose) in &self.moved {
            number(&mut hasher, *part);
            hasher.update(bytemuck::bytes_of(&waypoint_from_pose(pose)));
        }
        number(&mut hasher, self.added.len());
        for part in &self.added {
            number(&mut hasher, part.name.len());
            hasher.update(part.name.as_bytes());
            mesh(&mut hasher, &part.mesh);
        }
        hasher.finalize().into()
    }
}

impl SourceAssembly {
    /// The changed assembly as it would have been given. Parts that do not exist are
    /// ignored.
    #[must_use]
    pub fn revised(&self, revision: &Revision) -> Self {
        let mut revised = self.clone();
        for (part, mesh) in &revision.replaced {
            if let Some(part) = revised.parts.get_mut(*part) {
                part.mesh = mesh.clone();
            }
        }
        for (part, motion) in &revision.moved {
            for vertex in revised.parts.get_mut(*part).iter_mut().flat_map(|p| &mut p.mesh.vertices) {
                *vertex = (motion * Point3::from(*vertex)).into();
            }
        }
        revised.parts.extend(revision.added.iter().cloned());
        revised
    }
}

impl Assembly {
    /// The changed assembly. Its scale stays, so that everything known about what did not
    /// change holds.
    ///
    /// # Errors
    /// A part that is named does not exist, a name is given or a part moved twice, a mesh cannot be used, a pose is not
    /// finite, or the whole would be so much larger or smaller that another scale were due.
    pub fn revised(&self, revision: &Revision) -> Result<Self, GeometryError> {
        self.revised_until(revision, &Termination::default())
    }

    /// The same, unless the termination condition becomes true before it is done.
    ///
    /// # Errors
    /// As [`Assembly::revised`], and the interruption.
    pub fn revised_until(
        &self,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Self, GeometryError> {
        let refuse = |reason: String| GeometryError::Assembly { origin: self.name.clone(), reason };
        let mut revised = self.clone();
        let part_at = |part: usize| {
            let none = || refuse(format!("there is no part {part}; it has {} parts", self.parts.len()));
            self.parts.get(part).map(|p| p.name.clone()).ok_or_else(none)
        };
        for (part, mesh) in &revision.replaced {
            let source = SourcePart { name: part_at(*part)?, origin: "change".into(), mesh: mesh.clone() };
            revised.findings.retain(|(of, _)| of != part);
            revised.parts[*part] = revised.taken_in(*part, &source, termination)?;
        }
        for source in &revision.added {
            if revised.parts.iter().any(|p| p.name == source.name) {
                return Err(refuse(format!("there is a part `{}` already; give another name", source.name)));
            }
            let part = revised.taken_in(revised.parts.len(), source, termination)?;
            revised.parts.push(part);
        }
        for (i, (part, pose)) in revision.moved.iter().enumerate() {
            let name = part_at(*part)?;
            if revision.moved[..i].iter().any(|(before, _)| before == part) {
                return Err(refuse(format!("part `{name}` is moved twice; give one motion")));
            }
            if !waypoint_from_pose(pose).iter().all(|x| x.is_finite()) {
                return Err(refuse(format!("the pose of part `{name}` is not finite")));
            }
            let mut motion = *pose;
            motion.translation.vector *= self.scale;
            let moved = &mut revised.parts[*part];
            moved.moved = pose * moved.moved;
            moved.planning_from_shape = motion * moved.planning_from_shape;
            moved.bounds =
                Bounds::of(&transformed(&revised.shapes[moved.shape].hull, &moved.planning_from_shape));
        }
        revised.drop_unused_shapes();
        let longest = revised.longest_side();
        if !LONGEST_SIDE.contains(&longest) {
            return Err(refuse(format!(
                "with the change its longest side is {:.3} where it was {:.3}: upload it as a new assembly",
                longest / self.scale,
                self.longest_side() / self.scale
            )));
        }
        let named = revision.replaced.iter().map(|(part, _)| *part);
        let named = named.chain(revision.moved.iter().map(|(part, _)| *part));
        let changed = named.chain(self.parts.len()..revised.parts.len()).collect();
        let known = KnownRepetitions { found: &self.repetitions, changed: &changed };
        let places = revised.parts.iter().map(Part::place);
        revised.repetitions = repetitions(places, &revised.shapes, Some(&known), termination)?;
        Ok(revised)
    }

    /// A part as given, with its shape among the shapes.
    fn taken_in(
        &mut self,
        place: usize,
        source: &SourcePart,
        termination: &Termination,
    ) -> Result<Part, GeometryError> {
        let healed = heal_until(source, termination)?;
        self.findings.extend(healed.findings.into_iter().map(|finding| (place, finding)));
        let mut mesh = healed.mesh;
        for vertex in &mut mesh.vertices {
            *vertex *= self.scale;
        }
        let bounds = Bounds::of(&mesh.vertices);
        let copied = |(k, shape): (usize, &Arc<Shape>)| Some((k, congruence(shape.mesh(), &mesh)?));
        let copy = self.shapes.iter().enumerate().filter(|(_, s)| is_like(s, &mesh)).find_map(copied);
        let (shape, planning_from_shape) = match copy {
            Some(copy) => copy,
            None => {
                let frame = OwnFrame::of(&mesh);
                self.shapes.push(Arc::new(Shape::within(mesh, &frame, termination)?));
                (self.shapes.len() - 1, frame.pose())
            }
        };
        let moved = Pose::identity();
        Ok(Part { name: source.name.clone(), shape, planning_from_shape, bounds, moved })
    }

    fn drop_unused_shapes(&mut self) {
        let mut places = vec![None; self.shapes.len()];
        let mut used = Vec::new();
        for part in &mut self.parts {
            let place = *places[part.shape].get_or_insert_with(|| {
                used.push(Arc::clone(&self.shapes[part.shape]));
                used.len() - 1
            });
            part.shape = place;
        }
        self.shapes = used;
    }
}

/// Whether a mesh may be a copy: cheaper than to compare it.
fn is_like(shape: &Shape, mesh: &Mesh) -> bool {
    let surface = &shape.surface;
    surface.vertices().len() == mesh.vertices.len() && surface.triangles() == mesh.triangles
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{block_on_plate, cuboid, l_shape, moved, source};

    fn assembly() -> Assembly {
        let [plate, block] = block_on_plate();
        Assembly::new(&source([plate, block.clone(), moved(block, &Pose::translation(0.0, 0.0, 2.0))]))
            .unwrap()
    }

    fn added(name: &str, mesh: SourceMesh) -> SourcePart {
        SourcePart { name: name.into(), origin: "test".into(), mesh }
    }

    /// What matters of an assembly whose lengths are those of the planning frame.
    fn places(assembly: &Assembly) -> Vec<(String, Bounds)> {
        assembly.parts.iter().map(|p| (p.name.clone(), p.bounds)).collect()
    }

    #[test]
    fn a_revised_assembly_is_as_if_it_had_been_given_so() {
        let [plate, block] = block_on_plate();
        let source = source([plate, block.clone(), moved(block, &Pose::translation(0.0, 0.0, 2.0))]);
        let motion = Pose::new(Vector3::new(0.5, -0.25, 1.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let post = cuboid([-3.0, -3.0, 0.0], [-2.0, -2.0, 1.0]);
        let revision = Revision {
            replaced: vec![(1, l_shape())],
            moved: vec![(2, motion)],
            added: vec![added("3", post.clone()), added("4", moved(post, &motion))],
        };
        let base = Assembly::new(&source).unwrap();
        let revised = base.revised(&revision).unwrap();
        let whole = Assembly::new(&source.revised(&revision)).unwrap();
        for (a, b) in places(&revised).iter().zip(places(&whole)) {
            let off = (a.1.min - b.1.min).norm().max((a.1.max - b.1.max).norm());
            assert!(a.0 == b.0 && off < 1e-9, "{a:?} {b:?}");
        }
        assert_eq!((revised.parts.len(), revised.shapes.len()), (whole.parts.len(), whole.shapes.len()));
        assert!(Arc::ptr_eq(revised.shape(0), base.shape(0)), "what did not change is shared");
        assert!(Arc::ptr_eq(revised.shape(3), revised.shape(4)), "copies share a shape");
    }

    #[test]
    fn a_part_that_is_replaced_by_itself_keeps_its_shape() {
        let base = assembly();
        let [_, block] = block_on_plate();
        let revised = base.revised(&Revision { replaced: vec![(1, block)], ..Revision::default() }).unwrap();
        assert!(Arc::ptr_eq(revised.shape(1), base.shape(1)));
        assert_eq!(places(&revised), places(&base));
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let base = assembly();
        let refusal = |revision: Revision| base.revised(&revision).unwrap_err().to_string();
        let to = |x: f64| Pose::translation(x, 0.0, 0.0);
        let none = refusal(Revision { moved: vec![(7, to(1.0))], ..Revision::default() });
        assert!(none.contains("no part 7"), "{none}");
        let infinite = refusal(Revision { moved: vec![(1, to(f64::INFINITY))], ..Revision::default() });
        assert!(infinite.contains("`1`") && infinite.contains("not finite"), "{infinite}");
        let both = refusal(Revision { moved: vec![(1, to(1.0)), (1, to(2.0))], ..Revision::default() });
        assert!(both.contains("`1` is moved twice"), "{both}");
        let far = refusal(Revision { moved: vec![(1, to(1e4))], ..Revision::default() });
        assert!(far.contains("longest side") && far.contains("new assembly"), "{far}");
        let twice = refusal(Revision { added: vec![added("1", l_shape())], ..Revision::default() });
        assert!(twice.contains("`1` already"), "{twice}");
        let empty = refusal(Revision { replaced: vec![(1, SourceMesh::default())], ..Revision::default() });
        assert!(empty.contains("`1`"), "{empty}");
    }

    #[test]
    fn handles_differ_where_anything_does() {
        let base = [1; 32];
        let revisions = [
            Revision::default(),
            Revision { moved: vec![(1, Pose::translation(1.0, 0.0, 0.0))], ..Revision::default() },
            Revision { moved: vec![(2, Pose::translation(1.0, 0.0, 0.0))], ..Revision::default() },
            Revision { moved: vec![(1, Pose::translation(1.5, 0.0, 0.0))], ..Revision::default() },
            Revision { replaced: vec![(1, l_shape())], ..Revision::default() },
            Revision { added: vec![added("a", l_shape())], ..Revision::default() },
            Revision { added: vec![added("b", l_shape())], ..Revision::default() },
        ];
        let mut handles: Vec<_> = revisions.iter().map(|r| r.content_hash(&base)).collect();
        handles.extend(revisions.iter().map(|r| r.content_hash(&[2; 32])));
        let count = handles.len();
        handles.sort_unstable();
        handles.dedup();
        assert_eq!(handles.len(), count);
    }
}
