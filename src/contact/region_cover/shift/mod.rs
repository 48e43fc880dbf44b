//! How far a part may be shifted. Each piece of a surface lies in a convex region that the other surface does not
//! enter.
//!
//! A piece in a [`FreeRegion`] stays outside the other solid as long as it stays in the region. For shifts these are
//! a few linear inequalities, exact for any length: a peg in its hole is one piece with one region. Where a shift
//! leads out of a region, points nearby may prove that the other part is in the way: the lowest points of the piece
//! before that plane, and those of the triangle behind it. Otherwise the piece gets another region, around all of the
//! shift. If there is none, the piece is split, until a vertex that enters or a triangle without a region proves the
//! same. It is enough to cover one surface of a pair: if no piece of it enters the other solid, the surfaces do not
//! cross.

use std::cell::OnceCell;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::budgets::{FIRST_SIDE_REGIONS, REGIONS_PER_SHIFT, SHIFT_PIECES, SIDE_REGIONS, STALLS, WITNESSES};
use crate::geometry::Pose;
use crate::scene::{PosedPart, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{COVERED_OVERLAP, FREE_STEP, HELD, HELD_AT_FIRST, STALL, TOUCHED};

mod cache;
mod piece;
mod search;

use super::Halt;
use super::pieces::PlacedPiece;
use super::surface_pair::{Obstacle, SurfacePair, WantedShift, Witness};
use cache::{ShiftWay, StartCover, StartPair};
use search::ShiftSearch;

pub(crate) use piece::ShiftPiece;

pub use cache::ShiftCoverCache;

/// The covers of all pairs of a moving part and the standing parts near it.
pub(crate) struct ShiftCover<'a> {
    scene: &'a Scene,
    part: usize,
    /// The pose at zero shift.
    start: Pose,
    termination: &'a Termination,
    pairs: Vec<ShiftPair<'a>>,
    regions: usize,
}

/// A pair with the cover of one of its surfaces.
struct ShiftPair<'a> {
    surfaces: SurfacePair<'a>,
    pieces: Arc<Vec<ShiftPiece>>,
    /// Points that showed the last obstacles: along an obstacle they show it again at each step.
    witnesses: Vec<Witness>,
}

impl<'a> ShiftCover<'a> {
    pub(crate) fn new(scene: &'a Scene, moving: PosedPart<'_>, termination: &'a Termination) -> Self {
        Self { scene, part: moving.part, start: *moving.pose, termination, pairs: Vec::new(), regions: 0 }
    }

    /// The same part and start, without pairs.
    pub(crate) fn anew(&self) -> Self {
        Self::new(self.scene, self.moving(), self.termination)
    }

