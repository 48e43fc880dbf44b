//! The profile of a surface along a helix: its distances from the axis, by the height on the helix.
//!
//! There all turns of a thread lie on each other (see [`Helix`](crate::geometry::Helix)), and a part that is screwed
//! along keeps its profile. If the profiles of two surfaces have no distance in common at any height, nor any within
//! what the part strays from the helix, then the surfaces do not meet at any angle: neither those of a bolt in its nut
//! nor those of a helical wire in its tunnel, which has walls on both sides of the wire. Exact profiles are needed only
//! about as far from the axis as the other part is.

use std::f64::consts::TAU;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::budgets::{HEIGHTS_PER_PITCH, SHORT_STEPS_PER_POLL, SLABS_PER_PITCH, TRIANGLE_HALVINGS};
use crate::geometry::{Footprint, Helix, radii};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    EQUAL_GAP, FOOTPRINT_ERROR, PROFILE_FINENESS, PROFILE_JOINT, PROFILE_MARGIN, THREAD_END_SHARE,
    THREAD_ENDS,
};

use super::distances::Distances;
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

    /// The same without the ends of a thread, which do not count.
    pub(super) fn trimmed(self, pitch: f64) -> Self {
        let [low, high] = self.along;
        let end = (THREAD_ENDS * pitch).min(THREAD_END_SHARE * (high - low));
        Self { along: [low + end, high - end], ..self }
    }

    /// The same between two places along the axis.
    pub(super) fn between(self, along: [f64; 2]) -> Self {
        Self { along, ..self }
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

/// A piece of the profile along the axis.
#[derive(Debug, Clone)]
struct Slab {
    /// The distances by height on the helix. Empty as long as there is nothing.
    profile: Vec<Distances>,
    /// Whether something is nearer to the axis, or further from it, than the profile is exact.
    further: [bool; 2],
}

/// Scratch memory: the rest of a triangle that is being cut, and the footprint of a piece.
#[derive(Debug, Default)]
struct ProfileCut {
    stack: Vec<([Point3<f64>; 3], u32)>,
    print: Vec<[f64; 2]>,
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
        // What is joined does not depend on how triangles are dealt out.
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
        let joint = self.joint();
        for (slab, added) in (other.first..).zip(other.slabs) {
            let own = &mut self.slabs_between(slab, slab)[0];
            (0..2).for_each(|side| own.further[side] |= added.further[side]);
            if own.profile.is_empty() {
                own.profile = added.profile;
            } else {
                own.profile.iter_mut().zip(&added.profile).for_each(|(own, added)| own.add_all(added, joint));
            }
        }
        self
    }

    fn add(
        &mut self,
        corners: &[Point3<f64>; 3],
        rise: f64,
        ProfileCut { stack, print: scratch }: &mut ProfileCut,
    ) {
        let joint = self.joint();
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
                Some(print) if print.error <= FOOTPRINT_ERROR * self.finest || cuts >= TRIANGLE_HALVINGS => {
                    let heights = print.points.iter().zip(&corners);
                    let beside = range(heights.map(|(p, c)| p.y - c.z));
                    self.enter(&print, [low, high], beside, scratch);
                }
                None if far <= 4.0 * self.finest || cuts >= TRIANGLE_HALVINGS => {
                    // It may hold points of the axis, and is as if it were at all angles.
                    for slab in self.filled_slabs([low, high]) {
                        slab.profile.iter_mut().for_each(|at| at.add([near, far], joint));
                    }
                }
                _ => stack.extend(halves(&corners).map(|half| (half, cuts + 1))),
            }
        }
    }

    /// Gaps across the axis that are narrower than this count as none, or a profile of facets would be in crumbs.
    fn joint(&self) -> f64 {
        PROFILE_JOINT * self.finest
    }

    fn slab(&self, z: f64) -> i64 {
        (z / self.pitch * SLABS_PER_PITCH).floor() as i64
    }

    /// The slabs from one index to another, made if missing.
    fn slabs_between(&mut self, low: i64, high: i64) -> &mut [Slab] {
        let empty = || Slab { profile: Vec::new(), further: [false; 2] };
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

    /// The slabs between two places along the axis, with a profile.
    fn filled_slabs(&mut self, [low, high]: [f64; 2]) -> &mut [Slab] {
        let heights = self.heights;
        let slabs = self.slabs_between(self.slab(low), self.slab(high));
        for slab in slabs.iter_mut().filter(|slab| slab.profile.is_empty()) {
            slab.profile.resize(heights, Distances::default());
        }
        slabs
    }

    /// Adds a footprint. Its heights on the helix differ from those along the axis, `along[0]` to `along[1]`, by
    /// something in `beside`.
    fn enter(&mut self, print: &Footprint, along: [f64; 2], beside: [f64; 2], scratch: &mut Vec<[f64; 2]>) {
        let (size, pitch, heights, joint) = (self.finest, self.pitch, self.heights, self.joint());
        let [from, to] = range(print.points.iter().map(|p| p.y));
        let first = reached(print, size, scratch);
        for (low, slab) in (self.slab(along[0])..).zip(self.filled_slabs(along)) {
            let ends = [low as f64, (low + 1) as f64].map(|z| z / SLABS_PER_PITCH * pitch);
            let from = ((from.max(ends[0] + beside[0]) - print.error) / size).floor() as i64;
            let to = ((to.min(ends[1] + beside[1]) + print.error) / size).floor() as i64;
            let mut bin = from.rem_euclid(heights as i64) as usize;
            let within = scratch.iter().skip((from - first) as usize).take((to - from + 1).max(0) as usize);
            for range in within {
                slab.profile[bin].add(*range, joint);
                bin = if bin + 1 == heights { 0 } else { bin + 1 };
            }
        }
    }

    /// The profile between two places along the axis, and whether something is nearer to the axis or further from it.
    fn exact_between(&self, [from, to]: [f64; 2]) -> (Vec<Distances>, [bool; 2]) {
        let within = |z: f64| self.slab(z).saturating_sub(self.first).clamp(-1, self.slabs.len() as i64);
        let slabs = within(from).max(0)..=within(to).min(self.slabs.len() as i64 - 1);
        let joint = self.joint();
        let mut all = vec![Distances::default(); self.heights];
        let mut further = [false; 2];
        for slab in slabs {
            let slab = &self.slabs[slab as usize];
            (0..2).for_each(|side| further[side] |= slab.further[side]);
            all.iter_mut().zip(&slab.profile).for_each(|(own, added)| own.add_all(added, joint));
        }
        (all, further)
    }

    /// The same with all that is nearer to the axis or further from it, as if it were everywhere there.
    fn between(&self, places: [f64; 2]) -> Vec<Distances> {
        let (mut all, further) = self.exact_between(places);
        let ([near, far], joint) = (self.zone.across, self.joint());
        for (is_there, range) in further.into_iter().zip([[0.0, near], [far, f64::INFINITY]]) {
            if is_there {
                all.iter_mut().for_each(|own| own.add(range, joint));
            }
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
        let has = |envelope: &Self, [from, to]: [f64; 2]| {
            envelope.zone.along[0] <= from && to <= envelope.zone.along[1]
        };
        if !has(self, places) || !has(other, other_places) {
            return false;
        }
        let (one, other) = (self.between(places), other.between(other_places));
        let [from_axis, from_other] =
            [&one, &other].map(|profile| range(profile.iter().flat_map(Distances::ends)));
        let stray = stray(from_axis[1].min(from_other[1]));
        // Where they may meet, they are no nearer to the axis than …
        let inner = from_axis[0].max(from_other[0]);
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
        (0..bins).all(|i| {
            let own = &one[i as usize];
            own.is_empty()
                || (-wide..=wide).all(|k| {
                    let beside = (k.abs() - 2).max(0) as f64 * size;
                    let across = (margin * margin - beside * beside).max(0.0).sqrt();
                    own.gap(&other[(i + k - moved).rem_euclid(bins) as usize]) > across
                })
        })
    }

    /// The shift of another profile along the axis, up to `most`, that makes the gap across the axis widest, and that
    /// gap, if there is one no wider. Of shifts that are interrupted by contact those nearest to none count, and only as
    /// long as the two have half of their common heights: further on, what was in a tunnel is beside it.
    pub(super) fn widest_gap(&self, other: &Self, most: f64) -> Option<(f64, f64)> {
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let [(one, _), (other, _)] = [self, other].map(|envelope| envelope.exact_between(everywhere));
        let (bins, size) = (self.heights as i64, self.finest);
        // The number of common heights, and the gap.
        let compared = |shift: i64| {
            let at = |i: i64| one[i as usize].gap(&other[(i - shift).rem_euclid(bins) as usize]);
            let near = (0..bins).map(at).filter(|gap| *gap <= most);
            near.fold((0, f64::INFINITY), |(count, least), gap| (count + 1, gap.min(least)))
        };
        let furthest = (most / size) as i64;
        let common = compared(0).0;
        let gap = |shift: i64| {
            let (count, gap) = compared(shift);
            if 2 * count > common { gap } else { f64::NEG_INFINITY }
        };
        let gaps: Vec<(f64, i64)> = (-furthest..=furthest).map(|shift| (gap(shift), shift)).collect();
        let runs = gaps.split(|(gap, _)| *gap <= 0.0).filter(|run| !run.is_empty());
        let gaps = runs.min_by_key(|run| run.iter().map(|(_, shift)| shift.abs()).min())?;
        let widest = gaps.iter().map(|(gap, _)| *gap).fold(f64::NEG_INFINITY, f64::max);
        let as_wide = || gaps.iter().filter(|(gap, _)| *gap >= widest * (1.0 - EQUAL_GAP));
        let middle = as_wide().map(|(_, shift)| *shift as f64).sum::<f64>() / as_wide().count() as f64;
        Some((widest, middle * size))
    }
}

/// The range of a footprint across the axis, by bins of heights of some size, and the first bin.
fn reached(print: &Footprint, size: f64, ranges: &mut Vec<[f64; 2]>) -> i64 {
    let [low, high] = range(print.points.iter().map(|p| p.y));
    let bins =
        |low: f64, high: f64| [low - print.error, high + print.error].map(|y| (y / size).floor() as i64);
    let [first, last] = bins(low, high);
    ranges.clear();
    ranges.resize((last - first + 1) as usize, [f64::INFINITY, f64::NEG_INFINITY]);
    for i in 0..3 {
        let (a, b) = (print.points[i], print.points[(i + 1) % 3]);
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        let [least, most] = range([a.x, b.x].into_iter());
        let slope = (b.x - a.x) / (b.y - a.y);
        let at = |y: f64| (a.x + slope * (y - a.y)).clamp(least, most);
        let [from, to] = bins(a.y, b.y);
        for (bin, known) in (from..=to).zip(&mut ranges[(from - first) as usize..]) {
            let low = bin as f64 * size - print.error;
            let ends = if slope.is_finite() {
                range([at(low), at(low + size + 2.0 * print.error)].into_iter())
            } else {
                [least, most]
            };
            *known = [known[0].min(ends[0]), known[1].max(ends[1])];
        }
    }
    for [near, far] in ranges {
        (*near, *far) = (*near - print.error, *far + print.error);
    }
    first
}

/// The two halves of a triangle, cut across the side that is longest across the axis.
fn halves(corners: &[Point3<f64>; 3]) -> [[Point3<f64>; 3]; 2] {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).xy().norm_squared();
    let side = (1..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
    let [a, b, c] = [0, 1, 2].map(|k| corners[(side + k) % 3]);
    let cut = nalgebra::center(&a, &b);
    [[a, cut, c], [cut, b, c]]
}
