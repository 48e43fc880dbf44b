//! How far a part may be shifted: pieces of surface, each in a convex region that the other surface
//! does not enter.
//!
//! Of each pair one surface is asked, piece by piece: a piece in a [`FreeRegion`] stays out of the
//! other solid as long as it stays in there, which is a few linear inequalities in the shift, exact
//! for shifts of any length. A peg in its hole is one piece with one region. A piece for which a
//! shift is wanted that its region does not allow gets another, around all of that shift; where
//! there is none, it is split, until a vertex that gets inside or a triangle without a region
//! certifies that the other part is in the way. If no surface piece of the one gets into the other,
//! the two surfaces do not cross, so that one side is enough.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Closest, FreeRegion, NoRegion, Pose, Wanted};
use crate::termination::{Interrupt, Termination};

use super::super::Scene;
use super::DEPTH_TOLERANCE;
use super::facing::{Facing, Obstacle, Piece, Placed, SUNK, TILT};

/// Pieces this far off need no region, in the planning frame.
const FAR: f64 = 0.12;
/// Shifts that a region is asked to allow: the longest that works.
const AHEAD: [f64; 5] = [4.0, 0.5, 0.06, 0.012, 2e-3];
/// Which of these is asked for first; the shorter ones only where something is near ahead.
const SHORT: usize = 2;
/// Regions without a wanted shift are asked for so much around a piece.
const AROUND: f64 = 0.12;
/// A plane nearer than this is touched.
const TOUCHED: f64 = 1e-6;
/// A region that lets a piece go by less than this share of what was asked is too small.
const LEAST_LET_GO: f64 = 0.25;
/// Steps that are shorter lead nowhere.
const LEAST_STEP: f64 = 1e-5;
/// Regions are asked for so much larger than the piece.
const ROOM: f64 = 1.25;
/// So far outside its region, beyond what is granted, a piece may be where it begins: flat sides leave
/// out a little of what is free, and where parts stand assembled nothing is entered.
const HELD_AT_FIRST: f64 = 1e-3;
/// The same for what was not as far outside before. A corner of the measured surface gets deeper into a face
/// than that gets into the corner, a few times: still within what the engine declares.
const HELD: f64 = DEPTH_TOLERANCE / 2.0;
/// A bit of a triangle that is smaller than this and has no region ahead is in the way …
const SMALL: f64 = 0.3;
/// … and is lost if it has none at all and is smaller than this.
const SMALLEST: f64 = 0.02;
/// So many regions are looked for on one side of a pair before the other is tried; then twice as
/// many, and so on.
const FIRST_BUDGET: usize = 16;
/// Where more overlap than this is granted, facets lie across each other, and regions tell little.
const MOST_GRANTED: f64 = 1e-3;
/// So many regions are looked for before a motion is given up.
const MOST_REGIONS: usize = 20_000;

/// Why no answer can be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Halt {
    /// The termination condition became true.
    Interrupted(Interrupt),
    /// A piece is in no region, deeper than granted, or the surfaces are too complicated.
    Lost,
    /// Something is in the way of what was wished.
    Blocked,
}

impl From<Interrupt> for Halt {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

/// What a cell is asked for.
#[derive(Debug, Clone, Copy)]
struct Spot {
    pair: usize,
    piece: Piece,
    /// A triangle of the measured surface near it.
    guess: u32,
    /// Which of [`AHEAD`] it was let go by last.
    level: usize,
    /// How far outside its region it may be, beyond what is granted.
    held: f64,
}

/// A piece that is free while the shift stays within limits.
#[derive(Debug, Clone)]
struct Cell {
    spot: Spot,
    limits: Vec<Limit>,
    /// The shift must stay in this ball, too.
    middle: Vector3<f64>,
    room: f64,
}

/// normal · shift ≥ height.
#[derive(Debug, Clone, Copy)]
struct Limit {
    normal: Vector3<f64>,
    height: f64,
}

impl Cell {
    /// How far the shift may go from `at` along the unit vector `u`.
    fn length(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> f64 {
        let from = at - self.middle;
        let along = from.dot(u);
        let chord = along * along - from.norm_squared() + self.room * self.room;
        let ball = if chord > 0.0 { (chord.sqrt() - along).max(0.0) } else { 0.0 };
        self.limits.iter().fold(ball, |length, limit| {
            let speed = -limit.normal.dot(u);
            let gap = limit.gap(at) + if speed <= TILT { SUNK } else { 0.0 };
            if speed > 0.0 { length.min(gap.max(0.0) / speed) } else { length }
        })
    }

    fn blocks(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        self.limits.iter().any(|limit| limit.blocks(at, u))
    }

    /// What of it is in the way.
    fn obstacles(&self, pair: &Facing<'_>, wish: &Wish<'_>) -> Vec<Obstacle> {
        let blocking = self.limits.iter().filter(|l| l.blocks(&wish.at, &wish.along));
        blocking.map(|l| Obstacle { normal: l.normal, other: pair.other }).collect()
    }

    /// Whether there is nothing left to go on `u`.
    fn is_exhausted(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        let from = at - self.middle;
        (from + u * TOUCHED).norm() >= self.room
    }
}

impl Limit {
    fn gap(&self, at: &Vector3<f64>) -> f64 {
        self.normal.dot(at) - self.height
    }

