//! One implicit step of a rigid body: BDF1, solved as a minimum by Newton's method.
//!
//! With z = (Δx, θ), displacement of the centre of mass and rotation vector over one step of
//! length h, the backward Euler equations are the stationary points of
//! `m/(2h²)|Δx − x̂|² + 1/(2h²)(θ − θ̂)ᵀ I (θ − θ̂) + contact energy`, x̂ and θ̂ being where velocity
//! and action alone would lead; I is the inertia tensor at the start of the step, and the
//! gyroscopic moment is taken from there too. A minimum is looked for, not any stationary point:
//! each Newton step goes down, so a field whose slope jumps between cells cannot make it diverge,
//! and a minimum where it jumps is found as well.

use nalgebra::{Cholesky, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::budgets::{BACKTRACKS, EVALUATIONS_PER_ITERATION};
use crate::geometry::{Pose, Shape};
use crate::tolerances::{ARMIJO, BACKTRACK_SHARE, BARRED_SHARE};

use super::contacts::{BodyPlacement, ContactEnergy, Contacts};
use super::parameters::PenaltyParameters;
use super::slopes::{Metric, Slopes};

/// Added to the squared lengths in inertia tensors: bodies without extent across an axis have none.
const LEAST_INERTIA: f64 = 1e-8;
const LEAST_MASS: f64 = 1e-9;

/// A body at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BodyState {
    /// Centre of mass in the planning frame.
    pub(super) centre: Point3<f64>,
    /// planning_from_shape.
    pub(super) rotation: UnitQuaternion<f64>,
    /// Velocity of the centre of mass.
    pub(super) velocity: Vector3<f64>,
    /// Angular velocity in planning axes.
    pub(super) spin: Vector3<f64>,
}

impl BodyState {
    /// The same without velocity.
    pub(super) fn at_rest(self) -> Self {
        Self { velocity: Vector3::zeros(), spin: Vector3::zeros(), ..self }
    }
}

/// What an action does to a body, as accelerations.
#[derive(Debug, Clone, Copy)]
pub(super) struct PenaltyDrive {
    pub(super) linear: Vector3<f64>,
    pub(super) angular: Vector3<f64>,
    /// Whether the body may turn: 6 unknowns instead of 3 (the other 3 are uncoupled then, and 0).
    pub(super) turns: bool,
}

/// A rigid body of density 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct RigidBody {
    pub(super) mass: f64,
    /// About the centre of mass, in the shape's axes.
    inertia: Matrix3<f64>,
    /// Centre of mass in the shape's frame.
    mass_centre: Point3<f64>,
    /// Largest distance of a point from it.
    pub(super) reach: f64,
}

impl RigidBody {
    pub(super) fn new(shape: &Shape) -> Self {
        let mass = shape.mass.volume.max(LEAST_MASS);
        let unit = shape.mass.unit_inertia() + Matrix3::from_diagonal_element(LEAST_INERTIA);
        Self { mass, inertia: unit * mass, mass_centre: shape.mass.centre, reach: shape.reach }
    }

    /// At rest at a pose.
    pub(super) fn at_rest(&self, pose: &Pose) -> BodyState {
        let (velocity, spin) = (Vector3::zeros(), Vector3::zeros());
        BodyState { centre: pose * self.mass_centre, rotation: pose.rotation, velocity, spin }
    }

    pub(super) fn pose(&self, state: &BodyState) -> Pose {
        let origin = state.centre.coords - state.rotation * self.mass_centre.coords;
        Pose::from_parts(Translation3::from(origin), state.rotation)
    }

    /// How far a point of the body can be displaced by this.
    pub(super) fn travel(&self, displacement: &Vector6<f64>) -> f64 {
        displacement.fixed_rows::<3>(0).norm() + self.reach * displacement.fixed_rows::<3>(3).norm()
    }
}

/// How a step went.
#[derive(Debug, Clone, Copy)]
pub(super) struct PenaltyStep {
    /// The body after it.
    pub(super) state: BodyState,
    /// How far a point of the body can have been displaced.
    pub(super) travel: f64,
}

/// What steps have cost.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepTally {
    pub(super) steps: u64,
    /// Newton iterations; a step with nothing near takes none.
    pub(super) iterations: u64,
    /// Evaluations of all contact.
    pub(super) evaluations: u64,
    /// Steps whose last Newton step was not within the tolerance: no step led further down, for
    /// the slope of the field jumps there.
    pub(super) settled: u64,
}

/// Makes steps; holds what they need, so that none is allocated for.
pub(super) struct Stepper<'a> {
    pub(super) rigid: RigidBody,
    drive: PenaltyDrive,
    parameters: &'a PenaltyParameters,
    current: ContactEnergy,
    trial: ContactEnergy,
    pub(super) tally: StepTally,
}

impl<'a> Stepper<'a> {
    pub(super) fn new(
        rigid: RigidBody,
        drive: PenaltyDrive,
        parameters: &'a PenaltyParameters,
        pairs: usize,
    ) -> Self {
        let (current, trial) = (ContactEnergy::new(pairs), ContactEnergy::new(pairs));
        Self { rigid, drive, parameters, current, trial, tally: StepTally::default() }
    }