    fn moving(&self) -> PosedPart<'_> {
        PosedPart::new(self.part, &self.start)
    }

    /// Whether a standing part is in one of the pairs.
    pub(crate) fn knows(&self, other: usize) -> bool {
        self.pairs.iter().any(|p| p.surfaces.other == other)
    }

    /// Adds a pair, with the part at a shift.
    pub(crate) fn add(&mut self, other: usize, at: &Vector3<f64>) -> Result<(), Halt> {
        let (scene, termination) = (self.scene, self.termination);
        if scene.allowed.of(self.part, other) > COVERED_OVERLAP {
            return Err(Halt::Lost);
        }
        let gathered = if at == &Vector3::zeros() {
            starting(scene, self.moving(), other, (true, SHIFT_PIECES), termination)?
        } else {
            let place = StartPair::new(self.moving(), other);
            Arc::new(gathered(scene, &place, at, SHIFT_PIECES, termination)?)
        };
        let surfaces = SurfacePair::new(scene, self.moving(), other, gathered.covers_part, termination)?;
        let pieces = gathered.pieces.clone().ok_or(Halt::Lost)?;
        self.pairs.push(ShiftPair { surfaces, pieces, witnesses: Vec::new() });
        self.count(gathered.regions)
    }

    /// How far the part may be shifted from `at` along the unit vector `u` with every piece in its region.
    pub(crate) fn length(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> f64 {
        let pieces = self.pairs.iter().flat_map(|pair| pair.pieces.iter());
        pieces.map(|piece| piece.length(at, u)).fold(f64::INFINITY, f64::min)
    }

    /// How far the part may be shifted from `at` along the unit vector `u`, up to `most`, after [`Self::make_way`]. A
    /// piece whose region ends before that gets another one there.
    pub(crate) fn advance(&mut self, at: &Vector3<f64>, u: &Vector3<f64>, most: f64) -> Result<f64, Halt> {
        // Regions are replaced in the order in which they end, so that at each shift all pieces are in their regions.
        let ends_of = |pair: &ShiftPair<'_>| pair.pieces.iter().map(|piece| piece.length(at, u)).collect();
        let mut ends: Vec<Vec<f64>> = self.pairs.iter().map(ends_of).collect();
        let (mut reached, mut stalls) = (0.0, 0);
        loop {
            let of_pair = |(i, ends): (usize, &Vec<f64>)| {
                let first = ends.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
                first.map(|(k, end)| (*end, i, k))
            };
            let first = ends.iter().enumerate().filter_map(of_pair).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((end, i, k)) = first.filter(|(end, ..)| *end < most) else { return Ok(most) };
            stalls = if end - reached < STALL { stalls + 1 } else { 0 };
            reached = end;
            if stalls > STALLS {
                return Ok(reached);
            }
            let there = at + u * reached;
            let pair = &mut self.pairs[i];
            let left = REGIONS_PER_SHIFT - self.regions;
            let mut search = ShiftSearch::new(&pair.surfaces, left, self.termination);
            let found = search.find(pair.pieces[k].spot, &there, u);
            let (mut pieces, regions) = (search.pieces, search.regions);
            match found {
                // The next step finds this obstacle again, with the force unchanged.
                Err(Halt::Blocked | Halt::Lost) => return Ok(reached),
                Err(halt) => return Err(halt),
                Ok(()) => {
                    let of_pair = Arc::make_mut(&mut pair.pieces);
                    of_pair.swap_remove(k);
                    ends[i].swap_remove(k);
                    ends[i].extend(pieces.iter().map(|piece| reached + piece.length(&there, u)));
                    of_pair.append(&mut pieces);
                }
            }
            self.count(regions)?;
        }
    }

    /// Prepares a shift from `at` along the unit vector `u`: pieces whose region does not allow it get another one.
    /// Stops at the first piece that cannot, and adds what stops it to `obstacles`.
    pub(crate) fn make_way(
        &mut self,
        at: &Vector3<f64>,
        u: &Vector3<f64>,
        obstacles: &mut Vec<Obstacle>,
    ) -> Result<(), Halt> {
        for i in 0..self.pairs.len() {
            let (blocked, regions) =
                if at == &Vector3::zeros() { self.known_way(i, u)? } else { self.new_way(i, at, u)? };
            self.count(regions)?;
            if !blocked.is_empty() {
                let other = self.pairs[i].surfaces.other;
                obstacles.extend(blocked.into_iter().map(|normal| Obstacle { normal, other }));
                return Ok(());
            }
        }
        Ok(())
    }

    /// Prepares a pair at zero shift. Returns the normals of obstacles and the number of regions.
    fn known_way(&mut self, i: usize, u: &Vector3<f64>) -> Result<(Vec<Vector3<f64>>, usize), Halt> {
        let (scene, termination) = (self.scene, self.termination);
        let pair = &mut self.pairs[i];
        let place = StartPair::new(PosedPart::new(self.part, &self.start), pair.surfaces.other);
        let find = |scene: &Scene, place: &StartPair<'_>, u: &Vector3<f64>| way(scene, place, u, termination);
        let way = ShiftCoverCache::of(scene).way(scene, &place, (u, false), find)?;
        pair.pieces = Arc::clone(way.pieces.as_ref().ok_or(Halt::Lost)?);
        Ok((way.blocked.clone(), way.regions))
    }

    /// Extends the regions along `u` at zero shift as far as possible, where nothing is in the way.
    pub(crate) fn lengthen(&mut self, u: &Vector3<f64>) -> Result<(), Halt> {
        let (scene, termination) = (self.scene, self.termination);
        let find =
            |scene: &Scene, place: &StartPair<'_>, u: &Vector3<f64>| long_way(scene, place, u, termination);
        for i in 0..self.pairs.len() {
            let place = StartPair::new(PosedPart::new(self.part, &self.start), self.pairs[i].surfaces.other);
            let way = ShiftCoverCache::of(scene).way(scene, &place, (u, true), find)?;
            self.pairs[i].pieces = Arc::clone(way.pieces.as_ref().ok_or(Halt::Lost)?);
            self.count(way.regions)?;
        }
        Ok(())
    }

    /// Prepares a pair at a shift.
    fn new_way(
        &mut self,
        i: usize,
        at: &Vector3<f64>,
        u: &Vector3<f64>,
    ) -> Result<(Vec<Vector3<f64>>, usize), Halt> {
        let left = REGIONS_PER_SHIFT - self.regions;
        let ShiftPair { surfaces, pieces, witnesses } = &mut self.pairs[i];
        let seen = surfaces.obstacles_seen_by(witnesses, &WantedShift { at: *at, along: *u });
        if !seen.is_empty() {
            return Ok((seen.into_iter().map(|o| o.normal).collect(), 0));
        }
        let mut made =
            make_way(surfaces, pieces, &WantedShift { at: *at, along: *u }, left, self.termination)?;
        witnesses.append(&mut made.witnesses);
        witnesses.drain(..witnesses.len().saturating_sub(WITNESSES));
        Ok((made.blocked, made.regions))
    }

    fn count(&mut self, regions: usize) -> Result<(), Halt> {
        self.regions += regions;
        if self.regions >= REGIONS_PER_SHIFT { Err(Halt::Lost) } else { Ok(()) }
    }
}

