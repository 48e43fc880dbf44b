//! Directions from geometry: the axes along and about which an assembly's parts are made.
//!
//! Prismatic and turned parts leave along the axis that their surfaces are parallel or at right
//! angles to. The axes on which most surface agrees make up the assembly's own frame; parts that
//! stand askew in it add theirs. So the axes turn with the assembly, and a plan does not depend on
//! how it lies in the world.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Unit, Vector3};

use crate::budgets::EXTRA_AXES;
use crate::geometry::{NEAR_AXIS, SQUARE, Shape, WeightedDirection, oriented};
use crate::scene::Scene;
use crate::simulation::Axis;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::WORLD_PREFERENCE;

/// The axes along which a search moves some parts of an assembly: a right-angled frame (the world's where
/// surfaces do not agree on another) and the axes of parts that stand askew in it.
///
/// # Errors
/// The termination condition became true.
pub fn axes_of(scene: &Scene, present: &[usize], termination: &Termination) -> Result<Vec<Axis>, Interrupt> {
    Ok(Directions::of(scene, present, termination)?.axes)
}

/// The directions that a search draws from the geometry.
#[derive(Debug, Clone)]
pub(super) struct Directions {
    /// A right-angled frame, then the axes of parts that stand askew in it.
    pub(super) axes: Vec<Axis>,
    /// Per part: the index of the axis that it is made along, if any.
    own: Vec<Option<usize>>,
}

impl Directions {
    /// The paper's directions: the axes of the world, and no part's own.
    pub(super) fn of_world(scene: &Scene) -> Self {
        Self { axes: Axis::WORLD.to_vec(), own: vec![None; scene.bodies.len()] }
    }

    /// The directions of the present parts; the world's axes where surfaces do not agree on any.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn of(scene: &Scene, present: &[usize], termination: &Termination) -> Result<Self, Interrupt> {
        let mut votes = Axis::WORLD.map(|a| WeightedDirection { direction: a.unit(), weight: 0.0 }).to_vec();
        let mut own: Vec<Option<WeightedDirection>> = vec![None; scene.bodies.len()];
        let mut principal: Vec<WeightedDirection> = Vec::new();
        let mut spoken: HashMap<(*const Shape, [u64; 4]), [f64; 3]> = HashMap::new();
        for &part in present {
            termination.check()?;
            let body = &scene.bodies[part];
            let faces = body.shape.faces();
            let rotation = body.planning_from_shape.rotation;
            // Many equal parts have the same orientation: their weights are computed once.
            let standing = (Arc::as_ptr(&body.shape), rotation.coords.data.0[0].map(f64::to_bits));
            let for_world = spoken.entry(standing).or_insert_with(|| {
                Axis::WORLD.map(|a| faces.speaking_for(&rotation.inverse_transform_unit_vector(&a.unit())))
            });
            for (vote, weight) in votes.iter_mut().zip(for_world) {
                vote.weight += *weight;
            }
            let turned = |c: &WeightedDirection| WeightedDirection {
                direction: oriented(rotation * c.direction),
                ..*c
            };
            for c in faces.candidates.iter().map(turned).filter(|c| !is_of_world(c)) {
                c.count_among(&mut votes);
            }
            own[part] = faces.own.as_ref().map(turned);
            faces.principal.iter().map(turned).for_each(|c| c.count_among(&mut principal));
        }
        let best_first = |c: &mut Vec<WeightedDirection>| c.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
        best_first(&mut votes);
        best_first(&mut principal);
        let mut axes = frame(&votes, &principal);
        let mut extra: Vec<WeightedDirection> = Vec::new();
        for c in own.iter().flatten().chain(&principal).filter(|c| nearest(&axes, &c.direction).is_none()) {
            c.count_among(&mut extra);
        }
        best_first(&mut extra);
        axes.extend(extra.into_iter().take(EXTRA_AXES).map(|c| c.direction));
        let own = own.iter().map(|c| nearest(&axes, &c.as_ref()?.direction)).collect();
        Ok(Self { axes: axes.into_iter().map(Axis::along).collect(), own })
    }

    /// Whether a part is made along one of the axes.
    pub(super) fn has_own(&self, part: usize) -> bool {
        self.own[part].is_some()
    }

    /// Whether an action is along or about the axis that a part is made along.
    pub(super) fn is_own(&self, part: usize, axis: Axis) -> bool {
        self.own[part].is_some_and(|i| self.axes[i] == axis)
    }
}

/// The index of the axis nearest to a direction, if it is near.
fn nearest(axes: &[Unit<Vector3<f64>>], d: &Unit<Vector3<f64>>) -> Option<usize> {
    let cos = |i: &usize| axes[*i].dot(d).abs();
    (0..axes.len()).max_by(|i, j| cos(i).total_cmp(&cos(j))).filter(|i| cos(i) > NEAR_AXIS)
}

fn is_of_world(c: &WeightedDirection) -> bool {
    Axis::WORLD.iter().any(|a| c.is_like(&a.unit()))
}

/// The weight of a direction; more for the world's axes, for of a round part's many sides none is better.
fn rank(c: &WeightedDirection) -> f64 {
    c.weight * if is_of_world(c) { WORLD_PREFERENCE } else { 1.0 }
}

/// Three axes at right angles: the best, the best at right angles to it (a part's principal axis if surfaces
/// agree on none), and the third.
fn frame(votes: &[WeightedDirection], principal: &[WeightedDirection]) -> Vec<Unit<Vector3<f64>>> {
    let world = Axis::WORLD.map(Axis::unit).to_vec();
    let Some(first) = votes.first().map(|c| c.direction) else { return world };
    let square = |c: &&WeightedDirection| c.direction.dot(&first).abs() < SQUARE;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, rod, scene};
    use crate::geometry::{Pose, SourceMesh};

    fn axes_of(meshes: impl IntoIterator<Item = SourceMesh>) -> Vec<Axis> {
        let (scene, _) = scene(meshes);
        let present: Vec<_> = (0..scene.bodies.len()).collect();
        Directions::of(&scene, &present, &Termination::default()).unwrap().axes
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
        let directions = Directions::of(&scene, &[0, 1], &Termination::default()).unwrap();
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
