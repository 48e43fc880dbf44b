//! Directions from geometry: the axes along and about which an assembly's parts are made.
//!
//! Prismatic and turned parts leave along the axis that their surfaces are parallel or at right
//! angles to. The axes on which most surface agrees make up the assembly's own frame; parts that
//! stand askew in it add theirs. So the axes turn with the assembly, and a plan does not depend on
//! how it lies in the world.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Unit, Vector3};

use crate::geometry::Shape;
use crate::simulation::{Axis, Scene};
use crate::termination::{Interrupt, Termination};

/// cos of the angle within which two directions are one (a quarter of a degree).
const ALIKE: f64 = 0.999_99;
/// |cos| below which two directions are at right angles.
const SQUARE: f64 = 0.005;
/// The directions of a part's surfaces that are looked at: those with the most area.
const MOST_NORMALS: usize = 32;
/// Normals are first put into buckets of this many to the unit, and those with the most area looked
/// at: a free form has as many normals as triangles.
const BUCKETS: f64 = 500.0;
const MOST_BUCKETS: usize = 512;
/// The share of a part's surface that must agree on an axis.
const LEAST_SHARE: f64 = 0.5;
/// cos of the angle within which an axis stands for a part's own (3 degrees).
const NEAR: f64 = 0.9986;
/// Eigenvalues of a turned part, as shares of their sum: two differ by less than this …
const TURNED_ALIKE: f64 = 0.03;
/// … and the third by more than that.
const TURNED_APART: f64 = 0.06;
/// How much more an axis of the world counts.
const WORLD_PREFERENCE: f64 = 1.2;
/// Axes of askew parts beyond the frame, at most.
const MOST_EXTRA: usize = 3;

/// The axes along which a search of some parts of an assembly moves them: a right-angled frame, the world's
/// where surfaces do not agree on another, and those of parts that stand askew in it.
///
/// # Errors
/// The termination condition became true.
pub fn axes_of(scene: &Scene, present: &[usize], termination: &Termination) -> Result<Vec<Axis>, Interrupt> {
    let directions = Directions::of(scene, present, termination);
    termination.check()?;
    Ok(directions.axes)
}

/// The directions that a search draws from the geometry.
#[derive(Debug, Clone)]
pub(super) struct Directions {
    /// A right-angled frame, then the axes of parts that stand askew in it.
    pub(super) axes: Vec<Axis>,
    /// For each part, which of the axes it is made along, if any.
    own: Vec<Option<usize>>,
}

impl Directions {
    /// Those of the paper: the axes of the world, and no part's own.
    pub(super) fn of_world(scene: &Scene) -> Self {
        Self { axes: Axis::WORLD.to_vec(), own: vec![None; scene.bodies.len()] }
    }

    /// Those of the present parts; the world's axes where surfaces do not agree on any. Once the condition is
    /// true parts are left out: whoever asks must look at it before using them.
    #[must_use]
    pub(super) fn of(scene: &Scene, present: &[usize], termination: &Termination) -> Self {
        let mut of_shape: HashMap<*const Shape, Faces> = HashMap::new();
        let mut votes = Axis::WORLD.map(|a| Candidate { direction: a.unit(), weight: 0.0 }).to_vec();
        let mut own: Vec<Option<Candidate>> = vec![None; scene.bodies.len()];
        let mut principal: Vec<Candidate> = Vec::new();
        for &part in present {
            if termination.check().is_err() {
                break;
            }
            let body = &scene.bodies[part];
            let faces = of_shape.entry(Arc::as_ptr(&body.shape)).or_insert_with(|| Faces::of(&body.shape));
            let rotation = body.planning_from_shape.rotation;
            for v in &mut votes[..3] {
                v.weight += faces.speaking_for(&rotation.inverse_transform_unit_vector(&v.direction));
            }
            let turned = |c: &Candidate| Candidate { direction: oriented(rotation * c.direction), ..*c };
            for c in faces.candidates.iter().map(turned).filter(|c| !c.is_of_world()) {
                count(&mut votes, c);
            }
            own[part] = faces.own.as_ref().map(turned);
            faces.principal.iter().map(turned).for_each(|c| count(&mut principal, c));
        }
        let best_first = |c: &mut Vec<Candidate>| c.sort_by(|a, b| b.rank().total_cmp(&a.rank()));
        best_first(&mut votes);
        best_first(&mut principal);
        let mut axes = frame(&votes, &principal);
        let mut extra: Vec<Candidate> = Vec::new();
        for c in own.iter().flatten().chain(&principal).filter(|c| nearest(&axes, &c.direction).is_none()) {
            count(&mut extra, *c);
        }
        best_first(&mut extra);
        axes.extend(extra.into_iter().take(MOST_EXTRA).map(|c| c.direction));
        let own = own.iter().map(|c| nearest(&axes, &c.as_ref()?.direction)).collect();
        Self { axes: axes.into_iter().map(Axis::along).collect(), own }
    }

