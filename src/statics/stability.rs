//! How bodies are held: by contact alone, by friction, or by hands.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::equilibrium::{Balance, ContactKey, Falling, HeldContact, System, Velocity};
use super::{Connected, Statics};
use crate::budgets::{HOLDING_SETS, SIDEWAYS_DIRECTIONS};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{BALANCED, FALL_SHARE, FRICTION_PRECISION, FRICTION_ROOM, HELD_SHARE};

/// How the parts of a state are held.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stability {
    /// The least coefficient of friction with which all that does not fall stands: 0 where contacts alone hold it.
    pub needs_friction: f64,
    /// The share of the weight that may act sideways, in the worst of eight directions, until something falls: 0 is a
    /// pencil on its tip, 1 withstands 45 degrees. `None` where something falls as it is, nothing is free, or it is not wanted.
    pub margin: Option<f64>,
    /// What falls, by bodies that are connected with each other.
    pub unstable: Vec<Unstable>,
    /// Parts of which it is not known whether they are held: the solver gave no answer that passes its check.
    pub unknown: Vec<usize>,
}

/// Connected parts of which some fall.
#[derive(Debug, Clone, PartialEq)]
pub struct Unstable {
    /// What falls.
    pub falls: Vec<Fall>,
    /// Sets of parts, each of which is enough to hold, the smallest ones that were found.
    pub hold: Vec<Vec<usize>>,
    /// Forces exist that would hold all of them, but only if something pressed the contacts together that does not: a
    /// block between two walls.
    pub needs_clamping: bool,
}

/// A part that falls.
#[derive(Debug, Clone, PartialEq)]
pub struct Fall {
    /// The part.
    pub part: usize,
    /// The unit vector along which its centre of mass would begin to move if nothing rubbed.
    pub direction: [f64; 3],
}

impl Stability {
    /// That of several answers together.
    pub(super) fn of(answers: &[Arc<Self>]) -> Self {
        let mut all = Self::default();
        for answer in answers {
            all.needs_friction = all.needs_friction.max(answer.needs_friction);
            all.margin = match (all.margin, answer.margin) {
                (Some(one), Some(other)) => Some(one.min(other)),
                (one, other) => one.or(other),
            };
            all.unstable.extend(answer.unstable.iter().cloned());
            all.unknown.extend(&answer.unknown);
        }
        if !all.stands() {
            all.margin = None;
        }
        all.unknown.sort_unstable();
        all
    }

    /// Whether all is known to stand.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.unstable.is_empty() && self.unknown.is_empty()
    }

    /// The parts that fall.
    #[must_use]
    pub fn falling(&self) -> Vec<usize> {
        self.unstable.iter().flat_map(|unstable| unstable.falls.iter().map(|fall| fall.part)).collect()
    }

    /// The number of parts that have to be held at once, or are not known to stand.
    #[must_use]
    pub fn trouble(&self) -> usize {
        self.hands() + self.unknown.len()
    }

    /// The number of parts that have to be held at once.
    #[must_use]
    pub fn hands(&self) -> usize {
        self.unstable.iter().map(|unstable| unstable.hold.first().map_or(0, Vec::len)).sum()
    }
}

/// How bodies stand without regard to the least friction.
enum Standing {
    /// By contact alone, whatever the friction.
    Smooth(Vec<Vector3<f64>>),
    /// By friction, with these forces.
    Rubbing(Vec<Vector3<f64>>),
    /// With a motion that begins.
    Falls {
        motion: Vec<Velocity>,
        needs_clamping: bool,
    },
    Unknown,
}

