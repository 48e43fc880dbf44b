//! Verification of a path on the triangles, independent of distance fields and engines.
//!
//! For every standing part that the moving one comes near, both surfaces are bounded against each
//! other all along the way ([`depth`](super::depth) says how, and what that guarantees): what counts
//! is depth beyond that of the pair at the assembled pose, which is measured with the same search.
//! Screws of many turns are bounded by their profiles, too ([`screw`](super::screw)), and what
//! neither settles is checked at samples ([`sampling`](super::sampling)).

use std::collections::BTreeMap;
use std::collections::btree_map::Entry::{Occupied, Vacant};
use std::sync::Arc;

use nalgebra::{Point3, Translation3};
use rayon::prelude::*;

use crate::geometry::{Bounds, Pose, Shape, Surface, area_normal};
use crate::simulation::{Allowances, Scene};
use crate::termination::{Interrupt, Termination};

use super::course::{Course, Interval, View};
use super::depth::{Found, MOST_EFFORT, Precision, Question};
use super::sampling::{Samples, turns_far};
use super::screw::{centred, depth_on_screw};

/// Depth that is not looked into, as a share of the limit.
const SPARE: f64 = 1.0 / 16.0;
/// The same where overlap is granted: facets that lie across each other are deep here and there.
const SPARE_IN_OVERLAP: f64 = 1.0 / 4.0;
/// The smallest radius of a piece of surface, likewise.
const FINEST: f64 = 1.0 / 4.0;
/// Entries are no closer to each other than this, as a share of the longest side.
const COARSE: f64 = 4e-3;
/// The same for the overlap of assembled parts. No more is granted than is measured at some point, and
/// no less than nine tenths of what there is ([`depth`](super::depth) tells depths to a tenth), but
/// for what is between the corners of the smallest pieces, which are no larger than this.
const OVERLAP_SPARE: f64 = 2e-6;
const OVERLAP_FINEST: f64 = 1e-4;

/// Directions are alike within this.
const ALIKE: f64 = 1.0 / (1u64 << 40) as f64;

/// A point that got too deep.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The standing part of the pair.
    pub other: usize,
    /// Whether the point is one of the moving part.
    pub on_moving: bool,
    /// The point in the frame of the shape that it lies on.
    pub point: Point3<f64>,
    /// Depth beyond the allowance.
    pub over: f64,
}

/// What the check of a path found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Nothing gets deeper than this beyond the allowances along a good path; 0 if nothing does. Of a
    /// refused one, the deepest that was found before it was given up: it may get deeper.
    pub depth: f64,
    /// Points that got deep along a path that exceeds the limit; empty if the path is good.
    pub entries: Vec<Entry>,
}

impl Verdict {
    /// On a path where nothing but these points gets deeper than `bound` into one part.
    fn past(bound: f64, entries: Vec<Entry>) -> Self {
        Self { depth: deepest(bound, &entries), entries }
    }

    /// Of what was found past each of the parts that stand; entries up to `limit` make a good path and
    /// are dropped.
    #[must_use]
    pub fn of_all(past: Vec<Self>, limit: f64) -> Self {
        let depth = past.iter().map(|v| v.depth).fold(0.0, f64::max);
        let entries =
            if depth <= limit { Vec::new() } else { past.into_iter().flat_map(|v| v.entries).collect() };
        Self { depth, entries }
    }
}

/// The largest of a depth and those of some points.
fn deepest(depth: f64, entries: &[Entry]) -> f64 {
    entries.iter().map(|e| e.over).fold(depth, f64::max)
}

/// What is asked: how deep a part gets into those that stand, along a path of poses of its shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) scene: &'a Scene,
    pub(super) allowances: &'a Allowances,
    pub(super) standing: &'a [usize],
    pub(super) part: usize,
    pub(super) path: &'a [Pose],
    pub(super) termination: &'a Termination,
}