/// A cover of a pair's surface with the part at a pose: cached if a motion begins there, otherwise with no more than
/// `most` pieces.
pub(crate) fn starting(
    scene: &Scene,
    moving: PosedPart<'_>,
    other: usize,
    (is_start, most): (bool, usize),
    termination: &Termination,
) -> Result<Arc<StartCover>, Interrupt> {
    let place = StartPair::new(moving, other);
    if is_start {
        kept(scene, &place, termination)
    } else {
        gathered(scene, &place, &Vector3::zeros(), most, termination).map(Arc::new)
    }
}

/// The cached cover of a pair where a motion begins.
fn kept(
    scene: &Scene,
    place: &StartPair<'_>,
    termination: &Termination,
) -> Result<Arc<StartCover>, Interrupt> {
    let find = |scene: &Scene, place: &StartPair<'_>| {
        gathered(scene, place, &Vector3::zeros(), SHIFT_PIECES, termination)
    };
    ShiftCoverCache::of(scene).gathered(scene, place, find)
}

/// The cover of a pair at zero shift that allows `u`.
fn way(
    scene: &Scene,
    place: &StartPair<'_>,
    u: &Vector3<f64>,
    termination: &Termination,
) -> Result<ShiftWay, Interrupt> {
    let base = kept(scene, place, termination)?;
    let surfaces = SurfacePair::new(scene, place.moving, place.other, base.covers_part, termination)?;
    let lost = ShiftWay { blocked: Vec::new(), pieces: None, found: 0, regions: REGIONS_PER_SHIFT };
    let Some(base) = &base.pieces else { return Ok(lost) };
    let mut pieces = Arc::clone(base);
    match make_way(
        &surfaces,
        &mut pieces,
        &WantedShift { at: Vector3::zeros(), along: *u },
        REGIONS_PER_SHIFT,
        termination,
    ) {
        Ok(ClearedWay { blocked, found, regions, .. }) => {
            // If an obstacle stops the part, it goes another way from the same cover.
            let (pieces, found) = if blocked.is_empty() { (pieces, found) } else { (Arc::clone(base), 0) };
            Ok(ShiftWay { blocked, pieces: Some(pieces), found, regions })
        }
        Err(Halt::Interrupted(interrupt)) => Err(interrupt),
        Err(_) => Ok(lost),
    }
}

