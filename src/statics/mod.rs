//! Statics: what stands by itself under gravity, what needs friction for it, and what falls unless somebody holds it.
//!
//! Data flow: a [`Scene`] → `contacts` (points at which two parts press on each other) → `equilibrium` (a conic program
//! with friction cones, checked by substitution) → `stability` (the least friction, the margin, what falls, and which
//! parts to hold). Parts are rigid. Pairs that are joined, as by a press fit or a thread, are one body.

mod contacts;
mod equilibrium;
mod program;
mod stability;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Unit, Vector3};
use petgraph::unionfind::UnionFind;
use rayon::prelude::*;

use crate::geometry::Assembly;
use crate::scene::{Body, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::CONTACT_GAP;

use contacts::{ContactPoint, contacts_between};
use equilibrium::{ContactKey, HeldBody, HeldContact, System};
use stability::Loose;
pub use stability::{Fall, Stability, Unstable};

/// What the answer depends on besides the parts.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticsOptions {
    /// The direction against gravity, in the input's frame.
    pub up: Unit<Vector3<f64>>,
    /// The coefficient of friction (Coulomb) of all contacts. 0.2 is that of dry machined steel on steel, at the lower end.
    pub friction: f64,
    /// The gap up to which two surfaces count as touching, in the input's units. `None`: a hundredth of
    /// the longest side of the smaller part.
    pub gap: Option<f64>,
    /// Whether margins are wanted, which take most of the time.
    pub margin: bool,
}

impl Default for StaticsOptions {
    fn default() -> Self {
        Self { up: Vector3::z_axis(), friction: 0.2, gap: None, margin: false }
    }
}

/// The contacts of all parts of an assembly as they stand, and what is known about bodies that they hold.
#[derive(Debug)]
pub struct Statics<'a> {
    scene: &'a Scene,
    down: Vector3<f64>,
    friction: f64,
    margins: bool,
    contacts: BTreeMap<[usize; 2], Vec<ContactPoint>>,
    /// By part, the parts that it touches, ascending.
    touching: Vec<Vec<usize>>,
    joined: BTreeSet<[usize; 2]>,
    /// By the bodies that are connected with each other, and the parts that stay beside them.
    known: HashMap<Connected, Arc<Stability>>,
    /// The same of bodies of which all beside them stays.
    known_loose: HashMap<Connected, Arc<Loose>>,
    /// Whether contacts alone hold a body of which all beside it stays.
    known_alone: HashMap<Connected, bool>,
    /// Forces that hold the bodies of the last states in which contacts alone hold them, in the weight of a mass of 1: of the
    /// next state they hold most.
    forces: HashMap<ContactKey, Vector3<f64>>,
}

/// Bodies (lists of parts) that are connected with each other, and the parts that stay and touch them.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Connected {
    bodies: Vec<Vec<usize>>,
    stays: Vec<usize>,
}

impl Connected {
    /// Those bodies that are not marked, as if there were no others.
    fn unmarked(&self, marks: &[bool]) -> Self {
        let bodies = self.bodies.iter().zip(marks).filter(|(_, mark)| !**mark);
        Self { bodies: bodies.map(|(body, _)| body.clone()).collect(), stays: self.stays.clone() }
    }

    /// The same where some of the bodies stay.
    fn without(&self, fixed: &BTreeSet<Vec<usize>>) -> Self {
        let bodies = self.bodies.iter().filter(|body| !fixed.contains(*body)).cloned().collect();
        let mut stays = self.stays.clone();
        stays.extend(fixed.iter().flatten());
        stays.sort_unstable();
        Self { bodies, stays }
    }
}

