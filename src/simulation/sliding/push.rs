//! Translations: a shift that follows a force as far as contact allows, in steps as long as the regions around the
//! part's surface allow ([`shift`](crate::contact::region_cover::shift)), or in [free flight](super::free_flight).
//!
//! At each shift the force is projected onto the cone that the obstacles leave. Along an obstacle steps are short,
//! and each starts with the force unchanged: where the obstacle ends, the part follows the force again.

use nalgebra::{Vector3, Vector6};

use crate::budgets::{PUSH_BENDS, STALLS};
use crate::contact::constraint::VelocityConstraint;
use crate::contact::region_cover::Halt;
use crate::contact::region_cover::shift::ShiftCover;
use crate::contact::region_cover::surface_pair::Obstacle;
use crate::geometry::{Bounds, Pose};
use crate::scene::{PosedPart, Scene};
use crate::termination::Termination;
use crate::tolerances::{FREE_STEP, STALL, STUCK_SHARE};

use super::super::projection::project;
use super::drive::contact_step;
use super::free_flight::FreeFlight;

/// A part that is pushed.
pub(super) struct Push<'a> {
    scene: &'a Scene,
    start: Pose,
    standing: &'a [usize],
    /// The part's box at zero shift.
    bounds: Bounds,
    force: Vector3<f64>,
    /// The shift so far.
    shift: Vector3<f64>,
    cover: ShiftCover<'a>,
    /// The shift at which nearby parts were last searched.
    asked_at: Option<Vector3<f64>>,
    stalls: usize,
    contact_step: f64,
    /// Whether it is to get far: then long regions are asked for from the start.
    is_long: bool,
    flight: FreeFlight<'a>,
}

/// The result of a step.
pub(super) enum PushStep {
    Moved(Pose),
    Stuck { with: Vec<usize> },
}

