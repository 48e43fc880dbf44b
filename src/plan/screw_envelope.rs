//! How far a surface reaches from the axis of a helix, and how near it comes to it, by the height on
//! the helix: the profiles of a bolt and of a nut.
//!
//! All turns of a thread lie on each other there (see [`Helix`](crate::geometry::Helix)). If the profile of one part is beyond
//! that of the other at every height, and nowhere nearer than the part strays from the helix, then the
//! helical sheet between the two parts them at every angle: nothing is met.

use nalgebra::Point3;

use crate::geometry::{Footprint, Helix};

/// Slabs along the axis per pitch: what is elsewhere does not count.
const SLABS: f64 = 4.0;
/// Heights that are told apart within a pitch, at most.
const MOST_BINS: f64 = 4096.0;
/// Halvings of a triangle until it is taken as it is.
const MOST_CUTS: u32 = 24;

/// From the least to the largest distance from the axis, by height on the helix.
#[derive(Debug, Clone)]
struct Reaches(Vec<[f64; 2]>);

/// The profile of a surface.
pub(super) struct Envelope {
    pitch: f64,
    bins: usize,
    /// Errors of footprints below this are not worth further cuts.
    finest: f64,
    /// Index of the first slab.
    first: i64,
    slabs: Vec<Reaches>,
}

impl Envelope {
    /// The profile of triangles (axis frame) along a helix that rises, as exact as `finest`.
    pub(super) fn new(triangles: impl Iterator<Item = [Point3<f64>; 3]>, helix: &Helix, finest: f64) -> Self {
        let pitch = helix.pitch().abs();
        let bins = (pitch / finest).ceil().clamp(16.0, MOST_BINS) as usize;
        let mut envelope = Self { pitch, bins, finest, first: 0, slabs: Vec::new() };
        for corners in triangles {
            envelope.add(&corners, helix.rise);
        }
        envelope
    }

    fn add(&mut self, corners: &[Point3<f64>; 3], rise: f64) {
        let mut stack = vec![(*corners, 0)];
        while let Some((corners, cuts)) = stack.pop() {
            let print = Footprint::of(&corners, rise);
            let small =
                corners.iter().all(|p| p.xy().coords.norm() <= 4.0 * self.finest) || cuts >= MOST_CUTS;
            match print {
                Some(print) if print.error <= self.finest || cuts >= MOST_CUTS => {
                    self.enter(&print, &corners)
                }
                None if small => self.enter(&Footprint::at_all_angles(&corners, rise), &corners),
                _ => stack.extend(halves(&corners).map(|half| (half, cuts + 1))),
            }
        }
    }

    /// Notes where a footprint reaches.
    fn enter(&mut self, print: &Footprint, corners: &[Point3<f64>; 3]) {
        let slab = |z: f64| (z / self.pitch * SLABS).floor() as i64;
        let (low, high) = min_max(corners.iter().map(|p| p.z));
        let (low, high) = (slab(low), slab(high));
        let empty = || Reaches(vec![[f64::INFINITY, f64::NEG_INFINITY]; self.bins]);
        if self.slabs.is_empty() {
            self.first = low;
        }
        while low < self.first {
            self.slabs.insert(0, empty());
            self.first -= 1;
        }
        while high >= self.first + self.slabs.len() as i64 {
            self.slabs.push(empty());
        }
        let size = self.pitch / self.bins as f64;
        let (from, to) = min_max(print.points.iter().map(|p| p.y));
        let [from, to] =
            [((from - print.error) / size).floor() as i64, ((to + print.error) / size).floor() as i64];
        // What reaches over more than a pitch comes by everywhere.
        for bin in from..=to {
            let [near, far] = reach(print, [bin as f64 * size, (bin + 1) as f64 * size]);
            let at = bin.rem_euclid(self.bins as i64) as usize;
            for slab in low..=high {
                let own = &mut self.slabs[(slab - self.first) as usize].0[at];
                *own = [own[0].min(near), own[1].max(far)];
            }
        }
    }

