//! Finds regions for the pieces of one surface that another surface does not enter.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::geometry::{NoRegion, SignedClosest};
use crate::termination::Termination;
use crate::tolerances::{
    CONTACT_STEP, HELD, HELD_AT_FIRST, LEAST_SHARE_AHEAD, ROUNDED, SHIFTS_AHEAD, SMALL_BIT_AHEAD,
    SMALLEST_BIT,
};

use super::super::pieces::PlacedPiece;
use super::super::surface_pair::{CoverPiece, Obstacle, Slope, SurfacePair, WantedShift, Witness};
use super::super::{Halt, cover};
use super::piece::{ShiftLimit, ShiftPiece};

/// The index in [`SHIFTS_AHEAD`] that is tried first; shorter ones are tried only where something is near ahead.
const SHORT: usize = 2;

/// The number of next pieces that are searched in parallel with one.
const BESIDE: usize = 3;

/// A piece that is still to be covered, and the result of its search, if a thread made it ahead.
struct PendingPiece {
    spot: CoverPiece,
    /// Its share of the whole surface: the parts of a piece have equal shares.
    share: f64,
    looked: Option<PieceSearch>,
}

/// The result of searching a region for all of a piece. It depends on the piece and the wanted shift alone.
struct PieceSearch {
    /// With the nearest triangle.
    spot: CoverPiece,
    piece: Option<ShiftPiece>,
    is_smallest: bool,
    /// The number of regions that were computed.
    regions: usize,
}

/// The search for the cover of one pair.
pub(crate) struct ShiftSearch<'a> {
    termination: &'a Termination,
    pair: &'a SurfacePair<'a>,
    /// The number of regions that were computed.
    pub(crate) regions: usize,
    /// The largest number of regions.
    pub(crate) budget: usize,
    /// The pieces that were covered.
    pub(crate) pieces: Vec<ShiftPiece>,
    /// Normals of obstacles.
    pub(crate) obstacles: Vec<Vector3<f64>>,
    /// Points that show obstacles.
    pub(crate) witnesses: Vec<Witness>,
    /// An estimate of the regions that a whole cover needs.
    pub(crate) needed: f64,
    /// The pieces of a whole cover that are still to be covered; the next one is the last.
    waiting: Vec<PendingPiece>,
    /// The current piece.
    placed: PlacedPiece,
}

impl<'a> ShiftSearch<'a> {
    /// A search that covers all of the surface, each piece outside its region by no more than `held`.
    pub(crate) fn of_all(pair: &'a SurfacePair<'a>, held: f64, termination: &'a Termination) -> Self {
        let mut search = Self::new(pair, 0, termination);
        let all = pair.covered.root().map(|piece| CoverPiece { piece, guess: 0, level: 0, held });
        search.waiting.extend(all.map(|spot| PendingPiece { spot, share: 1.0, looked: None }));
        search
    }

    pub(crate) fn new(pair: &'a SurfacePair<'a>, budget: usize, termination: &'a Termination) -> Self {
        Self {
            termination,
            pair,
            regions: 0,
            budget,
            pieces: Vec::new(),
            obstacles: Vec::new(),
            witnesses: Vec::new(),
            needed: 0.0,
            waiting: Vec::new(),
            placed: PlacedPiece::default(),
        }
    }

    /// Continues a cover of [all](Self::of_all) pieces at a shift, always the same, with wide regions. Stops after
    /// `budget` regions in all or somewhat more than `most` pieces. Returns whether the cover is complete.
    pub(crate) fn gather(&mut self, at: &Vector3<f64>, budget: usize, most: usize) -> Result<bool, Halt> {
        let wish = WantedShift { at: *at, along: Vector3::zeros() };
        self.budget = budget;
        let (regions, left) = (self.regions, self.left());
        while let Some(next) = self.waiting.pop() {
            self.termination.check()?;
            if self.regions >= self.budget || self.pieces.len() > most {
                self.waiting.push(next);
                // An estimate from the pace of this call: pieces before it may have lain free.
                let pace = (self.regions - regions) as f64 / (left - self.left()).max(f64::MIN_POSITIVE);
                self.needed = self.regions as f64 + pace * self.left();
                return Ok(false);
            }
            let looked = next.looked.unwrap_or_else(|| self.looked_beside(&next.spot, &wish));
            let PieceSearch { spot, piece, is_smallest, regions } = looked;
            self.regions += regions;
            if let Some(piece) = piece {
                self.pieces.push(piece);
            } else if is_smallest {
                self.pair.place(&spot.piece, &wish.at, &mut self.placed);
                self.end(&spot, &wish)?;
            } else {
                let parts = self.pair.covered.parts(&spot.piece);
                let share = next.share / parts.len() as f64;
                let waiting = |piece| PendingPiece {
                    spot: CoverPiece { piece, level: 0, ..spot },
                    share,
                    looked: None,
                };
                self.waiting.extend(parts.into_iter().rev().map(waiting));
            }
        }
        Ok(true)
    }

