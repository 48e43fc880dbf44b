//! The end of endless turning.

use crate::contact::sampled::MovingBody;
use crate::tolerances::LEAST_TURNING_TRAVEL;

/// Detects endless turning: a whole turn that took the part no further from its start than it had been, and brought
/// no new contact. A thread gets further with every turn.
pub(super) struct Turning {
    angle: f64,
    start: nalgebra::Point3<f64>,
    farthest: f64,
    farthest_before: f64,
    new_contact: bool,
    /// Every part touched so far, ascending.
    pub(super) all_touched: Vec<usize>,
}

impl Turning {
    pub(super) fn new(mover: &MovingBody<'_>) -> Self {
        Self {
            angle: 0.0,
            start: mover.centre(),
            farthest: 0.0,
            farthest_before: 0.0,
            new_contact: false,
            all_touched: Vec::new(),
        }
    }

    pub(super) fn is_idle(&mut self, mover: &MovingBody<'_>, turned: f64, touching: &[usize]) -> bool {
        for &t in touching {
            if let Err(at) = self.all_touched.binary_search(&t) {
                self.all_touched.insert(at, t);
                self.new_contact = true;
            }
        }
        self.farthest = self.farthest.max((mover.centre() - self.start).norm());
        self.angle += turned;
        if self.angle < std::f64::consts::TAU {
            return false;
        }
        let idle = self.farthest - self.farthest_before < LEAST_TURNING_TRAVEL && !self.new_contact;
        self.angle = 0.0;
        self.farthest_before = self.farthest;
        self.new_contact = false;
        idle
    }
}
