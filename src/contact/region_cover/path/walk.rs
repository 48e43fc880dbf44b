//! The search over pieces of surface and stretches of the path: what no bound settles is split.

use nalgebra::{Point3, Vector3};

use crate::budgets::{
    EFFORT_PER_HALVING, HOPELESS_AFTER, HOPELESS_SHARE, HULL_CORNERS, MOST_HALVINGS, WANTED_CORNERS,
};
use crate::geometry::{FreeRegion, area_normal, bisected};
use crate::termination::Interrupt;
use crate::tolerances::{CLIP_MARGIN, DOUBTED_SIZE, FACING_ACROSS};

use super::super::super::course::{Interval, Leg};
use super::super::cover;
use super::super::pieces::Piece;
use super::bound::{furthest_of, swept};
use super::clip::clipped;
use super::{DepthPrecision, PathSearch, SearchHint, SweptBall};

/// Corners of the prism that a triangle sweeps on a straight path.
const OF_STRAIGHT_WAY: usize = 6;

/// A piece of the surface on a stretch of the way.
#[derive(Clone, Copy)]
struct SweptPiece {
    piece: Piece,
    /// The corners of a bit that were not measured yet at the end of the stretch; the others were, with the piece of
    /// which this is a part.
    is_new: [bool; 3],
    interval: Interval,
    /// Its share of all.
    share: f64,
    hint: SearchHint,
}

/// What is to be done about a piece.
enum Next {
    Nothing,
    /// Half of the stretch, or part of the surface.
    Split {
        in_time: bool,
    },
}

impl PathSearch<'_> {
    /// Searches all of the surface on a stretch of the path.
    pub(super) fn all(&mut self, interval: Interval) -> Result<(), Interrupt> {
        if let Some(piece) = self.question.covered.root() {
            let hint = SearchHint { triangle: 0, region: None, is_vain: false };
            let root = SweptPiece { piece, is_new: [true; 3], interval, share: 1.0, hint };
            cover(vec![root], |mut piece, rest| {
                self.poll.check()?;
                self.found.effort += self.price;
                if self.is_enough() {
                    rest.clear();
                    return Ok(());
                }
                let leg = self.view.leg(piece.interval);
                let next = match piece.piece {
                    _ if leg.maps.is_empty() => Next::Split { in_time: true },
                    Piece::Patch(node) => self.patch(node, &leg, &mut piece.hint),
                    Piece::Bit(corners) => self.bit(&corners, &leg, &mut piece),
                };
                match next {
                    Next::Nothing => self.done += piece.share,
                    Next::Split { in_time } => self.split(&piece, &leg, in_time, rest),
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

    /// Bounds a node of the tree on a stretch of the path.
    fn patch(&mut self, node: u32, leg: &Leg, hint: &mut SearchHint) -> Next {
        let tree = self.question.covered.tree;
        let patch = tree.patch(node);
        let centres: Vec<_> = leg.maps.iter().map(|m| m.apply(&patch.centre)).collect();
        let ball = patch.radius * leg.stretch + leg.slack;
        if self.is_apart(&centres, ball) {
            return Next::Nothing;
        }
        let swept = swept(&centres, ball);
        self.wanted.clear();
        self.facing = Vector3::zeros();
        self.wanted.extend(leg.images(tree.extremes(node)));
        let points = tree.vertices(node);
        self.hull.clear();
        if points.len() * leg.maps.len() <= HULL_CORNERS {
            self.hull.extend(leg.images(points));
        }
        let fits = |region: &FreeRegion, most: f64| {
            if centres.iter().all(|c| region.holds_ball(c, ball)) {
                return Some((0.0, swept.centre));
            }
            furthest_of(tree, node, leg, region, most)
        };
        let corners = || {
            let few = if points.len() * leg.maps.len() <= WANTED_CORNERS { points } else { &[] };
            leg.images(few).collect()
        };
        if self.is_settled(&swept, leg.slack, hint, fits, corners) {
            return Next::Nothing;
        }
        // What is beyond the ball is half of the stretch. On a straight path all that a small piece sweeps is
        // convex: what does not fit is as wide on each half of the stretch.
        Next::Split { in_time: leg.along.is_none() && swept.radius - ball > 2.0 * patch.radius }
    }

    /// Bounds a triangle, or a piece of one, on a stretch of the path.
    fn bit(&mut self, corners: &[Point3<f64>; 3], leg: &Leg, piece: &mut SweptPiece) -> Next {
        let points: Vec<_> = leg.maps.iter().flat_map(|m| corners.map(|p| m.apply(&p))).collect();
        if self.is_apart(&points, leg.slack) {
            return Next::Nothing;
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
        let fits = |region: &FreeRegion, most: f64| region.furthest(seen.iter().copied(), most);
        if self.is_settled(&within, leg.slack, &mut piece.hint, fits, Vec::new)
            || self.is_measured(corners, piece, leg, &swept(&points, leg.slack))
        {
            return Next::Nothing;
        }
        let (longest, _) = bisected(corners);
        let moved = points[..points.len() - 3].iter().zip(&points[3..]);
        Next::Split { in_time: moved.into_iter().any(|(a, b)| (b - a).norm() > longest) }
    }

    /// Pushes the parts of a piece, or the piece on the halves of its stretch: of patches the first one last, of bits the
    /// last one.
    fn split(&self, piece: &SweptPiece, leg: &Leg, in_time: bool, rest: &mut Vec<SweptPiece>) {
        // The corners that were measured at the end of the stretch.
        let measured = match &piece.piece {
            Piece::Bit(corners) if !leg.maps.is_empty() => &corners[..],
            _ => &[],
        };
        let mut parts: Vec<SweptPiece>;
        if in_time && leg.length > self.finest() / (2.0 * DOUBTED_SIZE) {
            let [first, second] = piece.interval.halves();
            // The second half of the stretch ends where the whole ends.
            let is_new = piece.is_new.map(|new| new && measured.is_empty());
            parts = vec![
                SweptPiece { interval: first, is_new: [true; 3], ..*piece },
                SweptPiece { interval: second, is_new, ..*piece },
            ];
        } else {
            let part = |part: Piece| SweptPiece {
                is_new: match &part {
                    Piece::Bit(corners) => corners.map(|p| !measured.contains(&p)),
                    Piece::Patch(_) => [true; 3],
                },
                piece: part,
                ..*piece
            };
            parts = self.question.covered.parts(&piece.piece).into_iter().map(part).collect();
        }
        if matches!(piece.piece, Piece::Patch(_)) {
            parts.reverse();
        }
        let share = piece.share / parts.len() as f64;
        rest.extend(parts.into_iter().map(|part| SweptPiece { share, ..part }));
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
    fn is_measured(
        &mut self,
        corners: &[Point3<f64>; 3],
        SweptPiece { is_new, hint, .. }: &SweptPiece,
        leg: &Leg,
        swept: &SweptBall,
    ) -> bool {
        let question = self.question;
        let over =
            |at: &Point3<f64>| -question.measured.signed_closest(at, hint.triangle).signed - question.allowed;
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