impl<'a> Statics<'a> {
    /// Finds the contacts of all parts of a scene, in parallel. Joined pairs (the smaller number first) are one body while
    /// both stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn of(
        scene: &'a Scene,
        assembly: &Assembly,
        options: &StaticsOptions,
        joined: BTreeSet<[usize; 2]>,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let side = |part: usize| scene.bodies[part].shape.bounds().extents().max();
        let gap = |[a, b]: [usize; 2]| match options.gap {
            Some(gap) => gap * assembly.scale,
            None => CONTACT_GAP * side(a).min(side(b)),
        };
        let widest = options.gap.map_or(CONTACT_GAP * scene.longest_side, |gap| gap * assembly.scale);
        let pairs = scene.broad_phase.pairs(widest).into_iter().map(|(a, b)| [a, b]);
        let apart: Vec<[usize; 2]> = pairs.filter(|pair| !joined.contains(pair)).collect();
        let contacts = apart
            .into_par_iter()
            .map(|pair| Ok((pair, contacts_between(scene, pair, gap(pair), termination)?)))
            .collect::<Result<Vec<_>, Interrupt>>()?;
        let contacts: BTreeMap<_, _> =
            contacts.into_iter().filter(|(_, contacts)| !contacts.is_empty()).collect();
        let mut touching = vec![Vec::new(); scene.bodies.len()];
        for &[a, b] in contacts.keys() {
            touching[a].push(b);
            touching[b].push(a);
        }
        let down = -options.up.into_inner();
        Ok(Self {
            scene,
            down,
            friction: options.friction,
            contacts,
            touching,
            joined,
            margins: options.margin,
            known: HashMap::new(),
            known_loose: HashMap::new(),
            known_alone: HashMap::new(),
            forces: HashMap::new(),
        })
    }

    /// How the parts that stand (ascending) are held, where some of them stay whatever happens.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn stability(
        &mut self,
        standing: &[usize],
        stays: &[usize],
        termination: &Termination,
    ) -> Result<Stability, Interrupt> {
        let count = self.scene.bodies.len();
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        // The node behind those of the parts is what stays.
        let mut bodies = UnionFind::<usize>::new(count + 1);
        stays.iter().filter(|part| stands(part)).for_each(|&part| _ = bodies.union(part, count));
        for [a, b] in self.joined.iter().filter(|pair| pair.iter().all(stands)) {
            bodies.union(*a, *b);
        }
        let mut connected = bodies.clone();
        let free = |part: usize| !bodies.equiv(part, count);
        let touching = || self.contacts.keys().filter(|pair| pair.iter().all(stands));
        touching().filter(|[a, b]| free(*a) && free(*b)).for_each(|[a, b]| _ = connected.union(*a, *b));
        let mut components: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for &part in standing.iter().filter(|&&part| free(part)) {
            let component = components.entry(connected.find(part)).or_default();
            component.entry(bodies.find(part)).or_default().push(part);
        }
        let mut beside: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
        for &[a, b] in touching() {
            for (part, other) in [(a, b), (b, a)] {
                if free(part) && !free(other) {
                    beside.entry(connected.find(part)).or_default().insert(other);
                }
            }
        }
        let mut answers = Vec::new();
        for (root, component) in components {
            let stays = beside.remove(&root).unwrap_or_default().into_iter().collect();
            let key = Connected { bodies: component.into_values().collect(), stays };
            termination.check()?;
            answers.push(match self.known.get(&key) {
                Some(answer) => Arc::clone(answer),
                None => {
                    let answer = Arc::new(stability::answer(self, &key, termination)?);
                    self.known.insert(key, Arc::clone(&answer));
                    answer
                }
            });
        }
        Ok(Stability::of(&answers))
    }

    /// Those bodies that are loose, by what is connected if all others stay.
    fn loose(&self, connected: &Connected, is_loose: &[bool]) -> Vec<Connected> {
        let kept =
            connected.bodies.iter().zip(is_loose).filter(|(_, loose)| !**loose).map(|(body, _)| body.clone());
        let all = connected.without(&kept.collect());
        let mut numbers = BTreeMap::new();
        for (body, number) in all.bodies.iter().zip(0..) {
            numbers.extend(body.iter().map(|&part| (part, number)));
        }
        let mut touching = UnionFind::<usize>::new(all.bodies.len());
        for (&part, &number) in &numbers {
            for other in self.touching[part].iter().filter_map(|other| numbers.get(other)) {
                touching.union(number, *other);
            }
        }
        let mut groups: BTreeMap<usize, Vec<Vec<usize>>> = BTreeMap::new();
        for (number, body) in all.bodies.iter().enumerate() {
            groups.entry(touching.find(number)).or_default().push(body.clone());
        }
        groups
            .into_values()
            .map(|bodies| Connected { stays: self.beside(&bodies, &all.stays), bodies })
            .collect()
    }

    /// Of parts that stay (ascending), those that touch bodies, ascending.
    fn beside(&self, bodies: &[Vec<usize>], stays: &[usize]) -> Vec<usize> {
        let touched = bodies.iter().flatten().flat_map(|&part| &self.touching[part]);
        let beside: BTreeSet<usize> =
            touched.copied().filter(|part| stays.binary_search(part).is_ok()).collect();
        beside.into_iter().collect()
    }

    /// One of connected bodies, with all beside it staying.
    fn alone(&self, connected: &Connected, body: &[usize]) -> Connected {
        let is_beside = |other: &usize| {
            connected.stays.binary_search(other).is_ok()
                || connected.bodies.iter().any(|parts| parts.binary_search(other).is_ok() && parts != body)
        };
        let touched = body.iter().flat_map(|&part| &self.touching[part]);
        let stays: BTreeSet<usize> = touched.copied().filter(is_beside).collect();
        Connected { bodies: vec![body.to_vec()], stays: stays.into_iter().collect() }
    }

    /// Connected bodies with the contacts among them and with what stays.
    fn system(&self, connected: &Connected, termination: &Termination) -> System {
        let place: HashMap<usize, usize> = connected
            .bodies
            .iter()
            .zip(0..)
            .flat_map(|(body, i)| body.iter().map(move |&p| (p, i)))
            .collect();
        let bodies = connected.bodies.iter().map(|parts| self.body(parts)).collect();
        let mut pairs = BTreeSet::new();
        for &part in place.keys() {
            let counts =
                |other: &&usize| place.contains_key(other) || connected.stays.binary_search(other).is_ok();
            pairs.extend(
                self.touching[part].iter().filter(counts).map(|&other| [part.min(other), part.max(other)]),
            );
        }
        let mut contacts = Vec::new();
        for pair in pairs {
            let of = pair.map(|part| place.get(&part).copied());
            if of[0] != of[1] {
                let points = self.contacts.get(&pair).into_iter().flatten();
                contacts.extend(points.zip(0..).map(|(&at, i)| HeldContact { of, key: (pair, i), at }));
            }
        }
        System { bodies, contacts, down: self.down, termination: termination.clone() }
    }

    /// Parts as one rigid body.
    fn body(&self, parts: &[usize]) -> HeldBody {
        /// Volume (planning frame) of a flat sheet, of which the box has none either: it must weigh something.
        const SHEET: f64 = 1e-9;
        let placed = |&part: &usize| {
            let body = &self.scene.bodies[part];
            let mass = &body.shape.mass;
            (body, mass.volume.max(SHEET), body.planning_from_shape * mass.centre)
        };
        let mass = parts.iter().map(placed).map(|(_, mass, _)| mass).sum::<f64>();
        let moment: Vector3<f64> =
            parts.iter().map(placed).map(|(_, mass, centre)| centre.coords * mass).sum();
        let centre = Point3::from(moment / mass);
        let inertia = |(body, mass, at): (&Body, f64, Point3<f64>)| {
            let (turn, away) = (body.planning_from_shape.rotation.to_rotation_matrix(), at - centre);
            let own = turn * body.shape.mass.unit_inertia() * turn.inverse();
            let shifted = Matrix3::from_diagonal_element(away.norm_squared()) - away * away.transpose();
            (own + shifted) * mass
        };
        let inertia = parts.iter().map(placed).map(inertia).sum();
        let corners = |(body, ..): (&'a Body, f64, Point3<f64>)| {
            body.shape.hull.iter().map(|p| (body.planning_from_shape * p - centre).norm())
        };
        let reach = parts.iter().map(placed).flat_map(corners).fold(0.0, f64::max);
        HeldBody { centre, mass, inertia, reach, bears: [Vector3::zeros(); 2] }
    }
}

#[cfg(test)]
mod tests;
