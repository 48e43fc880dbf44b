//! An admitted assembly: healed parts in the planning frame, equal parts sharing one shape.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::congruence::congruence;
use super::heal::heal_until;
use super::own_frame::OwnFrame;
use super::repeated::{PlacedShape, repetitions};
use super::{Bounds, GeometryError, Mesh, Pose, Repetition, Shape, SourceAssembly};
use crate::termination::{Interrupt, Termination};

/// A part of an assembly.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Index of its shape.
    pub shape: usize,
    /// Where the shape stands in the planning frame when assembled.
    pub planning_from_shape: Pose,
    /// Box of the assembled part in the planning frame.
    pub bounds: Bounds,
    /// Where its mesh stands against where it was given (input units and frame).
    pub moved: Pose,
}

impl Part {
    /// Its shape and where that stands.
    pub(super) fn place(&self) -> PlacedShape {
        (self.shape, self.planning_from_shape, self.bounds)
    }
}

/// Parts in the planning frame.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Assembly {
    /// A name for people.
    pub name: String,
    /// Unit of length of the input.
    pub units: Option<String>,
    /// Lengths in the planning frame are those of the input times this power of two.
    pub scale: f64,
    /// The parts, in natural order of their names.
    pub parts: Vec<Part>,
    /// The distinct shapes.
    #[serde(skip)]
    pub shapes: Vec<Arc<Shape>>,
    /// Indices of parts that the input declares fixed.
    pub fixed: Vec<usize>,
    /// What healing found, with the part it is about.
    pub findings: Vec<(usize, String)>,
    /// Parts that are given twice.
    pub repetitions: Vec<Repetition>,
}

impl Assembly {
    /// Heals the parts and brings them into the planning frame.
    ///
    /// # Errors
    /// A part's mesh cannot be used, there is no part, or a name that is declared fixed is none.
    pub fn new(source: &SourceAssembly) -> Result<Self, GeometryError> {
        Self::new_until(source, &Termination::default())
    }

    /// The same, unless the termination condition becomes true before it is done.
    ///
    /// # Errors
    /// As [`Assembly::new`], and the interruption.
    pub fn new_until(source: &SourceAssembly, termination: &Termination) -> Result<Self, GeometryError> {
        let refuse = |reason: String| GeometryError::Assembly { origin: source.name.clone(), reason };
        if source.parts.is_empty() {
            return Err(refuse("the assembly has no parts; add at least one mesh".into()));
        }
        let healed =
            source.parts.par_iter().map(|p| heal_until(p, termination)).collect::<Result<Vec<_>, _>>()?;
        let mut findings = Vec::new();
        let mut meshes = Vec::new();
        for (i, h) in healed.into_iter().enumerate() {
            findings.extend(h.findings.into_iter().map(|f| (i, f)));
            meshes.push(h.mesh);
        }
        let scale = planning_scale(&meshes);
        for vertex in meshes.iter_mut().flat_map(|m| &mut m.vertices) {
            *vertex *= scale;
        }
        findings.extend(odd_sizes(&meshes));
        let names: Vec<_> = source.parts.iter().map(|p| p.name.clone()).collect();
        let (shapes, parts) = share_shapes(meshes, names, termination)?;
        let fixed = source
            .fixed
            .iter()
            .map(|name| {
                parts
                    .iter()
                    .position(|p| &p.name == name)
                    .ok_or_else(|| refuse(format!("`fixed` names part `{name}`, which does not exist")))
            })
            .collect::<Result<_, _>>()?;
        let repetitions = repetitions(parts.iter().map(Part::place), &shapes, None, termination)?;
        let (name, units) = (source.name.clone(), source.units.clone());
        Ok(Self { name, units, scale, parts, shapes, fixed, findings, repetitions })
    }

    /// The shape of a part.
    #[must_use]
    pub fn shape(&self, part: usize) -> &Arc<Shape> {
        &self.shapes[self.parts[part].shape]
    }

    /// The middle of the assembled part's box, in the planning frame: the point that moves on a
    /// line between waypoints.
    #[must_use]
    pub fn centre(&self, part: usize) -> Point3<f64> {
        self.parts[part].bounds.centre()
    }

    /// Longest side of the box of all parts.
    #[must_use]
    pub fn longest_side(&self) -> f64 {
        self.parts.iter().fold(Bounds::EMPTY, |b, p| b.union(&p.bounds)).extents().max()
    }
}