    /// Whether an action is along or about the axis that a part is made along.
    pub(super) fn is_own(&self, part: usize, axis: Axis) -> bool {
        self.own[part].is_some_and(|i| self.axes[i] == axis)
    }
}

fn count(votes: &mut Vec<Candidate>, c: Candidate) {
    match votes.iter_mut().find(|v| v.is_like(&c.direction)) {
        Some(v) => v.weight += c.weight,
        None => votes.push(c),
    }
}

/// Which axis is the nearest to a direction, if it is near.
fn nearest(axes: &[Unit<Vector3<f64>>], d: &Unit<Vector3<f64>>) -> Option<usize> {
    let cos = |i: &usize| axes[*i].dot(d).abs();
    (0..axes.len()).max_by(|i, j| cos(i).total_cmp(&cos(j))).filter(|i| cos(i) > NEAR)
}

/// A direction and the surface that speaks for it.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    direction: Unit<Vector3<f64>>,
    /// Area that is parallel or at right angles to it.
    weight: f64,
}

impl Candidate {
    fn is_like(&self, direction: &Unit<Vector3<f64>>) -> bool {
        self.direction.dot(direction).abs() > ALIKE
    }

    fn is_of_world(&self) -> bool {
        Axis::WORLD.iter().any(|a| self.is_like(&a.unit()))
    }

    /// Its weight; more for the world's axes, for of a round part's many sides none is better.
    fn rank(&self) -> f64 {
        self.weight * if self.is_of_world() { WORLD_PREFERENCE } else { 1.0 }
    }
}

/// Where a shape's surface faces, in its frame.
struct Faces {
    /// The normals with the most area, opposite ones as one.
    normals: Vec<Candidate>,
    /// The area of the whole surface.
    area: f64,
    /// Directions that enough of the surface agrees on, best first.
    candidates: Vec<Candidate>,
    /// The axis that the shape is turned about, or else the best candidate.
    own: Option<Candidate>,
    /// Of a shape whose surface agrees on none, the principal axes that stand apart: an open ring has them
    /// along and across its gap.
    principal: Vec<Candidate>,
}

impl Faces {
    fn of(shape: &Shape) -> Self {
        let (normals, area) = normals(shape);
        let mut faces = Self { normals, area, candidates: Vec::new(), own: None, principal: Vec::new() };
        faces.candidates = faces.agreed();
        let spread = Spread::of(shape);
        if faces.candidates.is_empty() {
            let principal = (0..3).filter(|&i| spread.apart(i) > TURNED_APART).filter_map(|i| spread.axis(i));
            faces.principal = principal.map(|direction| Candidate { direction, weight: area }).collect();
        }
        let turned = spread.turning_axis().map(|axis| {
            let mut known = faces.candidates.iter().chain(&faces.normals).map(|c| c.direction);
            let direction = known.find(|d| d.dot(&axis).abs() > NEAR).unwrap_or(axis);
            Candidate { direction, weight: faces.speaking_for(&direction) }
        });
        faces.own = turned.or_else(|| faces.candidates.first().copied());
        faces
    }

    /// The area that is parallel or at right angles to a direction.
    fn speaking_for(&self, direction: &Unit<Vector3<f64>>) -> f64 {
        let speaks = |n: &&Candidate| {
            let cos = n.direction.dot(direction).abs();
            !(SQUARE..=ALIKE).contains(&cos)
        };
        self.normals.iter().filter(speaks).map(|n| n.weight).sum()
    }

    fn agreed(&self) -> Vec<Candidate> {
        let Some(largest) = self.normals.first() else { return Vec::new() };
        let mut out: Vec<Candidate> = Vec::new();
        // A turned part without flat ends shows its axis as what two of its sides have in common.
        let sides = self.normals[1..]
            .iter()
            .filter_map(|n| Unit::try_new(largest.direction.cross(&n.direction), 0.1).map(oriented))
            .take(MOST_NORMALS);
        for direction in self.normals.iter().take(MOST_NORMALS).map(|n| n.direction).chain(sides) {
            if out.iter().any(|c| c.is_like(&direction)) {
                continue;
            }
            let weight = self.speaking_for(&direction);
            if weight > LEAST_SHARE * self.area {
                out.push(Candidate { direction, weight });
            }
        }
        out.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        out
    }
}