/// The same with longer regions where there are any.
fn long_way(
    scene: &Scene,
    place: &StartPair<'_>,
    u: &Vector3<f64>,
    termination: &Termination,
) -> Result<ShiftWay, Interrupt> {
    let short = ShiftCoverCache::of(scene)
        .way(scene, place, (u, false), |scene, place, u| way(scene, place, u, termination))?;
    let base = kept(scene, place, termination)?;
    let surfaces = SurfacePair::new(scene, place.moving, place.other, base.covers_part, termination)?;
    let mut search = ShiftSearch::new(&surfaces, REGIONS_PER_SHIFT, termination);
    let mut lengthened = |piece: &ShiftPiece| {
        termination.check()?;
        let length = piece.length(&Vector3::zeros(), u);
        let longer = if length < FREE_STEP { search.far(piece.spot, u, length) } else { None };
        Ok(longer.unwrap_or_else(|| piece.clone()))
    };
    let mut pieces = short.pieces.as_deref().cloned();
    if let Some(pieces) = &mut pieces {
        // The new pieces were already given the longest regions.
        let others = pieces.len() - short.found;
        for piece in &mut pieces[..others] {
            *piece = lengthened(piece)?;
        }
    }
    Ok(ShiftWay { blocked: Vec::new(), pieces: pieces.map(Arc::new), found: 0, regions: search.regions })
}

/// Covers all of a surface of a pair at a shift, with no more than `most` pieces.
fn gathered(
    scene: &Scene,
    place: &StartPair<'_>,
    at: &Vector3<f64>,
    most: usize,
    termination: &Termination,
) -> Result<StartCover, Interrupt> {
    let &StartPair { moving, other, .. } = place;
    let surfaces = |covers_part| SurfacePair::new(scene, moving, other, covers_part, termination);
    let coverable = SurfacePair::coverable_sides(scene, moving.part, other);
    // On its way no piece may get deeper than the engine allows.
    let held = if at == &Vector3::zeros() { HELD_AT_FIRST } else { HELD };
    // One side is mostly enough. The patch tree of the other, perhaps of a large part, is built when it is needed.
    let sides: Vec<OnceCell<SurfacePair<'_>>> = coverable.iter().map(|_| OnceCell::new()).collect();
    let mut searches: Vec<Option<ShiftSearch<'_>>> = coverable.iter().map(|_| None).collect();
    // The inner or simpler surface needs fewer pieces. Which one this is shows in trying both in turn; then the side
    // that seems to need fewer gets twice the budget.
    let mut budgets =
        vec![if coverable.len() > 1 { FIRST_SIDE_REGIONS } else { REGIONS_PER_SHIFT }; coverable.len()];
    let mut goes_on = !coverable.is_empty();
    while goes_on {
        let needed = |i: usize| searches[i].as_ref().map_or(0.0, |search| search.needed);
        let rank = |i: usize| {
            if budgets[i] <= SIDE_REGIONS { budgets[i] as f64 } else { REGIONS_PER_SHIFT as f64 + needed(i) }
        };
        let Some(i) = (0..coverable.len()).min_by(|&i, &k| rank(i).total_cmp(&rank(k))) else { break };
        if budgets[i] > REGIONS_PER_SHIFT {
            break;
        }
        let covers_part = coverable[i];
        let search = match &mut searches[i] {
            Some(search) => search,
            none => {
                let side = surfaces(covers_part)?;
                none.insert(ShiftSearch::of_all(sides[i].get_or_init(|| side), held, termination))
            }
        };
        let found = search.gather(at, budgets[i], most);
        budgets[i] *= 2;
        goes_on = search.pieces.len() <= most;
        let pieces = if found == Ok(true) { std::mem::take(&mut search.pieces) } else { Vec::new() };
        let regions = searches.iter().flatten().map(|search| search.regions).sum();
        match found {
            Ok(true) if pieces.len() > most => {}
            Ok(true) => return Ok(StartCover { covers_part, pieces: Some(Arc::new(pieces)), regions }),
            Ok(false) => {}
            Err(Halt::Interrupted(interrupt)) => return Err(interrupt),
            Err(_) => return Ok(StartCover { covers_part, pieces: None, regions }),
        }
    }
    let regions = searches.iter().flatten().map(|search| search.regions).sum();
    Ok(StartCover { covers_part: true, pieces: None, regions })
}

