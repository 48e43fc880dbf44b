//! Paths off a thread in the middle of its play.
//!
//! It answers which screw motion keeps the surfaces of two parts furthest apart, from both surfaces and for a whole
//! path. Which displacement of one pose gives its contacts room, before all standing parts, the simulation computes:
//! `simulation/sliding/drive/clearance.rs`.
//!
//! An engine that pushes a part off a thread presses it against the flanks: such a path leaves no room, and its
//! wobble makes many waypoints. The two threads themselves determine a better one ([`slip`](super::slip)): both axes
//! as one, the profiles as far apart as possible, and no motion but turning along the helix. It is a proposal,
//! verified like any path.

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

use crate::budgets::CENTRING_PIECES;
use crate::geometry::{Helix, Pose, interpolate};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{OFF_HELIX, SCREW_POSE_ANGLE, STRAY_SHARE, UNSCREWING_ANGLE};

use super::super::course::turns_far;
use super::super::course::{Course, Interval};
use super::envelope::{Envelope, ProfileZone};
use super::path::ScrewPath;
use super::slip::{FlankFacet, slipping};

/// A path with the start and end of a given one that turns along the thread which a part shares with a standing part;
/// `None` if there is no such thread, or no play in it. `limit` is the depth at which paths are refused.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn path_on_thread(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    path: &[Pose],
    limit: f64,
    termination: &Termination,
) -> Result<Option<Vec<Pose>>, Interrupt> {
    if !turns_far(path) {
        return Ok(None);
    }
    let course = Course::new(path, scene.centre_in_shape(part), scene.bodies[part].shape.reach);
    let followed = ScrewPath::new(&course, &[Interval::WHOLE], limit * STRAY_SHARE);
    let Some(followed) = followed.filter(|followed| followed.helix.rise != 0.0) else { return Ok(None) };
    let Some((left, way)) = followed.leaves(followed.helix.pitch().abs() * OFF_HELIX) else {
        return Ok(None);
    };
    let mut widest: Option<(f64, SharedThread)> = None;
    for &other in standing.iter().filter(|&&other| scene.allowed.of(part, other) == 0.0) {
        let pair = ThreadPair::new(scene, [part, other], &followed.helix, &followed.reference);
        let rise = followed.helix.rise;
        let axis = |facets: Vec<FlankFacet>| Some(Helix { rise, ..slipping(&facets, rise)? });
        let [Some(own), Some(others)] = pair.flanks().map(axis) else { continue };
        let shared = SharedThread::shared(&pair, [own, others], termination)?;
        if let Some((play, thread)) = shared
            && widest.as_ref().is_none_or(|(most, _)| *most < play)
        {
            widest = Some((play, thread));
        }
    }
    Ok(widest.and_then(|(_, thread)| along(&thread, (left, way), path, &course)))
}

/// The path that turns along a thread up to where the given one leaves it (angle, and place on the path), and from
/// there on beside the given one to its end.
fn along(
    thread: &SharedThread,
    (left, way): (f64, f64),
    path: &[Pose],
    course: &Course,
) -> Option<Vec<Pose>> {
    // A part that is nearly off the thread is turned off it.
    let off = thread.off[usize::from(thread.helix.rise * left <= 0.0)];
    let is_near = (off - left).abs() < UNSCREWING_ANGLE;
    let angle = if is_near { off.abs().max(left.abs()).copysign(left) } else { left };
    let on_thread = thread.poses_to(angle);
    let rest = course.path_between([way, course.length]);
    // From there on like the given path, at the same distance from it, and on it at the end.
    let aside = rest.first()?.inverse() * thread.pose(angle);
    let rest: Vec<Pose> = if is_near { Vec::new() } else { rest.iter().map(|p| p * aside).collect() };
    let mut poses: Vec<Pose> = path.first().copied().into_iter().chain(on_thread).chain(rest).collect();
    // In pieces so small that their sense of rotation is unique.
    let (from, to) = (*poses.last()?, *path.last()?);
    let share = |k: u32| f64::from(k) / f64::from(CENTRING_PIECES);
    poses.extend((1..CENTRING_PIECES).map(|k| interpolate(&from, &to, &course.centre, share(k))));
    poses.push(to);
    Some(poses)
}

/// Two parts that may share a thread, in the axis frame of a helix near it.
pub(super) struct ThreadPair {
    guess: Helix,
    /// The pose of the moving part.
    reference: Pose,
    /// The triangles of the moving part, and of the standing one.
    triangles: [Vec<[Point3<f64>; 3]>; 2],
    zones: [ProfileZone; 2],
    /// Where both may have the thread; its ends do not count.
    zone: ProfileZone,
}

