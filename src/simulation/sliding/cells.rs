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

use nalgebra::{Matrix3, Point3, Vector3};

use crate::geometry::{
    Closest, FreeRegion, NoRegion, Parts, PatchTree, Pose, Surface, separating_direction,
};
use crate::termination::{Interrupt, Termination};

use super::super::Scene;
use super::DEPTH_TOLERANCE;

/// Pieces this far off need no region, in the planning frame.
const FAR: f64 = 0.12;
/// Shifts that a region is asked to allow: the longest that works.
const AHEAD: [f64; 3] = [4.0, 0.5, 0.06];
const SHORTEST: usize = AHEAD.len() - 1;
/// Regions without a wanted shift are asked for so much around a piece.
const AROUND: f64 = 0.12;
/// A plane nearer than this is touched.
const TOUCHED: f64 = 1e-6;
/// Shifts that lead into a plane by less than this share go along it: coordinates in files are
/// rounded, and so are planes.
const TILT: f64 = 1e-5;
/// What such shifts may come to.
const SUNK: f64 = 0.3 * DEPTH_TOLERANCE;
/// So much deeper than granted a piece may be and still be held.
const HELD: f64 = 1e-3;
/// Points are moved so far to see whether they get inside …
const PROBE: f64 = 2e-3;
/// … by more than this share of it.
const INSIDE: f64 = 0.125;
/// So many corners of a piece, and so many faces, are probed.
const PROBED: usize = 16;
/// A bit of a triangle that is smaller than this and has no region ahead is in the way …
const SMALL: f64 = 0.3;
/// … and is lost if it has none at all and is smaller than this.
const SMALLEST: f64 = 0.02;
/// So many regions are looked for on one side of a pair before the other is tried; then twice as
/// many, and so on.
const FIRST_BUDGET: usize = 16;
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

/// A plane that the part is kept from passing: normal · shift ≥ height, and whose it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Obstacle {
    pub(super) normal: Vector3<f64>,
    pub(super) other: usize,
}

/// A moving and a standing part: the surface that is asked, and that into which it may not get.
#[derive(Clone)]
struct Pair<'a> {
    other: usize,
    asked: &'a Surface,
    tree: &'a PatchTree,
    measured: &'a Surface,
    /// Without a shift.
    measured_from_asked: Pose,
    /// From shifts of the part to shifts of the asked surface against the measured one.
    shifted: Matrix3<f64>,
    allowance: f64,
}

impl<'a> Pair<'a> {
    /// The pair with the moving part's surface asked, or with the standing one's: those that can be,
    /// the smaller surface first. None if neither surface is closed.
    fn both(scene: &'a Scene, part: usize, start: &Pose, other: usize) -> Vec<Self> {
        let (moving, standing) = (&scene.bodies[part], &scene.bodies[other]);
        let stand = standing.planning_from_shape;
        let of = |ask_mine: bool| {
            let [mine, theirs] = [moving, standing].map(|body| &body.shape);
            let (asked, measured, measured_from_asked, turn) = if ask_mine {
                (mine, theirs, stand.inverse() * start, stand.rotation.inverse())
            } else {
                (theirs, mine, start.inverse() * stand, start.rotation.inverse())
            };
            let sense = if ask_mine { 1.0 } else { -1.0 };
            (!measured.surface.is_open()).then(|| Self {
                other,
                asked: &asked.surface,
                tree: asked.patches(),
                measured: &measured.surface,
                measured_from_asked,
                shifted: *turn.to_rotation_matrix().matrix() * sense,
                allowance: scene.allowances.of(part, other),
            })
        };
        let size = |s: &Surface| s.bounds().extents().product();
        let mine_first = size(&moving.shape.surface) <= size(&standing.shape.surface);
        [mine_first, !mine_first].into_iter().filter_map(of).collect()
    }

    fn held(&self) -> f64 {
        self.allowance + HELD
    }
}

/// A piece of the asked surface.
#[derive(Debug, Clone, Copy)]
enum Piece {
    Patch(u32),
    /// A triangle, or a bit of one, by its corners.
    Bit([Point3<f64>; 3]),
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
}

impl Spot {
    fn root(pair: usize, tree: &PatchTree) -> Option<Self> {
        tree.root().map(|root| Self { pair, piece: Piece::Patch(root), guess: 0, level: 0 })
    }
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

