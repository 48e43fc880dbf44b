//! The twists that the contacts of a part hardly resist: the joint that it makes with its surroundings.
//!
//! Where two surfaces lie close at a point p, with normal n, the twist (v, ω) about a centre c separates or presses
//! them at the speed n·(v + ω × (p − c)). These rows, with lengths as shares of the points' own spread, make up the
//! contact matrix, for both senses. Right singular vectors with small singular values are motions along which the
//! surfaces slip on each other (N. Gelfand and L. Guibas 2004, Shape segmentation using local slippage analysis; SVD
//! by faer): a thread shows its own helix there, whatever its pose and the rest of the part.

use faer::Mat;
use nalgebra::{Matrix3x2, Matrix6, Point3, Unit, Vector3, Vector6};

use crate::budgets::{FEWEST_NULL_CONTACTS, NULL_TWIST_POINTS, SHORT_STEPS_PER_POLL};
use crate::geometry::{Feature, Pose};
use crate::scene::{Body, Scene};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::{NEAR_NULL, NULL_TURN};

use super::Touching;

/// An axis about which contact lets a part turn, and along which, maybe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NullTwist {
    /// Its direction, in the planning frame.
    pub axis: Unit<Vector3<f64>>,
    /// A point on it, in the planning frame.
    pub through: Point3<f64>,
    /// About how far the part moves along the axis per radian. Facets that lean against their flanks make it wrong by
    /// up to a third, its sign right. `None` if the part may turn and shift independently.
    pub rise: Option<f64>,
}

/// A contact: a point and the normal of the surface near it.
type TwistContact = (Point3<f64>, Vector3<f64>);

impl NullTwist {
    /// The null twist of a part at a pose among standing parts (ascending), if contact leaves it one axis to turn
    /// about, and the parts near it. Surfaces within `reach` (planning frame) are in contact.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn of(
        scene: &Scene,
        part: usize,
        pose: &Pose,
        standing: &[usize],
        reach: f64,
        termination: &Termination,
    ) -> Result<(Option<Self>, Vec<usize>), Interrupt> {
        let poll = Poll::every(SHORT_STEPS_PER_POLL, Some(termination));
        let body = &scene.bodies[part];
        let parts = Touching::near(scene, part, pose, standing, reach);
        let mut contacts = Vec::new();
        for &other in &parts {
            let still = &scene.bodies[other];
            let place = &still.planning_from_shape;
            let within = reach + scene.allowed.of(part, other);
            contacts_of((body, pose), (still, place), within, &poll, &mut contacts)?;
            contacts_of((still, place), (body, pose), within, &poll, &mut contacts)?;
        }
        Ok((Self::left_by(&contacts), parts))
    }

    /// The axis that contacts leave.
    fn left_by(contacts: &[TwistContact]) -> Option<Self> {
        if contacts.len() < FEWEST_NULL_CONTACTS {
            return None;
        }
        let count = contacts.len() as f64;
        let centre = contacts.iter().map(|(p, _)| p.coords).sum::<Vector3<f64>>() / count;
        let spread =
            (contacts.iter().map(|(p, _)| (p.coords - centre).norm_squared()).sum::<f64>() / count).sqrt();
        // The Gram matrix of the contact matrix: its singular values are the squares.
        let mut gram = Matrix6::zeros();
        for (p, n) in contacts {
            let lever = (p.coords - centre).cross(n) / spread;
            let row = Vector6::new(n.x, n.y, n.z, lever.x, lever.y, lever.z);
            gram += row * row.transpose();
        }
        let svd = Mat::from_fn(6, 6, |i, j| gram[(i, j)]).thin_svd().ok()?;
        let values = svd.S().column_vector();
        let near_null = (0..6).filter(|&i| values[i] < values[0] * NEAR_NULL * NEAR_NULL).count();
        let vector = |i: usize, from: usize| Vector3::from_fn(|k, _| svd.V()[(from + k, i)]);
        // Turning is in units of the spread.
        let through = |i: usize| {
            let (shift, turn) = (vector(i, 0), vector(i, 3));
            Point3::from(centre + turn.cross(&shift) * (spread / turn.norm_squared()))
        };
        match near_null {
            1 => {
                let (shift, turn) = (vector(5, 0), vector(5, 3));
                let axis = Unit::try_new(turn, NULL_TURN)?;
                let rise = Some(axis.dot(&shift) * spread / turn.norm());
                Some(Self { axis, through: through(5), rise })
            }
            2 => {
                let turns = Matrix3x2::from_columns(&[vector(4, 3), vector(5, 3)]);
                // The directions about which both turn, the largest share first.
                let svd = turns.svd(true, false);
                let (axis, [most, next]) = (svd.u?.column(0).into_owned(), svd.singular_values.into());
                let axis = Unit::new_normalize(axis);
                let turns_most = if vector(4, 3).norm() > vector(5, 3).norm() { 4 } else { 5 };
                let through = through(turns_most);
                (most > NULL_TURN && next < NULL_TURN * most).then_some(Self { axis, through, rise: None })
            }
            _ => None,
        }
    }
}