impl Standing {
    /// That of a few bodies, asked all at once.
    fn of(system: &System, friction: f64) -> Result<Self, Interrupt> {
        let smooth = match system.balance(0.0, &Vector3::zeros())? {
            Balance::Held(forces) => return Ok(Self::Smooth(forces)),
            Balance::Falls(falling) => falling.velocities,
            Balance::Unknown => return Ok(Self::Unknown),
        };
        Ok(match system.balance(friction, &Vector3::zeros())? {
            Balance::Held(forces) if system.is_held_elastically(friction)? => Self::Rubbing(forces),
            Balance::Held(_) => Self::Falls { motion: smooth, needs_clamping: true },
            Balance::Falls(Falling { velocities: motion, .. }) => {
                Self::Falls { motion, needs_clamping: false }
            }
            Balance::Unknown => Self::Unknown,
        })
    }
}

/// How connected bodies are held.
///
/// Without friction most are held. What is not is loose, and is judged by itself with all else fixed: what falls then
/// falls; what stands leans on the others, which have to bear it.
pub(super) fn answer(
    statics: &mut Statics<'_>,
    connected: &Connected,
    termination: &Termination,
) -> Result<Stability, Interrupt> {
    let system = statics.system(connected, termination);
    let (friction, is_wanted) = (statics.friction, statics.margins);
    let margin = |system: &System| match is_wanted {
        true => margin(system, friction).map(Some),
        false => Ok(None),
    };
    let Smooth { loose, forces } = match smooth(statics, connected, &system, termination)? {
        Some(smooth) if smooth.loose.contains(&true) => smooth,
        Some(_) => return Ok(Stability { margin: margin(&system)?, ..Stability::default() }),
        None => return Ok(Stability { unknown: connected.bodies.concat(), ..Stability::default() }),
    };
    let mut found = Stability::default();
    let mut held: HashMap<ContactKey, Vector3<f64>> = forces.into_iter().collect();
    let (mut fixed, mut leaning) = (BTreeSet::new(), BTreeSet::new());
    for loose in statics.loose(connected, &loose) {
        let judged = match statics.known_loose.get(&loose) {
            Some(judged) => Arc::clone(judged),
            None => Arc::new(judged(statics, &loose, termination)?),
        };
        statics.known_loose.insert(loose.clone(), Arc::clone(&judged));
        match &*judged {
            Loose::Stands { friction, forces } => {
                found.needs_friction = found.needs_friction.max(*friction);
                held.extend(forces.iter().copied());
                leaning.extend(loose.bodies);
                continue;
            }
            Loose::Falls(unstable) => found.unstable.push(unstable.clone()),
            Loose::Unknown => found.unknown.extend(loose.bodies.concat()),
        }
        fixed.extend(loose.bodies);
    }
    // What falls is taken as held: then all else has to bear what leans on it, without friction or all together with it.
    let rest = connected.without(&fixed);
    let others = statics.system(&rest, termination);
    let given: Vec<_> =
        others.contacts.iter().map(|c| held.get(&c.key).copied().unwrap_or_default()).collect();
    let bears: Vec<bool> = rest.bodies.iter().map(|body| !leaning.contains(body)).collect();
    let (bearing, places) = others.around(&bears, &given);
    if bearing.mended(places.into_iter().map(|place| given[place]).collect(), 0.0)?.is_none() {
        match Standing::of(&others, friction)? {
            Standing::Smooth(_) => {}
            Standing::Rubbing(_) => found.needs_friction = least_friction(&others, friction)?,
            Standing::Falls { motion, needs_clamping } => {
                found.unstable.push(unstable(statics, &rest, &motion, needs_clamping, termination)?);
            }
            Standing::Unknown => found.unknown.extend(rest.bodies.concat()),
        }
    }
    if found.stands() {
        found.margin = margin(&system)?;
    }
    Ok(found)
}

/// Bodies of which all beside them stays.
#[derive(Debug)]
pub(super) enum Loose {
    /// They stand with this friction at least, by these forces.
    Stands {
        friction: f64,
        forces: Vec<(ContactKey, Vector3<f64>)>,
    },
    Falls(Unstable),
    Unknown,
}

