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

use crate::geometry::{Closest, FreeRegion, Parts, PatchTree, Pose, Surface};
use crate::termination::{Interrupt, Termination};

use super::super::Scene;
use super::DEPTH_TOLERANCE;

/// Pieces this far off need no region, in the planning frame.
const FAR: f64 = 0.12;
/// Shifts that a region is asked to allow: the first that works.
const AHEAD: [f64; 2] = [1.0, 0.06];
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
const HELD: f64 = 0.6 * DEPTH_TOLERANCE;
/// Vertices are moved so far to see whether they get inside …
const PROBE: f64 = 2e-3;
/// … by more than this share of it.
const INSIDE: f64 = 0.125;
/// So many vertices of a piece are probed.
const PROBED: usize = 16;
/// So many regions are looked for before a motion is given up.
const MOST_REGIONS: usize = 20_000;

/// Why no answer can be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Halt {
    /// The termination condition became true.
    Interrupted(Interrupt),
    /// A piece is in no region, deeper than granted, or the surfaces are too complicated.
    Lost,
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
    /// `None` if neither surface is closed.
    fn new(scene: &'a Scene, part: usize, start: &Pose, other: usize) -> Option<Self> {
        let (moving, standing) = (&scene.bodies[part], &scene.bodies[other]);
        let [mine, theirs] = [moving, standing].map(|body| &body.shape);
        let size = |s: &Surface| s.bounds().extents().product();
        let smaller = size(&mine.surface) <= size(&theirs.surface);
        let ask_mine = match (mine.surface.is_open(), theirs.surface.is_open()) {
            (true, true) => return None,
            (false, false) => smaller,
            (open, _) => open,
        };
        let stand = standing.planning_from_shape;
        let (asked, measured, measured_from_asked, turn) = if ask_mine {
            (mine, theirs, stand.inverse() * start, stand.rotation.inverse())
        } else {
            (theirs, mine, start.inverse() * stand, start.rotation.inverse())
        };
        let sense = if ask_mine { 1.0 } else { -1.0 };
        Some(Self {
            other,
            asked: &asked.surface,
            tree: asked.patches(),
            measured: &measured.surface,
            measured_from_asked,
            shifted: *turn.to_rotation_matrix().matrix() * sense,
            allowance: scene.allowances.of(part, other),
        })
    }

    fn held(&self) -> f64 {
        self.allowance + HELD
    }
}

/// A piece of the asked surface.
#[derive(Debug, Clone, Copy)]
enum Piece {
    Patch(u32),
    Triangle(u32),
}

/// A piece that is free while the shift stays within limits.
#[derive(Debug, Clone)]
struct Cell {
    pair: usize,
    piece: Piece,
    /// A triangle of the measured surface near it.
    guess: u32,
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

/// A question about a piece: from which shift on, and which way it is to go on.
struct Wish<'a> {
    at: Vector3<f64>,
    /// A unit vector.
    along: Vector3<f64>,
    /// What is certainly in the way.
    obstacles: &'a mut Vec<Obstacle>,
}