/// The check, prepared for all shapes.
#[derive(Debug, Clone)]
pub struct Verifier {
    /// For what turns far.
    samples: Samples,
    /// Depth beyond the allowance that is still accepted, in the planning frame.
    limit: f64,
}

impl Verifier {
    /// Bytes in memory, of what was prepared so far.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.samples.memory()
    }

    /// Prepares the check for shapes; `shape_of` gives each part's shape.
    #[must_use]
    pub fn new(shapes: &[Arc<Shape>], shape_of: Vec<usize>, limit: f64) -> Self {
        Self { samples: Samples::new(shapes, shape_of), limit }
    }

    /// The same check for an engine that declares another depth.
    #[must_use]
    pub fn with_limit(&self, limit: f64) -> Self {
        Self { limit, samples: self.samples.clone() }
    }

    /// The same check for a scene of two of the parts alone, as parts 0 and 1.
    #[must_use]
    pub fn of_pair(&self, parts: [usize; 2]) -> Self {
        Self { limit: self.limit, samples: self.samples.of_pair(parts) }
    }

    /// The same check for a scene that has every part twice: all of them, and then all of them again.
    #[must_use]
    pub fn twice(&self) -> Self {
        Self { limit: self.limit, samples: self.samples.twice() }
    }

    /// The depth at which a path is refused, in the planning frame.
    #[must_use]
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// How deep two parts overlap at the assembled pose.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn assembled_depth(
        &self,
        scene: &Scene,
        a: usize,
        b: usize,
        termination: &Termination,
    ) -> Result<f64, Interrupt> {
        let precision = Precision {
            spare: OVERLAP_SPARE * scene.longest_side,
            deep: f64::INFINITY,
            finest: OVERLAP_FINEST * scene.longest_side,
            coarse: COARSE * scene.longest_side,
        };
        let path = [scene.bodies[a].planning_from_shape];
        let course = Course::new(&path, scene.centre_in_shape(a), 0.0);
        let allowances = Allowances::none();
        let asked =
            Asked { scene, allowances: &allowances, standing: &[b], part: a, path: &path, termination };
        let way = Way { asked: &asked, course: &course, precision, other: b };
        let side = |on_moving| way.depth_of_side(on_moving, Interval::WHOLE, MOST_EFFORT);
        let (one, other) = rayon::join(|| side(true), || side(false));
        let (one, other) = (one?, other?);
        let depth = one.depth.max(other.depth);
        if !one.open.is_empty() || !other.open.is_empty() {
            return Ok(deepest(depth, &self.samples.entries_along(&asked, self.limit)?));
        }
        Ok(depth)
    }

    /// How deep a point in the middle of one part lies in both, where surfaces show no overlap: two
    /// parts that coincide have none of their surface inside the other.
    #[must_use]
    pub fn coincident_depth(&self, scene: &Scene, a: usize, b: usize) -> f64 {
        let (one, other) = (&scene.bodies[a], &scene.bodies[b]);
        let to_other = other.planning_from_shape.inverse() * one.planning_from_shape;
        let depth = |surface: &Surface, p: &Point3<f64>| -surface.signed_distance(p);
        interior_points(&one.shape.surface)
            .map(|p| depth(&one.shape.surface, &p).min(depth(&other.shape.surface, &(to_other * p))))
            .fold(0.0, f64::max)
    }

    /// A path from where a given one begins to where it ends that turns in the middle of the play of a
    /// thread, if the given one follows a thread. It is no better verified than any.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn centred_on_thread(
        &self,
        scene: &Scene,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Option<Vec<Pose>>, Interrupt> {
        centred(scene, standing, part, path, self.limit, termination)
    }

    /// Checks a path of a part (poses of its shape) among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn check(
        &self,
        scene: &Scene,
        allowances: &Allowances,
        standing: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Verdict, Interrupt> {
        let check = self.along(scene, allowances, part, path, termination);
        let past = |&other: &usize| check.past(other, &check.way_past(other));
        let past: Vec<_> = check.near(standing).par_iter().map(past).collect::<Result<_, _>>()?;
        Ok(Verdict::of_all(past, self.limit))
    }

    /// The check of a path, to be asked part by part of what stands.
    #[must_use]
    pub fn along<'a>(
        &'a self,
        scene: &'a Scene,
        allowances: &'a Allowances,
        part: usize,
        path: &'a [Pose],
        termination: &'a Termination,
    ) -> Check<'a> {
        let centre = scene.centre_in_shape(part);
        let reach = scene.reach(part);
        let swept = path.iter().fold(Bounds::EMPTY, |b, pose| {
            let c = pose * centre;
            b.union(&Bounds { min: c, max: c })
        });
        Check {
            verifier: self,
            asked: Asked { scene, allowances, standing: &[], part, path, termination },
            centre,
            reach,
            swept: swept.grown(reach),
        }
    }
}

