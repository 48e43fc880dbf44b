//! Free flight: how far a push goes before it meets anything.
//!
//! Where nothing bends a push, regions along its line would only show that nothing is there. So the edges and corners
//! that lead are cast ([`ShapeCast`]) to where they meet something, in stretches as long as the longest regions.
//! There, and wherever something bends the push, regions take over.

use nalgebra::Vector3;

use crate::contact::{CastMargins, ShapeCast};
use crate::geometry::{Bounds, Pose};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    BULGE_TOLERANCE, FLIGHT_STRETCH, FREE_STEP, LANDING, ROUNDED, SHORTEST_FLIGHT, TILT,
};

/// The free flight of a push.
#[derive(Clone, Copy)]
pub(super) struct FreeFlight<'a> {
    scene: &'a Scene,
    standing: &'a [usize],
    part: usize,
    termination: &'a Termination,
    /// How much further it flies, and whether it meets something there.
    left: f64,
    is_met: bool,
    state: FlightState,
    /// Whether it has flown.
    pub(super) any: bool,
}

/// How a push goes on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FlightState {
    /// Fly, if nothing is in the way.
    Ready,
    /// Fly on, or land.
    Aloft,
    /// Follow regions, until something bends the push.
    Grounded,
    /// Follow regions, until nothing bends the push any more.
    Bent,
    /// Follow regions to the end.
    Never,
}