/// A part so much larger, and one so much smaller, than all others that its unit of length is likely another one.
fn odd_sizes(meshes: &[Mesh]) -> Vec<(usize, String)> {
    /// How many times. A washer is 100 times smaller than its machine, but not than the next smallest part. At half,
    /// machines with one large frame are warned of; at double, inches among millimetres still are not (25).
    const SUSPICIOUS: f64 = 100.0;
    let size = |m: &Mesh| Bounds::of(&m.vertices).extents().max();
    let mut sizes: Vec<(f64, usize)> = meshes.iter().map(size).zip(0..).collect();
    sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
    let odd = |ratio: f64, part: usize, what: &str| {
        let advice = "check that all parts have the same unit";
        (ratio > SUSPICIOUS).then(|| (part, format!("{ratio:.0} times as {what} part: {advice}")))
    };
    let largest = match sizes[..] {
        [(largest, part), (next, _), ..] => odd(largest / next, part, "large as the next largest"),
        _ => None,
    };
    let smallest = match sizes[..] {
        // Of two, the larger one is odd already.
        [_, .., (next, _), (smallest, part)] => odd(next / smallest, part, "small as the next smallest"),
        _ => None,
    };
    largest.into_iter().chain(smallest).collect()
}

/// The power of two that brings the longest side of the box of all parts into (5, 10].
fn planning_scale(meshes: &[Mesh]) -> f64 {
    let bounds = meshes.iter().fold(Bounds::EMPTY, |b, m| b.union(&Bounds::of(&m.vertices)));
    let longest = bounds.extents().max();
    let mut scale = 2f64.powf((10.0 / longest).log2().floor());
    // The logarithm may round across a power of two.
    while longest * scale > 10.0 {
        scale /= 2.0;
    }
    while longest * scale <= 5.0 {
        scale *= 2.0;
    }
    scale
}