    /// Whether there is something to go on `u`.
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

/// A ball around a piece, what of the measured surface is nearest to its centre, and how near.
struct Ball {
    centre: Point3<f64>,
    radius: f64,
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
    pairs: Vec<Pair<'a>>,
    cells: Vec<Cell>,
    regions: usize,
    /// No more of them than this.
    budget: usize,
    /// A piece's points against the measured surface: all, and those that say most.
    points: Vec<Point3<f64>>,
    wanted: Vec<Point3<f64>>,
}

impl<'a> Cells<'a> {
    pub(super) fn new(termination: &'a Termination) -> Self {
        Self {
            termination,
            pairs: Vec::new(),
            cells: Vec::new(),
            regions: 0,
            budget: MOST_REGIONS,
            points: Vec::new(),
            wanted: Vec::new(),
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
        let mut sides = Pair::both(scene, part, start, other);
        if sides.is_empty() {
            return Err(Halt::Lost);
        }
        let mut wish = Wish { at: *at, along: Vector3::zeros(), obstacles: &mut Vec::new() };
        let cells = self.cells.len();
        let mut budget = FIRST_BUDGET;
        // The one inside the other, or the plainer one, needs fewer pieces: which, shows in trying.
        loop {
            sides.rotate_left(1);
            let Some(side) = sides.pop() else { return Err(Halt::Lost) };
            let Some(root) = Spot::root(self.pairs.len(), side.tree) else { return Ok(()) };
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
        let (centre, radius) = self.place(&spot, &wish.at);
        let measured = self.pairs[spot.pair].measured;
        let closest = measured.closest_from(&centre, spot.guess);
        let signed = measured.signed(&centre, &closest);
        spot.guess = closest.triangle;
        if self.regions >= self.budget {
            return Err(Halt::Lost);
        }
        if signed - radius >= FAR {
            let limits = Vec::new();
            self.cells.push(Cell { spot, limits, middle: wish.at, room: signed - radius });
            return Ok(());
        }
        let ball = Ball { centre, radius, closest, signed };
        if wish.along == Vector3::zeros() {
            return match self.held(&spot, &ball, wish, &Vector3::zeros()) {
                Ok(cell) => {
                    self.cells.push(cell);
                    Ok(())
                }
                Err(_) => self.split(&spot, radius, wish),
            };
        }
        let small = matches!(spot.piece, Piece::Bit(_)) && radius < SMALL;
        match self.held(&Spot { level: SHORTEST, ..spot }, &ball, wish, &(wish.along * AHEAD[SHORTEST])) {
            Ok(short) => {
                let further = (0..SHORTEST).find_map(|level| {
                    let shift = wish.along * AHEAD[level];
                    self.held(&Spot { level, ..spot }, &ball, wish, &shift).ok()
                });
                let cell = further.unwrap_or(short);
                // What gets no further the second time may do so in pieces.
                let again = cell.spot.level > 0 && cell.spot.level == spot.level;
                if again && !small {
                    return self.split(&spot, radius, wish);
                }
                self.cells.push(cell);
                return Ok(());
            }
            Err(NoRegion::Amid(triangle)) if !small && !self.is_beside(&spot, &centre, triangle) => {
                return self.split(&spot, radius, wish);
            }
            Err(_) => {}
        }
        if self.is_certain(&spot, wish) {
            return Err(Halt::Blocked);
        }
        if let Ok(cell) = self.held(&Spot { level: 0, ..spot }, &ball, wish, &Vector3::zeros()) {
            if !cell.blocks(&wish.at, &wish.along) {
                self.cells.push(cell);
                return Ok(());
            }
            if small {
                let other = self.pairs[spot.pair].other;
                let blocking = cell.limits.iter().filter(|l| l.blocks(&wish.at, &wish.along));
                wish.obstacles.extend(blocking.map(|l| Obstacle { normal: l.normal, other }));
                return Err(Halt::Blocked);
            }
        }
        self.split(&spot, radius, wish)
    }

    /// Whether a triangle of the measured surface may lie beside the piece at hand where it is.
    fn is_beside(&self, spot: &Spot, centre: &Point3<f64>, triangle: u32) -> bool {
        let pair = &self.pairs[spot.pair];
        let corners = pair.measured.corners(triangle);
        // What touches is beside, too.
        let inset = |p: &Point3<f64>| p + (centre - p) * (pair.held() / (centre - p).norm()).clamp(INSET, 1.0);
        let within: Vec<_> = self.wanted.iter().map(inset).collect();
        separating_direction(&corners, &within, 0.0, None).is_some()
    }

    /// Finds cells for the parts of a piece.
    fn split(&mut self, spot: &Spot, radius: f64, wish: &mut Wish<'_>) -> Result<(), Halt> {
        let Pair { tree, asked, .. } = self.pairs[spot.pair];
        let mut renew = |piece: Piece| self.renew(Spot { piece, level: 0, ..*spot }, wish);
        match spot.piece {
            Piece::Bit(_) if radius < SMALLEST => {
                let Pair { other, allowance, .. } = self.pairs[spot.pair];
                let depth = -self.pairs[spot.pair].measured.signed_distance(&self.points[0]);
                tracing::debug!(other, radius, allowance, depth, "a bit of surface is in no region");
                Err(Halt::Lost)
            }
            Piece::Bit(corners) => halves(&corners).into_iter().try_for_each(|b| renew(Piece::Bit(b))),
            Piece::Patch(index) => match tree.parts(index) {
                Parts::Patches(children) => children.into_iter().try_for_each(|c| renew(Piece::Patch(c))),
                Parts::Triangles(list) => {
                    list.iter().try_for_each(|&t| renew(Piece::Bit(asked.corners(t))))
                }
            },
        }
    }

    /// Takes a piece's points as they are against the measured surface; the ball that holds them.
    fn place(&mut self, spot: &Spot, at: &Vector3<f64>) -> (Point3<f64>, f64) {
        let Pair { tree, measured_from_asked, shifted, .. } = &self.pairs[spot.pair];
        let shift = shifted * at;
        let place = |p: &Point3<f64>| measured_from_asked * p + shift;
        self.points.clear();
        self.wanted.clear();
        match spot.piece {
            Piece::Patch(index) => {
                let patch = tree.patch(index);
                self.points.extend(tree.vertices(index).iter().map(place));
                self.wanted.extend(tree.extremes(index).map(place));
                (place(&patch.centre), patch.radius)
            }
            Piece::Bit(corners) => {
                let corners = corners.map(|p| place(&p));
                self.points.extend(corners);
                self.wanted.extend(corners);
                let centre = Point3::from(corners.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0);
                (centre, corners.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max))
            }
        }
    }

    /// The piece at hand in a region that also lets it go by a shift.
    fn held(&mut self, spot: &Spot, ball: &Ball, wish: &Wish<'_>, shift: &Vector3<f64>) -> Result<Cell, NoRegion> {
        self.regions += 1;
        let pair = &self.pairs[spot.pair];
        let most = pair.held();
        let ahead = pair.shifted * shift;
        let few = self.wanted.len();
        let mut around = Ball { radius: ball.radius + AROUND, ..*ball };
        if ahead != Vector3::zeros() {
            self.wanted.extend_from_within(..);
            self.wanted[few..].iter_mut().for_each(|p| *p += ahead);
            let centre = ball.centre + ahead / 2.0;
            let closest = pair.measured.closest_from(&centre, spot.guess);
            let signed = pair.measured.signed(&centre, &closest);
            around = Ball { centre, radius: ball.radius + ahead.norm() / 2.0, closest, signed };
        }
        let Ball { centre, radius, closest, signed } = &around;
        let seen = (closest, *signed);
        let region = pair.measured.free_region_around(centre, radius * ROOM, seen, &self.wanted, most);
        self.wanted.truncate(few);
        let region = region?;
        let depth = self.depth_below(&region, &ahead, most).ok_or(NoRegion::Cramped)?;
        let slack = if pair.allowance > 0.0 { ((most - depth) / 3f64.sqrt()).max(0.0) } else { 0.0 };
        let limits = region.planes().map(|(inward, height)| {
            let above = |p: &Point3<f64>| inward.dot(&p.coords) - height;
            let gap = self.points.iter().map(above).fold(f64::INFINITY, f64::min);
            let normal = pair.shifted.transpose() * inward;
            Limit { normal, height: normal.dot(&wish.at) - gap.max(0.0) - slack }
        });
        let spot = Spot { guess: closest.triangle, ..*spot };
        let offset = pair.shifted.transpose() * (ball.centre - region.centre());
        let room = region.radius() - ball.radius;
        Ok(Cell { spot, limits: limits.collect(), middle: wish.at - offset, room })
    }

    /// How deep the points at hand are below a region, here and shifted, if no more than `most`.
    fn depth_below(&self, region: &FreeRegion, shift: &Vector3<f64>, most: f64) -> Option<f64> {
        let still = shift == &Vector3::zeros();
        self.points.iter().try_fold(0.0, |depth: f64, p| {
            let here = region.distance_within(p, most)?;
            let there = if still { 0.0 } else { region.distance_within(&(p + shift), most)? };
            Some(depth.max(here).max(there))
        })
    }

    /// Whether a point of the piece at hand gets inside on the way: then that is certain, and the
    /// faces there are obstacles.
    fn is_certain(&self, spot: &Spot, wish: &mut Wish<'_>) -> bool {
        let pair = &self.pairs[spot.pair];
        let ahead = pair.shifted * wish.along;
        let depth = |p: &Point3<f64>, guess: u32| {
            let closest = pair.measured.closest_from(p, guess);
            (-pair.measured.signed(p, &closest), closest)
        };
        let before = wish.obstacles.len();
        for p in self.probes(spot, &wish.at, &ahead) {
            let (now, closest) = depth(&p, spot.guess);
            let (then, _) = depth(&(p + ahead * PROBE), closest.triangle);
            if then <= now.max(pair.allowance) + INSIDE * PROBE {
                continue;
            }
            let (mut least, mut most): (Option<Vector3<f64>>, Option<Vector3<f64>>) = (None, None);
            pair.measured.feature_normals(&closest, |n| {
                let speed = n.dot(&ahead);
                if least.is_none_or(|m| speed > m.dot(&ahead)) {
                    least = Some(n);
                }
                if most.is_none_or(|m| speed < m.dot(&ahead)) {
                    most = Some(n);
                }
            });
            // Before a convex edge either face is enough to stay above; if that does not help, it is
            // a reentrant one.
            let blocking = |n: &Vector3<f64>| n.dot(&ahead) < -TILT;
            if let Some(n) = least.filter(blocking).or(most.filter(blocking)) {
                let normal = pair.shifted.transpose() * n;
                let known = |o: &Obstacle| o.other == pair.other && o.normal.dot(&normal) > PARALLEL;
                if !wish.obstacles[before..].iter().any(known) {
                    wish.obstacles.push(Obstacle { normal, other: pair.other });
                }
            }
        }
        wish.obstacles.len() > before
    }

    /// Points of the piece at hand that are likely to get inside first: corners in front, and the
    /// middles of the largest faces that look ahead (corners may be at the rims of holes).
    fn probes(&self, spot: &Spot, at: &Vector3<f64>, ahead: &Vector3<f64>) -> Vec<Point3<f64>> {
        let Pair { asked, tree, measured_from_asked, shifted, .. } = &self.pairs[spot.pair];
        let mut probes = self.points.clone();
        if probes.len() > PROBED {
            let front = |p: &Point3<f64>, q: &Point3<f64>| {
                ahead.dot(&q.coords).total_cmp(&ahead.dot(&p.coords))
            };
            probes.select_nth_unstable_by(PROBED, front);
            probes.truncate(PROBED);
        }
        let shift = shifted * at;
        let mut middles = Vec::new();
        let mut middle = |[a, b, c]: [Point3<f64>; 3]| {
            let area = (b - a).cross(&(c - a)).dot(&measured_from_asked.inverse_transform_vector(ahead));
            if area > 0.0 {
                middles.push((area, Point3::from((a.coords + b.coords + c.coords) / 3.0)));
            }
        };
        match spot.piece {
            Piece::Patch(index) => tree.triangles(index).iter().for_each(|&t| middle(asked.corners(t))),
            Piece::Bit(corners) => middle(corners),
        }
        middles.sort_by(|a, b| b.0.total_cmp(&a.0));
        probes.extend(middles.into_iter().take(PROBED).map(|(_, p)| measured_from_asked * p + shift));
        probes
    }
}

/// A triangle cut in two across its longest side.
fn halves(corners: &[Point3<f64>; 3]) -> [[Point3<f64>; 3]; 2] {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).norm_squared();
    let side = (1..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
    let [a, b, c] = [0, 1, 2].map(|k| corners[(side + k) % 3]);
    let cut = nalgebra::center(&a, &b);
    [[a, cut, c], [cut, b, c]]
}

/// Pieces are drawn together by this share to see whether they only touch.
const INSET: f64 = 0.02;
/// Regions are asked for so much larger than the piece.
const ROOM: f64 = 1.25;
/// Cosine of the angle below which two planes are one.
const PARALLEL: f64 = 0.9999;
