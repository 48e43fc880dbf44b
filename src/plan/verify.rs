//! Verification of a path on the triangles, independent of distance fields and engines.
//!
//! For every standing part that the moving one comes near, both surfaces are bounded against each
//! other all along the way ([`depth`](super::depth) says how, and what that guarantees): what counts
//! is depth beyond that of the pair at the assembled pose, which is measured with the same search.
//! Paths that turn far are checked at samples instead ([`sampling`](super::sampling)).

use std::collections::BTreeMap;
use std::collections::btree_map::Entry::{Occupied, Vacant};
use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::geometry::{Bounds, Pose, Shape, Surface, area_normal};
use crate::simulation::{Allowances, Scene};
use crate::termination::{Interrupt, Termination};

use super::course::{Course, View};
use super::depth::{Found, Precision, Question};
use super::sampling::{Samples, turns_far};

/// Depth that is not looked into, as a share of the limit.
const SPARE: f64 = 1.0 / 16.0;
/// The same where overlap is granted: facets that lie across each other are deep here and there.
const SPARE_IN_OVERLAP: f64 = 1.0 / 4.0;
/// The smallest radius of a piece of surface, likewise.
const FINEST: f64 = 1.0 / 4.0;
/// Entries are no closer to each other than this, as a share of the longest side.
const COARSE: f64 = 4e-3;
/// The same for the overlap of assembled parts, that no more is granted than there is, and no less.
const OVERLAP_SPARE: f64 = 2e-6;
const OVERLAP_FINEST: f64 = 1e-4;

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
    /// Nothing gets deeper than this beyond the allowances along the path; 0 if nothing does.
    pub depth: f64,
    /// Points that got deep along a path that exceeds the limit; empty if the path is good.
    pub entries: Vec<Entry>,
}

