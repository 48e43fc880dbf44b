//! The profile of a surface along a helix: how far it reaches from the axis, and how near it comes to it, by the
//! height on the helix.
//!
//! There all turns of a thread lie on each other (see [`Helix`](crate::geometry::Helix)). If the profile of one part
//! is beyond that of the other at every height, by more than the part strays from the helix, then the helical sheet
//! between the profiles separates the parts at every angle. Exact profiles are needed only about as far from the axis
//! as the other part is.

use std::f64::consts::TAU;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::budgets::{HEIGHTS_PER_PITCH, SHORT_STEPS_PER_POLL, SLABS_PER_PITCH, TRIANGLE_HALVINGS};
use crate::geometry::{Footprint, Helix, radii};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{EQUAL_GAP, PROFILE_FINENESS, PROFILE_MARGIN};

use super::range;

/// A range along an axis and a range of distances from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProfileZone {
    /// Begin and end along the axis.
    along: [f64; 2],
    /// The least and the largest distance from it.
    across: [f64; 2],
}

impl ProfileZone {
    /// The zone of triangles (axis frame).
    pub(super) fn of(triangles: &[[Point3<f64>; 3]]) -> Self {
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        triangles.iter().fold(Self { along: empty, across: empty }, |zone, corners| {
            let [near, far] = radii(corners);
            let [low, high] = range(corners.iter().map(|p| p.z));
            Self {
                along: [zone.along[0].min(low), zone.along[1].max(high)],
                across: [zone.across[0].min(near), zone.across[1].max(far)],
            }
        })
    }

    /// The common part of two zones, or the gap between them.
    pub(super) fn common(&self, other: &Self) -> Self {
        let both = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        Self { along: both(self.along, other.along), across: both(self.across, other.across) }
    }

    /// Whether it is empty.
    pub(super) fn is_empty(&self) -> bool {
        self.along[0] >= self.along[1] || self.across[0] >= self.across[1]
    }

    /// The same, shorter by some length at both ends along the axis.
    pub(super) fn trimmed(self, by: f64) -> Self {
        Self { along: [self.along[0] + by, self.along[1] - by], ..self }
    }

    /// The same at all heights.
    pub(super) fn everywhere(self) -> Self {
        Self { along: [f64::NEG_INFINITY, f64::INFINITY], ..self }
    }

    /// Whether part of a triangle may be in it.
    pub(super) fn meets(&self, corners: &[Point3<f64>; 3]) -> bool {
        let [near, far] = radii(corners);
        let [low, high] = range(corners.iter().map(|p| p.z));
        let meets = |[low, high]: [f64; 2], own: [f64; 2]| low <= own[1] && high >= own[0];
        meets([low, high], self.along) && meets([near, far], self.across)
    }

    /// The range of a triangle along the axis.
    pub(super) fn along(&self) -> [f64; 2] {
        self.along
    }
}

/// The least and the largest distance from the axis, by height on the helix.
type Reaches = Vec<[f64; 2]>;

/// An empty range.
const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// A piece of the profile along the axis.
#[derive(Debug, Clone)]
struct Slab {
    /// Empty as long as there is nothing.
    reaches: Reaches,
    /// Whether something is nearer to the axis, or further from it, than the profile is exact.
    further: [bool; 2],
}

/// Scratch memory: the rest of a triangle that is being cut, and the footprint of a piece.
#[derive(Debug, Default)]
struct ProfileCut {
    stack: Vec<([Point3<f64>; 3], u32)>,
    reaches: Reaches,
}

/// The profile of a surface.
pub(super) struct Envelope {
    pitch: f64,
    /// The number of heights within a pitch.
    heights: usize,
    /// The size of a bin: the error that footprints may have.
    finest: f64,
    /// The zone in which the profile is exact.
    zone: ProfileZone,
    /// The index of the first slab.
    first: i64,
    slabs: Vec<Slab>,
}