/// How the normals of a shape are spread: ∫nnᵀdA, and its eigenvalues as shares of their sum.
struct Spread {
    axes: Matrix3<f64>,
    shares: Vector3<f64>,
}

impl Spread {
    fn of(shape: &Shape) -> Self {
        let surface = &shape.surface;
        let mut spread = Matrix3::zeros();
        for t in 0..surface.triangles().len() as u32 {
            let [a, b, c] = surface.corners(t);
            let twice = (b - a).cross(&(c - a));
            let area = twice.norm();
            if area > 0.0 {
                spread += twice * twice.transpose() / area;
            }
        }
        let eigen = spread.symmetric_eigen();
        Self { axes: eigen.eigenvectors, shares: eigen.eigenvalues / spread.trace() }
    }

    /// How far an eigenvalue is from the nearer of the two others.
    fn apart(&self, i: usize) -> f64 {
        let from = |j: usize| (self.shares[i] - self.shares[j]).abs();
        from((i + 1) % 3).min(from((i + 2) % 3))
    }

    fn axis(&self, i: usize) -> Option<Unit<Vector3<f64>>> {
        Unit::try_new(self.axes.column(i).into_owned(), 0.5).map(oriented)
    }

    /// The axis of a shape whose normals are spread alike all around it, as those of a bolt or a nut are,
    /// threads included: an eigenvalue stands apart from two others that are equal.
    fn turning_axis(&self) -> Option<Unit<Vector3<f64>>> {
        let alike = |i: usize| (self.shares[(i + 1) % 3] - self.shares[(i + 2) % 3]).abs() < TURNED_ALIKE;
        self.axis((0..3).find(|&i| alike(i) && self.apart(i) > TURNED_APART)?)
    }
}

/// The directions in which most of a shape's surface faces, with their areas, largest first;
/// opposite ones are one. Also the area of the whole surface.
fn normals(shape: &Shape) -> (Vec<Candidate>, f64) {
    let surface = &shape.surface;
    let mut buckets: HashMap<[i16; 3], Candidate> = HashMap::new();
    let mut area = 0.0;
    for t in 0..surface.triangles().len() as u32 {
        let [a, b, c] = surface.corners(t);
        let twice = (b - a).cross(&(c - a));
        let Some(direction) = Unit::try_new(twice, 1e-12).map(oriented) else { continue };
        let weight = twice.norm() / 2.0;
        area += weight;
        let key = direction.map(|x| (x * BUCKETS).round() as i16).into();
        buckets.entry(key).or_insert(Candidate { direction, weight: 0.0 }).weight += weight;
    }
    let mut largest: Vec<([i16; 3], Candidate)> = buckets.into_iter().collect();
    // The keys decide among equals, so that the order of the map does not.
    largest.sort_by(|(k, a), (l, b)| b.weight.total_cmp(&a.weight).then(k.cmp(l)));
    let mut out = Vec::new();
    for (_, c) in largest.into_iter().take(MOST_BUCKETS) {
        count(&mut out, c);
    }
    out.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    (out, area)
}

/// Three axes at right angles: the best, the best at right angles to it (a part's principal axis if surfaces
/// agree on none), and the third.
fn frame(votes: &[Candidate], principal: &[Candidate]) -> Vec<Unit<Vector3<f64>>> {
    let world = Axis::WORLD.map(Axis::unit).to_vec();
    let Some(first) = votes.first().map(|c| c.direction) else { return world };
    let square = |c: &&Candidate| c.direction.dot(&first).abs() < SQUARE;
    let across = |d: &Unit<Vector3<f64>>| Unit::try_new(d.into_inner() - *first * first.dot(d), 0.1);
    let second =
        votes.iter().chain(principal).find(square).and_then(|c| across(&c.direction)).or_else(|| {
            let flattest = world.iter().min_by(|a, b| a.dot(&first).abs().total_cmp(&b.dot(&first).abs()));
            flattest.and_then(across)
        });
    let Some(second) = second else { return world };
    let third = Unit::new_normalize(first.cross(&second));
    // In the order of the world's axes that they are nearest to.
    let mut axes = vec![oriented(first), oriented(second), oriented(third)];
    axes.sort_by_key(|a| a.iamax());
    axes
}

