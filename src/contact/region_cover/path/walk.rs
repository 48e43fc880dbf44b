//! The search over pieces of surface and stretches of the path: what no bound settles is split.

use nalgebra::{Point3, Vector3};

use crate::budgets::{
    EFFORT_PER_HALVING, HOPELESS_AFTER, HOPELESS_SHARE, HULL_CORNERS, MOST_HALVINGS, WANTED_CORNERS,
};
use crate::geometry::{FreeRegion, Parts, area_normal, bisected};
use crate::termination::Interrupt;
use crate::tolerances::{CLIP_MARGIN, DOUBTED_SIZE, FACING_ACROSS};

use super::super::super::course::{Interval, Leg};
use super::super::cover;
use super::bound::{furthest, furthest_of, swept};
use super::clip::clipped;
use super::{DepthPrecision, PathSearch, SearchHint, SweptBall};

/// Corners of the prism that a triangle sweeps on a straight path.
const OF_STRAIGHT_WAY: usize = 6;

/// A piece of the surface on a stretch of the way.
#[derive(Clone, Copy)]
enum SweptPiece {
    Patch(PatchPiece),
    Triangle(TrianglePiece),
}

/// A node of the tree on a stretch of the way.
#[derive(Clone, Copy)]
struct PatchPiece {
    node: u32,
    interval: Interval,
    /// Its share of all.
    share: f64,
    hint: SearchHint,
}

/// A triangle, or a piece of one, on a stretch of the way.
#[derive(Clone, Copy)]
struct TrianglePiece {
    corners: [Point3<f64>; 3],
    /// The corners that were not measured yet at the end of the stretch; the others were, with the piece of which
    /// this is a half.
    is_new: [bool; 3],
    interval: Interval,
    /// Its share of all.
    share: f64,
    hint: SearchHint,
}