fn judged(statics: &Statics<'_>, loose: &Connected, termination: &Termination) -> Result<Loose, Interrupt> {
    let system = statics.system(loose, termination);
    Ok(match Standing::of(&system, statics.friction)? {
        Standing::Smooth(held) => Loose::Stands { friction: 0.0, forces: keyed(&system, held).collect() },
        Standing::Rubbing(held) => {
            let friction = least_friction(&system, statics.friction)?;
            // What leans on others rubs no more than it has to.
            let held = match system.balance(friction * FRICTION_ROOM, &Vector3::zeros())? {
                Balance::Held(held) => held,
                Balance::Falls(_) | Balance::Unknown => held,
            };
            Loose::Stands { friction, forces: keyed(&system, held).collect() }
        }
        Standing::Falls { motion, needs_clamping } => {
            Loose::Falls(unstable(statics, loose, &motion, needs_clamping, termination)?)
        }
        Standing::Unknown => Loose::Unknown,
    })
}

/// Forces by the keys of the contacts.
fn keyed(system: &System, forces: Vec<Vector3<f64>>) -> impl Iterator<Item = (ContactKey, Vector3<f64>)> {
    system.contacts.iter().map(|contact| contact.key).zip(forces)
}

/// What holds connected bodies if nothing rubs.
struct Smooth {
    /// By body: whether nothing holds it.
    loose: Vec<bool>,
    /// What holds the others.
    forces: Vec<(ContactKey, Vector3<f64>)>,
}

/// What holds connected bodies if nothing rubs; `None` if the solver found no answer.
///
/// What is not held although all beside it stays is loose: with less to lean on, less is held. So is what is not held
/// without those. If all the rest is held, that is the answer, and little was asked that other states have not asked.
/// A body that counts as loose although it is held does no harm: what is loose is judged anew.
fn smooth(
    statics: &mut Statics<'_>,
    connected: &Connected,
    system: &System,
    termination: &Termination,
) -> Result<Option<Smooth>, Interrupt> {
    let mut loose = vec![false; connected.bodies.len()];
    loop {
        let rest = connected.unmarked(&loose);
        let mut found = loose.clone();
        for (body, loose) in connected.bodies.iter().zip(&mut found) {
            *loose = *loose || !is_held_alone(statics, &rest, body, termination)?;
        }
        if found == loose {
            break;
        }
        loose = found;
    }
    let is_any_loose = loose.contains(&true);
    let rest = is_any_loose.then(|| statics.system(&connected.unmarked(&loose), termination));
    let others = rest.as_ref().unwrap_or(system);
    let balance = match held_smoothly(others, &mut statics.forces)? {
        Balance::Held(forces) => {
            return Ok(Some(Smooth { loose, forces: keyed(others, forces).collect() }));
        }
        _ if is_any_loose => system.balance(0.0, &Vector3::zeros())?,
        balance => balance,
    };
    Ok(match balance {
        Balance::Held(forces) => {
            Some(Smooth { loose: vec![false; loose.len()], forces: keyed(system, forces).collect() })
        }
        Balance::Falls(falling) => {
            let loose = is_loose(&falling, &statics.down);
            Some(Smooth { loose, forces: keyed(system, falling.forces).collect() })
        }
        Balance::Unknown => None,
    })
}

/// Whether contacts alone hold a body if all beside it stays.
fn is_held_alone(
    statics: &mut Statics<'_>,
    connected: &Connected,
    body: &[usize],
    termination: &Termination,
) -> Result<bool, Interrupt> {
    let alone = statics.alone(connected, body);
    if let Some(held) = statics.known_alone.get(&alone) {
        return Ok(*held);
    }
    let held = is_held(&statics.system(&alone, termination), 0.0, &Vector3::zeros())?;
    statics.known_alone.insert(alone, held);
    Ok(held)
}