impl<'a> Push<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        standing: &'a [usize],
        PosedPart { part, pose: start }: PosedPart<'_>,
        force: Vector3<f64>,
        termination: &'a Termination,
    ) -> Self {
        let shape = &scene.bodies[part].shape;
        Self {
            scene,
            start: *start,
            standing,
            bounds: shape.bounds().transformed(start),
            force,
            shift: Vector3::zeros(),
            cover: ShiftCover::new(scene, PosedPart::new(part, start), termination),
            asked_at: None,
            stalls: 0,
            contact_step: contact_step(shape),
            is_long: true,
            flight: FreeFlight::new(scene, standing, part, termination),
        }
    }

    /// The same for a short way.
    pub(super) fn short(self) -> Self {
        Self { is_long: false, flight: self.flight.never(), ..self }
    }

    /// Starts again without flights, if there was one.
    pub(super) fn begins_on_foot(&mut self) -> bool {
        let has_flown = self.flight.any;
        if has_flown {
            self.flight = self.flight.never();
            self.shift = Vector3::zeros();
            self.land();
        }
        has_flown
    }

    /// The shift so far.
    pub(super) fn travel(&self) -> f64 {
        self.shift.norm()
    }

    /// One step; `Halt::Lost` where regions cannot cover it.
    pub(super) fn step(&mut self) -> Result<PushStep, Halt> {
        if let Some(step) = self.flown()? {
            return Ok(step);
        }
        let mut obstacles = Vec::new();
        let mut u = self.force;
        self.look_around()?;
        for bends in 0.. {
            let known = obstacles.len();
            self.cover.make_way(&self.shift, &u, &mut obstacles)?;
            if obstacles.len() == known {
                break;
            }
            let Some((along, by)) = projected(&self.force, &obstacles).filter(|_| bends < PUSH_BENDS) else {
                return Err(Halt::Lost);
            };
            if along.norm_squared() < STUCK_SHARE {
                return Ok(PushStep::Stuck { with: by });
            }
            u = along.normalize();
        }
        self.flight.stepped(!obstacles.is_empty());
        if self.is_long && self.shift == Vector3::zeros() {
            self.cover.lengthen(&u)?;
        }
        let longest = if obstacles.is_empty() { FREE_STEP } else { self.contact_step };
        let seen = self.asked_at.map_or(0.0, |at| FREE_STEP - (self.shift - at).norm());
        let most = longest.min(seen);
        // A push that is only to show a short way must not pay for regions further on.
        let length = match self.is_long {
            true => self.cover.advance(&self.shift, &u, most)?,
            false => self.cover.length(&self.shift, &u).min(most),
        };
        self.stalls = if length < STALL { self.stalls + 1 } else { 0 };
        if self.stalls > STALLS {
            return Err(Halt::Lost);
        }
        self.shift += u * length;
        Ok(PushStep::Moved(self.pose()))
    }

    /// A step in flight, if the push flies.
    fn flown(&mut self) -> Result<Option<PushStep>, Halt> {
        let was_aloft = self.flight.is_aloft();
        let step = self.flight.step(&self.pose(), &self.here(), &self.force)?;
        if let Some(length) = step {
            self.shift += self.force * length;
            return Ok(Some(PushStep::Moved(self.pose())));
        }
        if was_aloft {
            self.land();
        }
        Ok(None)
    }

    /// Former regions lie elsewhere.
    fn land(&mut self) {
        self.cover = self.cover.anew();
        (self.asked_at, self.stalls) = (None, 0);
    }

    fn pose(&self) -> Pose {
        let mut pose = self.start;
        pose.translation.vector += self.shift;
        pose
    }

    /// The part's box at its shift.
    fn here(&self) -> Bounds {
        Bounds { min: self.bounds.min + self.shift, max: self.bounds.max + self.shift }
    }

    /// Adds parts that have come near.
    fn look_around(&mut self) -> Result<(), Halt> {
        if self.asked_at.is_some_and(|at| (self.shift - at).norm() < FREE_STEP * 0.9) {
            return Ok(());
        }
        self.asked_at = Some(self.shift);
        for other in self.scene.broad_phase.meeting_of(self.standing, &self.here().grown(FREE_STEP)) {
            if !self.cover.knows(other) {
                self.cover.add(other, &self.shift)?;
            }
        }
        Ok(())
    }
}