/// All pieces of all pairs.
pub(super) struct Cells<'a> {
    termination: &'a Termination,
    pairs: Vec<Pair<'a>>,
    cells: Vec<Cell>,
    regions: usize,
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
            points: Vec::new(),
            wanted: Vec::new(),
        }
    }

    /// Whether a standing part is among the pairs.
    pub(super) fn knows(&self, other: usize) -> bool {
        self.pairs.iter().any(|p| p.other == other)
    }

    /// Takes a pair in, at a shift of the part from `start`, to be moved along a unit vector.
    pub(super) fn add(
        &mut self,
        scene: &'a Scene,
        (part, start): (usize, &Pose),
        other: usize,
        at: &Vector3<f64>,
        along: &Vector3<f64>,
        obstacles: &mut Vec<Obstacle>,
    ) -> Result<(), Halt> {
        let pair = Pair::new(scene, part, start, other).ok_or(Halt::Lost)?;
        let Some(root) = pair.tree.root() else { return Ok(()) };
        self.pairs.push(pair);
        let mut wish = Wish { at: *at, along: *along, obstacles };
        self.renew(self.pairs.len() - 1, Piece::Patch(root), 0, &mut wish)
    }

    /// How far the part may be shifted from `at` along the unit vector `u`.
    pub(super) fn length(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> f64 {
        self.cells.iter().map(|cell| cell.length(at, u)).fold(f64::INFINITY, f64::min)
    }

    /// Makes way for a shift from `at` along the unit vector `u`: pieces whose region does not let
    /// them go there get others, and what is certainly in the way is added to `obstacles`.
    pub(super) fn make_way(
        &mut self,
        at: &Vector3<f64>,
        u: &Vector3<f64>,
        obstacles: &mut Vec<Obstacle>,
    ) -> Result<(), Halt> {
        let mut wish = Wish { at: *at, along: *u, obstacles };
        let known = self.cells.len();
        let mut renewed = Vec::new();
        for i in 0..known {
            let cell = &self.cells[i];
            if cell.blocks(at, u) || cell.is_exhausted(at, u) {
                let Cell { pair, piece, guess, .. } = *cell;
                renewed.push(i);
                self.renew(pair, piece, guess, &mut wish)?;
            }
        }
        for i in renewed.into_iter().rev() {
            self.cells.swap_remove(i);
        }
        Ok(())
    }

    /// Finds cells for a piece, as free along the wish as can be.
    fn renew(&mut self, pair: usize, piece: Piece, guess: u32, wish: &mut Wish<'_>) -> Result<(), Halt> {
        self.termination.check()?;
        let (centre, radius) = self.place(pair, piece, &wish.at);
        let measured = self.pairs[pair].measured;
        let closest = measured.closest_from(&centre, guess);
        let signed = measured.signed(&centre, &closest);
        let guess = closest.triangle;
        if signed - radius >= FAR {
            let (limits, middle) = (Vec::new(), wish.at);
            self.cells.push(Cell { pair, piece, guess, limits, middle, room: signed - radius });
            return Ok(());
        }
        for ahead in AHEAD {
            let shift = wish.along * ahead;
            if let Some(cell) = self.held(pair, piece, (centre, radius), (closest, signed), wish, &shift) {
                self.cells.push(cell);
                return Ok(());
            }
        }
        if self.regions > MOST_REGIONS {
            return Err(Halt::Lost);
        }
        let still = self.held(pair, piece, (centre, radius), (closest, signed), wish, &Vector3::zeros());
        if let Some(cell) = still {
            if !cell.blocks(&wish.at, &wish.along) || self.is_certain(&cell, wish) {
                self.cells.push(cell);
                return Ok(());
            }
            if let Piece::Triangle(_) = piece {
                let other = self.pairs[pair].other;
                let blocking = cell.limits.iter().filter(|l| l.blocks(&wish.at, &wish.along));
                wish.obstacles.extend(blocking.map(|l| Obstacle { normal: l.normal, other }));
                self.cells.push(cell);
                return Ok(());
            }
        }
        let tree = self.pairs[pair].tree;
        match piece {
            Piece::Triangle(_) => Err(Halt::Lost),
            Piece::Patch(index) => match tree.parts(index) {
                Parts::Patches(children) => {
                    children.into_iter().try_for_each(|c| self.renew(pair, Piece::Patch(c), guess, wish))
                }
                Parts::Triangles(list) => {
                    list.iter().try_for_each(|&t| self.renew(pair, Piece::Triangle(t), guess, wish))
                }
            },
        }
    }

    /// Takes a piece's points as they are against the measured surface; the ball that holds them.
    fn place(&mut self, pair: usize, piece: Piece, at: &Vector3<f64>) -> (Point3<f64>, f64) {
        let Pair { asked, tree, measured_from_asked, shifted, .. } = &self.pairs[pair];
        let shift = shifted * at;
        let place = |p: &Point3<f64>| measured_from_asked * p + shift;
        self.points.clear();
        self.wanted.clear();
        match piece {
            Piece::Patch(index) => {
                let patch = tree.patch(index);
                self.points.extend(tree.vertices(index).iter().map(place));
                self.wanted.extend(tree.extremes(index).map(place));
                (place(&patch.centre), patch.radius)
            }
            Piece::Triangle(t) => {
                let corners = asked.corners(t).map(|p| place(&p));
                self.points.extend(corners);
                self.wanted.extend(corners);
                let centre = Point3::from(corners.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0);
                (centre, corners.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max))
            }
        }
    }

    /// The piece at hand in a region that also lets it go by a shift.
    fn held(
        &mut self,
        pair: usize,
        piece: Piece,
        (centre, radius): (Point3<f64>, f64),
        seen: (Closest, f64),
        wish: &Wish<'_>,
        shift: &Vector3<f64>,
    ) -> Option<Cell> {
        self.regions += 1;
        let at = &self.pairs[pair];
        let most = at.held();
        let ahead = at.shifted * shift;
        let few = self.wanted.len();
        let (middle, reach, seen) = if ahead == Vector3::zeros() {
            (centre, radius + AROUND, seen)
        } else {
            self.wanted.extend_from_within(..);
            self.wanted[few..].iter_mut().for_each(|p| *p += ahead);
            let middle = centre + ahead / 2.0;
            let closest = at.measured.closest_from(&middle, seen.0.triangle);
            let signed = at.measured.signed(&middle, &closest);
            (middle, radius + ahead.norm() / 2.0, (closest, signed))
        };
        let region = (-seen.1 <= most.max(reach))
            .then(|| at.measured.free_region_around(&middle, reach * ROOM, (&seen.0, seen.1), &self.wanted, most))
            .flatten();
        self.wanted.truncate(few);
        let region = region?;
        let depth = self.depth_below(&region, &ahead, most)?;
        let slack = if at.allowance > 0.0 { ((most - depth) / 3f64.sqrt()).max(0.0) } else { 0.0 };
        let limits = region.planes().map(|(inward, height)| {
            let gap = self.points.iter().map(|p| inward.dot(&p.coords) - height).fold(f64::INFINITY, f64::min);
            let normal = at.shifted.transpose() * inward;
            Limit { normal, height: normal.dot(&wish.at) - gap.max(0.0) - slack }
        });
        let (limits, guess) = (limits.collect(), seen.0.triangle);
        let offset = at.shifted.transpose() * (centre - region.centre());
        let room = region.radius() - radius;
        Some(Cell { pair, piece, guess, limits, middle: wish.at - offset, room })
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

    /// Whether a vertex of the piece at hand gets inside on the way: then that is certain, and the
    /// faces there are obstacles.
    fn is_certain(&self, cell: &Cell, wish: &mut Wish<'_>) -> bool {
        let pair = &self.pairs[cell.pair];
        let ahead = pair.shifted * wish.along;
        let depth = |p: &Point3<f64>, guess: u32| {
            let closest = pair.measured.closest_from(p, guess);
            (-pair.measured.signed(p, &closest), closest)
        };
        let before = wish.obstacles.len();
        // Those in front touch first.
        let mut front: Vec<(f64, &Point3<f64>)> =
            self.points.iter().map(|p| (ahead.dot(&p.coords), p)).collect();
        front.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, p) in front.into_iter().take(PROBED) {
            let (now, closest) = depth(p, cell.guess);
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
}

/// Regions are asked for so much larger than the piece.
const ROOM: f64 = 1.25;
/// Cosine of the angle below which two planes are one.
const PARALLEL: f64 = 0.9999;
