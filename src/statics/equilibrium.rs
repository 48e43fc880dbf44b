//! Whether contacts can hold bodies against gravity: a conic program, solved by clarabel and checked afterwards.
//!
//! Unknown are the force at each contact point, within its friction cone, and for each body the share of its weight that
//! these forces hold. The shares are made as large as possible. If all are 1, the forces are an equilibrium; otherwise
//! the multipliers of the balances are a motion that no contact stops, along which gravity does work: what falls. Both
//! are checked by substitution.
//!
//! Forces are in units of the weight that they act on, torques in units of weight times the body's reach.

use clarabel::solver::{NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use nalgebra::{Matrix3, Point3, Vector3};

use super::contacts::ContactPoint;
use super::program::Program;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{BALANCED, HELD_SHARE, LEAST_WEIGHT};

/// A body that contacts have to hold.
#[derive(Debug, Clone)]
pub(super) struct HeldBody {
    /// Its centre of mass.
    pub(super) centre: Point3<f64>,
    /// Its mass; only ratios matter. None counts as lighter than [`LEAST_WEIGHT`] of the heaviest.
    pub(super) mass: f64,
    /// The inertia tensor about its centre, for that mass.
    pub(super) inertia: Matrix3<f64>,
    /// The greatest distance of any of its points from the centre.
    pub(super) reach: f64,
    /// A force and a torque about the centre that it has to bear besides its weight, in the weight of a mass of 1.
    pub(super) bears: [Vector3<f64>; 2],
}

/// A pair of parts, and the number of a contact among those of the pair.
pub(super) type ContactKey = ([usize; 2], usize);

/// A contact between two bodies, or between a body and what stays.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldContact {
    /// The body that the normal leads to, and the other one. `None`: it stays.
    pub(super) of: [Option<usize>; 2],
    /// Its pair of parts, and its number among those of the pair.
    pub(super) key: ContactKey,
    pub(super) at: ContactPoint,
}

/// Bodies and their contacts.
#[derive(Debug, Clone)]
pub(super) struct System {
    pub(super) bodies: Vec<HeldBody>,
    pub(super) contacts: Vec<HeldContact>,
    /// The unit vector along which things fall.
    pub(super) down: Vector3<f64>,
    /// Ends every program early.
    pub(super) termination: Termination,
}

/// A velocity of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Velocity {
    /// Of its centre of mass.
    pub(super) linear: Vector3<f64>,
    /// In radians.
    pub(super) angular: Vector3<f64>,
}

/// What is not held.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Falling {
    /// By body: the motion that begins, found and checked; zero for what does not move.
    pub(super) velocities: Vec<Velocity>,
    /// By body: the share of its weight that is held.
    pub(super) shares: Vec<f64>,
    /// By contact, in the weight of a mass of 1: the forces that hold these.
    pub(super) forces: Vec<Vector3<f64>>,
}

/// The answer to whether contacts hold bodies.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Balance {
    /// Forces that hold all of them were found, and checked: by contact, in the weight of a mass of 1.
    Held(Vec<Vector3<f64>>),
    /// Not all of them are held.
    Falls(Falling),
    /// The solver did not get to an answer that passes the check.
    Unknown,
}

/// What a program is about.
struct Question<'a> {
    friction: f64,
    load: Vector3<f64>,
    /// By contact: how far it slips, where all of the load must be held by elastic contacts.
    slip: Option<&'a [f64]>,
}

/// What the solver found.
struct Solution {
    forces: Vec<Vector3<f64>>,
    shares: Vec<f64>,
    velocities: Vec<Velocity>,
    /// By contact: how fast it slips.
    slip: Vec<f64>,
}

