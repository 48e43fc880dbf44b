//! What is remembered of scenes: joined hulls (`hull`); and what keys of the stages above have of bodies.

mod hull;

pub(crate) use hull::HULL;

use crate::cache::Digest;
use crate::geometry::{add_bounds, add_pose};

use super::{Body, CongruentPair, Scene};

/// Adds how two parts stand to each other to a key.
pub(crate) fn add_pair(digest: &mut Digest, scene: &Scene, pair: &CongruentPair) {
    for (part, pose) in pair.parts.iter().zip(&pair.poses) {
        digest.hash(scene.bodies[*part].shape.content());
        add_pose(digest, pose);
    }
}

/// Adds the samples that verification added to a body to a key.
pub(crate) fn add_samples(digest: &mut Digest, body: &Body) {
    let points = body.extra_samples.points();
    digest.integer(points.len() as u64);
    points.iter().for_each(|p| {
        digest.numbers(p.iter().copied());
    });
}

/// Adds a part that stands to a key, and how deep another may overlap it.
pub(crate) fn add_standing(digest: &mut Digest, scene: &Scene, part: usize, standing: usize) {
    let body = &scene.bodies[standing];
    digest.hash(body.shape.content());
    add_pose(digest, &body.planning_from_shape);
    add_bounds(digest, &body.bounds);
    digest.numbers([scene.allowed.of(part, standing)]);
}
