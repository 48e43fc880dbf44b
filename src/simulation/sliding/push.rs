//! Translations: a shift that follows a force as far as contact lets it, in steps as long as the
//! regions around the part's surface allow ([`cells`](super::cells)).
//!
//! At each shift the force is projected onto the cone that the obstacles leave. Along an obstacle
//! steps are short, and each begins with the force as it is: where the obstacle ends, the part
//! follows it again.

use nalgebra::{Vector3, Vector6};

use crate::geometry::{Bounds, Pose};
use crate::termination::Termination;

use super::super::Scene;
use super::super::projection::{Row, project};
use super::cells::{Cells, Halt};
use super::drive::{FREE_STEP, LEAST_SHARE, contact_step, others};
use super::facing::Obstacle;

/// So many times the direction is bent at one place.
const MOST_BENDS: usize = 64;
/// So many steps in succession may be vanishingly short.
const MOST_STALLS: usize = 16;
const STALL: f64 = 1e-7;

/// A part that is pushed.
pub(super) struct Push<'a> {
    scene: &'a Scene,
    part: usize,
    start: Pose,
    standing: &'a [usize],
    /// The part's box without a shift.
    bounds: Bounds,
    force: Vector3<f64>,
    /// How far it got.
    shift: Vector3<f64>,
    cells: Cells<'a>,
    /// Where the surroundings were asked last.
    asked_at: Option<Vector3<f64>>,
    stalls: usize,
    contact_step: f64,
}

/// What a step came to.
pub(super) enum Step {
    Moved(Pose),
    Stuck { with: Vec<usize> },
}

impl<'a> Push<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        standing: &'a [usize],
        (part, start): (usize, &Pose),
        force: Vector3<f64>,
        termination: &'a Termination,
    ) -> Self {
        Self::with(Cells::new(termination), scene, standing, (part, start), force)
    }

    /// The same with some pairs that are known already.
    pub(super) fn with(
        cells: Cells<'a>,
        scene: &'a Scene,
        standing: &'a [usize],
        (part, start): (usize, &Pose),
        force: Vector3<f64>,
    ) -> Self {
        let shape = &scene.bodies[part].shape;
        Self {
            scene,
            part,
            start: *start,
            standing,
            bounds: shape.bounds().transformed(start),
            force,
            shift: Vector3::zeros(),
            cells,
            asked_at: None,
            stalls: 0,
            contact_step: contact_step(shape),
        }
    }

    /// How far it got.
    pub(super) fn travel(&self) -> f64 {
        self.shift.norm()
    }

    /// One step; `Halt::Lost` where regions cannot tell.
    pub(super) fn step(&mut self) -> Result<Step, Halt> {
        let mut obstacles = Vec::new();
        let mut u = self.force;
        self.look_around()?;
        for bends in 0.. {
            let known = obstacles.len();
            self.cells.make_way(&self.shift, &u, &mut obstacles)?;
            if obstacles.len() == known {
                break;
            }
            let Some((along, by)) = projected(&self.force, &obstacles).filter(|_| bends < MOST_BENDS) else {
                return Err(Halt::Lost);
            };
            if along.norm_squared() < LEAST_SHARE {
                return Ok(Step::Stuck { with: by });
            }
            u = along.normalize();
        }
        let longest = if obstacles.is_empty() { FREE_STEP } else { self.contact_step };
        let seen = self.asked_at.map_or(0.0, |at| FREE_STEP - (self.shift - at).norm());
        let length = self.cells.length(&self.shift, &u).min(longest).min(seen);
        self.stalls = if length < STALL { self.stalls + 1 } else { 0 };
        if self.stalls > MOST_STALLS {
            return Err(Halt::Lost);
        }
        self.shift += u * length;
        let mut pose = self.start;
        pose.translation.vector += self.shift;
        Ok(Step::Moved(pose))
    }

    /// Takes in parts that come near.
    fn look_around(&mut self) -> Result<(), Halt> {
        if self.asked_at.is_some_and(|at| (self.shift - at).norm() < FREE_STEP * 0.9) {
            return Ok(());
        }
        self.asked_at = Some(self.shift);
        let here = Bounds { min: self.bounds.min + self.shift, max: self.bounds.max + self.shift };
        for other in self.scene.broad_phase.meeting_of(self.standing, &here.grown(FREE_STEP)) {
            if !self.cells.knows(other) {
                let who = (self.part, &self.start);
                self.cells.add(self.scene, who, other, &self.shift)?;
            }
        }
        Ok(())
    }
}

/// The direction nearest to a force that no obstacle stops, and the parts that bend it, ascending.
fn projected(force: &Vector3<f64>, obstacles: &[Obstacle]) -> Option<(Vector3<f64>, Vec<usize>)> {
    let row = |o: &Obstacle| {
        let n = o.normal;
        Row { a: Vector6::new(n.x, n.y, n.z, 0.0, 0.0, 0.0), b: 0.0, other: o.other }
    };
    let rows: Vec<Row> = obstacles.iter().map(row).collect();
    let result = project(&Vector6::new(force.x, force.y, force.z, 0.0, 0.0, 0.0), &rows)?;
    Some((result.w.fixed_rows::<3>(0).into(), others(&result.active, &rows)))
}