/// Whether bodies are held without friction. The forces of the last state that was held hold most of them, and are
/// replaced by those that hold these.
fn held_smoothly(
    system: &System,
    last: &mut HashMap<ContactKey, Vector3<f64>>,
) -> Result<Balance, Interrupt> {
    let known = |contact: &HeldContact| last.get(&contact.key).copied();
    let given = system.contacts.iter().map(|contact| known(contact).unwrap_or_default()).collect();
    let is_begun = system.contacts.iter().any(|contact| known(contact).is_some());
    let mended = if is_begun { system.mended(given, 0.0)? } else { None };
    let found = match mended {
        Some(held) => Balance::Held(held),
        None => system.balance(0.0, &Vector3::zeros())?,
    };
    if let Balance::Held(held) = &found {
        last.extend(keyed(system, held.clone()));
    }
    Ok(found)
}

/// By body: whether not all of its weight is held without friction, or it moves down with what is not.
fn is_loose(smooth: &Falling, down: &Vector3<f64>) -> Vec<bool> {
    let fall = |velocity: &Velocity| velocity.linear.dot(down);
    let fastest = smooth.velocities.iter().map(fall).fold(0.0, f64::max);
    let of = smooth.velocities.iter().zip(&smooth.shares);
    of.map(|(velocity, share)| *share <= 1.0 - HELD_SHARE || fall(velocity) > FALL_SHARE * fastest).collect()
}

/// What of connected bodies falls, and what to hold.
fn unstable(
    statics: &Statics<'_>,
    connected: &Connected,
    motion: &[Velocity],
    needs_clamping: bool,
    termination: &Termination,
) -> Result<Unstable, Interrupt> {
    let fall = |body: usize| motion[body].linear.dot(&statics.down);
    let fastest = (0..motion.len()).map(fall).fold(0.0, f64::max);
    let falling: Vec<usize> = (0..motion.len()).filter(|&body| fall(body) > FALL_SHARE * fastest).collect();
    let begins = statics.system(connected, termination).beginning()?;
    let mut falls = Vec::new();
    for &body in &falling {
        // Motions that are free are many; where what falls does not begin to, as one part of it wedges another, any will do.
        let begins = begins.as_ref().map(|begins| begins[body]).filter(|a| a.dot(&statics.down) > BALANCED);
        let direction = begins.unwrap_or(motion[body].linear).normalize().into();
        falls.extend(connected.bodies[body].iter().map(|&part| Fall { part, direction }));
    }
    falls.sort_by_key(|fall| fall.part);
    let hold = holding(statics, connected, &falling, termination)?;
    Ok(Unstable { falls, hold, needs_clamping })
}

/// The least coefficient of friction with which bodies stand that stand with a greater one.
fn least_friction(system: &System, enough: f64) -> Result<f64, Interrupt> {
    let least = |low: f64, holds: &dyn Fn(f64) -> Result<bool, Interrupt>| {
        let (mut low, mut high) = (low, enough);
        while high - low > FRICTION_PRECISION * enough {
            let middle = (low + high) / 2.0;
            if holds(middle)? { high = middle } else { low = middle }
        }
        Ok(high)
    };
    let found = least(0.0, &|friction| is_held(system, friction, &Vector3::zeros()))?;
    let room = found * FRICTION_ROOM;
    // Close to the least friction slips take long to settle.
    if room >= enough || system.is_held_elastically(room)? {
        return Ok(found);
    }
    least(room, &|friction| system.is_held_elastically(friction))
}

fn is_held(system: &System, friction: f64, sideways: &Vector3<f64>) -> Result<bool, Interrupt> {
    Ok(matches!(system.balance(friction, sideways)?, Balance::Held(_)))
}

