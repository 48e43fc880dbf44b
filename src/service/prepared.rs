//! An assembly prepared for the search: its scene, verifier, overlaps and fields.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::cache::RequestCache;
use crate::contact::ShiftCoverCache;
use crate::geometry::Assembly;
use crate::plan::{PairOverlap, Verifier, overlap_key};
use crate::scene::{CongruentPair, HullTree, JoinedHulls, Scene, grouped, resolution};
use crate::sdf::Field;
use crate::search::{PlanSink, Progress, Stage};
use crate::termination::{Interrupt, Termination};

use super::shared_shape::SharedShape;

/// Overlaps smaller than this share of the longest side are rounding, not modelling.
const LEAST_OVERLAP: f64 = 1e-6;
/// Verification refuses paths deeper than this share of the longest side (0.002 where it is 10).
const DEPTH_LIMIT: f64 = 2e-4;

/// An assembly with everything derived from it.
#[derive(Debug)]
pub(super) struct Prepared {
    /// All parts at their assembled poses.
    pub(super) scene: Scene,
    /// The check on the triangles.
    pub(super) verifier: Verifier,
    /// Overlapping pairs and their depths in the planning frame.
    pub(super) overlaps: Vec<(usize, usize, f64)>,
    /// The fields of the shapes.
    fields: Vec<Arc<Field>>,
    /// The time to prepare the verifier and to measure the overlaps.
    pub(super) overlap_time: Duration,
}

impl Prepared {
    /// Measures all overlaps, in parallel on the current rayon pool. Fields are built when they are first used.
    pub(super) fn new(
        assembly: &Assembly,
        shapes: &[Arc<SharedShape>],
        hulls: &Arc<JoinedHulls>,
        termination: &Termination,
        cache: &RequestCache,
    ) -> Result<Self, Interrupt> {
        let fields: Vec<_> = shapes.iter().map(|shape| Arc::clone(&shape.field)).collect();
        let started = Instant::now();
        let mut scene = Scene { hulls: Arc::clone(hulls), ..Scene::assembled(assembly, &fields) };
        let shape_of = assembly.parts.iter().map(|p| p.shape).collect();
        let verifier = Verifier::new(&assembly.shapes, shape_of, depth_limit(assembly));
        let least = LEAST_OVERLAP * scene.longest_side;
        let mut overlaps = Vec::new();
        for (a, b, found) in measure_overlaps(&scene, &verifier, termination, cache)? {
            // Surfaces that coincide are reported, but not allowed.
            if found.surface > least {
                scene.allowed.allow(a, b, found.surface);
            }
            if found.depth() > least {
                overlaps.push((a, b, found.depth()));
            }
        }
        Ok(Self { scene, verifier, overlaps, fields, overlap_time: started.elapsed() })
    }

    /// Builds the fields that are not there yet, in parallel on the current rayon pool.
    pub(super) fn build_fields(
        &self,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<(), Interrupt> {
        let total = self.fields.len() as u32;
        let done = AtomicU32::new(0);
        let report = |sink: &mut dyn PlanSink, done| {
            sink.progress(Progress { stage: Stage::Sdf, done, total, simulations: 0, tried: None });
        };
        report(sink, 0);
        let sink = std::sync::Mutex::new(sink);
        self.fields.par_iter().try_for_each(|field| {
            field.prepare(termination)?;
            let n = done.fetch_add(1, Ordering::Relaxed) + 1;
            if let Ok(mut sink) = sink.lock() {
                report(&mut **sink, n);
            }
            Ok(())
        })
    }

    /// Approximate bytes in memory, without the shapes and their fields.
    pub(super) fn memory(&self) -> usize {
        let Self { scene, verifier, overlaps, .. } = self;
        let hulls = scene.whole.get().map_or(0, HullTree::memory);
        size_of_val(&**scene.bodies)
            + ShiftCoverCache::of(scene).memory()
            + hulls
            + verifier.memory()
            + size_of_val(&**overlaps)
    }
}

/// The depth beyond what is allowed at which paths are refused, in the planning frame.
pub(super) fn depth_limit(assembly: &Assembly) -> f64 {
    DEPTH_LIMIT * resolution(assembly)
}

fn measure_overlaps(
    scene: &Scene,
    verifier: &Verifier,
    termination: &Termination,
    cache: &RequestCache,
) -> Result<Vec<(usize, usize, PairOverlap)>, Interrupt> {
    let pairs = scene.broad_phase.pairs(0.0);
    let placed = |&(a, b): &(usize, usize)| {
        let pair = CongruentPair::turned(scene, a, b);
        (overlap_key(scene, &pair), pair)
    };
    let keyed: Vec<_> = pairs.par_iter().map(placed).collect();
    let (first, group_of) = grouped(keyed.iter().map(|(key, _)| *key));
    // One pair per task: most depths are cached, and two that are not must not run one after the other on a thread.
    let depths = first
        .par_iter()
        .with_max_len(1)
        .map(|&i| {
            let (key, pair) = &keyed[i];
            cache.get_or(*key, || verifier.overlap(scene, pair, termination))
        })
        .collect::<Result<Vec<_>, Interrupt>>()?;
    Ok(pairs.into_iter().zip(group_of).map(|((a, b), group)| (a, b, depths[group])).collect())
}