impl PathSearch<'_> {
    /// Searches all of the surface on a stretch of the path.
    pub(super) fn all(&mut self, interval: Interval) -> Result<(), Interrupt> {
        if let Some(node) = self.question.tree.root() {
            let hint = SearchHint { triangle: 0, region: None, is_vain: false };
            let root = SweptPiece::Patch(PatchPiece { node, interval, share: 1.0, hint });
            cover(vec![root], |piece, rest| {
                self.poll.check()?;
                self.found.effort += self.price;
                if self.is_enough() {
                    rest.clear();
                    return Ok(());
                }
                match piece {
                    SweptPiece::Patch(piece) => self.patch(piece, rest),
                    SweptPiece::Triangle(piece) => self.triangle(piece, rest),
                }
                if self.first_deep.is_none() && !self.found.deep.is_empty() {
                    self.first_deep = Some(self.found.effort);
                }
                Ok(())
            })?;
        }
        if self.gave_up() {
            self.found.open.push(interval);
        }
        Ok(())
    }

    fn gave_up(&self) -> bool {
        self.found.effort > self.most_effort || self.is_hopeless()
    }

    /// Whether, near holes, so little is bounded after this effort that most will stay open.
    fn is_hopeless(&self) -> bool {
        self.has_rim && self.found.effort > self.most_effort / HOPELESS_AFTER && self.done < HOPELESS_SHARE
    }

    fn is_enough(&self) -> bool {
        // A search for more deep points takes no longer than that for the first one.
        let (effort, few) = (self.found.effort, EFFORT_PER_HALVING);
        let is_refuted = self.first_deep.is_some_and(|first| effort > (2 * first).max(few));
        self.gave_up() || self.found.is_enough() || is_refuted
    }

    /// Bounds a node of the tree on a stretch of the path, or splits it.
    fn patch(&mut self, piece: PatchPiece, rest: &mut Vec<SweptPiece>) {
        let PatchPiece { node: index, interval, share, mut hint } = piece;
        let tree = self.question.tree;
        let patch = tree.patch(index);
        let leg = self.view.leg(interval);
        let mut in_time = leg.maps.is_empty();
        if !in_time {
            let centres: Vec<_> = leg.maps.iter().map(|m| m.apply(&patch.centre)).collect();
            let ball = patch.radius * leg.stretch + leg.slack;
            if self.is_apart(&centres, ball) {
                self.done += share;
                return;
            }
            let swept = swept(&centres, ball);
            // What is beyond the ball is half of the stretch. On a straight path all that a small piece sweeps is
            // convex: what does not fit is as wide on each half of the stretch.
            in_time = leg.along.is_none() && swept.radius - ball > 2.0 * patch.radius;
            self.wanted.clear();
            self.facing = Vector3::zeros();
            self.wanted.extend(leg.images(tree.extremes(index)));
            let points = tree.vertices(index);
            self.hull.clear();
            if points.len() * leg.maps.len() <= HULL_CORNERS {
                self.hull.extend(leg.images(points));
            }
            let fits = |region: &FreeRegion, most: f64| {
                if centres.iter().all(|c| region.holds_ball(c, ball)) {
                    return Some((0.0, swept.centre));
                }
                furthest_of(tree, index, &leg, region, most)
            };
            let corners = || {
                let few = if points.len() * leg.maps.len() <= WANTED_CORNERS { points } else { &[] };
                leg.images(few).collect()
            };
            if self.is_settled(&swept, leg.slack, &mut hint, fits, corners) {
                self.done += share;
                return;
            }
        }
        let share = share / 2.0;
        if in_time && leg.length > self.finest() / (2.0 * DOUBTED_SIZE) {
            let [first, second] = interval.halves();
            let half = |interval| SweptPiece::Patch(PatchPiece { interval, share, hint, ..piece });
            rest.extend([second, first].map(half));
            return;
        }
        match tree.parts(index) {
            Parts::Patches([left, right]) => {
                let child = |node| SweptPiece::Patch(PatchPiece { node, share, hint, ..piece });
                rest.extend([right, left].map(child));
            }
            Parts::Triangles(list) => {
                let share = piece.share / list.len() as f64;
                rest.extend(list.iter().rev().map(|&t| {
                    let corners = self.question.surface.corners(t);
                    SweptPiece::Triangle(TrianglePiece { corners, is_new: [true; 3], interval, share, hint })
                }));
            }
        }
    }

    /// Bounds a triangle, or a piece of one, on a stretch of the path, or splits it.
    fn triangle(&mut self, piece: TrianglePiece, rest: &mut Vec<SweptPiece>) {
        let TrianglePiece { corners, is_new, interval, mut hint, .. } = piece;
        let leg = self.view.leg(interval);
        let (longest, halves) = bisected(&corners);
        let mut in_time = leg.maps.is_empty();
        if !in_time {
            let points: Vec<_> = leg.maps.iter().flat_map(|m| corners.map(|p| m.apply(&p))).collect();
            if self.is_apart(&points, leg.slack) {
                self.done += piece.share;
                return;
            }
            let clipped = self.clipped(&points, leg.slack);
            let seen = clipped.as_deref().unwrap_or(&points);
            let within = swept(seen, leg.slack);
            self.wanted.clear();
            self.wanted.extend_from_slice(seen);
            self.hull.clone_from(&self.wanted);
            let outward = area_normal(&corners[0], &corners[1], &corners[2]);
            self.facing = leg.end.rotation * -outward.try_normalize(0.0).unwrap_or_default();
            if let Some(along) = leg.along {
                // A plane that is askew to a long straight path is far off at its ends.
                let across = self.facing - along * self.facing.dot(&along);
                self.facing = across.try_normalize(FACING_ACROSS).unwrap_or(self.facing);
            }
            let fits = |region: &FreeRegion, most: f64| furthest(seen.iter().copied(), region, most);
            if self.is_settled(&within, leg.slack, &mut hint, fits, Vec::new)
                || self.is_measured(&piece, &leg, &swept(&points, leg.slack), hint.triangle)
            {
                self.done += piece.share;
                return;
            }
            in_time =
                points[..points.len() - 3].iter().zip(&points[3..]).any(|(a, b)| (b - a).norm() > longest);
        }
        let was_measured = !leg.maps.is_empty();
        let share = piece.share / 2.0;
        if in_time && leg.length > self.finest() / (2.0 * DOUBTED_SIZE) {
            // The second half of the stretch ends where the whole ends.
            let [first, second] = interval.halves();
            let half = |is_new, interval| {
                SweptPiece::Triangle(TrianglePiece { is_new, interval, share, hint, ..piece })
            };
            rest.push(half([true; 3], first));
            rest.push(half(is_new.map(|new| new && !was_measured), second));
        } else {
            rest.extend(halves.map(|half| {
                let is_new = half.map(|p| !(was_measured && corners.contains(&p)));
                SweptPiece::Triangle(TrianglePiece { corners: half, is_new, interval, share, hint })
            }));
        }
    }

    /// The part of a hull that may be in the measured surface, if it is a small part. What is beyond the surface's
    /// box is outside, unless the surface has holes. On a path with bends there are too many lines to clip.
    fn clipped(&self, points: &[Point3<f64>], slack: f64) -> Option<Vec<Point3<f64>>> {
        if self.has_rim || points.len() > OF_STRAIGHT_WAY {
            return None;
        }
        clipped(points, &self.question.measured.bounds().grown(slack + CLIP_MARGIN))
    }

    /// Whether the box of the measured surface lies beside a hull of balls.
    fn is_apart(&self, centres: &[Point3<f64>], radius: f64) -> bool {
        let bounds = self.question.measured.bounds();
        (0..3).any(|a| {
            centres.iter().all(|c| c[a] - radius >= bounds.max[a])
                || centres.iter().all(|c| c[a] + radius <= bounds.min[a])
        })
    }

    /// Measures the corners of a piece at its end; returns whether nothing more can be said about the piece.
    fn is_measured(&mut self, piece: &TrianglePiece, leg: &Leg, swept: &SweptBall, guess: u32) -> bool {
        let TrianglePiece { corners, is_new, .. } = piece;
        let question = self.question;
        let over = |at: &Point3<f64>| {
            -question.measured.signed(at, &question.measured.closest_from(at, guess)) - question.allowed
        };
        for (p, _) in corners.iter().zip(is_new).filter(|(_, new)| **new) {
            let over = over(&(leg.end * p));
            self.found.depth = self.found.depth.max(over);
            if over > question.precision.deep {
                self.found.deep.push((*p, over));
            }
        }
        self.found.bound = self.found.bound.max(self.found.depth);
        if swept.radius > self.finest() {
            return self.is_enough();
        }
        if !self.found.deep.is_empty() {
            return true;
        }
        // As in `is_settled`: depth changes by no more than the distance, except near holes.
        let mut bound = over(&swept.centre) + swept.radius;
        if self.has_rim {
            bound = self.wanted.iter().map(over).fold(bound, f64::max);
        }
        if bound > question.precision.deep {
            if swept.radius > self.finest() / DOUBTED_SIZE {
                return false;
            }
            self.found.deep.push((corners[0], bound));
        }
        self.settled(question.allowed + bound)
    }

    /// The depth up to which nothing is searched: allowed, ignored, or as good as found.
    pub(super) fn ignored(&self) -> f64 {
        let precision = self.question.precision;
        let found = self.found.depth + precision.margin_of(self.found.depth);
        // What touches all along a path is bounded less precisely, the longer it takes.
        let halvings = (self.found.effort / EFFORT_PER_HALVING).min(MOST_HALVINGS) as i32;
        let coarse =
            if precision.deep.is_finite() { precision.deep * (1.0 - 0.5f64.powi(halvings)) } else { 0.0 };
        let ignored = precision.ignored.max(coarse);
        self.question.allowed + found.min(precision.deep).max(ignored)
    }

    /// The smallest size of pieces at present.
    fn finest(&self) -> f64 {
        let DepthPrecision { deep, finest, coarse, .. } = self.question.precision;
        if self.found.depth > deep { coarse } else { finest }
    }
}
