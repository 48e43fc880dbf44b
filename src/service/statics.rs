//! How the parts of an assembly stand in some of its states.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use crate::fasteners::Fastener;
use crate::geometry::{Assembly, Pose, scaled_pose};
use crate::scene::Scene;
use crate::simulation::NullTwist;
use crate::statics::{Stability, Statics, StaticsOptions};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{CLEARANCE_REACH, JOINED_OVERLAP, LEAST_PITCH};

/// A state whose stability is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct StandingState {
    /// The parts that stand, ascending, and the motion of each from its assembled pose (input frame): the identity, unless
    /// it was moved aside.
    pub parts: Vec<(usize, Pose)>,
    /// The parts that stay whatever happens: the base, what is fixed.
    pub stays: Vec<usize>,
}

/// How some states stand.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StaticsQuery {
    /// What the answers depend on besides the parts.
    pub options: StaticsOptions,
    /// The states.
    pub states: Vec<StandingState>,
    /// Parts that a plan screws off: they are joined to those that they share a thread with.
    pub screwed: BTreeSet<usize>,
    /// Pairs that are joined, whatever their shapes say.
    pub join: Vec<[usize; 2]>,
    /// Pairs that are not.
    pub apart: Vec<[usize; 2]>,
}

/// The answer to a [`StaticsQuery`].
#[derive(Debug, Clone, PartialEq)]
pub struct StaticsAnswer {
    /// The pairs (the smaller number first) that are joined in some of the states, ascending.
    pub joints: BTreeMap<[usize; 2], JointKind>,
    /// By state, how it is held.
    pub states: Vec<Stability>,
}

/// Why two parts count as one body while both stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// It was asked for.
    Named,
    /// They overlap as assembled: a press fit, or a thread drawn as a cylinder.
    Overlap,
    /// One is a nut or a screw by its shape, and the other has the rod or the hole for it.
    Fastener,
    /// The plan screws one of them off, and their contacts leave only a helix.
    Thread,
}

/// Whether a path turns its part by more than half a turn: off a thread, as far as contacts show one.
#[must_use]
pub fn is_screwed_off(path: &[Pose]) -> bool {
    let turns = path.windows(2).map(|pair| pair[0].rotation.angle_to(&pair[1].rotation));
    turns.sum::<f64>() > std::f64::consts::PI
}

/// States with the same parts aside.
struct SamePlaces {
    /// These parts, and how they have moved.
    aside: Vec<(usize, Pose)>,
    /// The numbers of the states.
    states: Vec<usize>,
}

/// How each of some states is held.
pub(super) fn answer(
    assembly: &Assembly,
    scene: &Scene,
    query: &StaticsQuery,
    termination: &Termination,
) -> Result<StaticsAnswer, Interrupt> {
    let StaticsQuery { options, states, .. } = query;
    let mut answer =
        StaticsAnswer { joints: BTreeMap::new(), states: vec![Stability::default(); states.len()] };
    let fasteners = fasteners(assembly);
    // They share what is found about their contacts.
    let mut places: Vec<SamePlaces> = Vec::new();
    for (i, state) in states.iter().enumerate() {
        let aside: Vec<(usize, Pose)> =
            state.parts.iter().filter(|(_, motion)| *motion != Pose::identity()).copied().collect();
        match places.iter_mut().find(|places| places.aside == aside) {
            Some(places) => places.states.push(i),
            None => places.push(SamePlaces { aside, states: vec![i] }),
        }
    }
    for SamePlaces { aside, states: members } in places {
        let places: Vec<(usize, Pose)> = aside
            .iter()
            .map(|(part, motion)| {
                (*part, scaled_pose(motion, assembly.scale) * scene.bodies[*part].planning_from_shape)
            })
            .collect();
        let scene = scene.with_placed(&places);
        let fastener = |part: usize| fasteners[assembly.parts[part].shape].as_ref();
        // What is moved aside does not overlap as it did, but with what was moved along.
        let motion = |part: usize| aside.iter().find(|(moved, _)| *moved == part).map(|(_, motion)| motion);
        let is_assembled = |[a, b]: [usize; 2]| motion(a) == motion(b);
        let joints = joints(&scene, query, fastener, is_assembled, termination)?;
        let joined = joints.keys().copied().collect();
        let mut statics = Statics::of(&scene, assembly, options, joined, termination)?;
        for i in members {
            let standing: Vec<usize> = states[i].parts.iter().map(|(part, _)| *part).collect();
            answer.states[i] = statics.stability(&standing, &states[i].stays, termination)?;
        }
        answer.joints.extend(joints);
    }
    Ok(answer)
}

