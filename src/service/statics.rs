//! How the parts of an assembly stand in some of its states.

use std::collections::BTreeSet;

use crate::geometry::{Assembly, Pose};
use crate::scene::Scene;
use crate::simulation::NullTwist;
use crate::statics::{Stability, Statics, StaticsOptions};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{CLEARANCE_REACH, LEAST_PITCH};

/// A state whose stability is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct StandingState {
    /// The parts that stand, ascending, and the motion of each from its assembled pose (input frame): the identity, unless
    /// it was moved aside.
    pub parts: Vec<(usize, Pose)>,
    /// The parts that stay whatever happens: the base, what is fixed.
    pub stays: Vec<usize>,
}

/// States with the same parts aside.
struct SamePlaces {
    /// These parts, and how they have moved.
    aside: Vec<(usize, Pose)>,
    /// The numbers of the states.
    states: Vec<usize>,
}

/// How each of some states is held. Parts that are screwed are one body with those that they share a thread with.
pub(super) fn stabilities(
    assembly: &Assembly,
    scene: &Scene,
    options: &StaticsOptions,
    states: &[StandingState],
    screwed: &BTreeSet<usize>,
    termination: &Termination,
) -> Result<Vec<Stability>, Interrupt> {
    let mut answers = vec![Stability::default(); states.len()];
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
        let aside: Vec<(usize, Pose)> = aside
            .iter()
            .map(|(part, motion)| {
                (*part, scaled(motion, assembly.scale) * scene.bodies[*part].planning_from_shape)
            })
            .collect();
        let scene = scene.with_placed(&aside);
        let mut statics = Statics::of(&scene, assembly, options, termination)?;
        for [a, b] in statics.touching().collect::<Vec<_>>() {
            if (screwed.contains(&a) || screwed.contains(&b)) && shares_thread(&scene, a, b, termination)? {
                statics.join(a, b);
            }
        }
        for i in members {
            let standing: Vec<usize> = states[i].parts.iter().map(|(part, _)| *part).collect();
            answers[i] = statics.stability(&standing, &states[i].stays, termination)?;
        }
    }
    Ok(answers)
}

/// A motion of the input's frame in the planning frame.
fn scaled(motion: &Pose, scale: f64) -> Pose {
    Pose { translation: (motion.translation.vector * scale).into(), ..*motion }
}

/// Whether contact leaves two parts a helix to move along each other.
fn shares_thread(scene: &Scene, a: usize, b: usize, termination: &Termination) -> Result<bool, Interrupt> {
    let pose = &scene.bodies[a].planning_from_shape;
    let (twist, _) = NullTwist::of(scene, a, pose, &[b], CLEARANCE_REACH, termination)?;
    let rise = twist.and_then(|twist| twist.rise);
    Ok(rise.is_some_and(|rise| rise.abs() * std::f64::consts::TAU > LEAST_PITCH))
}