    /// The profile between two places along the axis.
    fn between(&self, [from, to]: [f64; 2]) -> Reaches {
        let slab = |z: f64| (z / self.pitch * SLABS).floor() as i64 - self.first;
        let range = slab(from).max(0)..=slab(to).min(self.slabs.len() as i64 - 1);
        let mut all = Reaches(vec![[f64::INFINITY, f64::NEG_INFINITY]; self.bins]);
        for slab in range {
            for (own, [near, far]) in all.0.iter_mut().zip(&self.slabs[slab as usize].0) {
                *own = [own[0].min(*near), own[1].max(*far)];
            }
        }
        all
    }

    /// Whether this surface, between two places along the axis, stays apart from another between two
    /// places, which is shifted along the axis and strays from there, the more the further its points
    /// are from the axis.
    pub(super) fn is_apart(
        &self,
        places: [f64; 2],
        other: &Self,
        other_places: [f64; 2],
        shift: f64,
        stray: impl Fn(f64) -> f64,
    ) -> bool {
        let (one, other) = (self.between(places), other.between(other_places));
        let widest = |r: &Reaches| r.0.iter().map(|[_, far]| *far).fold(0.0, f64::max);
        let stray = stray(widest(&one).min(widest(&other)));
        let narrowest = |r: &Reaches| r.0.iter().map(|[near, _]| *near).fold(f64::INFINITY, f64::min);
        // Where one is around the other, that is no nearer to the axis than …
        let inner = narrowest(&one).max(narrowest(&other));
        if inner <= 2.0 * stray {
            return false;
        }
        // A way in space is a little longer in the half plane.
        let rise = self.pitch / std::f64::consts::TAU;
        let margin = stray * 1.0f64.hypot(2.0 * rise / inner);
        let size = self.pitch / self.bins as f64;
        let bins = self.bins as i64;
        let moved = (shift / size).floor() as i64;
        let wide = (margin / size).ceil() as i64 + 2;
        if wide * 2 >= bins {
            return false;
        }
        let is_inside = |inner: &Reaches, outer: &Reaches, moved: i64| {
            (0..bins).all(|i| {
                let far = inner.0[i as usize][1];
                far == f64::NEG_INFINITY
                    || (-wide..=wide).all(|k| {
                        let beside = (k.abs() - 2).max(0) as f64 * size;
                        let across = (margin * margin - beside * beside).max(0.0).sqrt();
                        outer.0[(i + k - moved).rem_euclid(bins) as usize][0] > far + across
                    })
            })
        };
        is_inside(&one, &other, moved) || is_inside(&other, &one, -moved)
    }
}

/// From where to where a footprint reaches across, between two heights.
fn reach(print: &Footprint, [low, high]: [f64; 2]) -> [f64; 2] {
    let (low, high) = (low - print.error, high + print.error);
    let mut found = [f64::INFINITY, f64::NEG_INFINITY];
    for i in 0..3 {
        let (a, b) = (print.points[i], print.points[(i + 1) % 3]);
        if a.y.min(b.y) > high || a.y.max(b.y) < low {
            continue;
        }
        let at = |y: f64| {
            let share = if a.y == b.y { 0.0 } else { ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0) };
            a.x + (b.x - a.x) * share
        };
        let ends = if a.y == b.y { [a.x, b.x] } else { [at(low), at(high)] };
        found = [found[0].min(ends[0]).min(ends[1]), found[1].max(ends[0]).max(ends[1])];
    }
    [found[0] - print.error, found[1] + print.error]
}

fn min_max(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The two halves of a triangle, cut across the side that is longest beside the axis.
fn halves(corners: &[Point3<f64>; 3]) -> [[Point3<f64>; 3]; 2] {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).xy().norm_squared();
    let side = (1..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
    let [a, b, c] = [0, 1, 2].map(|k| corners[(side + k) % 3]);
    let cut = nalgebra::center(&a, &b);
    [[a, cut, c], [cut, b, c]]
}