/// The share of the weight that may act sideways.
fn margin(system: &System, friction: f64) -> Result<f64, Interrupt> {
    let across = system.down.cross(&Vector3::ith(system.down.iamin(), 1.0)).normalize();
    let other = system.down.cross(&across);
    let mut least = 1.0;
    for i in 0..SIDEWAYS_DIRECTIONS {
        let (sine, cosine) = (std::f64::consts::TAU * i as f64 / SIDEWAYS_DIRECTIONS as f64).sin_cos();
        let direction = across * cosine + other * sine;
        let holds = |share: f64| is_held(system, friction, &(direction * share));
        if holds(least)? {
            continue;
        }
        let mut low = 0.0;
        while least - low > FRICTION_PRECISION {
            let middle = (low + least) / 2.0;
            if holds(middle)? { low = middle } else { least = middle }
        }
        least = low;
    }
    Ok(least)
}

/// The smallest sets of bodies that have to be held, each by one of its parts, the heaviest: of those that fall and those
/// that touch them. A lid that stands by itself may have to be held against what it keeps in.
fn holding(
    statics: &Statics<'_>,
    connected: &Connected,
    falling: &[usize],
    termination: &Termination,
) -> Result<Vec<Vec<usize>>, Interrupt> {
    let volume = |part: &usize| statics.scene.bodies[*part].shape.mass.volume;
    let heaviest = |body: &usize| {
        let parts = &connected.bodies[*body];
        parts.iter().copied().max_by(|a, b| volume(a).total_cmp(&volume(b)).then(b.cmp(a)))
    };
    let named = |held: &[usize]| held.iter().filter_map(heaviest).collect::<Vec<_>>();
    let is_enough = |held: &[usize]| {
        let held = held.iter().map(|&body| connected.bodies[body].clone()).collect();
        let rest = connected.without(&held);
        if rest.bodies.is_empty() {
            return Ok(true);
        }
        let rest = statics.system(&rest, termination);
        let standing = Standing::of(&rest, statics.friction)?;
        Ok::<_, Interrupt>(matches!(standing, Standing::Smooth(_) | Standing::Rubbing(_)))
    };
    let falls: Vec<bool> = (0..connected.bodies.len()).map(|body| falling.contains(&body)).collect();
    let near = statics.system(connected, termination).with_neighbours(&falls);
    let near: Vec<usize> = (0..near.len()).filter(|&body| near[body]).collect();
    // One after the other is let go, light ones first, where the rest is enough. Where it is not, one of those that were let
    // go has to be held, or this one.
    let (mut held, mut needed) = (near.clone(), Vec::new());
    let mut by_weight = near.clone();
    let weight = |body: usize| connected.bodies[body].iter().map(volume).sum::<f64>();
    by_weight.sort_by(|&a, &b| weight(a).total_cmp(&weight(b)));
    for body in by_weight {
        let rest: Vec<usize> = held.iter().copied().filter(|&other| other != body).collect();
        // They fall if nobody holds any.
        if !rest.is_empty() && is_enough(&rest)? {
            held = rest;
        } else {
            needed.push(near.iter().copied().filter(|other| !rest.contains(other)).collect::<Vec<_>>());
        }
    }
    let singles = near.iter().map(|&body| vec![body]);
    let pairs = (0..near.len()).flat_map(|i| near[i + 1..].iter().map(move |&other| (i, other)));
    let pairs = pairs.map(|(i, other)| vec![near[i], other]);
    let meets = |set: &[usize], all: &[usize]| all.iter().any(|body| set.contains(body));
    for sets in [singles.collect::<Vec<_>>(), pairs.collect()] {
        let sets: Vec<_> = sets
            .into_iter()
            .filter(|set| set.len() <= held.len() && needed.iter().all(|all| meets(set, all)))
            .collect();
        if sets.len() > HOLDING_SETS {
            continue;
        }
        let asked = sets.into_par_iter().map(|set| Ok((set == held || is_enough(&set)?, set)));
        let asked = asked.collect::<Result<Vec<_>, Interrupt>>()?;
        let found: Vec<_> =
            asked.iter().filter(|(is_enough, _)| *is_enough).map(|(_, set)| named(set)).collect();
        if !found.is_empty() {
            return Ok(found);
        }
    }
    Ok(vec![named(&held)])
}