    /// Per pair, whether it was in contact at the end of the last step.
    pub(super) fn touched(&self) -> &[bool] {
        &self.current.touched
    }

    /// How far velocity and action alone would move a point of the body, at most.
    pub(super) fn expected_travel(&self, state: &BodyState) -> f64 {
        self.rigid.travel(&self.goal(state).free)
    }

    /// The body after one time step. `contacts` must hold what comes near on the way.
    pub(super) fn step(&mut self, state: &BodyState, contacts: &Contacts<'_>) -> PenaltyStep {
        let goal = self.goal(state);
        let mut z = goal.free;
        self.tally.steps += 1;
        if contacts.is_empty() {
            self.current.clear();
        } else if !self.minimise(state, &goal, contacts, &mut z) {
            self.tally.settled += 1;
        }
        let h = self.parameters.time_step;
        let (dx, turn) = (linear(&z), angular(&z));
        let mut after = BodyState {
            centre: state.centre + dx,
            rotation: state.rotation,
            velocity: dx / h,
            spin: turn / h,
        };
        if self.drive.turns {
            after.rotation = UnitQuaternion::from_scaled_axis(turn) * state.rotation;
            after.rotation.renormalize();
        }
        PenaltyStep { state: after, travel: self.rigid.travel(&z) }
    }

    fn goal(&self, state: &BodyState) -> StepGoal {
        let h = self.parameters.time_step;
        let axes = state.rotation.to_rotation_matrix().into_inner();
        let inertia = axes * self.rigid.inertia * axes.transpose();
        let mut free = Vector6::zeros();
        free.fixed_rows_mut::<3>(0).copy_from(&((state.velocity + self.drive.linear * h) * h));
        if self.drive.turns {
            let moment = -state.spin.cross(&(inertia * state.spin));
            let gyroscopic = Cholesky::new(inertia).map_or_else(Vector3::zeros, |c| c.solve(&moment));
            let spin = state.spin + (self.drive.angular + gyroscopic) * h;
            free.fixed_rows_mut::<3>(3).copy_from(&(spin * h));
        }
        let mut weight = Matrix6::zeros();
        let diagonal = Matrix3::from_diagonal_element(self.rigid.mass);
        weight.fixed_view_mut::<3, 3>(0, 0).copy_from(&(diagonal / (h * h)));
        weight.fixed_view_mut::<3, 3>(3, 3).copy_from(&(inertia / (h * h)));
        StepGoal { free, weight }
    }

    /// Newton's method from `z`; returns whether it converged.
    fn minimise(
        &mut self,
        state: &BodyState,
        goal: &StepGoal,
        contacts: &Contacts<'_>,
        z: &mut Vector6<f64>,
    ) -> bool {
        let at = StepProblem { state, goal, contacts };
        self.tally.evaluations += 1;
        contacts.evaluate(&placement(state, z), self.drive.turns, &mut self.current);
        let most =
            self.tally.evaluations + EVALUATIONS_PER_ITERATION * u64::from(self.parameters.newton_iterations);
        for _ in 0..self.parameters.newton_iterations {
            if self.tally.evaluations >= most {
                break;
            }
            self.tally.iterations += 1;
            match self.descend(&at, z) {
                Descent::Lower(next) => *z = next,
                Descent::Lowest(last) => {
                    *z = last;
                    return true;
                }
                Descent::Nowhere => return false,
            }
            std::mem::swap(&mut self.current, &mut self.trial);
        }
        false
    }

    /// One Newton step. Where a face of cells bars the way, the slope behind it is kept too, and the
    /// next direction leads down both: along the face, or nowhere if the lowest point is on it.
    fn descend(&mut self, at: &StepProblem<'_>, z: &Vector6<f64>) -> Descent {
        let local = at.goal.local(z, &self.current);
        let Some(metric) = Metric::new(local.hessian).or_else(|| Metric::new(local.gauss)) else {
            return Descent::Nowhere;
        };
        let mut slopes = Slopes::new(metric.scaled(&local.gradient));
        let (mut short, mut is_first) = (None, true);
        loop {
            let slope = slopes.least();
            let up = metric.step(&slope);
            if self.rigid.travel(&up) <= self.parameters.newton_tolerance {
                if is_first {
                    return Descent::Lowest(z - up);
                }
                // With a way left towards the face, the lowest point is not here yet.
                let Some(next) = short else { return Descent::Lowest(*z) };
                return self.taken(at, next);
            }
            let found = self.search(at, z, local.energy, slope.norm_squared(), &up);
            if found.share >= BARRED_SHARE {
                return Descent::Lower(z - up * found.share);
            }
            if found.share > 0.0 {
                short = Some(z - up * found.share);
            }
            is_first = false;
            if !slopes.add(metric.scaled(&found.barred)) {
                return short.map_or(Descent::Nowhere, |next| self.taken(at, next));
            }
        }
    }

    /// A step that was found lower before others were tried.
    fn taken(&mut self, at: &StepProblem<'_>, next: Vector6<f64>) -> Descent {
        self.evaluate(at, &next);
        Descent::Lower(next)
    }