impl Envelope {
    /// The numbers of heights within a pitch by which profiles are compared, coarse ones first.
    pub(super) fn finenesses(pitch: f64) -> impl Iterator<Item = usize> {
        let most = (pitch.abs() / PROFILE_FINENESS) as usize;
        let [first, finer @ ..] = HEIGHTS_PER_PITCH;
        std::iter::once(first).chain(finer.into_iter().filter(move |&heights| heights <= most))
    }

    /// The profile of triangles (axis frame) along a rising helix by some number of heights within a pitch, exact in
    /// `zone`, where the other part can be near.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn new(
        triangles: &[[Point3<f64>; 3]],
        helix: &Helix,
        zone: &ProfileZone,
        heights: usize,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let pitch = helix.pitch().abs();
        let [near, far] = zone.across;
        let zone =
            ProfileZone { across: [near - PROFILE_MARGIN * pitch, far + PROFILE_MARGIN * pitch], ..*zone };
        let finest = pitch / heights as f64;
        let empty = || Self { pitch, heights, finest, zone, first: 0, slabs: Vec::new() };
        let add = |mut envelope: Self, triangles: &[[Point3<f64>; 3]]| {
            termination.check()?;
            let mut cut = ProfileCut::default();
            triangles.iter().for_each(|corners| envelope.add(corners, helix.rise, &mut cut));
            Ok(envelope)
        };
        // Minimum and maximum do not depend on how triangles are dealt out.
        triangles
            .par_chunks(SHORT_STEPS_PER_POLL as usize)
            .try_fold(empty, add)
            .try_reduce(empty, |one, other| Ok(one.with(other)))
    }

    /// The profile of the union of two surfaces.
    fn with(mut self, mut other: Self) -> Self {
        if self.slabs.len() < other.slabs.len() {
            std::mem::swap(&mut self, &mut other);
        }
        for (slab, added) in (other.first..).zip(other.slabs) {
            let own = &mut self.slabs_between(slab, slab)[0];
            (0..2).for_each(|side| own.further[side] |= added.further[side]);
            if own.reaches.is_empty() {
                own.reaches = added.reaches;
            } else {
                own.reaches.iter_mut().zip(&added.reaches).for_each(|(own, added)| widen(own, added));
            }
        }
        self
    }

    fn add(&mut self, corners: &[Point3<f64>; 3], rise: f64, ProfileCut { stack, reaches }: &mut ProfileCut) {
        stack.push((*corners, 0));
        while let Some((corners, cuts)) = stack.pop() {
            let [low, high] = range(corners.iter().map(|p| p.z));
            if low > self.zone.along[1] || high < self.zone.along[0] {
                continue;
            }
            let [near, far] = radii(&corners);
            let further = [far < self.zone.across[0], near > self.zone.across[1]];
            if further.contains(&true) {
                for slab in self.slabs_between(self.slab(low), self.slab(high)) {
                    (0..2).for_each(|side| slab.further[side] |= further[side]);
                }
                continue;
            }
            match Footprint::of(&corners, rise) {
                Some(print) if print.error <= self.finest || cuts >= TRIANGLE_HALVINGS => {
                    let heights = print.points.iter().zip(&corners);
                    let beside = range(heights.map(|(p, c)| p.y - c.z));
                    self.enter(&print, [low, high], beside, reaches);
                }
                None if far <= 4.0 * self.finest || cuts >= TRIANGLE_HALVINGS => {
                    let whole = [f64::NEG_INFINITY, f64::INFINITY];
                    self.enter(&Footprint::at_all_angles(&corners, rise), [low, high], whole, reaches);
                }
                _ => stack.extend(halves(&corners).map(|half| (half, cuts + 1))),
            }
        }
    }

    fn slab(&self, z: f64) -> i64 {
        (z / self.pitch * SLABS_PER_PITCH).floor() as i64
    }

    /// The slabs from one index to another, made if missing.
    fn slabs_between(&mut self, low: i64, high: i64) -> &mut [Slab] {
        let empty = || Slab { reaches: Vec::new(), further: [false; 2] };
        if self.slabs.is_empty() {
            self.first = low;
        }
        let before = (self.first - low).max(0) as usize;
        self.slabs.splice(0..0, std::iter::repeat_with(empty).take(before));
        self.first -= before as i64;
        let needed = (high - self.first + 1) as usize;
        if needed > self.slabs.len() {
            self.slabs.resize_with(needed, empty);
        }
        &mut self.slabs[(low - self.first) as usize..needed]
    }

    /// Adds a footprint. Its heights on the helix differ from those along the axis, `along[0]` to `along[1]`, by
    /// something in `beside`.
    fn enter(&mut self, print: &Footprint, along: [f64; 2], beside: [f64; 2], reaches: &mut Reaches) {
        let (size, pitch, heights) = (self.finest, self.pitch, self.heights);
        let [from, to] = range(print.points.iter().map(|p| p.y));
        let first = reached(print, size, reaches);
        let lowest = self.slab(along[0]);
        for (low, slab) in (lowest..).zip(self.slabs_between(lowest, self.slab(along[1]))) {
            if slab.reaches.is_empty() {
                slab.reaches.resize(heights, NOTHING);
            }
            let ends = [low as f64, (low + 1) as f64].map(|z| z / SLABS_PER_PITCH * pitch);
            let from = ((from.max(ends[0] + beside[0]) - print.error) / size).floor() as i64;
            let to = ((to.min(ends[1] + beside[1]) + print.error) / size).floor() as i64;
            let mut bin = from.rem_euclid(heights as i64) as usize;
            let within = reaches.iter().skip((from - first) as usize).take((to - from + 1).max(0) as usize);
            for reach in within {
                widen(&mut slab.reaches[bin], reach);
                bin = if bin + 1 == heights { 0 } else { bin + 1 };
            }
        }
    }

    /// The profile between two places along the axis.
    fn between(&self, [from, to]: [f64; 2]) -> Reaches {
        let within = |z: f64| self.slab(z).saturating_sub(self.first).clamp(-1, self.slabs.len() as i64);
        let slabs = within(from).max(0)..=within(to).min(self.slabs.len() as i64 - 1);
        let mut all = vec![NOTHING; self.heights];
        let mut further = [false; 2];
        for slab in slabs {
            let slab = &self.slabs[slab as usize];
            (0..2).for_each(|side| further[side] |= slab.further[side]);
            all.iter_mut().zip(&slab.reaches).for_each(|(own, reach)| widen(own, reach));
        }
        for own in &mut all {
            *own = [if further[0] { 0.0 } else { own[0] }, if further[1] { f64::INFINITY } else { own[1] }];
        }
        all
    }

    /// Whether this surface, between two places along the axis, stays apart from another one, between two places,
    /// which is shifted along the axis and strays from there, the more the further its points are from the axis.
    pub(super) fn is_apart(
        &self,
        places: [f64; 2],
        other: &Self,
        other_places: [f64; 2],
        shift: f64,
        stray: impl Fn(f64) -> f64,
    ) -> bool {
        let (one, other) = (self.between(places), other.between(other_places));
        let widest = |r: &Reaches| r.iter().map(|[_, far]| *far).fold(0.0, f64::max);
        let stray = stray(widest(&one).min(widest(&other)));
        let narrowest = |r: &Reaches| r.iter().map(|[near, _]| *near).fold(f64::INFINITY, f64::min);
        // Where one is around the other, that is no nearer to the axis than …
        let inner = narrowest(&one).max(narrowest(&other));
        if !stray.is_finite() || inner <= 2.0 * stray {
            return false;
        }
        // A distance in space is a little longer in the half plane.
        let margin = stray * 1.0f64.hypot(2.0 * self.pitch / TAU / inner);
        let (size, bins) = (self.finest, self.heights as i64);
        let moved = (shift / size).floor() as i64;
        if margin >= PROFILE_MARGIN * self.pitch {
            return false;
        }
        let wide = (margin / size).ceil() as i64 + 2;
        let is_inside = |inner: &Reaches, outer: &Reaches, moved: i64| {
            (0..bins).all(|i| {
                let far = inner[i as usize][1];
                far == f64::NEG_INFINITY
                    || (-wide..=wide).all(|k| {
                        let beside = (k.abs() - 2).max(0) as f64 * size;
                        let across = (margin * margin - beside * beside).max(0.0).sqrt();
                        outer[(i + k - moved).rem_euclid(bins) as usize][0] > far + across
                    })
            })
        };
        is_inside(&one, &other, moved) || is_inside(&other, &one, -moved)
    }

    /// The shift of another profile along the axis, up to `most`, that makes the gap across the axis widest, and that
    /// gap, if there is one.
    pub(super) fn widest_gap(&self, other: &Self, most: f64) -> Option<(f64, f64)> {
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let (one, other) = (self.between(everywhere), other.between(everywhere));
        let (bins, size) = (self.heights as i64, self.finest);
        let gap = |inner: &Reaches, outer: &Reaches, shift: i64| {
            let at = |i: i64| outer[(i + shift).rem_euclid(bins) as usize][0] - inner[i as usize][1];
            (0..bins).map(at).fold(f64::INFINITY, f64::min)
        };
        let most = (most / size) as i64;
        let gaps: Vec<(f64, i64)> = (-most..=most)
            .map(|shift| (gap(&one, &other, -shift).max(gap(&other, &one, shift)), shift))
            .collect();
        let widest = gaps.iter().map(|(gap, _)| *gap).fold(f64::NEG_INFINITY, f64::max);
        let as_wide = || gaps.iter().filter(|(gap, _)| *gap >= widest * (1.0 - EQUAL_GAP));
        let middle = as_wide().map(|(_, shift)| *shift as f64).sum::<f64>() / as_wide().count() as f64;
        (widest > 0.0 && widest.is_finite()).then_some((widest, middle * size))
    }
}