    /// The share of the surface that is still to be covered.
    fn left(&self) -> f64 {
        self.waiting.iter().map(|waiting| waiting.share).sum()
    }

    /// Searches a region for a piece and, in parallel, for the pieces that probably come next: when a single pair is
    /// new, other threads are idle. Searches take unequal times.
    fn looked_beside(&mut self, spot: &CoverPiece, wish: &WantedShift) -> PieceSearch {
        let (pair, termination) = (self.pair, self.termination);
        let look = |spot: &CoverPiece| ShiftSearch::new(pair, 1, termination).looked(*spot, wish);
        if !other_thread() {
            return look(spot);
        }
        let from = self.waiting.len().saturating_sub(BESIDE);
        let not_yet = self.waiting[from..].iter_mut().filter(|waiting| waiting.looked.is_none());
        let beside: Vec<&mut PendingPiece> = not_yet.collect();
        let look_at = |waiting: &mut PendingPiece| waiting.looked = Some(look(&waiting.spot));
        rayon::join(|| look(spot), || beside.into_par_iter().for_each(look_at)).0
    }

    fn looked(mut self, mut spot: CoverPiece, wish: &WantedShift) -> PieceSearch {
        let seen = self.place(&mut spot, wish);
        let free = self.free(&spot, &seen, wish);
        let piece = free.or_else(|| self.held(&spot, &seen, wish, &Vector3::zeros()).ok());
        PieceSearch { spot, piece, is_smallest: self.is_smallest(&spot), regions: self.regions }
    }

    /// Covers a piece at a shift, with as much room as possible along the unit vector `u`.
    pub(crate) fn find(&mut self, spot: CoverPiece, at: &Vector3<f64>, u: &Vector3<f64>) -> Result<(), Halt> {
        let wish = WantedShift { at: *at, along: *u };
        cover(vec![spot], |spot, parts| self.renew(spot, &wish, parts))
    }

    /// A region for all of a piece that lets it go further than `least` along the unit vector `u`, if there is one.
    pub(crate) fn far(&mut self, mut spot: CoverPiece, u: &Vector3<f64>, least: f64) -> Option<ShiftPiece> {
        let wish = WantedShift { at: Vector3::zeros(), along: *u };
        let seen = self.place(&mut spot, &wish);
        let let_go = |level: usize| {
            self.held(&CoverPiece { level, ..spot }, &seen, &wish, &(u * SHIFTS_AHEAD[level])).ok()
        };
        (0..SHORT).find_map(let_go).filter(|piece| piece.length(&wish.at, u) > least)
    }

    /// Makes a piece the current one, and looks at its centre.
    fn place(&mut self, spot: &mut CoverPiece, wish: &WantedShift) -> SignedClosest {
        self.pair.place(&spot.piece, &wish.at, &mut self.placed);
        let seen = self.pair.measured.signed_closest(&self.placed.centre, spot.guess);
        spot.guess = seen.closest.triangle;
        seen
    }

    /// The current piece without a region, if it is so far off that it needs none.
    fn free(&self, spot: &CoverPiece, seen: &SignedClosest, wish: &WantedShift) -> Option<ShiftPiece> {
        let room = seen.signed - self.placed.radius;
        let held = if self.pair.allowed > 0.0 { spot.held } else { HELD };
        let ball = (self.placed.centre, seen.signed);
        let spot = CoverPiece { held, ..*spot };
        (room >= CONTACT_STEP).then(|| ShiftPiece { spot, limits: Vec::new(), middle: wish.at, room, ball })
    }

    fn block(&mut self, by: &[Obstacle]) {
        self.obstacles.extend(by.iter().map(|o| o.normal));
    }

