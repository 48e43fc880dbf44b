//! The thread that two parts share, from their surfaces alone.
//!
//! Its helix is fitted to the flanks of both parts ([`slip`](super::slip), [`helix_fit`](super::helix_fit)). In the
//! middle of its play, both axes are one, and the profiles are as far apart as possible.

use std::f64::consts::TAU;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

use crate::budgets::HELIX_ROUNDS;
use crate::geometry::{Helix, Pose};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{LEAST_PITCH, OFF_HELIX, RISE_BY_RADIUS, RISE_RANGE, SCREW_POSE_ANGLE};

use super::envelope::{Envelope, ProfileZone};
use super::helix_fit::{FlankPoint, fitted_helices, fitted_rise, spread};
use super::slip::{FlankFacet, slipping};

/// A thread that a part shares with others.
pub(super) struct SharedThread {
    pub(super) helix: Helix,
    /// The pose of the moving part in the middle of its play, in the axis frame, at the start.
    reference: Pose,
    /// The angles after which it is off the others, further along the axis and against it.
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

    /// The thread that a part shares with some others from a pose, near a helix (in the planning frame; without a rise,
    /// it gives the axis alone): that with the most play. `None` where it shares none with play.
    pub(super) fn widest(
        scene: &Scene,
        others: &[usize],
        part: usize,
        pose: &Pose,
        guess: &Helix,
        termination: &Termination,
    ) -> Result<Option<Self>, Interrupt> {
        let mut widest: Option<(f64, Self)> = None;
        let mut off = [0.0f64; 2];
        for &other in others.iter().filter(|&&other| scene.allowed.of(part, other) == 0.0) {
            let Some((pair, axes)) = fitted(scene, [part, other], pose, guess, termination)? else {
                continue;
            };
            let Some((play, thread)) = Self::shared(&pair, axes, termination)? else { continue };
            for (off, own) in off.iter_mut().zip(thread.off) {
                *off = if own.abs() > off.abs() { own } else { *off };
            }
            if widest.as_ref().is_none_or(|(most, _)| *most < play) {
                widest = Some((play, thread));
            }
        }
        Ok(widest.map(|(_, thread)| Self { off, ..thread }))
    }

    /// The thread that two parts share along their helices (moving and standing, of one rise, in the pair's frame), and
    /// the play in it.
    fn shared(
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

/// Two parts in the frame of the helix that fits their thread, and both helices in that frame, near another helix; of
/// any rise if that has none.
fn fitted(
    scene: &Scene,
    parts: [usize; 2],
    pose: &Pose,
    guess: &Helix,
    termination: &Termination,
) -> Result<Option<(ThreadPair, [Helix; 2])>, Interrupt> {
    let mut helix = *guess;
    for _ in 0..HELIX_ROUNDS {
        termination.check()?;
        let pair = ThreadPair::new(scene, parts, &helix, &(helix.axis_from_frame * pose));
        let Some(axes) = axes(&pair, helix.rise, termination)? else { return Ok(None) };
        helix =
            Helix { axis_from_frame: axes[1].axis_from_frame * helix.axis_from_frame, rise: axes[1].rise };
    }
    let pair = ThreadPair::new(scene, parts, &helix, &(helix.axis_from_frame * pose));
    Ok(axes(&pair, helix.rise, termination)?.map(|axes| (pair, axes)))
}

/// The helices of the flanks of two parts, in the frame of a helix near both.
fn axes(pair: &ThreadPair, guess: f64, termination: &Termination) -> Result<Option<[Helix; 2]>, Interrupt> {
    let flanks = pair.flanks();
    let [Some(own), Some(others)] = flanks.each_ref().map(|facets| slipping(facets, guess)) else {
        return Ok(None);
    };
    let points = |axis: &Helix, facets: &[FlankFacet]| -> Vec<FlankPoint> {
        let flanks: Vec<&FlankFacet> = facets.iter().filter(|f| f.is_flank()).collect();
        spread(&flanks).iter().map(|p| p.moved(&axis.axis_from_frame)).collect()
    };
    let points = [points(&own, &flanks[0]), points(&others, &flanks[1])];
    let radius = points.iter().flatten().map(FlankPoint::radius).fold(0.0, f64::max);
    let [least, most] = RISE_BY_RADIUS.map(|share| share * radius);
    let least = least.max(LEAST_PITCH / TAU);
    // What hardly rises is a joint that turns, and no thread, or what it touches does not show how it rises.
    let ranges: Vec<[f64; 2]> = if guess.abs() < least {
        vec![[least, most], [-least, -most]]
    } else {
        let [from, to] = RISE_RANGE.map(|share| share * guess.abs());
        vec![[from.max(least), to].map(|rise| rise.copysign(guess))]
    };
    let Some(rise) = fitted_rise(&points, &ranges, termination)? else { return Ok(None) };
    let fits = fitted_helices(&points, rise, termination)?;
    Ok(Some(std::array::from_fn(|i| Helix {
        axis_from_frame: fits[i].axis_from_frame * [&own, &others][i].axis_from_frame,
        rise: fits[i].rise,
    })))
}

/// Two parts that may share a thread, in the axis frame of a helix near it.
struct ThreadPair {
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
    fn new(scene: &Scene, [part, other]: [usize; 2], guess: &Helix, reference: &Pose) -> Self {
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
    fn flanks(&self) -> [Vec<FlankFacet>; 2] {
        let in_zone = |t: &Vec<[Point3<f64>; 3]>| {
            t.iter().filter(|c| self.zone.meets(c)).filter_map(FlankFacet::of).collect()
        };
        self.triangles.each_ref().map(in_zone)
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