impl ThreadPair {
    /// A moving and a standing part, with a helix near their thread and the pose of the moving one in its axis frame.
    pub(super) fn new(scene: &Scene, [part, other]: [usize; 2], guess: &Helix, reference: &Pose) -> Self {
        let triangles = |part: usize, frame: Pose| -> Vec<[Point3<f64>; 3]> {
            let surface = &scene.bodies[part].shape.surface;
            (0..surface.triangles().len() as u32).map(|t| surface.corners(t).map(|p| frame * p)).collect()
        };
        let standing = guess.axis_from_frame * scene.bodies[other].planning_from_shape;
        let triangles = [triangles(part, *reference), triangles(other, standing)];
        let zones = triangles.each_ref().map(|t| ProfileZone::of(t));
        let zone = zones[0].common(&zones[1]).trimmed(guess.pitch().abs());
        Self { guess: *guess, reference: *reference, triangles, zones, zone }
    }

    /// Facets of both parts where they may have the thread.
    pub(super) fn flanks(&self) -> [Vec<FlankFacet>; 2] {
        let in_zone = |t: &Vec<[Point3<f64>; 3]>| {
            t.iter().filter(|c| self.zone.meets(c)).filter_map(FlankFacet::of).collect()
        };
        self.triangles.each_ref().map(in_zone)
    }
}

/// A thread that two parts share.
pub(super) struct SharedThread {
    pub(super) helix: Helix,
    /// The pose of the moving part in the middle of its play, in the axis frame, at the start.
    reference: Pose,
    /// The angles after which it is off the other part, further along the axis and against it.
    pub(super) off: [f64; 2],
}

impl SharedThread {
    /// The pose of the moving part after turning by an angle.
    pub(super) fn pose(&self, angle: f64) -> Pose {
        self.helix.axis_from_frame.inverse() * self.helix.screwed(angle) * self.reference
    }

    /// Its poses from the start to an angle.
    pub(super) fn poses_to(&self, angle: f64) -> impl Iterator<Item = Pose> {
        let count = (angle / SCREW_POSE_ANGLE).abs().ceil().max(1.0);
        (0..=count as usize).map(move |k| self.pose(angle * k as f64 / count))
    }

    /// The thread that two parts share along their helices (moving and standing, of one rise, in the pair's frame), and
    /// the play in it.
    pub(super) fn shared(
        pair: &ThreadPair,
        [own, others]: [Helix; 2],
        termination: &Termination,
    ) -> Result<Option<(f64, Self)>, Interrupt> {
        termination.check()?;
        let ThreadPair { guess, reference, triangles: [moving, standing], zones, zone } = pair;
        if zone.is_empty() {
            return Ok(None);
        }
        let helix = others;
        // The moving part's axis onto the standing one's.
        let to_other = onto(&own, &others, f64::midpoint(zone.along()[0], zone.along()[1]));
        let frame = helix.axis_from_frame;
        let envelope = |t: &[[Point3<f64>; 3]], frame: Pose, heights: usize| {
            let moved: Vec<_> = t.iter().map(|c| c.map(|p| frame * p)).collect();
            Envelope::new(&moved, &helix, zone, heights, termination)
        };
        let mut gap = None;
        for heights in Envelope::finenesses(helix.pitch()) {
            let (one, two) = rayon::join(
                || envelope(moving, frame * to_other, heights),
                || envelope(standing, frame, heights),
            );
            gap = two?.widest_gap(&one?, OFF_HELIX * helix.pitch().abs());
            if gap.is_some() {
                break;
            }
        }
        let Some((play, shift)) = gap else { return Ok(None) };
        let reference = Translation3::from(Vector3::z() * shift) * frame * to_other * reference;
        let helix = Helix { axis_from_frame: frame * guess.axis_from_frame, ..helix };
        let [own, others] = zones.each_ref().map(ProfileZone::along);
        let off = [others[1] - own[0], others[0] - own[1]].map(|travel| travel / helix.rise);
        Ok(Some((play, Self { helix, reference, off })))
    }
}

/// The smallest displacement that takes one axis onto another, at some height.
fn onto(axis: &Helix, other: &Helix, height: f64) -> Pose {
    let [(from, along), (to, wanted)] = [axis, other].map(|h| {
        let frame = h.axis_from_frame.inverse();
        let along = frame * Vector3::z();
        let origin = frame * Point3::origin();
        (origin + along * ((height - origin.z) / along.z), along)
    });
    let turn = UnitQuaternion::rotation_between(&along, &wanted).unwrap_or_default();
    Pose::from_parts(Translation3::from(to - turn * from), turn)
}
