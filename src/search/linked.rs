//! Parts that are linked, as two links of a chain: a proof that neither leaves while both are there.
//!
//! If a closed curve on one body and one on another have a linking number other than 0, no motion
//! that keeps the bodies from entering each other separates them. Guarantees: no part is called
//! linked that could leave. Not found are links of open or crossing meshes, of parts that overlap,
//! of more holes than are looked at, of curves that come too close to each other, and whatever is
//! held without being linked, as a ball in a cage.

use nalgebra::Point3;

use crate::geometry::{linking_number, surface_loops};
use crate::simulation::Scene;

use super::sbdp::Search;

/// Two per hole.
const MOST_LOOPS: usize = 64;
/// Pairs of loop segments that are looked at for one pair of parts.
const MOST_SEGMENT_PAIRS: usize = 4_000_000;
/// Curves that come closer than this, in the planning frame, might meet by what engines tolerate.
const CLEARANCE: f64 = 2e-3;

/// Per part: those that it is linked with.
#[derive(Debug, Default)]
pub(super) struct Links(Vec<Vec<usize>>);

impl Links {
    /// Among some parts (ascending).
    pub(super) fn among(scene: &Scene, parts: &[usize]) -> Self {
        let loops: Vec<Vec<Vec<Point3<f64>>>> = parts.iter().map(|&p| loops(scene, p)).collect();
        let mut links = vec![Vec::new(); scene.bodies.len()];
        for (i, &a) in parts.iter().enumerate() {
            for (j, &b) in parts.iter().enumerate().skip(i + 1) {
                let near = scene.bodies[a].bounds.meets(&scene.bodies[b].bounds);
                if near && scene.allowances.of(a, b) == 0.0 && are_linked(&loops[i], &loops[j]) {
                    links[a].push(b);
                    links[b].push(a);
                }
            }
        }
        Self(links)
    }

    /// One of some parts (ascending) that a part is linked with.
    pub(super) fn holder(&self, part: usize, among: &[usize]) -> Option<usize> {
        self.0.get(part)?.iter().copied().find(|p| among.binary_search(p).is_ok())
    }
}

impl Search<'_, '_> {
    /// Looks, once, which of the parts that stand are linked; true if any is. Beyond the paper.
    pub(super) fn find_links(&mut self) -> bool {
        if self.links.is_some() || self.separate_lists || !self.guided {
            return false;
        }
        let (scene, standing) = (&self.disassembly.problem.scene, self.disassembly.everything.standing());
        let links = Links::among(scene, standing);
        let any = standing.iter().any(|&p| links.holder(p, standing).is_some());
        self.links = Some(links);
        any
    }

    /// A part that stands and is linked with this one.
    pub(super) fn linked_with(&self, part: usize) -> Option<usize> {
        self.links.as_ref()?.holder(part, self.disassembly.everything.standing())
    }
}

/// Curves that generate all on a part's surface, as it stands.
fn loops(scene: &Scene, part: usize) -> Vec<Vec<Point3<f64>>> {
    let body = &scene.bodies[part];
    let mut loops = surface_loops(&body.shape.surface, MOST_LOOPS).unwrap_or_default();
    for p in loops.iter_mut().flatten() {
        *p = body.planning_from_shape * *p;
    }
    loops
}

fn are_linked(a: &[Vec<Point3<f64>>], b: &[Vec<Point3<f64>>]) -> bool {
    let segments = |loops: &[Vec<Point3<f64>>]| loops.iter().map(Vec::len).sum::<usize>();
    let linked = |(a, b): (&Vec<_>, &Vec<_>)| linking_number(a, b, CLEARANCE).is_some_and(|n| n != 0);
    segments(a) * segments(b) <= MOST_SEGMENT_PAIRS
        && a.iter().flat_map(|a| b.iter().map(move |b| (a, b))).any(linked)
}