impl System {
    /// Whether any forces at the contacts hold all bodies, with a coefficient of friction. `sideways` is a load besides the
    /// weight, as a share of it.
    ///
    /// Such forces may press bodies together that nothing presses: see [`Self::is_held_elastically`].
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn balance(&self, friction: f64, sideways: &Vector3<f64>) -> Result<Balance, Interrupt> {
        let load = self.down + sideways;
        let question = Question { friction, load, slip: None };
        let Some(found) = self.solved(&question)? else { return Ok(Balance::Unknown) };
        let unit = self.unit();
        let forces: Vec<_> = found.forces.iter().map(|force| force * unit).collect();
        if found.shares.iter().all(|share| *share > 1.0 - HELD_SHARE) {
            let is_right = self.balances(&forces, &question);
            return Ok(if is_right { Balance::Held(forces) } else { Balance::Unknown });
        }
        Ok(if self.is_free_motion(&found.velocities, &question) {
            Balance::Falls(Falling { velocities: found.velocities, shares: found.shares, forces })
        } else {
            Balance::Unknown
        })
    }

    /// Whether contacts that give way a little hold all bodies with a coefficient of friction, if gravity alone presses
    /// them together. A block between two walls is held by forces that press it, but nothing presses it.
    ///
    /// Coulomb's law with slip is a conic program if each contact first moves apart by as much as friction times the slip
    /// (G. De Saxcé and Z.-Q. Feng 1998); the slip that makes both agree is found by repetition (F. Cadoux 2009). Without
    /// end, the bodies slip away.
    ///
    /// Slips are in units of what a contact gives way under the weight of the heaviest body.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn is_held_elastically(&self, friction: f64) -> Result<bool, Interrupt> {
        /// Count of repetitions. Most slips settle within ten. At half, a friction within some 4 % of the least counts as
        /// too little; at double, what slips away slowly takes twice as long.
        const ROUNDS: usize = 60;
        /// Share of the greatest slip, or of the unit: a change that is smaller is none. At half one repetition more; at
        /// double one less.
        const SETTLED: f64 = 1e-3;
        /// Share of the last change below which a change shrinks fast enough to settle within [`ROUNDS`]
        /// (0.95⁶⁰ = 0.05), …
        const SHRINKING: f64 = 0.95;
        /// … and count of changes in a row that may be larger. At 1, slips that first grow are given up; at double, what
        /// nothing presses takes half as long again.
        const PATIENCE: usize = 3;
        let mut slip = vec![0.0; self.contacts.len()];
        let (mut last, mut steady) = (f64::INFINITY, 0);
        for _ in 0..ROUNDS {
            let question = Question { friction, load: self.down, slip: Some(&slip) };
            let Some(found) = self.solved(&question)? else { return Ok(false) };
            let unit = self.unit();
            if !self.balances(&found.forces.iter().map(|force| force * unit).collect::<Vec<_>>(), &question) {
                return Ok(false);
            }
            let change = found.slip.iter().zip(&slip).map(|(new, old)| (new - old).abs()).fold(0.0, f64::max);
            let most = found.slip.iter().copied().fold(0.0, f64::max);
            if change <= SETTLED * most.max(1.0) {
                return Ok(true);
            }
            steady = if change > SHRINKING * last { steady + 1 } else { 0 };
            if steady == PATIENCE {
                return Ok(false);
            }
            (slip, last) = (found.slip, change);
        }
        Ok(false)
    }

    /// The accelerations of the centres of mass with which bodies begin to move if nothing rubs, in units of gravity: of all
    /// that no contact stops, those nearest to free fall (Gauss' principle of least constraint). `None` where the solver
    /// finds no answer that passes the check.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn beginning(&self) -> Result<Option<Vec<Vector3<f64>>>, Interrupt> {
        let unit = self.unit();
        let (mut curvature, mut linear) = (Vec::new(), Vec::new());
        // In the axes of its inertia, each body's turns are apart from each other.
        let turned: Vec<_> = self.bodies.iter().map(|body| body.inertia.symmetric_eigen()).collect();
        for (body, turns) in self.bodies.iter().zip(&turned) {
            let (mass, squared) = (body.mass / unit, body.reach * body.reach);
            // None turns more easily than a ball of a hundredth of its reach.
            let inertia = turns.eigenvalues.map(|value| (value / (unit * squared)).max(1e-4 * mass));
            curvature.extend([mass, mass, mass, inertia.x, inertia.y, inertia.z]);
            let weight = self.down * -mass;
            linear.extend([weight.x, weight.y, weight.z, 0.0, 0.0, 0.0]);
        }
        let mut program = Program::new(curvature, linear);
        for (row, contact) in self.contacts.iter().enumerate() {
            for (body, sign, lever) in self.ends(contact) {
                let turn = turned[body].eigenvectors.transpose() * lever.cross(&contact.at.normal);
                for i in 0..3 {
                    program.push(row, 6 * body + i, -sign * contact.at.normal[i]);
                    program.push(row, 6 * body + 3 + i, -sign * turn[i] / self.bodies[body].reach);
                }
            }
            program.right.push(0.0);
        }
        if !self.contacts.is_empty() {
            program.cones.push(NonnegativeConeT(self.contacts.len()));
        }
        let Some(found) = program.solve(&self.termination)? else { return Ok(None) };
        let part = |from: usize| Vector3::from_fn(|i, _| found.point[from + i]);
        let accelerations: Vec<Velocity> = (0..self.bodies.len())
            .map(|body| Velocity {
                linear: part(6 * body),
                angular: turned[body].eigenvectors * part(6 * body + 3) / self.bodies[body].reach,
            })
            .collect();
        let question = Question { friction: 0.0, load: self.down, slip: None };
        let is_right = self.is_free_motion(&accelerations, &question);
        Ok(is_right.then(|| accelerations.iter().map(|acceleration| acceleration.linear).collect()))
    }

    /// The bodies that a force at a contact acts on: each with the sign of the force, and the lever from its centre.
    fn ends(&self, contact: &HeldContact) -> impl Iterator<Item = (usize, f64, Vector3<f64>)> {
        let ends = [(contact.of[0], 1.0), (contact.of[1], -1.0)];
        let point = contact.at.point;
        let centre = |body: usize| self.bodies[body].centre;
        ends.into_iter().filter_map(move |(body, sign)| body.map(|body| (body, sign, point - centre(body))))
    }

    /// The mass in whose weight the program has its forces: the greatest.
    fn unit(&self) -> f64 {
        self.bodies.iter().map(|body| body.mass).fold(f64::MIN_POSITIVE, f64::max)
    }

    /// By how much a force in that unit is larger in the weight of a body.
    fn weights(&self) -> Vec<f64> {
        let unit = self.unit();
        self.bodies.iter().map(|body| unit / body.mass.max(unit * LEAST_WEIGHT)).collect()
    }

    /// By body: the load in its weight, and the torque in its weight times its reach. `share` is that of its weight.
    fn loads(&self, load: &Vector3<f64>, share: f64) -> Vec<[Vector3<f64>; 2]> {
        let (unit, weights) = (self.unit(), self.weights());
        let bodies = self.bodies.iter().zip(weights);
        bodies
            .map(|(body, weight)| {
                let [force, torque] = body.bears.map(|bears| bears * (weight / unit));
                [load * share + force, torque / body.reach]
            })
            .collect()
    }

    /// Forces that hold all bodies with a coefficient of friction, given some (in the weight of a mass of 1, by contact) that
    /// held them when a little was different: as few as possible are changed. `None` if none are found so.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn mended(
        &self,
        forces: Vec<Vector3<f64>>,
        friction: f64,
    ) -> Result<Option<Vec<Vector3<f64>>>, Interrupt> {
        /// Count of contacts from a body that is out of balance to those that are asked with it. At half, most parts with
        /// two washers are asked all at once; with more, all might be asked at once.
        const HOPS: [usize; 3] = [1, 2, 4];
        let question = Question { friction, load: self.down, slip: None };
        let mut held = forces;
        let disturbed: Vec<bool> =
            self.rests(&held, &question).iter().map(|rest| *rest > HELD_SHARE / 2.0).collect();
        if !disturbed.contains(&true) {
            return Ok(self.balances(&held, &question).then_some(held));
        }
        let (mut near, mut hops) = (disturbed, 0);
        for wanted in HOPS {
            while hops < wanted {
                near = self.with_neighbours(&near);
                hops += 1;
            }
            if 2 * near.iter().filter(|near| **near).count() > near.len() {
                return Ok(None);
            }
            let (part, contacts) = self.around(&near, &held);
            let Balance::Held(found) = part.balance(friction, &Vector3::zeros())? else { continue };
            for (contact, force) in contacts.into_iter().zip(found) {
                held[contact] = force;
            }
            return Ok(self.balances(&held, &question).then_some(held));
        }
        Ok(None)
    }

    /// Bodies, and those that touch them.
    pub(super) fn with_neighbours(&self, bodies: &[bool]) -> Vec<bool> {
        let mut grown = bodies.to_vec();
        for contact in &self.contacts {
            if let [Some(a), Some(b)] = contact.of
                && (bodies[a] || bodies[b])
            {
                (grown[a], grown[b]) = (true, true);
            }
        }
        grown
    }

    /// Some of the bodies, with their contacts among each other and with what stays, which are numbered. They bear the
    /// forces at all other contacts.
    pub(super) fn around(&self, near: &[bool], held: &[Vector3<f64>]) -> (Self, Vec<usize>) {
        let mut numbers = vec![None; near.len()];
        let mut bodies = Vec::new();
        for body in (0..near.len()).filter(|&body| near[body]) {
            numbers[body] = Some(bodies.len());
            bodies.push(self.bodies[body].clone());
        }
        let (mut contacts, mut places) = (Vec::new(), Vec::new());
        for (place, contact) in self.contacts.iter().enumerate() {
            let of = contact.of.map(|body| body.map(|body| numbers[body]));
            if of.iter().flatten().all(Option::is_some) {
                contacts.push(HeldContact { of: of.map(Option::flatten), ..*contact });
                places.push(place);
                continue;
            }
            for (body, sign, lever) in self.ends(contact) {
                if let Some(number) = numbers[body] {
                    let force = held[place] * sign;
                    bodies[number].bears[0] += force;
                    bodies[number].bears[1] += lever.cross(&force);
                }
            }
        }
        (Self { bodies, contacts, down: self.down, termination: self.termination.clone() }, places)
    }

    fn solved(&self, question: &Question<'_>) -> Result<Option<Solution>, Interrupt> {
        let (bodies, contacts) = (self.bodies.len(), self.contacts.len());
        let rubs = question.friction > 0.0;
        let width = if rubs { 3 } else { 1 };
        let shares = if question.slip.is_none() { bodies } else { 0 };
        let forces = width * contacts;
        let axes: Vec<[Vector3<f64>; 3]> = self.contacts.iter().map(|c| axes(&c.at.normal)).collect();
        let weights = self.weights();
        // Of forces that do the same, the smallest; where contacts give way, by as much as the force.
        let curvature = if question.slip.is_some() { 1.0 } else { BALANCED };
        let curvature = [vec![curvature; forces], vec![0.0; shares]].concat();
        let mut linear = [vec![0.0; forces], vec![-1.0; shares]].concat();
        for (c, slip) in question.slip.into_iter().flatten().enumerate() {
            linear[width * c] = question.friction * slip;
        }
        let mut program = Program::new(curvature, linear);
        for (c, contact) in self.contacts.iter().enumerate() {
            for (body, sign, lever) in self.ends(contact) {
                let factor = sign * weights[body];
                for (k, axis) in axes[c][..width].iter().enumerate() {
                    let torque = lever.cross(axis) / self.bodies[body].reach;
                    for i in 0..3 {
                        program.push(6 * body + i, width * c + k, factor * axis[i]);
                        program.push(6 * body + 3 + i, width * c + k, factor * torque[i]);
                    }
                }
            }
        }
        let fixed = if question.slip.is_some() { 1.0 } else { 0.0 };
        for [force, torque] in self.loads(&question.load, fixed) {
            program.right.extend((-force).iter().chain(&-torque));
        }
        program.cones.push(ZeroConeT(6 * bodies));
        for body in 0..shares {
            (0..3).for_each(|i| program.push(6 * body + i, forces + body, question.load[i]));
            for (sign, limit) in [(1.0, 1.0), (-1.0, 0.0)] {
                program.push(program.right.len(), forces + body, sign);
                program.right.push(limit);
            }
        }
        if shares > 0 {
            program.cones.push(NonnegativeConeT(2 * shares));
        }
        let first_of_cones = program.right.len();
        for c in 0..contacts {
            for k in 0..width {
                let factor = if rubs && k == 0 { question.friction } else { 1.0 };
                program.push(program.right.len(), width * c + k, -factor);
                program.right.push(0.0);
            }
            program.cones.push(if rubs { SecondOrderConeT(3) } else { NonnegativeConeT(1) });
        }
        let Some(found) = program.solve(&self.termination)? else { return Ok(None) };
        let force = |c: usize| {
            axes[c][..width].iter().enumerate().map(|(k, axis)| axis * found.point[width * c + k]).sum()
        };
        let velocity = |body: usize| {
            let part =
                |from: usize| Vector3::from_fn(|i, _| weights[body] * found.multipliers[6 * body + from + i]);
            Velocity { linear: part(0), angular: part(3) / self.bodies[body].reach }
        };
        let slips = |c: usize| {
            let multiplier = |k: usize| found.multipliers[first_of_cones + width * c + k];
            if rubs { multiplier(1).hypot(multiplier(2)) } else { 0.0 }
        };
        Ok(Some(Solution {
            forces: (0..contacts).map(force).collect(),
            shares: found.point[forces..].to_vec(),
            velocities: (0..bodies).map(velocity).collect(),
            slip: (0..contacts).map(slips).collect(),
        }))
    }

    /// By body: how much of its load forces leave, as a share of its weight.
    fn rests(&self, forces: &[Vector3<f64>], question: &Question<'_>) -> Vec<f64> {
        let (unit, weights) = (self.unit(), self.weights());
        let mut rests = self.loads(&question.load, 1.0);
        for (contact, force) in self.contacts.iter().zip(forces) {
            for (body, sign, lever) in self.ends(contact) {
                let force = force * (sign * weights[body] / unit);
                rests[body][0] += force;
                rests[body][1] += lever.cross(&force) / self.bodies[body].reach;
            }
        }
        rests.iter().map(|[force, torque]| force.norm().max(torque.norm())).collect()
    }

    /// Whether forces (in the weight of a mass of 1) are within their cones, and add up to the load on every body.
    fn balances(&self, forces: &[Vector3<f64>], question: &Question<'_>) -> bool {
        let off = BALANCED * forces.iter().map(Vector3::norm).fold(self.unit(), f64::max);
        let is_within = |(contact, force): (&HeldContact, &Vector3<f64>)| {
            let pressure = force.dot(&contact.at.normal);
            let rubbing = (force - contact.at.normal * pressure).norm();
            pressure >= -off && rubbing <= question.friction * pressure + off
        };
        self.contacts.iter().zip(forces).all(is_within)
            && self.rests(forces, question).iter().all(|rest| *rest <= HELD_SHARE)
    }

    /// Whether no contact stops a motion, not even by friction, and gravity does work along it.
    fn is_free_motion(&self, velocities: &[Velocity], question: &Question<'_>) -> bool {
        let speed = |(v, body): (&Velocity, &HeldBody)| v.linear.norm() + v.angular.norm() * body.reach;
        let fastest = velocities.iter().zip(&self.bodies).map(speed).fold(0.0, f64::max);
        let is_let = |contact: &HeldContact| {
            let velocity = |(body, sign, lever): (usize, f64, Vector3<f64>)| {
                (velocities[body].linear + velocities[body].angular.cross(&lever)) * sign
            };
            let relative: Vector3<f64> = self.ends(contact).map(velocity).sum();
            let apart = relative.dot(&contact.at.normal);
            let slips = (relative - contact.at.normal * apart).norm();
            apart >= question.friction * slips - HELD_SHARE * fastest
        };
        let work = |(v, body): (&Velocity, &HeldBody)| v.linear.dot(&question.load) * body.mass;
        velocities.iter().zip(&self.bodies).map(work).sum::<f64>() > 0.0 && self.contacts.iter().all(is_let)
    }
}

/// A contact's normal, and two axes across it.
fn axes(normal: &Vector3<f64>) -> [Vector3<f64>; 3] {
    let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    [*normal, across, normal.cross(&across)]
}