/// How parts stand in states that are asked for one after the other. No part is moved aside.
#[derive(Debug)]
pub struct StandingSession<'a> {
    statics: Statics<'a>,
    stays: &'a [usize],
    termination: &'a Termination,
}

impl<'a> StandingSession<'a> {
    /// With what stays in the first state of a query.
    pub(super) fn new(
        assembly: &Assembly,
        scene: &'a Scene,
        query: &'a StaticsQuery,
        termination: &'a Termination,
    ) -> Result<Self, Interrupt> {
        let fasteners = fasteners(assembly);
        let fastener = |part: usize| fasteners[assembly.parts[part].shape].as_ref();
        let joined = joints(scene, query, fastener, |_| true, termination)?.into_keys().collect();
        let statics = Statics::of(scene, assembly, &query.options, joined, termination)?;
        let stays = query.states.first().map_or(&[][..], |state| &state.stays);
        Ok(Self { statics, stays, termination })
    }

    /// How the parts that stand (ascending) are held.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn stability(&mut self, standing: &[usize]) -> Result<Stability, Interrupt> {
        self.statics.stability(standing, self.stays, self.termination)
    }
}

/// The fastener of each shape, if it is one.
pub(super) fn fasteners(assembly: &Assembly) -> Vec<Option<Fastener>> {
    assembly.shapes.par_iter().map(|shape| Fastener::of(&shape.surface)).collect()
}

/// The pairs that are joined as the parts stand.
fn joints<'f>(
    scene: &Scene,
    query: &StaticsQuery,
    fastener: impl Fn(usize) -> Option<&'f Fastener> + Sync,
    is_assembled: impl Fn([usize; 2]) -> bool + Sync,
    termination: &Termination,
) -> Result<BTreeMap<[usize; 2], JointKind>, Interrupt> {
    let has = |pairs: &[[usize; 2]], [a, b]: [usize; 2]| pairs.contains(&[a, b]) || pairs.contains(&[b, a]);
    let is_screwed = |[f, other]: [usize; 2]| {
        let [of, at] = [f, other].map(|part| &scene.bodies[part]);
        let pose = at.planning_from_shape.inverse() * of.planning_from_shape;
        fastener(f).is_some_and(|fastener| fastener.is_screwed_to(&at.shape.surface, &pose))
    };
    let kind = |pair: [usize; 2]| {
        let [a, b] = pair;
        termination.check()?;
        Ok(if has(&query.join, pair) {
            Some(JointKind::Named)
        } else if has(&query.apart, pair) {
            None
        } else if is_assembled(pair) && scene.allowed.of(a, b) > JOINED_OVERLAP {
            Some(JointKind::Overlap)
        } else if is_screwed([a, b]) || is_screwed([b, a]) {
            Some(JointKind::Fastener)
        } else if pair.iter().any(|part| query.screwed.contains(part))
            && shares_thread(scene, pair, termination)?
        {
            Some(JointKind::Thread)
        } else {
            None
        })
    };
    let named = query.join.iter().map(|&[a, b]| [a.min(b), a.max(b)]);
    let pairs: BTreeSet<[usize; 2]> =
        scene.broad_phase.pairs(0.0).into_iter().map(|(a, b)| [a, b]).chain(named).collect();
    let kinds = pairs.into_par_iter().map(|pair| Ok((pair, kind(pair)?)));
    let kinds = kinds.collect::<Result<Vec<_>, Interrupt>>()?;
    Ok(kinds.into_iter().filter_map(|(pair, kind)| Some((pair, kind?))).collect())
}

/// Whether contact leaves two parts a helix to move along each other.
fn shares_thread(scene: &Scene, [a, b]: [usize; 2], termination: &Termination) -> Result<bool, Interrupt> {
    let pose = &scene.bodies[a].planning_from_shape;
    let (twist, _) = NullTwist::of(scene, a, pose, &[b], CLEARANCE_REACH, termination)?;
    let rise = twist.and_then(|twist| twist.rise);
    Ok(rise.is_some_and(|rise| rise.abs() * std::f64::consts::TAU > LEAST_PITCH))
}
