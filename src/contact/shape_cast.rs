//! Shape casts: how far a part goes straight before it meets a standing one, by the edges and corners of both.
//!
//! A solid that moves along `d` comes to overlap another exactly if, on some line along `d`, a point of its surface
//! that faces `d` passes a point of the other's surface that faces against it. Walls along the direction face neither
//! way: sliding along them, however flush, is free.
//!
//! Such lines first meet at an edge or a corner: an edge of one face passes an edge of the other, or a corner of one
//! the other face. So the convex edges of one surface are swept against the faces of the other, and the other's
//! corners against the faces of the one: nothing passes between samples.
//!
//! What a pair may overlap (its allowed penetration, and the tolerance) is taken off the edges across the direction:
//! a press fit's rim passes the rim of its hole. An overlap at the start counts as allowed. Known refusals: contact
//! that slides down a slope, and overlaps that grow on the way. Known miss: edges whose faces differ by less than a
//! thousandth count as flat.

use std::cell::Cell;

use nalgebra::{Point3, Vector3};

use crate::budgets::SHORT_STEPS_PER_POLL;
use crate::geometry::{Bounds, ConvexEdges, Pose, Surface};
use crate::scene::Scene;
use crate::termination::{Interrupt, Poll, Termination};

/// What a shape cast allows.
#[derive(Debug, Clone, Copy)]
pub struct CastMargins {
    /// How deep the part may get into the other across the direction.
    pub allowed: f64,
    /// How far before its start the part may have met the other; it meets such things at once.
    pub back: f64,
    /// Sine of the angle below which a face along the direction counts as a wall.
    pub steepness: f64,
    /// How deep the part may get into a face before it has met it: facets of round walls are a little askew, and are
    /// past before they matter.
    pub sunk: f64,
}

/// A part that goes straight past a standing one.
#[derive(Debug)]
pub struct ShapeCast<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) part: usize,
    pub(crate) start: &'a Pose,
    pub(crate) direction: &'a Vector3<f64>,
    /// The standing part.
    pub other: usize,
    /// How far the part goes, until it is past the other or out.
    pub travel: f64,
    /// What is allowed.
    pub margins: CastMargins,
    pub(crate) termination: &'a Termination,
}

impl ShapeCast<'_> {
    /// Whether the part enters the other on its way. This depends only on the fields here, the two shapes, and the
    /// other's pose.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn enters(&self) -> Result<bool, Interrupt> {
        Ok(self.way(self.travel)? < self.travel)
    }

    /// How far the part goes until it meets the other, at most `travel`. A result below `least` may be an upper
    /// bound.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn way(&self, least: f64) -> Result<f64, Interrupt> {
        Ok(self.counted_way(least)?.0)
    }

    /// The same, and the number of edges and corners that were cast: a measure of the effort.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn counted_way(&self, least: f64) -> Result<(f64, usize), Interrupt> {
        let Self { scene, part, start, direction, other, travel, margins, termination } = *self;
        termination.check()?;
        let poll = &Poll::every(SHORT_STEPS_PER_POLL, Some(termination));
        let count = &Cell::new(0);
        let [mine, theirs] = [part, other].map(|i| &scene.bodies[i].shape);
        let standing = &scene.bodies[other].planning_from_shape;
        let standing_from_moving = standing.inverse() * start;
        let along = [standing.rotation.inverse() * direction, start.rotation.inverse() * -direction];
        let [forward, backward] = [
            (mine, theirs, standing_from_moving, along[0]),
            (theirs, mine, standing_from_moving.inverse(), along[1]),
        ]
        .map(|(edges, target, to_target, along)| {
            let (edges, target) = (edges.convex_edges(), &target.surface);
            let least = least.min(travel);
            Cast { edges, target, to_target, along, travel, margins, least, poll, count }
        });
        // Edges cost more than corners.
        let way = if forward.edges.count() <= backward.edges.count() {
            backward.corners(forward.edges(travel)?)?
        } else {
            forward.corners(backward.edges(travel)?)?
        };
        Ok((way, count.get()))
    }
}

/// The leading edges and corners of one surface, against another surface.
struct Cast<'a> {
    edges: &'a ConvexEdges,
    target: &'a Surface,
    to_target: Pose,
    /// The direction of the edges against the target, in its frame.
    along: Vector3<f64>,
    travel: f64,
    margins: CastMargins,
    /// Below this length the result need not be exact.
    least: f64,
    poll: &'a Poll<'a>,
    /// The number of edges and corners that were cast.
    count: &'a Cell<usize>,
}