    /// Backtracks down from `energy` until it is low enough; `trial` belongs to the last try.
    fn search(
        &mut self,
        at: &StepProblem<'_>,
        z: &Vector6<f64>,
        energy: f64,
        slope: f64,
        up: &Vector6<f64>,
    ) -> LineSearch {
        let mut found = LineSearch { share: 0.0, barred: Vector6::zeros() };
        let mut share = 1.0;
        for _ in 0..=BACKTRACKS {
            let next = z - up * share;
            self.evaluate(at, &next);
            if at.goal.energy(&next, &self.trial) <= energy - ARMIJO * share * slope {
                found.share = share;
                break;
            }
            found.barred = at.goal.gradient(&next, &self.trial);
            share *= BACKTRACK_SHARE;
        }
        found
    }

    fn evaluate(&mut self, at: &StepProblem<'_>, z: &Vector6<f64>) {
        self.tally.evaluations += 1;
        at.contacts.evaluate(&placement(at.state, z), self.drive.turns, &mut self.trial);
    }
}

/// What a line search found.
struct LineSearch {
    /// The share of the step that leads low enough; 0 if none does.
    share: f64,
    /// The slope at the shortest try that did not.
    barred: Vector6<f64>,
}

/// What a step is to minimise.
struct StepProblem<'a> {
    state: &'a BodyState,
    goal: &'a StepGoal,
    contacts: &'a Contacts<'a>,
}

/// What a Newton step found.
enum Descent {
    /// A lower point, which `trial` belongs to.
    Lower(Vector6<f64>),
    /// The lowest one, within the tolerance.
    Lowest(Vector6<f64>),
    /// No way down, nor that there is none.
    Nowhere,
}

/// Where the body would be without contact, and what it costs to be elsewhere.
struct StepGoal {
    free: Vector6<f64>,
    weight: Matrix6<f64>,
}

/// The energy of a step at some z with its derivatives.
struct LocalEnergy {
    energy: f64,
    gradient: Vector6<f64>,
    hessian: Matrix6<f64>,
    gauss: Matrix6<f64>,
}

impl StepGoal {
    fn energy(&self, z: &Vector6<f64>, contact: &ContactEnergy) -> f64 {
        let off = z - self.free;
        0.5 * off.dot(&(self.weight * off)) + contact.energy
    }

    fn gradient(&self, z: &Vector6<f64>, contact: &ContactEnergy) -> Vector6<f64> {
        self.weight * (z - self.free) + chain(z).transpose() * contact.gradient
    }

    fn local(&self, z: &Vector6<f64>, contact: &ContactEnergy) -> LocalEnergy {
        let chain = chain(z);
        let back = chain.transpose();
        let gauss = self.weight + back * contact.gauss * chain;
        LocalEnergy {
            energy: self.energy(z, contact),
            gradient: self.gradient(z, contact),
            hessian: gauss + back * contact.curvature * chain,
            gauss,
        }
    }
}

/// exp(θ + dθ) = exp(J dθ) exp(θ): contact is differentiated by the turn J dθ. That J itself changes
/// with θ adds a term that is smaller by |θ| (0.03 at most) and is left out of second derivatives.
fn chain(z: &Vector6<f64>) -> Matrix6<f64> {
    let mut chain = Matrix6::identity();
    chain.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn_jacobian(&angular(z)));
    chain
}

/// The left Jacobian of rotation vectors: exp(θ + dθ) ≈ exp(J dθ) exp(θ).
fn turn_jacobian(turn: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (turn.norm(), turn.cross_matrix());
    // The series where the quotients lose their digits.
    let (first, second) = if angle < 1e-2 {
        let squared = angle * angle;
        (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        ((1.0 - angle.cos()) / (angle * angle), (angle - angle.sin()) / (angle * angle * angle))
    };
    Matrix3::identity() + cross * first + cross * cross * second
}

/// Where a displacement takes a body.
pub(super) fn placement(state: &BodyState, z: &Vector6<f64>) -> BodyPlacement {
    let rotation = UnitQuaternion::from_scaled_axis(angular(z)) * state.rotation;
    BodyPlacement { centre: state.centre + linear(z), rotation: rotation.to_rotation_matrix().into_inner() }
}

fn linear(z: &Vector6<f64>) -> Vector3<f64> {
    z.fixed_rows::<3>(0).into_owned()
}

fn angular(z: &Vector6<f64>) -> Vector3<f64> {
    z.fixed_rows::<3>(3).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jacobian_of_turns_is_that_of_finite_differences() {
        for turn in [Vector3::zeros(), Vector3::new(3e-3, -2e-3, 5e-3), Vector3::new(0.3, -0.8, 0.4)] {
            let jacobian = turn_jacobian(&turn);
            for a in 0..3 {
                let mut d = Vector3::zeros();
                d[a] = 1e-6;
                let [below, above] = [turn - d, turn + d].map(UnitQuaternion::from_scaled_axis);
                let between = (above * below.inverse()).scaled_axis() / 2e-6;
                assert!((between - jacobian.column(a)).norm() < 1e-8, "{between} at {turn}");
            }
        }
    }
}