    fn blocks(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        self.normal.dot(u) < -TILT && self.gap(at) <= TOUCHED
    }
}

/// What of the measured surface is nearest to a point, and how near.
struct Seen {
    closest: Closest,
    signed: f64,
}

/// A question about a piece: from which shift on, and which way it is to go on.
struct Wish<'a> {
    at: Vector3<f64>,
    /// A unit vector, or nothing.
    along: Vector3<f64>,
    /// What is certainly in the way.
    obstacles: &'a mut Vec<Obstacle>,
}

/// All pieces of all pairs.
#[derive(Clone)]
pub(super) struct Cells<'a> {
    termination: &'a Termination,
    pairs: Vec<Facing<'a>>,
    cells: Vec<Cell>,
    regions: usize,
    /// No more of them than this.
    budget: usize,
    /// The piece at hand.
    placed: Placed,
}

impl<'a> Cells<'a> {
    pub(super) fn new(termination: &'a Termination) -> Self {
        Self {
            termination,
            pairs: Vec::new(),
            cells: Vec::new(),
            regions: 0,
            budget: MOST_REGIONS,
            placed: Placed::default(),
        }
    }

    /// Whether a standing part is among the pairs.
    pub(super) fn knows(&self, other: usize) -> bool {
        self.pairs.iter().any(|p| p.other == other)
    }

    /// Takes a pair in, at a shift of the part from `start`.
    pub(super) fn add(
        &mut self,
        scene: &'a Scene,
        (part, start): (usize, &Pose),
        other: usize,
        at: &Vector3<f64>,
    ) -> Result<(), Halt> {
        let mut sides = Facing::both(scene, part, start, other);
        if sides.is_empty() || scene.allowances.of(part, other) > MOST_GRANTED {
            return Err(Halt::Lost);
        }
        let mut wish = Wish { at: *at, along: Vector3::zeros(), obstacles: &mut Vec::new() };
        let cells = self.cells.len();
        let mut budget = FIRST_BUDGET;
        // The one inside the other, or the plainer one, needs fewer pieces: which, shows in trying.
        loop {
            sides.rotate_left(1);
            let Some(side) = sides.pop() else { return Err(Halt::Lost) };
            let Some(piece) = side.root() else { return Ok(()) };
            let root = Spot { pair: self.pairs.len(), piece, guess: 0, level: 0, held: HELD_AT_FIRST };
            self.pairs.push(side);
            self.budget = if sides.is_empty() { MOST_REGIONS } else { self.regions + budget };
            match self.renew(root, &mut wish) {
                Err(Halt::Lost) if self.regions >= self.budget && self.budget < MOST_REGIONS => {}
                done => {
                    self.budget = MOST_REGIONS;
                    return done;
                }
            }
            self.cells.truncate(cells);
            sides.extend(self.pairs.pop());
            budget *= 2;
        }
    }