/// The check of one path.
#[derive(Debug)]
pub struct Check<'a> {
    verifier: &'a Verifier,
    asked: Asked<'a>,
    /// The point of the shape that moves on a line between waypoints, and how far from it the shape reaches.
    centre: Point3<f64>,
    reach: f64,
    /// Holds the part all along.
    swept: Bounds,
}

impl Check<'_> {
    /// Of the parts that stand, those that the path may meet.
    #[must_use]
    pub fn near(&self, standing: &[usize]) -> Vec<usize> {
        let meets = |o: &usize| self.asked.scene.bodies[*o].bounds.meets(&self.swept);
        standing.iter().copied().filter(meets).collect()
    }

    /// The path up to where the part has passed another for good: its last piece, if it is straight, as
    /// far as their boxes meet. So what is found past it does not depend on how far others reach.
    #[must_use]
    pub fn way_past(&self, other: usize) -> Vec<Pose> {
        let Asked { scene, path, part, .. } = self.asked;
        let mut way = path.to_vec();
        if let [.., from, to] = &mut way[..]
            && from.rotation == to.rotation
            && let Some(direction) = (to.translation.vector - from.translation.vector).try_normalize(0.0)
        {
            // The same to the bit wherever the path ends.
            let direction = direction.map(|x| (x / ALIKE).round() * ALIKE);
            let moving = scene.bodies[part].shape.bounds().transformed(from);
            let passed = moving.way_past(&scene.bodies[other].bounds, &direction);
            if passed == 0.0 {
                way.pop();
            } else if passed < (to.translation.vector - from.translation.vector).norm() {
                *to = Translation3::from(direction * passed) * *from;
            }
        }
        way
    }

    /// What is found past one part that stands, on the way past it: it depends on no other.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn past(&self, other: usize, way: &[Pose]) -> Result<Verdict, Interrupt> {
        let Self { verifier, asked, .. } = self;
        let course = &Course::new(way, self.centre, self.reach);
        let (scene, limit) = (asked.scene, verifier.limit);
        let share = if asked.allowances.of(asked.part, other) > 0.0 { SPARE_IN_OVERLAP } else { SPARE };
        let precision = Precision {
            spare: limit * share,
            deep: limit,
            finest: limit * FINEST,
            coarse: COARSE * scene.longest_side,
        };
        let standing = [other];
        let asked = Asked { standing: &standing, path: way, ..*asked };
        let far = turns_far(way);
        let way = Way { asked: &asked, course, precision, other };
        let found = if far { depth_on_screw(&way, limit)? } else { way.depth()? };
        let bound = found.iter().map(|f| f.bound).fold(0.0, f64::max);
        let mut entries = deepest_entries(scene, other, &found);
        if bound <= limit {
            for stretch in joined(course, found.iter().flat_map(|f| &f.open)) {
                let path = course.path_between(stretch);
                let asked = Asked { path: &path, ..asked };
                entries.extend(verifier.samples.entries_along(&asked, limit)?);
            }
        }
        Ok(Verdict::past(bound, entries))
    }
}