impl Cast<'_> {
    /// How far of `travel` the edges go until they meet a face.
    fn edges(&self, travel: f64) -> Result<f64, Interrupt> {
        let (along, corridor) = (self.along_here(), self.corridor());
        let leading = self
            .edges
            .leading(&self.to_target, &corridor, &along, self.margins.steepness)
            .filter_map(|edge| {
                let ends = self.edges.ends_of(edge);
                let is_met = self.leads(&edge.normals, &along)
                    && Bounds::of(&ends.map(|(p, _)| self.to_target * p)).meets(&corridor);
                is_met.then(|| ends.map(|(p, normals)| self.from(p, normals, &along)))
            });
        self.way(travel, leading, |ends, reach| {
            self.target.met_by_edge(ends, &self.along, reach, [self.margins.steepness, self.margins.sunk])
        })
    }

    /// How far of `travel` the corners go.
    fn corners(&self, travel: f64) -> Result<f64, Interrupt> {
        let (along, corridor) = (self.along_here(), self.corridor());
        let ends = self.edges.ends().leading(&self.to_target, &corridor, &along, self.margins.steepness);
        let leading = ends.filter_map(|(p, normals)| {
            let is_met = self.leads(normals, &along) && corridor.contains(&(self.to_target * p));
            is_met.then(|| self.from(p, normals, &along))
        });
        self.way(travel, leading, |p, reach| {
            self.target.met_by_point(p, &self.along, reach, [self.margins.steepness, self.margins.sunk])
        })
    }

    fn way<T>(
        &self,
        travel: f64,
        leading: impl Iterator<Item = T>,
        met: impl Fn(&T, f64) -> Option<f64>,
    ) -> Result<f64, Interrupt> {
        let mut way = travel;
        for item in leading {
            self.poll.check()?;
            if way < self.least {
                break;
            }
            self.count.set(self.count.get() + 1);
            // If nothing is met, the result is `travel` to the bit.
            way = met(&item, way + self.margins.back).map_or(way, |at| way.min(at - self.margins.back));
        }
        Ok(way)
    }

    fn leads(&self, normals: &[Vector3<f64>], along: &Vector3<f64>) -> bool {
        normals.iter().any(|n| n.dot(along) > self.margins.steepness)
    }

    /// In the edges' frame.
    fn along_here(&self) -> Vector3<f64> {
        self.to_target.rotation.inverse() * self.along
    }

    /// Where a corner starts in the target's frame: moved back, and below the faces there.
    fn from(&self, p: &Point3<f64>, normals: &[Vector3<f64>], along: &Vector3<f64>) -> Point3<f64> {
        self.to_target * (p + inward(normals, along, self.margins.allowed)) - self.along * self.margins.back
    }

    /// The box of the target, extended against the direction.
    fn corridor(&self) -> Bounds {
        let bounds = *self.target.bounds();
        let back = self.along * -(self.travel + self.margins.back);
        let before = Bounds { min: bounds.min + back, max: bounds.max + back };
        bounds.union(&before).grown(2.0 * self.margins.allowed)
    }
}

/// The offset across `along` that moves a point below all faces that meet there by `depth`; `None` if they leave no
/// room.
fn inward(normals: &[Vector3<f64>], along: &Vector3<f64>, depth: f64) -> Vector3<f64> {
    let across = |n: &Vector3<f64>| (n - along * n.dot(along)).try_normalize(0.1);
    let mut offset = Vector3::zeros();
    for side in normals.iter().filter_map(across) {
        offset -= side * (side.dot(&offset) + depth).max(0.0);
    }
    let below = |side: Vector3<f64>| side.dot(&offset) <= -0.5 * depth;
    if normals.iter().filter_map(across).all(below) { offset } else { Vector3::zeros() }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_4, TAU};

    use super::*;
    use crate::fixtures::{block_on_plate, cuboid, moved, scene};
    use crate::tolerances::DEPTH_TOLERANCE;

    /// How far part 1 gets along a direction, of `travel`, until it meets part 0.
    fn way(scene: &Scene, direction: Vector3<f64>, travel: f64) -> f64 {
        let start = &scene.bodies[1].planning_from_shape;
        let allowed = scene.allowed.of(0, 1) + DEPTH_TOLERANCE;
        let margins = CastMargins { allowed, back: allowed, steepness: 1e-3, sunk: 0.2 * DEPTH_TOLERANCE };
        let direction = &direction;
        let termination = &Termination::default();
        let (part, other) = (1, 0);
        let cast = ShapeCast { scene, part, start, direction, travel, other, margins, termination };
        assert_eq!(cast.enters().unwrap(), cast.way(travel).unwrap() < travel);
        cast.way(0.0).unwrap()
    }

    #[test]
    fn bars_across_each_other_meet_at_their_edges() {
        // Turned about themselves, each ends in an edge towards the other; no corner passes over the other bar.
        let bar = cuboid([-4.0, -0.2, -0.2], [4.0, 0.2, 0.2]);
        let on_edge = Pose::rotation(Vector3::x() * FRAC_PI_4);
        for turn in [0.3, TAU / 4.0, 2.0] {
            let above = Pose::new(Vector3::z() * 2.0, Vector3::z() * turn) * on_edge;
            let (scene, _) = scene([moved(bar.clone(), &on_edge), moved(bar.clone(), &above)]);
            let gap = 2.0 - 2.0 * 0.2 * 2f64.sqrt();
            let met = way(&scene, -Vector3::z(), 3.0);
            assert!((gap - 1e-9..gap + 2.0 * DEPTH_TOLERANCE).contains(&met), "{met} of {gap}");
            assert_eq!(way(&scene, -Vector3::z(), gap - 0.01), gap - 0.01);
            assert_eq!(way(&scene, Vector3::z(), 3.0), 3.0);
        }
    }

    #[test]
    fn a_block_meets_what_is_wider_and_what_is_narrower_than_it() {
        for wall in [cuboid([2.0, -4.0, -4.0], [3.0, 4.0, 4.0]), cuboid([2.0, -0.1, 0.9], [3.0, 0.1, 1.1])] {
            let [plate, block] = block_on_plate();
            let (scene, _) = scene([wall, block, plate]);
            let met = way(&scene, Vector3::x(), 4.0);
            assert!((1.0 - 1e-9..1.0 + DEPTH_TOLERANCE).contains(&met), "{met}");
            assert_eq!(way(&scene, Vector3::y(), 4.0), 4.0);
        }
    }
}