/// The result of preparing a pair.
struct ClearedWay {
    /// The normals of obstacles.
    blocked: Vec<Vector3<f64>>,
    /// Points that show them.
    witnesses: Vec<Witness>,
    /// The number of new pieces, which are the last ones.
    found: usize,
    /// The number of regions that were computed.
    regions: usize,
}

/// The normals of what is certainly in the way, shown by the first piece that touches something ahead. With an
/// allowed penetration, regions allow the rest of it, which leads nowhere.
fn touched(
    surfaces: &SurfacePair<'_>,
    pieces: &[ShiftPiece],
    wish: &WantedShift,
) -> Option<Vec<Vector3<f64>>> {
    let reach = if surfaces.allowed > 0.0 { HELD_AT_FIRST } else { TOUCHED };
    let mut placed = PlacedPiece::default();
    let of_shift_piece = |piece: &ShiftPiece| piece.touched(surfaces, wish, reach, &mut placed);
    let found = pieces.iter().map(of_shift_piece).find(|found| !found.is_empty())?;
    Some(found.into_iter().map(|obstacle| obstacle.normal).collect())
}

/// Prepares the cover of a pair for a wanted shift.
fn make_way(
    surfaces: &SurfacePair<'_>,
    pieces: &mut Arc<Vec<ShiftPiece>>,
    wish: &WantedShift,
    most: usize,
    termination: &Termination,
) -> Result<ClearedWay, Halt> {
    if let Some(blocked) = touched(surfaces, pieces, wish) {
        return Ok(ClearedWay { blocked, witnesses: Vec::new(), found: 0, regions: 0 });
    }
    let WantedShift { at, along: u } = wish;
    let ends = |piece: &ShiftPiece| piece.blocks(at, u) || piece.is_exhausted(at, u);
    if !pieces.iter().any(ends) {
        return Ok(ClearedWay { blocked: Vec::new(), witnesses: Vec::new(), found: 0, regions: 0 });
    }
    let mut search = ShiftSearch::new(surfaces, most, termination);
    let mut ended = Ok(());
    let of_pair = Arc::make_mut(pieces);
    let mut i = 0;
    while i < of_pair.len() && ended.is_ok() {
        if ends(&of_pair[i]) {
            let known = search.pieces.len();
            ended = search.find(of_pair[i].spot, at, u);
            if ended.is_err() {
                search.pieces.truncate(known);
            } else {
                of_pair.swap_remove(i);
                continue;
            }
        }
        i += 1;
    }
    let (found, regions) = (search.pieces.len(), search.regions);
    of_pair.append(&mut search.pieces);
    match ended {
        Ok(()) => Ok(ClearedWay { blocked: Vec::new(), witnesses: Vec::new(), found, regions }),
        Err(Halt::Blocked) => {
            Ok(ClearedWay { blocked: search.obstacles, witnesses: search.witnesses, found, regions })
        }
        Err(halt) => Err(halt),
    }
}