    /// How far the part may be shifted from `at` along the unit vector `u`.
    pub(super) fn length(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> f64 {
        self.cells.iter().map(|cell| cell.length(at, u)).fold(f64::INFINITY, f64::min)
    }

    /// Makes way for a shift from `at` along the unit vector `u`: pieces whose region does not let
    /// them go there get others. Ends at the first that cannot: what is in its way is added to
    /// `obstacles`.
    pub(super) fn make_way(
        &mut self,
        at: &Vector3<f64>,
        u: &Vector3<f64>,
        obstacles: &mut Vec<Obstacle>,
    ) -> Result<(), Halt> {
        let mut wish = Wish { at: *at, along: *u, obstacles };
        let mut replaced = Vec::new();
        let mut ended = Ok(());
        for i in 0..self.cells.len() {
            let cell = &self.cells[i];
            if !cell.blocks(at, u) && !cell.is_exhausted(at, u) {
                continue;
            }
            let (spot, known) = (cell.spot, self.cells.len());
            ended = self.renew(spot, &mut wish);
            if ended.is_err() {
                self.cells.truncate(known);
                break;
            }
            replaced.push(i);
        }
        for i in replaced.into_iter().rev() {
            self.cells.swap_remove(i);
        }
        if ended == Err(Halt::Blocked) { Ok(()) } else { ended }
    }

    /// Finds cells for a piece, as free along the wish as can be.
    fn renew(&mut self, mut spot: Spot, wish: &mut Wish<'_>) -> Result<(), Halt> {
        self.termination.check()?;
        if self.regions >= self.budget {
            return Err(Halt::Lost);
        }
        let pair = &self.pairs[spot.pair];
        pair.place(&spot.piece, &wish.at, &mut self.placed);
        let radius = self.placed.radius;
        let seen = look(pair, &self.placed.centre, spot.guess);
        spot.guess = seen.closest.triangle;
        if seen.signed - radius >= FAR {
            let limits = Vec::new();
            spot.held = if pair.allowance > 0.0 { spot.held } else { HELD };
            self.cells.push(Cell { spot, limits, middle: wish.at, room: seen.signed - radius });
            return Ok(());
        }
        let still = Vector3::zeros();
        if wish.along == still {
            return match self.held(&spot, &seen, wish, &still) {
                Ok(cell) => {
                    self.cells.push(cell);
                    Ok(())
                }
                Err(_) => self.split(&spot, radius, wish),
            };
        }
        let small = matches!(spot.piece, Piece::Bit(_)) && radius < SMALL;
        let let_go = |cells: &mut Self, level: usize| {
            cells.held(&Spot { level, ..spot }, &seen, wish, &(wish.along * AHEAD[level]))
        };
        match let_go(self, SHORT) {
            Ok(short) => {
                let further = (0..SHORT).find_map(|level| let_go(self, level).ok());
                let cell = further.unwrap_or(short);
                // What gets no further the second time may do so in pieces.
                if !small && cell.spot.level > 0 && cell.spot.level == spot.level {
                    return self.split(&spot, radius, wish);
                }
                self.cells.push(cell);
                return Ok(());
            }
            Err(NoRegion::Amid(t)) if !small && !self.is_beside(&spot, t) => {
                return self.split(&spot, radius, wish);
            }
            Err(_) => {}
        }
        let pair = &self.pairs[spot.pair];
        let certain = pair.obstacles(&spot.piece, &self.placed, (&wish.at, &wish.along), spot.guess);
        if !certain.is_empty() {
            wish.obstacles.extend(certain);
            return Err(Halt::Blocked);
        }
        let nearer = (SHORT + 1..AHEAD.len()).find_map(|level| let_go(self, level).ok());
        if let Some(cell) = nearer {
            if !small && cell.spot.level == spot.level {
                return self.split(&spot, radius, wish);
            }
            self.cells.push(cell);
            return Ok(());
        }
        if let Ok(cell) = self.held(&Spot { level: 0, ..spot }, &seen, wish, &still) {
            if cell.length(&wish.at, &wish.along) > LEAST_STEP {
                self.cells.push(cell);
                return Ok(());
            }
            let blocking = cell.obstacles(&self.pairs[spot.pair], wish);
            if small && !blocking.is_empty() {
                wish.obstacles.extend(blocking);
                return Err(Halt::Blocked);
            }
        }
        self.split(&spot, radius, wish)
    }

    /// Whether a triangle may lie beside the piece at hand.
    fn is_beside(&self, spot: &Spot, triangle: u32) -> bool {
        let pair = &self.pairs[spot.pair];
        pair.is_beside(&self.placed, triangle, pair.allowance + spot.held)
    }

    /// Finds cells for the parts of a piece.
    fn split(&mut self, spot: &Spot, radius: f64, wish: &mut Wish<'_>) -> Result<(), Halt> {
        if matches!(spot.piece, Piece::Bit(_)) && radius < SMALLEST {
            let cell = self.before_face(spot, wish).ok_or(Halt::Lost)?;
            let blocked = cell.obstacles(&self.pairs[spot.pair], wish);
            if wish.along != Vector3::zeros() && !blocked.is_empty() {
                wish.obstacles.extend(blocked);
                return Err(Halt::Blocked);
            }
            self.cells.push(cell);
            return Ok(());
        }
        let parts = self.pairs[spot.pair].parts(&spot.piece);
        parts.into_iter().try_for_each(|piece| self.renew(Spot { piece, level: 0, ..*spot }, wish))
    }

    /// The piece at hand, a small bit no deeper than it may be, before the face that it is nearest
    /// to: where facets with granted overlap lie across each other there are no regions. That is not
    /// certain, as regions are; paths are verified.
    fn before_face(&self, spot: &Spot, wish: &Wish<'_>) -> Option<Cell> {
        let (pair, Placed { points, centre, .. }) = (&self.pairs[spot.pair], &self.placed);
        if pair.allowance == 0.0 {
            return None;
        }
        let held = pair.allowance + spot.held;
        let depth = points.iter().map(|p| -look(pair, p, spot.guess).signed).fold(0.0, f64::max);
        if depth > held {
            return None;
        }
        let closest = look(pair, centre, spot.guess).closest;
        let ahead = pair.shifted * wish.along * AHEAD[SHORT];
        let mut best: Option<(f64, Vector3<f64>)> = None;
        pair.measured.feature_normals(&closest, |n| {
            let ends = n.dot(&(centre + ahead - closest.point));
            if best.is_none_or(|(most, _)| ends > most) {
                best = Some((ends, n));
            }
        });
        let (_, inward) = best?;
        let gap = points.iter().map(|p| inward.dot(&(p - closest.point))).fold(f64::INFINITY, f64::min);
        let normal = pair.shifted.transpose() * inward;
        let height = normal.dot(&wish.at) - gap.max(0.0) - (held - depth) / 3f64.sqrt();
        Some(Cell {
            spot: *spot,
            limits: vec![Limit { normal, height }],
            middle: wish.at,
            room: AHEAD[SHORT],
        })
    }

    /// The piece at hand in a region that also lets it go by a shift.
    fn held(
        &mut self,
        spot: &Spot,
        seen: &Seen,
        wish: &Wish<'_>,
        shift: &Vector3<f64>,
    ) -> Result<Cell, NoRegion> {
        self.regions += 1;
        let pair = &self.pairs[spot.pair];
        let most = pair.allowance + spot.held;
        let ahead = pair.shifted * shift;
        let Placed { points, extremes, centre, radius } = &self.placed;
        let of = |points| Wanted { points, most, from_behind: true };
        let region = if ahead == Vector3::zeros() {
            let around = (radius + AROUND) * ROOM;
            pair.measured.free_region_around(centre, around, (&seen.closest, seen.signed), of(extremes))
        } else {
            let wanted: Vec<_> = extremes.iter().copied().chain(extremes.iter().map(|p| p + ahead)).collect();
            let middle = centre + ahead / 2.0;
            let around = (radius + ahead.norm() / 2.0) * ROOM;
            let seen = look(pair, &middle, spot.guess);
            pair.measured.free_region_around(&middle, around, (&seen.closest, seen.signed), of(&wanted))
        }?;
        let depth = depth_below(points, &region, &ahead, most).ok_or(NoRegion::Cramped)?;
        let slack = if pair.allowance > 0.0 { ((most - depth) / 3f64.sqrt()).max(0.0) } else { 0.0 };
        let back = pair.shifted.transpose();
        let limits = region.planes().map(|(inward, height)| {
            let above = |p: &Point3<f64>| inward.dot(&p.coords) - height;
            let gap = points.iter().map(above).fold(f64::INFINITY, f64::min);
            let normal = back * inward;
            Limit { normal, height: normal.dot(&wish.at) - gap.max(0.0) - slack }
        });
        let limits = limits.collect();
        // The ball around the piece stays in that of the region, or all its points are far enough
        // from the edge.
        let offset = centre - region.centre();
        let (middle, room) = if offset.norm() + radius < region.radius() {
            (wish.at - back * offset, region.radius() - radius)
        } else {
            let far = points.iter().map(|p| (p - region.centre()).norm()).fold(0.0, f64::max);
            (wish.at, region.radius() - far)
        };
        let held = if pair.allowance > 0.0 { HELD_AT_FIRST } else { HELD.max(depth + HELD / 10.0) };
        let held = held.min(spot.held);
        let cell = Cell { spot: Spot { held, ..*spot }, limits, middle, room };
        let too_small =
            ahead != Vector3::zeros() && cell.length(&wish.at, &wish.along) < LEAST_LET_GO * shift.norm();
        if too_small { Err(NoRegion::Cramped) } else { Ok(cell) }
    }
}

fn look(pair: &Facing<'_>, p: &Point3<f64>, guess: u32) -> Seen {
    let closest = pair.measured.closest_from(p, guess);
    Seen { signed: pair.measured.signed(p, &closest), closest }
}

/// How deep some points are below a region, here and shifted, if no more than `most`.
fn depth_below(points: &[Point3<f64>], region: &FreeRegion, shift: &Vector3<f64>, most: f64) -> Option<f64> {
    let still = shift == &Vector3::zeros();
    points.iter().try_fold(0.0, |depth: f64, p| {
        let here = region.distance_within(p, most)?;
        let there = if still { 0.0 } else { region.distance_within(&(p + shift), most)? };
        Some(depth.max(here).max(there))
    })
}