    /// Covers a piece, with as much room as possible along the wanted shift, or pushes its parts.
    fn renew(
        &mut self,
        mut spot: CoverPiece,
        wish: &WantedShift,
        parts: &mut Vec<CoverPiece>,
    ) -> Result<(), Halt> {
        self.termination.check()?;
        if self.regions >= self.budget {
            return Err(Halt::Lost);
        }
        let seen = self.place(&mut spot, wish);
        if let Some(piece) = self.free(&spot, &seen, wish) {
            self.pieces.push(piece);
            return Ok(());
        }
        let small = spot.piece.is_bit_below(SMALL_BIT_AHEAD, self.placed.radius);
        let let_go = |pieces: &mut Self, level: usize| {
            pieces.held(&CoverPiece { level, ..spot }, &seen, wish, &(wish.along * SHIFTS_AHEAD[level]))
        };
        match let_go(self, SHORT) {
            Ok(short) => {
                let further = (0..SHORT).find_map(|level| let_go(self, level).ok());
                let piece = further.unwrap_or(short);
                // A piece that gets no further the second time may do so in parts.
                if !small && piece.spot.level > 0 && piece.spot.level == spot.level {
                    return self.split(&spot, wish, parts);
                }
                self.pieces.push(piece);
                return Ok(());
            }
            Err(NoRegion::Amid(t)) if !small && !self.is_beside(&spot, t) => {
                return self.split(&spot, wish, parts);
            }
            Err(_) => {}
        }
        let pair = self.pair;
        let probes = pair.probes_ahead(&spot.piece, &self.placed, wish);
        let certain = pair.obstacles(&probes, wish, (spot.guess, Slope::Any), &mut self.witnesses);
        if !certain.is_empty() {
            self.block(&certain);
            return Err(Halt::Blocked);
        }
        let nearer = (SHORT + 1..SHIFTS_AHEAD.len()).find_map(|level| let_go(self, level).ok());
        if let Some(piece) = nearer {
            if !small && piece.spot.level == spot.level {
                return self.split(&spot, wish, parts);
            }
            self.pieces.push(piece);
            return Ok(());
        }
        if let Ok(piece) = self.held(&CoverPiece { level: 0, ..spot }, &seen, wish, &Vector3::zeros()) {
            if piece.length(&wish.at, &wish.along) > ROUNDED {
                self.pieces.push(piece);
                return Ok(());
            }
            let blocking = piece.obstacles(self.pair, &wish.at, &wish.along);
            if small && !blocking.is_empty() {
                self.block(&blocking);
                return Err(Halt::Blocked);
            }
        }
        self.split(&spot, wish, parts)
    }

    /// Whether a triangle may lie beside the current piece.
    fn is_beside(&self, spot: &CoverPiece, triangle: u32) -> bool {
        let pair = self.pair;
        pair.is_beside(&self.placed, triangle, pair.allowed + spot.held)
    }

    /// Whether the current piece, without a region, is too small to be split.
    fn is_smallest(&self, spot: &CoverPiece) -> bool {
        spot.piece.is_bit_below(SMALLEST_BIT, self.placed.radius)
    }

    /// Covers the current piece, too small to be split, by the plane of a face, or gives the pair up.
    fn end(&mut self, spot: &CoverPiece, wish: &WantedShift) -> Result<(), Halt> {
        let piece = self.before_face(spot, wish).ok_or(Halt::Lost)?;
        let blocked = piece.obstacles(self.pair, &wish.at, &wish.along);
        if !blocked.is_empty() {
            self.block(&blocked);
            return Err(Halt::Blocked);
        }
        self.pieces.push(piece);
        Ok(())
    }

    /// Pushes the parts of the current piece, or ends with it if it is too small.
    fn split(
        &mut self,
        spot: &CoverPiece,
        wish: &WantedShift,
        parts: &mut Vec<CoverPiece>,
    ) -> Result<(), Halt> {
        if self.is_smallest(spot) {
            return self.end(spot, wish);
        }
        let pieces = self.pair.covered.parts(&spot.piece);
        parts.extend(pieces.into_iter().rev().map(|piece| CoverPiece { piece, level: 0, ..*spot }));
        Ok(())
    }

    /// The current piece, a small bit no deeper than allowed, in front of the nearest face.
    fn before_face(&self, spot: &CoverPiece, wish: &WantedShift) -> Option<ShiftPiece> {
        let (pair, placed) = (self.pair, &self.placed);
        if pair.allowed == 0.0 {
            return None;
        }
        let held = pair.allowed + spot.held;
        let deep = |p: &Point3<f64>| -pair.measured.signed_closest(p, spot.guess).signed;
        let depth = placed.points.iter().map(deep).fold(0.0, f64::max);
        if depth > held {
            return None;
        }
        let ahead = pair.shifted * wish.along * SHIFTS_AHEAD[SHORT];
        let (inward, gap, triangle) = pair.before_face(placed, spot.guess, &ahead)?;
        let normal = pair.shifted.transpose() * inward;
        let height = normal.dot(&wish.at) - gap.max(0.0) - (held - depth) / 3f64.sqrt();
        Some(ShiftPiece {
            spot: *spot,
            limits: vec![ShiftLimit { normal, height, triangle }],
            middle: wish.at,
            room: SHIFTS_AHEAD[SHORT],
            ball: (placed.centre, placed.radius + SHIFTS_AHEAD[SHORT]),
        })
    }