fn share_shapes(
    meshes: Vec<Mesh>,
    names: Vec<String>,
    termination: &Termination,
) -> Result<(Vec<Arc<Shape>>, Vec<Part>), Interrupt> {
    // The first part of each shape, and of each part its shape and where it stands against that first one.
    let mut firsts: Vec<usize> = Vec::new();
    let mut copies = Vec::new();
    for (i, mesh) in meshes.iter().enumerate() {
        termination.check()?;
        let copied = |(k, first): (usize, &usize)| Some((k, congruence(&meshes[*first], mesh)?));
        copies.push(firsts.iter().enumerate().find_map(copied).unwrap_or_else(|| {
            firsts.push(i);
            (firsts.len() - 1, Pose::identity())
        }));
    }
    let mut copies_of = vec![Vec::new(); firsts.len()];
    for (i, (shape, _)) in copies.iter().enumerate() {
        copies_of[*shape].push((i, &meshes[i]));
    }
    let originals: Vec<_> = copies_of.par_iter().filter_map(|copies| OwnFrame::among(copies)).collect();
    let place = |(i, name): (usize, String)| {
        termination.check()?;
        let (shape, from_first) = copies[i];
        let (original, frame) = &originals[shape];
        // Where a copy stands depends on the two alone, and not on which came first.
        let motion = if *original == firsts[shape] {
            from_first
        } else if i == *original {
            Pose::identity()
        } else {
            let through_first = || from_first * copies[*original].1.inverse();
            congruence(&meshes[*original], &meshes[i]).unwrap_or_else(through_first)
        };
        let planning_from_shape = motion * frame.pose();
        let bounds = Bounds::of(&meshes[i].vertices);
        Ok(Part { name, shape, planning_from_shape, bounds, moved: Pose::identity() })
    };
    let parts = names.into_iter().enumerate().map(place).collect::<Result<_, Interrupt>>()?;
    let shape = |(i, frame): &(usize, OwnFrame)| Shape::within(&meshes[*i], frame, termination);
    let shapes = originals.par_iter().map(|o| shape(o).map(Arc::new)).collect::<Result<_, _>>()?;
    Ok((shapes, parts))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{block_on_plate, cuboid, healed, l_shape, moved, source};

    fn scaled(factor: f64) -> SourceAssembly {
        source(block_on_plate().map(|mut m| {
            m.vertices.iter_mut().flatten().for_each(|x| *x *= factor);
            m
        }))
    }

    #[test]
    fn the_longest_side_falls_into_the_planning_frame() {
        for size in [1.0, 1e7, 1e-4, 1.25, 0.625, 0.6249999999, 1.2500000001, 3.7e3, 1.0 / 3.0] {
            let a = Assembly::new(&scaled(size)).unwrap();
            assert!(a.longest_side() > 5.0 && a.longest_side() <= 10.0, "{} for {size}", a.longest_side());
            assert_eq!(a.scale.log2().fract(), 0.0, "{} is no power of two", a.scale);
            assert!((a.longest_side() / a.scale - 8.0 * size).abs() < 1e-9 * size);
        }
    }

    #[test]
    fn copies_share_a_shape_and_stand_at_their_places() {
        let poses = [
            Pose::identity(),
            Pose::translation(4.0, 0.0, 0.0),
            Pose::new(Vector3::new(0.0, 4.0, 1.0), Vector3::new(0.3, -0.2, 1.0)),
        ];
        let meshes = poses.iter().map(|p| moved(l_shape(), p)).chain([cuboid([-2.0; 3], [-1.0; 3])]);
        let a = Assembly::new(&source(meshes)).unwrap();
        assert_eq!(a.shapes.len(), 2);
        assert_eq!(a.parts.iter().map(|p| p.shape).collect::<Vec<_>>(), [0, 0, 0, 1]);
        assert!(Arc::ptr_eq(a.shape(0), a.shape(2)));
        for (i, pose) in poses.iter().enumerate() {
            let part = &a.parts[i];
            for v in l_shape().vertices {
                let there = (pose * Point3::from(v)) * a.scale;
                let d = a.shape(i).surface.signed_distance(&(part.planning_from_shape.inverse() * there));
                assert!(d.abs() < 1e-9, "{d} off the copy");
                assert!(part.bounds.grown(1e-9).contains(&there));
            }
        }
    }

    #[test]
    fn shapes_do_not_depend_on_which_copy_comes_first() {
        let turns = [
            Pose::identity(),
            Pose::new(Vector3::new(0.1, 4.0, 1.0), Vector3::y() * std::f64::consts::FRAC_PI_2),
            Pose::new(Vector3::new(0.0, -4.0, 0.3), Vector3::x() * std::f64::consts::PI),
            Pose::new(Vector3::new(4.0, 0.2, 1.0), Vector3::new(0.3, -0.2, 1.0)),
        ];
        // As files round them: no two copies are the same.
        let copy = |i: usize| {
            let mut mesh = moved(moved(l_shape(), &turns[i]), &Pose::translation(1.0 / 3.0, 0.0, 0.1));
            mesh.vertices.iter_mut().flatten().for_each(|x| *x = (*x * 1e6).round() / 1e6);
            mesh
        };
        let content = |order: [usize; 4]| {
            let a = Assembly::new(&source(order.map(copy))).unwrap();
            assert_eq!(a.shapes.len(), 1);
            for (part, i) in order.into_iter().enumerate() {
                let there = a.parts[part].planning_from_shape;
                let given = healed(copy(i)).vertices.into_iter();
                let off = given.zip(a.shapes[0].surface.vertices());
                let off = off.map(|(v, own)| (v * a.scale - there * own).norm()).fold(0.0, f64::max);
                assert!(off < 1e-5, "copy {i} of {order:?} is {off} off");
            }
            *a.shapes[0].content()
        };
        assert_eq!([[3, 1, 0, 2], [2, 3, 1, 0], [1, 0, 2, 3]].map(content), [content([0, 1, 2, 3]); 3]);
    }

    #[test]
    fn a_shape_has_the_middle_of_its_box_as_origin() {
        let a = Assembly::new(&source(block_on_plate())).unwrap();
        for (i, part) in a.parts.iter().enumerate() {
            assert!(a.shape(i).bounds().centre().coords.norm() < 1e-12);
            assert_eq!(part.planning_from_shape * Point3::origin(), a.centre(i));
        }
    }

    #[test]
    fn a_fixed_name_must_exist() {
        let mut s = source(block_on_plate());
        s.fixed = vec!["1".into()];
        assert_eq!(Assembly::new(&s).unwrap().fixed, [1]);
        s.fixed = vec!["bolt".into()];
        let refusal = Assembly::new(&s).unwrap_err().to_string();
        assert!(refusal.contains("`bolt`") && refusal.contains("does not exist"), "{refusal}");
    }

    #[test]
    fn what_is_cancelled_is_not_taken_in() {
        let given = source(block_on_plate());
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let interrupted = GeometryError::Interrupted(Interrupt::Cancelled);
        assert_eq!(Assembly::new_until(&given, &termination).unwrap_err(), interrupted);
        let replaced = vec![(0, cuboid([0.0; 3], [1.0; 3]))];
        let revision = crate::geometry::Revision { replaced, ..Default::default() };
        let base = Assembly::new(&given).unwrap();
        assert_eq!(base.revised_until(&revision, &termination).unwrap_err(), interrupted);
    }

    #[test]
    fn an_assembly_without_parts_is_refused() {
        let refusal = Assembly::new(&source([])).unwrap_err().to_string();
        assert!(refusal.contains("no parts"), "{refusal}");
    }

    #[test]
    fn a_part_in_another_unit_is_pointed_out() {
        let a = Assembly::new(&source([cuboid([0.0; 3], [1.0; 3]), cuboid([0.0; 3], [500.0; 3])])).unwrap();
        assert!(a.findings.iter().any(|(part, f)| *part == 1 && f.contains("same unit")), "{:?}", a.findings);
        assert!(Assembly::new(&source(block_on_plate())).unwrap().findings.is_empty());
    }
}