impl Verdict {
    /// On a path where nothing but these points gets deeper than `bound`; entries up to `limit` make
    /// a good path and are dropped.
    fn new(bound: f64, entries: Vec<Entry>, limit: f64) -> Self {
        let depth = deepest(bound, &entries);
        Self { depth, entries: if depth <= limit { Vec::new() } else { entries } }
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
        let side = |on_moving| depth_of_side(&asked, &course, precision, b, on_moving);
        let (one, other) = rayon::join(|| side(true), || side(false));
        let (one, other) = (one?, other?);
        let depth = one.depth.max(other.depth);
        if one.gave_up() || other.gave_up() {
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
        let asked = Asked { scene, allowances, standing, part, path, termination };
        if turns_far(path) {
            return Ok(Verdict::new(0.0, self.samples.entries_along(&asked, self.limit)?, self.limit));
        }
        let shape = &scene.bodies[part].shape;
        let centre = scene.centre_in_shape(part);
        let reach = shape.hull.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        let course = Course::new(path, centre, reach);
        let precision = Precision {
            spare: self.limit * SPARE,
            deep: self.limit,
            finest: self.limit * FINEST,
            coarse: COARSE * scene.longest_side,
        };
        let swept = path.iter().fold(Bounds::EMPTY, |b, pose| {
            let c = pose * centre;
            b.union(&Bounds { min: c, max: c })
        });
        let swept = swept.grown(reach);
        let tasks: Vec<(usize, bool)> = standing
            .iter()
            .filter(|&&o| scene.bodies[o].bounds.meets(&swept))
            .flat_map(|&o| [(o, true), (o, false)])
            .collect();
        let found = tasks
            .par_iter()
            .map(|&(other, on_moving)| {
                let share = if allowances.of(part, other) > 0.0 { SPARE_IN_OVERLAP } else { SPARE };
                let precision = Precision { spare: self.limit * share, ..precision };
                depth_of_side(&asked, &course, precision, other, on_moving)
            })
            .collect::<Result<Vec<_>, Interrupt>>()?;
        let bound = found.iter().map(|f| f.bound).fold(0.0, f64::max);
        let mut entries = deepest_entries(scene, &tasks, &found);
        let mut open: Vec<usize> =
            tasks.iter().zip(&found).filter(|(_, f)| f.gave_up()).map(|((other, _), _)| *other).collect();
        open.dedup();
        if bound <= self.limit && !open.is_empty() {
            let asked = Asked { standing: &open, ..asked };
            entries.extend(self.samples.entries_along(&asked, self.limit)?);
        }
        Ok(Verdict::new(bound, entries, self.limit))
    }
}

/// How deep the moving part gets into a standing one, or the other way round.
fn depth_of_side(
    asked: &Asked<'_>,
    course: &Course,
    precision: Precision,
    other: usize,
    on_moving: bool,
) -> Result<Found, Interrupt> {
    let (moving, standing) = (&asked.scene.bodies[asked.part], &asked.scene.bodies[other]);
    let (looked_at, measured) = if on_moving { (moving, standing) } else { (standing, moving) };
    let view = View::new(course, standing.planning_from_shape, on_moving, precision.finest / 16.0);
    let question = Question {
        surface: &looked_at.shape.surface,
        tree: looked_at.shape.patches(),
        measured: &measured.shape.surface,
        granted: asked.allowances.of(asked.part, other),
        precision,
    };
    question.answer(view, asked.termination)
}

/// The points that help in refining a motion: of those that are near each other, the deepest.
fn deepest_entries(scene: &Scene, tasks: &[(usize, bool)], found: &[Found]) -> Vec<Entry> {
    let cell = COARSE * scene.longest_side;
    let mut taken: BTreeMap<(usize, bool, [i64; 3]), Entry> = BTreeMap::new();
    for (&(other, on_moving), side) in tasks.iter().zip(found) {
        for &(point, over) in &side.deep {
            let key = (other, on_moving, point.coords.map(|x| (x / cell).floor() as i64).into());
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
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{LIMIT, block_on_plate, cells, cuboid, l_shape, moved, peg_in_hole, scene};
    use crate::geometry::{SourceMesh, interpolate};

    /// The path of part 1 by steps from its assembled pose, checked against all others.
    fn checked(scene: &Scene, verifier: &Verifier, steps: &[Vector3<f64>]) -> Verdict {
        let mut path = vec![scene.bodies[1].planning_from_shape];
        for s in steps {
            path.push(nalgebra::Translation3::from(*s) * path[path.len() - 1]);
        }
        checked_path(scene, verifier, &path)
    }

    fn checked_path(scene: &Scene, verifier: &Verifier, path: &[Pose]) -> Verdict {
        let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
        verifier.check(scene, &scene.allowances, &standing, 1, path, &Termination::default()).unwrap()
    }

    fn overlap(scene: &Scene, verifier: &Verifier, a: usize, b: usize) -> f64 {
        verifier.assembled_depth(scene, a, b, &Termination::default()).unwrap()
    }

    #[test]
    fn a_path_through_a_wall_is_refused_and_the_wall_named() {
        let [plate, block] = block_on_plate();
        let wall = cuboid([2.5, -4.0, 0.0], [3.0, 4.0, 3.0]);
        let (scene, verifier) = scene([plate, block, wall]);
        let verdict = checked(&scene, &verifier, &[Vector3::x() * 6.0]);
        // The block gets no deeper into the wall than half its width, the wall into the block likewise;
        // how deep a path gets that is refused anyway is not looked into.
        assert!(verdict.depth > LIMIT && verdict.depth <= 1.0, "{}", verdict.depth);
        assert!(verdict.entries.iter().any(|e| e.on_moving) && verdict.entries.iter().any(|e| !e.on_moving));
        assert!(verdict.entries.len() > 10);
        for e in &verdict.entries {
            assert!(e.other == 2 && e.over > LIMIT && e.over <= 1.0, "{e:?}");
        }
    }

    #[test]
    fn entries_are_points_of_the_surface_that_they_name() {
        let (scene, verifier) = scene(block_on_plate());
        let verdict = checked(&scene, &verifier, &[Vector3::new(0.3, 0.2, -0.1)]);
        assert!((verdict.depth - 0.1).abs() < 1e-9, "{}", verdict.depth);
        for e in &verdict.entries {
            let shape = &scene.bodies[if e.on_moving { 1 } else { e.other }].shape;
            assert!(shape.surface.signed_distance(&e.point).abs() < 1e-9, "{e:?}");
        }
    }

    #[test]
    fn a_thin_wall_between_two_waypoints_is_found() {
        let wall = cuboid([1.5, -3.0, -3.0], [1.6, 3.0, 3.0]);
        let (scene, verifier) = scene([wall, cuboid([0.0; 3], [1.0; 3])]);
        let verdict = checked(&scene, &verifier, &[Vector3::x() * 4.0]);
        assert!(verdict.depth > 0.05 && verdict.depth <= 0.5, "{}", verdict.depth);
    }

    #[test]
    fn flush_sliding_is_not_deep() {
        let turn = Pose::rotation(Vector3::new(0.2, -0.15, 0.1));
        for pose in [Pose::identity(), turn] {
            let (scene, verifier) = scene(block_on_plate().map(|m| moved(m, &pose)));
            let steps =
                [Vector3::new(2.0, 1.0, 0.0), Vector3::new(-4.0, 0.5, 0.0), Vector3::new(8.0, 0.0, 0.0)];
            let verdict = checked(&scene, &verifier, &steps.map(|s| pose * s));
            assert!(verdict.depth < 1e-9 && verdict.entries.is_empty(), "{}", verdict.depth);
        }
    }

    #[test]
    fn a_flush_peg_leaves_its_hole_unhindered() {
        let (scene, verifier) = scene(peg_in_hole(0.0));
        assert!(checked(&scene, &verifier, &[Vector3::z() * 4.0]).depth < 1e-9);
        let askew = checked(&scene, &verifier, &[Vector3::z(), Vector3::x() * 0.05]);
        assert!((askew.depth - 0.05).abs() < 1e-3, "{}", askew.depth);
    }

    #[test]
    fn what_a_turn_sweeps_over_is_found() {
        // A bar that points up turns half-way about y, through a ridge it is clear of at both ends.
        let base =
            cells([&[-4.0, 1.5, 1.8, 4.0], &[-1.0, 1.0], &[-1.0, 0.0, 2.0]], |c| c[2] == 0 || c[0] == 1);
        let (scene, verifier) = scene([base, cuboid([-0.2, -0.2, 0.5], [0.2, 0.2, 4.5])]);
        let from = scene.bodies[1].planning_from_shape;
        let about = |angle: f64| {
            let foot = Pose::translation(0.0, 0.0, 2.5);
            foot * Pose::rotation(Vector3::y() * angle) * foot.inverse() * from
        };
        assert!(checked_path(&scene, &verifier, &[from, about(-0.5)]).depth < 1e-9);
        let path = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| about(k * std::f64::consts::FRAC_PI_4));
        assert!(checked_path(&scene, &verifier, &[path[0]]).depth < 1e-9);
        assert!(checked_path(&scene, &verifier, &[path[4]]).depth < 1e-9);
        assert!(checked_path(&scene, &verifier, &path).depth > 0.05);
    }

    #[test]
    fn an_overlap_is_measured_and_granted() {
        let low = cuboid([-3.0, -3.0, -2.0], [3.0, 3.0, 0.0]);
        let (scene, verifier) = scene([low, cuboid([-1.0, -1.0, -0.3], [1.0, 1.0, 3.0])]);
        let depth = overlap(&scene, &verifier, 0, 1);
        assert!((depth - 0.3).abs() < 1e-9, "{depth}");
        assert!((overlap(&scene, &verifier, 1, 0) - depth).abs() < 1e-9);
        assert!(checked(&scene, &verifier, &[Vector3::z() * 0.1, Vector3::x()]).depth < 1e-9);
        let deeper = checked(&scene, &verifier, &[Vector3::z() * -0.1]);
        assert!((deeper.depth - 0.1).abs() < 1e-9, "{}", deeper.depth);
    }

    #[test]
    fn parts_that_touch_or_are_apart_do_not_overlap() {
        let (scene, verifier) = scene(block_on_plate());
        assert!(overlap(&scene, &verifier, 0, 1) < 1e-12);
        assert_eq!(verifier.coincident_depth(&scene, 0, 1), 0.0);
        assert_eq!(verifier.coincident_depth(&scene, 1, 0), 0.0);
    }

    #[test]
    fn coincident_parts_share_their_inside() {
        let block = || cuboid([-3.0, -2.0, -1.0], [3.0, 2.0, 1.0]);
        let (scene, verifier) = scene([block(), block()]);
        assert!(overlap(&scene, &verifier, 0, 1) < 1e-9, "no surface is inside the other");
        let depth = verifier.coincident_depth(&scene, 0, 1);
        assert!(depth > 0.1 && depth <= 1.0, "{depth}");
    }

    #[test]
    fn a_depth_up_to_the_limit_is_told_but_not_refused() {
        let (scene, verifier) = scene(block_on_plate());
        let slight = checked(&scene, &verifier, &[Vector3::z() * (-0.9 * LIMIT)]);
        assert!((slight.depth - 0.9 * LIMIT).abs() < 1e-9 && slight.entries.is_empty());
        assert!(!checked(&scene, &verifier, &[Vector3::z() * (-1.1 * LIMIT)]).entries.is_empty());
        assert_eq!(verifier.limit(), LIMIT);
    }

    #[test]
    fn a_cancelled_check_ends_with_the_reason() {
        let (scene, verifier) = scene(block_on_plate());
        let termination = Termination::default();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        let path = [scene.bodies[1].planning_from_shape];
        let ended = verifier.check(&scene, &scene.allowances, &[0], 1, &path, &termination);
        assert_eq!(ended, Err(Interrupt::Cancelled));
    }

    fn poses(size: f64) -> impl Strategy<Value = Vec<Pose>> {
        let step = prop::array::uniform6(-1.0..1.0f64);
        let step = step.prop_map(move |[x, y, z, a, b, c]| {
            Pose::new(Vector3::new(x, y, z) * size, Vector3::new(a, b, c) * size)
        });
        prop::collection::vec(step, 1..4)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn nothing_is_deeper_than_the_bound(steps in poses(0.08), x in -0.3..0.6f64, turn in 0.0..6.0f64) {
            // Two solids with a reentrant corner each, about to mesh, and something far away.
            let large = |mesh: SourceMesh| SourceMesh {
                vertices: mesh.vertices.iter().map(|v| v.map(|x| x * 1.5)).collect(),
                ..mesh
            };
            let place = Pose::new(Vector3::new(3.0 + x, 0.4, 1.5), Vector3::y() * 0.3 + Vector3::z() * turn);
            let far = cuboid([7.0, -1.0, -1.0], [7.5, 0.0, 0.0]);
            let (scene, verifier) = scene([large(l_shape()), moved(large(l_shape()), &place), far]);
            let granted = scene.allowances.of(0, 1);
            let from = scene.bodies[1].planning_from_shape;
            let mut path = vec![from];
            path.extend(steps.iter().map(|s| s * from));
            let verdict = checked_path(&scene, &verifier, &path);
            let centre = scene.centre_in_shape(1);
            let dense: Vec<Pose> = path
                .windows(2)
                .flat_map(|w| (0..=40).map(|k| interpolate(&w[0], &w[1], &centre, f64::from(k) / 40.0)))
                .collect();
            let depth = |pose: &Pose, on_moving: bool, p: &Point3<f64>| {
                let relative = scene.bodies[0].planning_from_shape.inverse() * pose;
                let at = if on_moving { relative * p } else { relative.inverse() * p };
                let into = &scene.bodies[usize::from(!on_moving)].shape.surface;
                -into.signed_distance(&at) - granted
            };
            // What a dense look finds, at points all over both.
            let deepest = dense.iter().step_by(4).flat_map(|pose| {
                let sides = [(true, 1), (false, 0)];
                sides.map(|(on_moving, body)| {
                    let points = on_surface(&scene.bodies[body].shape.surface);
                    points.iter().map(|p| depth(pose, on_moving, p)).fold(0.0, f64::max)
                })
            });
            let deepest = deepest.fold(0.0, f64::max);
            prop_assert!(verdict.depth >= deepest.min(LIMIT) - 1e-5, "{} for {deepest}", verdict.depth);
            prop_assert_eq!(verdict.depth > LIMIT, !verdict.entries.is_empty());
            // No alarm without a cause.
            for e in verdict.entries.iter().take(20) {
                let there = dense.iter().map(|pose| depth(pose, e.on_moving, &e.point)).fold(0.0, f64::max);
                prop_assert!(there > 0.25 * LIMIT && e.over <= there + 0.01, "{there} at {e:?}");
            }
        }
    }

    fn on_surface(surface: &Surface) -> Vec<Point3<f64>> {
        let weights = (0..=6u32).flat_map(|i| (0..=6 - i).map(move |j| [i, j, 6 - i - j]));
        let at = |t: u32, w: [u32; 3]| {
            let corners = surface.corners(t);
            Point3::from((0..3).map(|k| corners[k].coords * f64::from(w[k]) / 6.0).sum::<Vector3<f64>>())
        };
        (0..surface.triangles().len() as u32).flat_map(|t| weights.clone().map(move |w| at(t, w))).collect()
    }
}
