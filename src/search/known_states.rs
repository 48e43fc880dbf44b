//! The states of one part, and whether a pose is one of them (the paper's rmd).
//!
//! A hash grid over the positions of the centre of mass. A cell is as wide as the resolution, so poses of the
//! same state lie in the same cell or in one of the 26 around it. When the resolution changes, which happens
//! ten times at most, the grid is built again.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::geometry::Pose;
use crate::scene::Scene;
use crate::tolerances::{SAME_STATE_ROTATION, SAME_STATE_TRAVEL};

use super::state::{coarseness, least_travel};

/// At which resolution states are distinguished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Resolution {
    /// The paper's: δ_t and δ_r for all parts, however many states there are.
    Fixed,
    /// A smaller δ_t for small parts; coarser, the more states a part has.
    Adaptive,
}

/// States of one part, by numbers that the caller gives.
#[derive(Debug)]
pub(super) struct KnownStates {
    centre: Point3<f64>,
    resolution: Resolution,
    least_travel: f64,
    /// Width of a cell, as a multiple of the least travel.
    coarseness: f64,
    states: Vec<(usize, Pose)>,
    /// Indices into `states`.
    cells: HashMap<[i64; 3], Vec<usize>>,
}

impl KnownStates {
    pub(super) fn new(scene: &Scene, part: usize, resolution: Resolution) -> Self {
        Self {
            centre: scene.bodies[part].shape.mass.centre,
            resolution,
            least_travel: match resolution {
                Resolution::Fixed => SAME_STATE_TRAVEL,
                Resolution::Adaptive => least_travel(scene, part),
            },
            coarseness: 1.0,
            states: Vec::new(),
            cells: HashMap::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.states.len()
    }

    pub(super) fn add(&mut self, number: usize, pose: Pose) {
        self.cells.entry(self.cell(&pose)).or_default().push(self.states.len());
        self.states.push((number, pose));
        let coarse = match self.resolution {
            Resolution::Fixed => 1.0,
            Resolution::Adaptive => coarseness(self.len()),
        };
        if coarse != self.coarseness {
            self.coarseness = coarse;
            self.cells.clear();
            for (i, (_, pose)) in self.states.iter().enumerate() {
                self.cells.entry(self.cell(pose)).or_default().push(i);
            }
        }
    }

    /// Whether a pose is one of the states whose number `counts`, at the present resolution.
    pub(super) fn has_like(&self, pose: &Pose, counts: impl Fn(usize) -> bool) -> bool {
        let [x, y, z] = self.cell(pose);
        let around = |c: i64| c.saturating_sub(1)..=c.saturating_add(1);
        let cells = around(x).flat_map(|x| around(y).flat_map(move |y| around(z).map(move |z| [x, y, z])));
        let listed = cells.filter_map(|cell| self.cells.get(&cell)).flatten();
        let mut states = listed.map(|&i| &self.states[i]);
        states.any(|(number, known)| self.alike(known, pose, self.coarseness) && counts(*number))
    }

    /// The distance of a pose to the nearest state, in units of the resolution: infinite if there is none.
    pub(super) fn novelty(&self, pose: &Pose) -> f64 {
        let distance = |known: &Pose| {
            let travel = (known * self.centre - pose * self.centre).norm() / self.least_travel;
            travel + known.rotation.angle_to(&pose.rotation) / SAME_STATE_ROTATION
        };
        self.states.iter().map(|(_, known)| distance(known)).fold(f64::INFINITY, f64::min)
    }

    /// The states whose number `counts`.
    pub(super) fn poses(&self, counts: impl Fn(usize) -> bool) -> impl Iterator<Item = Pose> {
        self.states.iter().filter(move |(number, _)| counts(*number)).map(|(_, pose)| *pose)
    }

    /// Whether two poses are the same state at a multiple of the resolution.
    pub(super) fn alike(&self, a: &Pose, b: &Pose, coarseness: f64) -> bool {
        (a * self.centre - b * self.centre).norm() < self.least_travel * coarseness
            && a.rotation.angle_to(&b.rotation) < SAME_STATE_ROTATION * coarseness
    }

    fn width(&self) -> f64 {
        self.least_travel * self.coarseness
    }

    fn cell(&self, pose: &Pose) -> [i64; 3] {
        (pose * self.centre).coords.map(|x| (x / self.width()).floor() as i64).into()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{block_on_plate, scene};

    /// The answer is that of going through all states one by one.
    #[test]
    fn the_grid_answers_as_a_scan_does() {
        let (scene, _) = scene(block_on_plate());
        let centre = scene.bodies[0].shape.mass.centre;
        let pose = |p: &[f64; 6]| {
            Isometry3::new(Vector3::new(p[0], p[1], p[2]), Vector3::new(p[3], p[4], p[5]) * 3.0)
        };
        let poses = |most| prop::collection::vec(prop::array::uniform6(-0.4..0.4f64), 1..most);
        proptest!(|(states in poses(40), asked in poses(20), left_out in 0..3usize)| {
            let mut known = KnownStates::new(&scene, 0, Resolution::Adaptive);
            for (number, p) in states.iter().enumerate() {
                known.add(number, pose(p));
            }
            let coarse = coarseness(states.len());
            for p in asked.iter().map(pose) {
                let like = |q: &Pose| {
                    (q * centre - p * centre).norm() < least_travel(&scene, 0) * coarse
                        && q.rotation.angle_to(&p.rotation) < SAME_STATE_ROTATION * coarse
                };
                let scanned = states.iter().enumerate().any(|(i, q)| i % 3 != left_out && like(&pose(q)));
                prop_assert_eq!(known.has_like(&p, |i| i % 3 != left_out), scanned);
            }
        });
    }
}