/// The direction nearest to a force that no obstacle stops, and the parts that bend it, ascending.
pub(super) fn projected(force: &Vector3<f64>, obstacles: &[Obstacle]) -> Option<(Vector3<f64>, Vec<usize>)> {
    let row = |o: &Obstacle| {
        let n = o.normal;
        VelocityConstraint { a: Vector6::new(n.x, n.y, n.z, 0.0, 0.0, 0.0), b: 0.0, other: o.other }
    };
    let rows: Vec<VelocityConstraint> = obstacles.iter().map(row).collect();
    let result = project(&Vector6::new(force.x, force.y, force.z, 0.0, 0.0, 0.0), &rows)?;
    Some((result.w.fixed_rows::<3>(0).into(), result.others(&rows)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Translation3, Unit};
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{LIMIT, block_on_plate, cuboid, l_shape, moved, peg_in_hole, scene};
    use crate::plan::Verifier;
    use crate::tolerances::BULGE_TOLERANCE;

    /// Pushes part 1 with all others standing: its shifts, and what stopped it within some steps.
    fn pushed(scene: &Scene, force: Vector3<f64>, steps: usize) -> (Vec<Vector3<f64>>, Option<Vec<usize>>) {
        let termination = Termination::default();
        let standing: Vec<usize> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
        let start = scene.bodies[1].planning_from_shape;
        let mut push = Push::new(scene, &standing, PosedPart::new(1, &start), force, &termination);
        let mut shifts = vec![Vector3::zeros()];
        for _ in 0..steps {
            match push.step() {
                Ok(PushStep::Stuck { with }) => return (shifts, Some(with)),
                Ok(PushStep::Moved(pose)) => {
                    shifts.push(pose.translation.vector - start.translation.vector);
                }
                // Where regions cannot tell, they claim nothing beyond the shifts so far.
                Err(halt) => {
                    assert_eq!(halt, Halt::Lost);
                    break;
                }
            }
        }
        (shifts, None)
    }

    fn depth(scene: &Scene, verifier: &Verifier, shifts: &[Vector3<f64>]) -> f64 {
        let start = scene.bodies[1].planning_from_shape;
        let path: Vec<Pose> = shifts.iter().map(|s| Translation3::from(*s) * start).collect();
        let standing: Vec<usize> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
        let t = Termination::default();
        let of = |path: &[Pose]| verifier.check(scene, &scene.allowed, &standing, 1, path, &t).unwrap().depth;
        // Piece by piece: about bends, what is bounded is more than what happens.
        path.windows(2).map(of).fold(of(&path[..1]), f64::max)
    }

    #[test]
    fn a_flush_peg_leaves_its_hole_in_free_steps() {
        for excess in [0.0, 5e-4] {
            let (scene, verifier) = scene(peg_in_hole(excess));
            let (shifts, stopped) = pushed(&scene, Vector3::z(), 8);
            assert_eq!(stopped, None);
            let far = shifts[shifts.len() - 1];
            assert!(far.z >= 6.0 * FREE_STEP && far.xy().norm() < 1e-9, "{far}");
            assert!(depth(&scene, &verifier, &shifts) < LIMIT);
        }
    }

    #[test]
    fn what_begins_again_on_foot_goes_the_same_way_by_regions_alone() {
        let [plate, block] = block_on_plate();
        let (scene, _) = scene([plate, block, cuboid([3.0, -4.0, 0.0], [3.5, 4.0, 3.0])]);
        let termination = Termination::default();
        let start = scene.bodies[1].planning_from_shape;
        let mut push = Push::new(&scene, &[0, 2], PosedPart::new(1, &start), Vector3::x(), &termination);
        let stopped = |push: &mut Push<'_>| {
            while let PushStep::Moved(_) = push.step().unwrap() {}
            push.travel()
        };
        assert!((stopped(&mut push) - 2.0).abs() < 1e-6);
        assert!(push.begins_on_foot());
        assert_eq!(push.travel(), 0.0);
        assert!((stopped(&mut push) - 2.0).abs() < 1e-6);
        assert!(!push.begins_on_foot(), "there was no flight this time");
    }

    #[test]
    fn what_stands_in_the_way_is_named() {
        let (scene, _) = scene(peg_in_hole(0.0));
        for force in [-Vector3::z(), Vector3::x(), -Vector3::y()] {
            assert_eq!(pushed(&scene, force, 3), (vec![Vector3::zeros()], Some(vec![0])));
        }
    }

    #[test]
    fn a_block_as_wide_as_its_plate_slides_off_it() {
        // All corners of the one lie on edges of the other, or beside its upright faces, which stop nothing.
        for width in [3.0, 3.0 - 1e-5, 3.0 + 1e-5] {
            let plate = cuboid([-3.0, -3.0, -1.0], [3.0, 3.0, 0.0]);
            let (scene, verifier) = scene([plate, cuboid([-width, -width, 0.0], [width, width, 1.0])]);
            for force in [Vector3::new(0.6, 0.0, -0.8), Vector3::new(-0.48, 0.36, -0.8)] {
                let (shifts, stopped) = pushed(&scene, force, 20);
                let last = shifts[shifts.len() - 1];
                assert!(stopped.is_none() && last.xy().norm() > 0.5, "{width}: {last}");
                assert!(depth(&scene, &verifier, &shifts) < 1e-6);
            }
        }
    }

    #[test]
    fn a_block_stops_flush_with_a_wall() {
        let [plate, block] = block_on_plate();
        let wall = cuboid([2.7, -4.0, 0.0], [3.0, 4.0, 3.0]);
        let (scene, verifier) = scene([plate, block, wall]);
        let (shifts, stopped) = pushed(&scene, Vector3::x(), 100);
        assert_eq!(stopped, Some(vec![2]));
        let last = shifts[shifts.len() - 1];
        assert!((last - Vector3::x() * 1.7).norm() < 1e-6, "{last}");
        assert!(depth(&scene, &verifier, &shifts) < 1e-6);
    }

    #[test]
    fn a_pressed_block_slides_and_follows_the_force_where_the_plate_ends() {
        // The block is 2 wide, the plate ends at x = 4: its last corner leaves it at a shift of 5.
        let (scene, verifier) = scene(block_on_plate());
        let force = Vector3::new(0.8, 0.0, -0.6);
        let (shifts, stopped) = pushed(&scene, force, 60);
        assert_eq!(stopped, None);
        let on_plate: Vec<_> = shifts.iter().filter(|s| s.x < 5.0 - 1e-6).collect();
        assert!(on_plate.len() > 10 && on_plate.iter().all(|s| s.z.abs() < 1e-6 && s.y.abs() < 1e-9));
        let last = shifts[shifts.len() - 1];
        assert!(last.z < -0.5, "{last}");
        assert!(depth(&scene, &verifier, &shifts) < 1e-6);
    }

    /// Two solids with a reentrant corner each, and a third that stands about.
    fn two_and_a_post(pose: &Pose) -> (Scene, Verifier) {
        scene([l_shape(), moved(l_shape(), pose), cuboid([2.0, -3.0, -3.0], [2.5, -2.0, 3.0])])
    }

    /// How deep it gets; what is not bounded by what the engine declares is sampled.
    fn depth_declared(scene: &Scene, verifier: &Verifier, shifts: &[Vector3<f64>]) -> f64 {
        depth(scene, &verifier.with_limit(BULGE_TOLERANCE), shifts)
    }

    #[test]
    fn what_was_seen_to_get_or_to_seem_deep_does_not() {
        // A flight that met a face at a small angle was followed by another, below it. Edges that slide along each
        // other and off at their corners are less deep than their bound.
        for (place, turn, force) in [
            (
                [-1.35992359627, -1.25888683151, -0.07799203542],
                [1.10567338203, 0.18007836931, 1.8044874663],
                [0.64420030344, 0.72731354932, -0.4098396775],
            ),
            (
                [-0.76090116854, -0.47229543056, 1.22474105485],
                [4.06679104209, 1.47181673536, 5.30179106492],
                [0.76101447589, 0.7108588169, -0.4035112045],
            ),
        ] {
            let pose = Pose::new(Vector3::from(place), Vector3::from(turn));
            let (scene, verifier) = two_and_a_post(&pose);
            let force = Unit::new_normalize(Vector3::from(force)).into_inner();
            let got = depth_declared(&scene, &verifier, &pushed(&scene, force, 40).0);
            assert!(got <= BULGE_TOLERANCE, "{got}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn nothing_is_entered_and_what_stops_is_in_the_way(
            place in prop::array::uniform3(-2.5..2.5f64),
            turn in prop::array::uniform3(0.0..TAU),
            force in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let force = Unit::try_new(Vector3::from(force), 0.1);
            prop_assume!(force.is_some());
            let force = force.unwrap().into_inner();
            let pose = Pose::new(Vector3::from(place), Vector3::from(turn));
            let (scene, verifier) = two_and_a_post(&pose);
            prop_assume!(depth(&scene, &verifier, &[Vector3::zeros()]) < 1e-9);
            prop_assume!(scene.allowed.of(0, 1) == 0.0 && scene.allowed.of(1, 2) == 0.0);
            let (shifts, stopped) = pushed(&scene, force, 40);
            // So in 40,000 cases.
            let got = depth_declared(&scene, &verifier, &shifts);
            prop_assert!(got <= BULGE_TOLERANCE, "{got}");
            if let Some(with) = stopped {
                prop_assert!(!with.is_empty());
                let last = shifts[shifts.len() - 1];
                prop_assert!(depth(&scene, &verifier, &[last, last + force * 0.02]) > 1e-3);
            }
        }
    }
}
