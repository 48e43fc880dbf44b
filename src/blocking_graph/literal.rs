//! The paper's static analysis of a pair, taken literally.
//!
//! Source: the paper, section "DBGs Static Analysis". It needs no simulation, but trusts the sign of
//! a distance alone: a tilted peg or a press fit is blocked in all directions by it. Offered to
//! reproduce the paper and to be compared with; see [`super::audit`].

use nalgebra::Vector3;

use crate::geometry::{Bounds, Pose};
use crate::scene::{Body, Scene};
use crate::simulation::Action;
use crate::termination::{Interrupt, Termination};

/// How often a contacting point is extended.
const EXTENSIONS: usize = 5;
/// Length of one extension: at most this, in the planning frame …
const LONGEST: f64 = 0.05;
/// … and this share of the mobile part's length along the direction.
const SHARE: f64 = 1.0 / 20.0;

/// For each translation, whether the paper's rule adds an edge from `part` at `pose` to `other`:
/// either is mobile in turn, since a hit of one adds the other's reverse edge.
///
/// # Errors
/// The termination condition became true.
pub(super) fn pair_blocks(
    scene: &Scene,
    part: usize,
    pose: &Pose,
    other: usize,
    translations: &[Action],
    termination: &Termination,
) -> Result<Vec<bool>, Interrupt> {
    let mine = PosedBody::new(&scene.bodies[part], pose);
    let theirs = PosedBody::new(&scene.bodies[other], &scene.bodies[other].planning_from_shape);
    if !mine.bounds.meets(&theirs.bounds) {
        return Ok(vec![false; translations.len()]);
    }
    let blocked = |action: &Action| {
        termination.check()?;
        let direction = action.force();
        Ok(mine.hits(&theirs, &direction) || theirs.hits(&mine, &-direction))
    };
    translations.iter().map(blocked).collect()
}

/// A body at a pose.
struct PosedBody<'a> {
    body: &'a Body,
    pose: Pose,
    bounds: Bounds,
}

impl<'a> PosedBody<'a> {
    fn new(body: &'a Body, pose: &Pose) -> Self {
        Self { body, pose: *pose, bounds: body.shape.bounds().transformed(pose) }
    }

    /// Whether a (potential) contacting point, extended along a direction, comes to lie inside.
    fn hits(&self, still: &Self, direction: &Vector3<f64>) -> bool {
        let extent = |b: &Bounds| b.extents().dot(&direction.abs());
        let step = direction * LONGEST.min(extent(&self.bounds) * SHARE);
        // The potential collision area: where the mobile part lies behind the other one.
        let rear = -still.bounds.support(&-direction);
        let area = (extent(&self.bounds) > extent(&still.bounds)).then_some(rear);
        let to_still = still.pose.inverse();
        self.body.shape.surface.vertices().iter().any(|v| {
            let p = self.pose * v;
            let behind = area.is_some_and(|rear| p.coords.dot(direction) < rear);
            (behind || still.bounds.contains(&p))
                && (1..=EXTENSIONS).any(|k| still.body.field.value(&(to_still * (p + step * k as f64))) < 0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, cells, moved, peg_in_hole, scene};

    fn blocked(scene: &Scene, part: usize, other: usize) -> Vec<usize> {
        let pose = scene.bodies[part].planning_from_shape;
        let blocks = pair_blocks(scene, part, &pose, other, &Action::translations(), &Termination::default());
        let blocks = blocks.unwrap();
        (0..6).filter(|&a| blocks[a]).collect()
    }

    #[test]
    fn a_tight_peg_is_blocked_sideways_and_towards_the_bottom() {
        let (scene, _) = scene(peg_in_hole(0.0));
        let found = blocked(&scene, 1, 0);
        assert!([0, 1, 2, 3, 5].iter().all(|a| found.contains(a)), "{found:?}");
    }

    #[test]
    fn a_tilted_peg_is_blocked_everywhere_as_the_public_planner_has_it() {
        let tilt = Pose::rotation(Vector3::new(0.1, 0.5, 0.0));
        let (scene, _) = scene(peg_in_hole(0.0).map(|m| moved(m, &tilt)));
        assert_eq!(blocked(&scene, 1, 0), [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn edges_are_symmetric() {
        let (scene, _) = scene(block_on_plate());
        let (forward, mut reverse) = (blocked(&scene, 1, 0), blocked(&scene, 0, 1));
        reverse.iter_mut().for_each(|a| *a ^= 1);
        reverse.sort_unstable();
        assert!(forward.contains(&5) && forward == reverse, "{forward:?}, {reverse:?}");
    }

    #[test]
    fn a_head_behind_its_washer_is_in_the_potential_collision_area() {
        // A bolt through a washer: of its vertices, only those of the shaft's ends are not behind,
        // and none lies where the boxes overlap.
        let washer = cells([&[-1.0, -0.4, 0.4, 1.0], &[-1.0, -0.4, 0.4, 1.0], &[0.0, 0.2]], |c| {
            c[0] != 1 || c[1] != 1
        });
        let bolt = cells([&[-0.7, -0.3, 0.3, 0.7], &[-0.7, -0.3, 0.3, 0.7], &[-2.0, -0.02, 5.0]], |c| {
            c[2] == 0 || c[0] == 1 && c[1] == 1
        });
        let (scene, _) = scene([washer, bolt]);
        let found = blocked(&scene, 1, 0);
        assert!(found.contains(&4) && !found.contains(&5), "{found:?}");
    }
}