/// The range of a footprint across the axis, by bins of heights of some size, and the first bin.
fn reached(print: &Footprint, size: f64, reaches: &mut Reaches) -> i64 {
    let [low, high] = range(print.points.iter().map(|p| p.y));
    let bins =
        |low: f64, high: f64| [low - print.error, high + print.error].map(|y| (y / size).floor() as i64);
    let [first, last] = bins(low, high);
    reaches.clear();
    reaches.resize((last - first + 1) as usize, NOTHING);
    for i in 0..3 {
        let (a, b) = (print.points[i], print.points[(i + 1) % 3]);
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        let [least, most] = range([a.x, b.x].into_iter());
        let slope = (b.x - a.x) / (b.y - a.y);
        let at = |y: f64| (a.x + slope * (y - a.y)).clamp(least, most);
        let [from, to] = bins(a.y, b.y);
        for (bin, reach) in (from..=to).zip(&mut reaches[(from - first) as usize..]) {
            let low = bin as f64 * size - print.error;
            let ends = if slope.is_finite() {
                range([at(low), at(low + size + 2.0 * print.error)].into_iter())
            } else {
                [least, most]
            };
            widen(reach, &ends);
        }
    }
    for [near, far] in reaches {
        (*near, *far) = (*near - print.error, *far + print.error);
    }
    first
}

/// Extends a range to hold another.
fn widen(reach: &mut [f64; 2], other: &[f64; 2]) {
    *reach = [reach[0].min(other[0]), reach[1].max(other[1])];
}

/// The two halves of a triangle, cut across the side that is longest across the axis.
fn halves(corners: &[Point3<f64>; 3]) -> [[Point3<f64>; 3]; 2] {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).xy().norm_squared();
    let side = (1..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
    let [a, b, c] = [0, 1, 2].map(|k| corners[(side + k) % 3]);
    let cut = nalgebra::center(&a, &b);
    [[a, cut, c], [cut, b, c]]
}