    /// The current piece in a region that also allows a shift.
    fn held(
        &mut self,
        spot: &CoverPiece,
        seen: &SignedClosest,
        wish: &WantedShift,
        shift: &Vector3<f64>,
    ) -> Result<ShiftPiece, NoRegion> {
        self.regions += 1;
        let pair = self.pair;
        let most = pair.allowed + spot.held;
        let ahead = pair.shifted * shift;
        let PlacedPiece { points, cloud, extremes, centre, radius } = &self.placed;
        let region = if ahead == Vector3::zeros() {
            pair.region((centre, seen), radius + CONTACT_STEP, extremes, most)
        } else {
            let wanted: Vec<_> = extremes.iter().copied().chain(extremes.iter().map(|p| p + ahead)).collect();
            let middle = centre + ahead / 2.0;
            let seen = pair.measured.signed_closest(&middle, spot.guess);
            pair.region((&middle, &seen), radius + ahead.norm() / 2.0, &wanted, most)
        }?;
        let gaps = region.gaps(cloud);
        let below = |shift: &Vector3<f64>| {
            region.distance_of_shifted(points, &gaps, shift, most).ok_or(NoRegion::Cramped)
        };
        let here = below(&Vector3::zeros())?;
        let depth = if ahead == Vector3::zeros() { here } else { here.max(below(&ahead)?) };
        let slack = if pair.allowed > 0.0 { ((most - depth) / 3f64.sqrt()).max(0.0) } else { 0.0 };
        let back = pair.shifted.transpose();
        let limits = region.planes().zip(&gaps).map(|((inward, triangle), gap)| {
            let normal = back * inward;
            ShiftLimit { normal, height: normal.dot(&wish.at) - gap.max(0.0) - slack, triangle }
        });
        let limits = limits.collect();
        // Either the ball around the piece stays in the region's ball, or all of its points are far enough from the
        // edge.
        let offset = centre - region.centre();
        let (middle, room) = if offset.norm() + radius < region.radius() {
            (wish.at - back * offset, region.radius() - radius)
        } else {
            (wish.at, region.radius() - self.placed.reach_from(&region.centre()))
        };
        let held = if pair.allowed > 0.0 { HELD_AT_FIRST } else { HELD.max(depth + HELD / 10.0) };
        let held = held.min(spot.held);
        let ball = (region.centre(), region.radius());
        let piece = ShiftPiece { spot: CoverPiece { held, ..*spot }, limits, middle, room, ball };
        let too_small = ahead != Vector3::zeros()
            && piece.length(&wish.at, &wish.along) < LEAST_SHARE_AHEAD * shift.norm();
        if too_small { Err(NoRegion::Cramped) } else { Ok(piece) }
    }
}

/// Whether the current thread pool has a second thread; elsewhere handing work over only costs.
fn other_thread() -> bool {
    rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{peg_in_hole, scene, thread};
    use crate::geometry::SourceMesh;
    use crate::scene::PosedPart;

    /// All pieces of one side of a pair, and the number of regions after each budget.
    fn gathered(meshes: [SourceMesh; 2], covers_part: bool, threads: usize) -> Vec<String> {
        let (scene, _) = scene(meshes);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let termination = Termination::default();
            let start = scene.bodies[1].planning_from_shape;
            let surfaces =
                SurfacePair::new(&scene, PosedPart::new(1, &start), 0, covers_part, &termination).unwrap();
            let mut search = ShiftSearch::of_all(&surfaces, HELD_AT_FIRST, &termination);
            let mut told = Vec::new();
            for budget in [1, 5, 16, 64, 4096] {
                let ended = search.gather(&Vector3::zeros(), budget, usize::MAX);
                told.push(format!("{ended:?} {} {} {:?}", search.regions, search.needed, search.pieces));
                if ended != Ok(false) {
                    break;
                }
                assert!(search.needed > search.regions as f64, "there is more to come");
            }
            told
        })
    }

    #[test]
    fn cells_do_not_depend_on_who_else_looks() {
        for (meshes, covers_part) in
            [(peg_in_hole(5e-4), false), (peg_in_hole(0.0), true), (thread(3.0, 0.5), true)]
        {
            let alone = gathered(meshes.clone(), covers_part, 1);
            assert_eq!(alone, gathered(meshes, covers_part, 3));
        }
        assert!(gathered(peg_in_hole(5e-4), false, 1).len() > 2, "there was something to look at ahead");
    }
}