/// The way of a part past one that stands.
pub(super) struct Way<'a> {
    pub(super) asked: &'a Asked<'a>,
    pub(super) course: &'a Course,
    precision: Precision,
    pub(super) other: usize,
}

impl Way<'_> {
    /// How deep the moving part gets into the standing one, and the other way round.
    fn depth(&self) -> Result<[Found; 2], Interrupt> {
        let side = |on_moving| self.depth_of_side(on_moving, Interval::WHOLE, MOST_EFFORT);
        let (one, other) = rayon::join(|| side(true), || side(false));
        Ok([one?, other?])
    }

    /// How deep the moving part gets into the standing one on a stretch of the way, or the other way
    /// round, looked at with no more than some effort.
    pub(super) fn depth_of_side(
        &self,
        on_moving: bool,
        interval: Interval,
        most_effort: usize,
    ) -> Result<Found, Interrupt> {
        let Self { asked, course, precision, other } = *self;
        let (moving, standing) = (&asked.scene.bodies[asked.part], &asked.scene.bodies[other]);
        let (looked_at, measured) = if on_moving { (moving, standing) } else { (standing, moving) };
        let view = View::new(course, standing.planning_from_shape, on_moving, precision.finest / 16.0);
        let question = Question {
            surface: &looked_at.shape.surface,
            tree: looked_at.shape.patches(asked.termination)?,
            measured: &measured.shape.surface,
            granted: asked.allowances.of(asked.part, other),
            precision,
        };
        question.answer(view, interval, most_effort, asked.termination)
    }
}

/// Stretches of the way, those that touch each other as one.
fn joined<'i>(course: &Course, intervals: impl Iterator<Item = &'i Interval>) -> Vec<[f64; 2]> {
    let mut stretches: Vec<[f64; 2]> = intervals.map(|i| i.of(course.length)).collect();
    stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    stretches.dedup_by(|next, last| {
        let touch = next[0] <= last[1];
        last[1] = if touch { last[1].max(next[1]) } else { last[1] };
        touch
    });
    stretches
}

/// The points that help in refining a motion: of those that are near each other, the deepest.
fn deepest_entries(scene: &Scene, other: usize, [moving, standing]: &[Found; 2]) -> Vec<Entry> {
    let cell = COARSE * scene.longest_side;
    let mut taken: BTreeMap<(bool, [i64; 3]), Entry> = BTreeMap::new();
    for (on_moving, side) in [(true, moving), (false, standing)] {
        for &(point, over) in &side.deep {
            let key = (on_moving, point.coords.map(|x| (x / cell).floor() as i64).into());
            let entry = Entry { other, on_moving, point, over };
            match taken.entry(key) {
                Occupied(mut known) if known.get().over < over => {
                    known.insert(entry);
                }
                Occupied(_) => {}
                Vacant(free) => {
                    free.insert(entry);
                }
            }
        }
    }
    taken.into_values().collect()
}

/// A few points below the largest faces, by a tenth of the smallest extent.
fn interior_points(surface: &Surface) -> impl Iterator<Item = Point3<f64>> + '_ {
    const PROBES: usize = 8;
    let area = |t: u32| {
        let [a, b, c] = surface.corners(t);
        area_normal(&a, &b, &c).norm()
    };
    let mut faces: Vec<u32> = (0..surface.triangles().len() as u32).collect();
    faces.sort_by(|&s, &t| area(t).total_cmp(&area(s)).then(s.cmp(&t)));
    let below = surface.bounds().extents().min() / 10.0;
    faces.into_iter().take(PROBES).map(move |t| {
        let [a, b, c] = surface.corners(t);
        Point3::from((a.coords + b.coords + c.coords) / 3.0) - surface.face_normal(t) * below
    })
}

#[cfg(test)]
mod tests;
