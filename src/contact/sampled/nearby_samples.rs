//! Gathers the samples of one surface that are near another, with the other's distance field or without it.

use std::cell::Cell;

use nalgebra::Point3;

use crate::budgets::{LONG_STEPS_PER_POLL, SHORT_STEPS_PER_POLL};
use crate::geometry::{Closest, Pose, SampleTree};
use crate::scene::Body;
use crate::sdf::Grid;
use crate::termination::{Interrupt, Poll, Termination};

use super::{Contact, ContactSet};

/// The body that samples are measured against.
pub(super) struct MeasuredBody<'m> {
    pub(super) body: &'m Body,
    pub(super) to_measured: &'m Pose,
    pub(super) allowed: f64,
    pub(super) reach: f64,
}

/// With the body's distance field.
pub(super) fn gather(
    tree: &SampleTree,
    measured: &MeasuredBody<'_>,
    termination: Option<&Termination>,
    near: &mut ContactSet,
    tag: impl Fn(Point3<f64>, f64, Closest) -> Contact,
) -> Result<(), Interrupt> {
    let MeasuredBody { body, to_measured, allowed, reach } = *measured;
    // The field's bound holds outside alone, so it excludes nothing that is deeper than zero.
    let limit = (reach - allowed).max(0.0);
    let field: &Grid = &body.field;
    let clearance = Cell::new(near.clearance);
    let keep = |bound: f64| clearance.set(clearance.get().min(bound + allowed));
    // The first node of samples that comes near a large surface fills that surface's field.
    let poll = Poll::every(1, termination);
    let sample_poll = Poll::every(LONG_STEPS_PER_POLL, termination);
    tree.walk(
        (),
        |node, ()| {
            poll.check()?;
            let bound = field.estimate(&(to_measured * node.centre)).lower_bound - node.radius;
            if bound > limit {
                keep(bound);
            }
            Ok((bound <= limit).then_some(()))
        },
        |sample, ()| {
            sample_poll.check()?;
            let p = to_measured * sample;
            let bound = field.estimate(&p).lower_bound;
            if bound > limit {
                keep(bound);
                return Ok(());
            }
            match body.closest(&p, limit) {
                Some((closest, distance)) if distance + allowed < reach => {
                    near.contacts.push(tag(*sample, distance + allowed, closest));
                }
                Some((_, distance)) => keep(distance),
                None => keep(limit),
            }
            Ok(())
        },
    )?;
    near.clearance = clearance.get();
    Ok(())
}

/// The limit on measurements.
#[derive(Clone, Copy)]
pub(super) struct GatherLimits<'t> {
    /// The largest number of measurements …
    pub(super) most: usize,
    /// … of samples whose gap may be smaller than this.
    pub(super) within: f64,
    pub(super) termination: Option<&'t Termination>,
}

/// Without a distance field, in few measurements against the other surface, which must be closed; `None` if more are
/// needed. A signed distance varies by no more than the way between two points, inside as well: for penetrating
/// samples this takes far fewer measurements than fields, whose bounds hold outside alone.
pub(super) fn gather_exactly(
    tree: &SampleTree,
    measured: &MeasuredBody<'_>,
    GatherLimits { most, within, termination }: GatherLimits<'_>,
    near: &mut ContactSet,
    tag: impl Fn(Point3<f64>, f64, Closest) -> Contact,
) -> Result<Option<()>, Interrupt> {
    let MeasuredBody { body, to_measured, allowed, reach } = *measured;
    let bounds = body.shape.surface.bounds();
    let clearance = Cell::new(near.clearance);
    let keep = |gap: f64| clearance.set(clearance.get().min(gap));
    let looks = Cell::new(0);
    let poll = Poll::every(SHORT_STEPS_PER_POLL, termination);
    let look = |p: &Point3<f64>, guess: u32, counts: bool| {
        looks.set(looks.get() + usize::from(counts));
        let (closest, distance) = body.closest_from(p, guess);
        (distance + allowed, closest)
    };
    let is_too_many = || looks.get() > most;
    tree.walk(
        (0, true),
        |node, (guess, counts)| {
            poll.check()?;
            if is_too_many() {
                return Ok(None);
            }
            let p = to_measured * node.centre;
            let apart = bounds.distance(&p);
            if apart > 0.0 && apart + allowed - node.radius >= reach {
                keep(apart + allowed - node.radius);
                return Ok(None);
            }
            let (gap, closest) = look(&p, guess, counts);
            let least = gap - node.radius;
            if least >= reach {
                keep(least);
                return Ok(None);
            }
            Ok(Some((closest.triangle, least < within)))
        },
        |sample, (guess, counts)| {
            poll.check()?;
            if is_too_many() {
                return Ok(());
            }
            let (gap, closest) = look(&(to_measured * sample), guess, counts);
            if gap < reach {
                near.contacts.push(tag(*sample, gap, closest));
            } else {
                keep(gap);
            }
            Ok(())
        },
    )?;
    near.clearance = clearance.get();
    Ok((looks.get() <= most).then_some(()))
}
