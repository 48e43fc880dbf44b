//! How deep the inside is that two parts have in common.
//!
//! Overlaps are measured from the surfaces: the deepest point of either surface in the other solid. Where the surfaces
//! coincide, that is nothing, though all of a body may be in both parts. Then a body of one is a body of the other, as
//! what is inside both and beside no surface that enters the other ends at the surface of both. So a point inside each
//! body shows it ([`Shape::inner_points`]), and most pairs have none of these in common.
//!
//! The deepest point that both have inside is found by branch and bound over boxes: a signed distance changes no faster
//! than its point moves. First come points below the surfaces, which are the deepest in thin parts.

use std::collections::BinaryHeap;

use nalgebra::Point3;

use crate::budgets::{COMMON_POINTS, COMMON_SEEDS};
use crate::contact::PairPath;
use crate::geometry::{Bounds, Pose, Shape, Surface};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::DEPTH_SHARE;

/// The depth, in either of two parts, of the deepest point that is inside both, if they have a body in common. It is
/// measured at a point, and no less than nine tenths of the deepest there is, unless the budget ends the search.
///
/// # Errors
/// The termination condition became true.
pub(super) fn common_depth(pair: &PairPath<'_>, termination: &Termination) -> Result<f64, Interrupt> {
    let Some(other_from_one) = pair.path.first() else { return Ok(0.0) };
    let inside = Common { shapes: pair.shapes, other_from_one: *other_from_one };
    if inside.is_empty() { Ok(0.0) } else { inside.deepest(termination) }
}

/// What is inside two shapes, in the frame of the second.
struct Common<'a> {
    shapes: [&'a Shape; 2],
    other_from_one: Pose,
}

/// The depth of a point, and the most that points around it can have.
struct Measured {
    /// Nothing unless it is inside both.
    depth: f64,
    /// The depth in that shape in which it is less: below zero outside.
    least: f64,
    /// The depth in that shape in which it is more.
    most: f64,
}

/// A box to look into, ordered by the most that it can have.
struct Open {
    most: f64,
    bounds: Bounds,
}

impl Common<'_> {
    /// Whether none of the bodies of one has its inner point in the other.
    fn is_empty(&self) -> bool {
        let [one, other] = self.shapes;
        let surfaces = [&one.surface, &other.surface];
        if !surfaces[0].has_inside_for(surfaces[1]) || !surfaces[1].has_inside_for(surfaces[0]) {
            return true;
        }
        let one_from_other = self.other_from_one.inverse();
        let is_in = |surface: &Surface, p: &Point3<f64>| {
            surface.bounds().contains(p) && surface.signed_distance(p) < 0.0
        };
        !one.inner_points().iter().any(|p| is_in(&other.surface, &(self.other_from_one * p)))
            && !other.inner_points().iter().any(|p| is_in(&one.surface, &(one_from_other * p)))
    }

    fn measured(&self, p: &Point3<f64>) -> Measured {
        let [one, other] = self.shapes;
        let depths = [
            -one.surface.signed_distance(&self.other_from_one.inverse_transform_point(p)),
            -other.surface.signed_distance(p),
        ];
        let (least, most) = (depths[0].min(depths[1]), depths[0].max(depths[1]));
        Measured { depth: if least > 0.0 { most } else { 0.0 }, least, most }
    }

    fn deepest(&self, termination: &Termination) -> Result<f64, Interrupt> {
        let [one, other] = self.shapes.map(Shape::bounds);
        let bounds = one.transformed(&self.other_from_one).intersection(other);
        let mut deepest = 0.0f64;
        for p in self.seeds().chain([bounds.centre()]) {
            termination.check()?;
            deepest = deepest.max(self.measured(&p).depth);
        }
        let mut open = BinaryHeap::from([Open { most: f64::INFINITY, bounds }]);
        let mut looked = 0;
        while let Some(Open { most, bounds }) = open.pop() {
            if most * (1.0 - DEPTH_SHARE) <= deepest || looked >= COMMON_POINTS {
                break;
            }
            for bounds in halves(&bounds) {
                termination.check()?;
                looked += 1;
                let radius = bounds.extents().norm() / 2.0;
                let at = self.measured(&bounds.centre());
                deepest = deepest.max(at.depth);
                if at.least + radius > 0.0 {
                    open.push(Open { most: at.most + radius, bounds });
                }
            }
        }
        Ok(deepest)
    }

    /// Points that may be deep, in the frame of the second.
    fn seeds(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        let [one, other] = self.shapes;
        let below = |shape: &Shape| {
            let surface = &shape.surface;
            let inner = surface.spread_points(COMMON_SEEDS).filter_map(|at| surface.inner_point(&at));
            inner.chain(shape.inner_points().iter().copied()).collect::<Vec<_>>()
        };
        below(one).into_iter().map(|p| self.other_from_one * p).chain(below(other))
    }
}

