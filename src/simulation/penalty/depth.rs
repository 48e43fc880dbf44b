//! The check that no pair gets deeper than the engine declares.
//!
//! Forces follow the interpolated field, which is off by up to 0.87 cells near edges, and contact
//! points are far apart; so what a motion claims is checked by other means: the samples that
//! `sliding` uses, against the triangles. The field only shows which samples need no measurement.

use crate::budgets::SHORT_STEPS_PER_POLL;
use crate::contact::sampled;
use crate::geometry::{Pose, interpolate};
use crate::scene::Body;
use crate::termination::Poll;
use crate::tolerances::{PENALTY_TRAVEL, SAMPLED_DEPTH_SHARE};

use super::contacts::Contacts;
use super::parameters::PenaltyParameters;

/// Whether all pairs keep to their depth between two poses, the first one excluded. Puts the
/// indices of pairs that do not in `deep`.
pub(super) fn holds_between(
    contacts: &Contacts<'_>,
    parameters: &PenaltyParameters,
    from: &Pose,
    to: &Pose,
    deep: &mut Vec<usize>,
) -> bool {
    let body = contacts.body;
    let centre = contacts.scene.centre_in_shape(contacts.part);
    let turn = from.rotation.angle_to(&to.rotation);
    let radius = body.shape.reach + (centre - body.shape.mass.centre).norm();
    let travel = (to * centre - from * centre).norm() + turn * radius;
    let count = (travel / PENALTY_TRAVEL).ceil().max(1.0) as u32;
    (1..=count).all(|k| {
        let between = || interpolate(from, to, &centre, f64::from(k) / f64::from(count));
        let pose = if k == count { *to } else { between() };
        holds(contacts, parameters, &pose, deep)
    })
}

fn holds(
    contacts: &Contacts<'_>,
    parameters: &PenaltyParameters,
    pose: &Pose,
    deep: &mut Vec<usize>,
) -> bool {
    let bounds = contacts.body.shape.bounds().transformed(pose);
    let before = deep.len();
    for (i, pair) in contacts.pairs.iter().enumerate().filter(|(_, p)| p.standing.bounds.meets(&bounds)) {
        let allowed = contacts.scene.allowed.of(contacts.part, pair.other);
        let limit = allowed + parameters.depth_tolerance() * pair.scale * SAMPLED_DEPTH_SHARE;
        let to_standing = pair.standing.planning_from_shape.inverse() * pose;
        let is_deep = is_deeper(contacts.body, pair.standing, &to_standing, limit)
            || is_deeper(pair.standing, contacts.body, &to_standing.inverse(), limit);
        if is_deep {
            deep.push(i);
        }
    }
    deep.len() == before
}

/// Whether a sample of one body is deeper than `limit` in the other.
fn is_deeper(sampled: &Body, measured: &Body, to_measured: &Pose, limit: f64) -> bool {
    // Without a condition nothing interrupts.
    let poll = Poll::every(SHORT_STEPS_PER_POLL, None);
    let is_deeper = |samples| sampled::is_deeper(samples, measured, to_measured, limit, &poll) == Ok(true);
    is_deeper(sampled.shape.samples()) || is_deeper(&sampled.extra_samples)
}