/// The same axis, its largest component positive.
fn oriented(d: Unit<Vector3<f64>>) -> Unit<Vector3<f64>> {
    if d[d.iamax()] < 0.0 { -d } else { d }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, rod, scene};
    use crate::geometry::{Pose, SourceMesh};

    fn axes_of(meshes: impl IntoIterator<Item = SourceMesh>) -> Vec<Axis> {
        let (scene, _) = scene(meshes);
        let present: Vec<_> = (0..scene.bodies.len()).collect();
        Directions::of(&scene, &present, &Termination::default()).axes
    }

    #[test]
    fn parts_that_are_square_to_the_world_have_its_axes() {
        assert_eq!(axes_of(block_on_plate()), Axis::WORLD);
    }

    #[test]
    fn axes_turn_with_the_assembly() {
        let turn = Pose::rotation(Vector3::new(0.3, -0.5, 0.2));
        let found = axes_of(peg_in_hole(0.0).map(|m| moved(m, &turn)));
        assert_eq!(found.len(), 3);
        for axis in Axis::WORLD.map(|a| turn * a.unit().into_inner()) {
            assert!(found.iter().any(|a| a.unit().dot(&axis).abs() > 1.0 - 1e-9), "{axis}");
        }
    }

    #[test]
    fn a_part_that_stands_askew_adds_its_axis() {
        let [plate, _] = block_on_plate();
        let lean = Pose::rotation(Vector3::new(0.0, 0.4, 0.0));
        let pin = moved(rod(0.3, [1.0, 4.0], 24), &lean);
        let found = axes_of([plate, pin]);
        assert_eq!(found[..3], Axis::WORLD);
        assert!(found.len() == 4 && found[3].unit().dot(&(lean * Vector3::z())).abs() > 1.0 - 1e-9);
    }

    #[test]
    fn a_body_without_flat_faces_leaves_the_world_its_axes() {
        assert_eq!(
            axes_of([moved(crate::fixtures::ball(4), &Pose::translation(2.0, 0.0, 0.0)), cube()])[..3],
            Axis::WORLD
        );
    }

    #[test]
    fn a_nut_and_its_bolt_are_made_along_the_thread() {
        let turn = Pose::rotation(Vector3::new(0.3, -0.5, 0.2));
        let (scene, _) = scene(crate::fixtures::thread(3.0, 0.5).map(|m| moved(m, &turn)));
        let directions = Directions::of(&scene, &[0, 1], &Termination::default());
        let along =
            directions.axes.iter().position(|a| a.unit().dot(&(turn * Vector3::z())).abs() > 0.999_999);
        assert!(along.is_some() && directions.own == [along, along], "{directions:?}");
    }

    #[test]
    fn a_ring_that_is_open_has_the_axis_of_its_gap() {
        let turn = Pose::rotation(Vector3::new(0.3, -0.5, 0.2));
        let lean = Pose::rotation(Vector3::new(0.0, 0.0, 0.5));
        // Where nothing else tells a direction across the rod, and where the rod's end tells another one.
        for (pose, sides) in [(turn, 24), (lean, 4)] {
            let found = axes_of([rod(0.3, [-4.0, 4.0], sides), open_ring(1.0, 0.2)].map(|m| moved(m, &pose)));
            let gap = pose * Vector3::x();
            assert!(found.iter().any(|a| a.unit().dot(&gap).abs() > 1.0 - 1e-6), "{found:?}");
        }
    }

    /// A ring about z without the sixth of it that is around +x: a torus, whose surface agrees on no axis.
    fn open_ring(radius: f64, thickness: f64) -> SourceMesh {
        use std::f64::consts::{PI, TAU};
        const ALONG: u32 = 60;
        const AROUND: u32 = 16;
        let mut mesh = SourceMesh::default();
        for (i, j) in (0..=ALONG).flat_map(|i| (0..AROUND).map(move |j| (i, j))) {
            let a = PI / 6.0 + f64::from(i) / f64::from(ALONG) * PI * 5.0 / 3.0;
            let b = f64::from(j) / f64::from(AROUND) * TAU;
            let r = radius + thickness * b.cos();
            mesh.vertices.push([r * a.cos(), r * a.sin(), thickness * b.sin()]);
        }
        let at = |i: u32, j: u32| i * AROUND + j % AROUND;
        for (i, j) in (0..ALONG).flat_map(|i| (0..AROUND).map(move |j| (i, j))) {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        for j in 1..AROUND - 1 {
            mesh.triangles.push([at(0, 0), at(0, j), at(0, j + 1)]);
            mesh.triangles.push([at(ALONG, 0), at(ALONG, j + 1), at(ALONG, j)]);
        }
        mesh
    }

    fn cube() -> SourceMesh {
        crate::fixtures::cuboid([-3.0, -1.0, -1.0], [-2.0, 1.0, 1.0])
    }
}