/// The two halves of a box, across its longest side.
fn halves(bounds: &Bounds) -> [Bounds; 2] {
    let axis = bounds.extents().imax();
    let middle = bounds.centre()[axis];
    let [mut low, mut high] = [*bounds; 2];
    (low.max[axis], high.min[axis]) = (middle, middle);
    [low, high]
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.most.total_cmp(&other.most)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{
        ball, block_on_plate, cells, cuboid, joined, moved, peg_in_hole, rod, scene, tube,
    };
    use crate::geometry::SourceMesh;
    use crate::scene::CongruentPair;

    fn depth(meshes: [SourceMesh; 2]) -> f64 {
        let (scene, _) = scene(meshes);
        let [there, back] = [[0, 1], [1, 0]].map(|[a, b]| {
            let pair = PairPath::standing(&scene, &CongruentPair::turned(&scene, a, b));
            common_depth(&pair, &Termination::default()).unwrap()
        });
        assert_eq!(there, back);
        there
    }

    fn near(found: f64, deepest: f64) {
        assert!(found <= deepest + 1e-9 && found >= 0.9 * deepest, "{found} of {deepest}");
    }

    #[test]
    fn copies_are_as_deep_as_the_body_itself() {
        let turn = Pose::rotation(Vector3::new(0.3, -0.2, 0.1));
        for pose in [Pose::identity(), turn] {
            let twice = |mesh: SourceMesh| {
                let mesh = moved(mesh, &pose);
                depth([mesh.clone(), mesh])
            };
            near(twice(cuboid([-3.0; 3], [3.0; 3])), 3.0);
            near(twice(cuboid([-4.0, -4.0, 0.0], [4.0, 4.0, 0.02])), 0.01);
            near(twice(rod(1.0, [-4.0, 4.0], 48)), (std::f64::consts::PI / 48.0).cos());
            near(twice(tube(3.0, 4.0, [-1.0, 1.0], 48)), 0.5);
            let across: &[f64] = &[-4.0, -1.0, 1.0, 4.0];
            near(twice(cells([across, across, &[0.0, 1.0]], |c| c != [1, 1, 0])), 0.5);
        }
    }

    #[test]
    fn a_body_that_two_parts_have_in_common_is_found() {
        let at = |x: f64, size: f64| cuboid([x, 0.0, 0.0], [x + size, size, size]);
        let one = joined([at(0.0, 1.5), at(4.0, 2.0)]);
        let other = joined([at(4.0, 2.0), at(7.0, 1.5)]);
        near(depth([one.clone(), other]), 1.0);
        near(depth([one.clone(), at(0.0, 1.5)]), 0.75);
        assert_eq!(depth([one, at(7.0, 1.0)]), 0.0);
    }

    #[test]
    fn a_copy_of_other_triangles_is_as_deep() {
        near(depth([rod(3.0, [-1.0, 2.0], 48), rod(3.0, [-1.0, 2.0], 40)]), 1.5);
        let large = |rounds| {
            let mut ball = ball(rounds);
            ball.vertices.iter_mut().flatten().for_each(|x| *x *= 3.0);
            ball
        };
        near(depth([large(4), large(3)]), 3.0);
    }

    #[test]
    fn parts_that_fit_into_each_other_have_nothing_in_common() {
        assert_eq!(depth(block_on_plate()), 0.0);
        assert_eq!(depth(peg_in_hole(0.0)), 0.0);
        assert_eq!(depth(peg_in_hole(0.05)), 0.0, "what a press fit has in common is no body");
        assert_eq!(depth([tube(1.0, 3.0, [-1.0, 1.0], 48), rod(1.0, [-1.0, 1.0], 48)]), 0.0);
    }
}