impl<'a> FreeFlight<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        standing: &'a [usize],
        part: usize,
        termination: &'a Termination,
    ) -> Self {
        Self {
            scene,
            standing,
            part,
            termination,
            left: 0.0,
            is_met: false,
            state: FlightState::Ready,
            any: false,
        }
    }

    /// For a push that must not fly.
    pub(super) fn never(self) -> Self {
        Self { left: 0.0, is_met: false, state: FlightState::Never, any: false, ..self }
    }

    /// Notes whether a step by regions was bent. Where nothing bends a push any more, it may fly again.
    pub(super) fn stepped(&mut self, is_bent: bool) {
        self.state = match (self.state, is_bent) {
            (FlightState::Grounded, true) => FlightState::Bent,
            (FlightState::Bent, false) => FlightState::Ready,
            (state, _) => state,
        };
    }

    /// The next step of a flight from a pose, with the part's box there, along the unit vector `u`; `None` where
    /// regions take over.
    pub(super) fn step(
        &mut self,
        from: &Pose,
        bounds: &Bounds,
        u: &Vector3<f64>,
    ) -> Result<Option<f64>, Interrupt> {
        if matches!(self.state, FlightState::Grounded | FlightState::Bent | FlightState::Never) {
            return Ok(None);
        }
        if self.left == 0.0 {
            // A face that is met at a small angle may have been entered a little: another flight counts that as
            // allowed.
            let lands = std::mem::take(&mut self.is_met);
            (self.left, self.is_met) = if lands { (0.0, false) } else { self.length(from, bounds, u)? };
        }
        let step = self.left.min(FREE_STEP);
        self.left -= step;
        self.state = if step > 0.0 { FlightState::Aloft } else { FlightState::Grounded };
        self.any |= step > 0.0;
        Ok(Some(step).filter(|step| *step > 0.0))
    }

    /// Whether it flies.
    pub(super) fn is_aloft(&self) -> bool {
        self.state == FlightState::Aloft
    }

    /// How far it goes until it meets something, up to [`FLIGHT_STRETCH`], and whether it does; 0 if that is too
    /// short. It depends only on what the box meets on this stretch.
    fn length(&self, from: &Pose, bounds: &Bounds, u: &Vector3<f64>) -> Result<(f64, bool), Interrupt> {
        let Self { scene, standing, part, termination, .. } = *self;
        let end = u * (FLIGHT_STRETCH + LANDING);
        let swept = bounds.union(&Bounds { min: bounds.min + end, max: bounds.max + end });
        let (mut length, mut is_met) = (FLIGHT_STRETCH, false);
        for other in scene.broad_phase.meeting_of(standing, &swept) {
            let allowed = scene.allowed.of(part, other) + ROUNDED;
            // By the depth that it may have before.
            let back = allowed + BULGE_TOLERANCE;
            let margins = CastMargins { allowed, back, steepness: TILT, sunk: ROUNDED };
            let passed = bounds.grown(allowed).way_past(&scene.bodies[other].bounds, u);
            let travel = passed.min(length + LANDING);
            let (start, direction) = (from, u);
            let cast = ShapeCast { scene, part, start, direction, travel, other, margins, termination };
            let way = cast.way(SHORTEST_FLIGHT + LANDING)?;
            if way < travel {
                (length, is_met) = (way - LANDING, true);
            }
            if length < SHORTEST_FLIGHT {
                return Ok((0.0, false));
            }
        }
        Ok((length, is_met))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, cuboid, scene};

    fn length(scene: &Scene, u: Vector3<f64>) -> f64 {
        let standing: Vec<usize> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
        let body = &scene.bodies[1];
        let termination = Termination::default();
        let flight = FreeFlight::new(scene, &standing, 1, &termination);
        flight.length(&body.planning_from_shape, &body.bounds, &u).unwrap().0
    }

    #[test]
    fn a_flight_ends_before_what_is_met_and_none_begins_where_that_is_near() {
        let [plate, block] = block_on_plate();
        let walls = [cuboid([2.0, -4.0, 0.0], [2.5, 4.0, 2.0]), cuboid([-4.0, 1.1, 0.0], [4.0, 1.5, 2.0])];
        let [far, near] = walls;
        let (scene, _) = scene([plate, block, far, near]);
        let to_wall = length(&scene, Vector3::x());
        // The bound is that of a face that is met squarely.
        assert!((1.0 - LANDING..1.0 - LANDING + 2.0 * ROUNDED).contains(&to_wall), "{to_wall}");
        assert_eq!(length(&scene, Vector3::y()), 0.0);
        assert_eq!(length(&scene, -Vector3::z()), 0.0, "onto the plate");
        assert_eq!(length(&scene, Vector3::z()), FLIGHT_STRETCH);
        assert_eq!(length(&scene, -Vector3::x()), FLIGHT_STRETCH, "along the plate, and off it");
    }

    #[test]
    fn a_push_that_landed_flies_again_only_where_nothing_bends_it_any_more() {
        let [plate, block] = block_on_plate();
        let (scene, _) = scene([plate, block, cuboid([2.0, -4.0, 0.0], [2.5, 4.0, 2.0])]);
        let body = &scene.bodies[1];
        let termination = Termination::default();
        let mut flight = FreeFlight::new(&scene, &[0, 2], 1, &termination);
        let (mut pose, mut bounds, u) = (body.planning_from_shape, body.bounds, Vector3::x());
        let mut steps = Vec::new();
        while let Some(step) = flight.step(&pose, &bounds, &u).unwrap() {
            assert!(flight.is_aloft() && flight.any);
            pose.translation.vector += u * step;
            (bounds.min, bounds.max) = (bounds.min + u * step, bounds.max + u * step);
            steps.push(step);
        }
        assert_eq!(steps.len(), 2);
        assert!(steps[0] == FREE_STEP && steps[1] < FREE_STEP && !flight.is_aloft());
        assert_eq!(flight.step(&pose, &bounds, &Vector3::z()).unwrap(), None);
        for is_bent in [false, true, true] {
            flight.stepped(is_bent);
            assert_eq!(flight.step(&pose, &bounds, &Vector3::z()).unwrap(), None);
        }
        flight.stepped(false);
        assert_eq!(flight.step(&pose, &bounds, &Vector3::z()).unwrap(), Some(FREE_STEP));
        let mut never = flight.never();
        never.stepped(true);
        never.stepped(false);
        assert_eq!(never.step(&pose, &bounds, &Vector3::z()).unwrap(), None);
    }
}