/// Adds the contacts at the samples of one body with another, each at its place, in the planning frame.
fn contacts_of(
    (asked, at): (&Body, &Pose),
    (measured, stands): (&Body, &Pose),
    within: f64,
    poll: &Poll<'_>,
    contacts: &mut Vec<TwistContact>,
) -> Result<(), Interrupt> {
    let to_measured = stands.inverse() * at;
    let near = measured.shape.bounds().grown(within);
    let points: Vec<Point3<f64>> =
        asked.shape.samples().points().iter().map(|p| to_measured * p).filter(|p| near.contains(p)).collect();
    let surface = &measured.shape.surface;
    for p in points.iter().step_by(points.len().div_ceil(NULL_TWIST_POINTS).max(1)) {
        poll.check()?;
        // At an edge there is a choice of normals.
        if let Some(closest) = surface.closest(p, within).filter(|c| c.feature == Feature::Face) {
            contacts.push((stands * closest.point, stands.rotation * surface.face_normal(closest.triangle)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, rod, scene, thread, tube};
    use crate::geometry::SourceMesh;

    const TURN: Vector3<f64> = Vector3::new(0.4, -0.7, 0.3);

    /// What contact leaves part 1, when both are turned.
    fn left(meshes: [SourceMesh; 2]) -> Option<NullTwist> {
        let (scene, _) = scene(meshes.map(|mesh| moved(mesh, &Pose::rotation(TURN))));
        let pose = scene.bodies[1].planning_from_shape;
        let found = NullTwist::of(&scene, 1, &pose, &[0], 0.05, &Termination::default()).unwrap();
        assert_eq!(found.1, [0]);
        found.0
    }

    fn along_z(twist: &NullTwist) -> f64 {
        twist.axis.dot(&(Pose::rotation(TURN) * Vector3::z())).abs()
    }

    #[test]
    fn a_thread_leaves_its_own_helix() {
        for pitch in [0.5, 0.8] {
            let twist = left(thread(3.0, pitch)).unwrap();
            assert!(along_z(&twist) > 0.9999, "{twist:?}");
            let found = twist.rise.unwrap() * std::f64::consts::TAU;
            // Facets on a grid all lean the same way against the flank, and show a false rise.
            assert!((found / pitch - 1.0).abs() < 0.3, "{found} of {pitch}");
        }
    }

    #[test]
    fn the_sense_of_a_fine_thread_is_told_of_either_hand() {
        let mirrored = |mut mesh: SourceMesh| {
            mesh.vertices.iter_mut().for_each(|v| v[0] = -v[0]);
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            mesh
        };
        for pitch in [0.3, 0.4, 0.5] {
            assert!(left(thread(2.0, pitch)).unwrap().rise.unwrap() > 0.0, "{pitch}");
            assert!(
                left(thread(2.0, pitch).map(mirrored)).unwrap().rise.unwrap() < 0.0,
                "{pitch}, left-handed"
            );
        }
    }

    #[test]
    fn a_pin_in_a_round_hole_turns_and_shifts_as_it_likes() {
        let twist = left([tube(1.0, 2.0, [-1.0, 1.0], 48), rod(0.98, [-3.0, 3.0], 48)]).unwrap();
        assert!(along_z(&twist) > 0.9999 && twist.rise.is_none(), "{twist:?}");
    }

    #[test]
    fn what_cannot_turn_or_shifts_two_ways_has_no_twist() {
        assert_eq!(left(peg_in_hole(-0.01)), None, "a square peg on the ground of its hole");
        assert_eq!(left(block_on_plate()), None, "turns about one axis, and shifts along two");
    }
}
