//! A pair of surfaces, one of them in pieces with regions.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use crate::budgets::{
    CONTACTS_PER_LOOK, EDGE_SECTIONS, KEPT_CONTACTS, PASSED_TRIANGLES, PROBED_CORNERS, REGIONS_ON_APPROACH,
    REGIONS_PER_LOOK, REGIONS_PER_MOTION, REGIONS_PER_STEP, RIGID_PIECES,
};
use crate::geometry::{Bounds, FreeRegion, NoRegion, Pose};
use crate::scene::{PosedPart, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    BULGE_TOLERANCE, CONTACT_STEP, COVERED_OVERLAP, DEPTH_TOLERANCE, SMALL_BIT_ENTERED, SMALLEST_BIT,
};

use super::super::super::sampled::{Contact, ContactSet, MovingBody};
use super::super::cover;
use super::super::pieces::{Piece, PlacedPiece};
use super::super::shift::starting;
use super::super::surface_pair::{CoverPiece, SurfacePair};
use super::piece::{RigidPiece, StepPoses};

/// The inverse of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Around the smallest bit, the plane of the nearest face serves as its region this far, in the planning frame.
const AROUND_SMALLEST: f64 = 4.0 * SMALLEST_BIT;

/// A pair with a cover of one of its surfaces.
pub(crate) struct RigidPair<'a> {
    pub(crate) surfaces: SurfacePair<'a>,
    pieces: Vec<RigidPiece>,
    /// Contacts that mattered.
    pub(crate) known: Vec<Contact>,
    /// Whether the last query found the pair within reach.
    pub(crate) is_near: bool,
    /// Whether the cover failed: from the base on the pair is measured at samples.
    pub(crate) is_left_to_samples: bool,
    /// The number of steps, and of regions that were computed.
    steps: usize,
    regions: usize,
    placed: PlacedPiece,
}

/// Pieces that have left their regions.
pub(crate) struct OutsidePieces {
    outside: Vec<usize>,
    ends: StepPoses,
}

/// Why a piece got no region.
enum Uncovered {
    /// It is too deep at the other end of the step.
    Entered(Contact),
    /// It is too deep between the two ends.
    Crossed,
    /// The budget was spent.
    Unsure,
}

impl<'a> RigidPair<'a> {
    /// Covers a pair with the part at a pose; `None` if regions cannot.
    pub(crate) fn new(
        scene: &'a Scene,
        moving: PosedPart<'_>,
        other: usize,
        is_start: bool,
        termination: &Termination,
    ) -> Result<Option<Self>, Interrupt> {
        if scene.allowed.of(moving.part, other) > COVERED_OVERLAP {
            return Ok(None);
        }
        let gathered = starting(scene, moving, other, (is_start, RIGID_PIECES), termination)?;
        let pieces = gathered.pieces.as_ref().filter(|pieces| pieces.len() <= RIGID_PIECES);
        let Some(pieces) = pieces else { return Ok(None) };
        let surfaces = SurfacePair::new(scene, moving, other, gathered.covers_part, termination)?;
        let mut placed = PlacedPiece::default();
        let here = surfaces.with_part_at(moving.pose);
        let pieces = pieces
            .iter()
            .map(|piece| RigidPiece::of_shift_piece(piece, &surfaces, &here, &mut placed))
            .collect();
        let known = Vec::new();
        Ok(Some(Self {
            surfaces,
            pieces,
            known,
            is_near: false,
            is_left_to_samples: false,
            steps: 0,
            regions: 0,
            placed,
        }))
    }

    /// Adds what is near the body's pose to `near`; the part was free at `base`. Returns the pieces that have left
    /// their regions, unless one of them is known to enter something: whether these enter is [not yet
    /// known](Self::renewed).
    pub(crate) fn near(
        &mut self,
        base: &Pose,
        mover: &MovingBody<'_>,
        reach: f64,
        near: &mut ContactSet,
    ) -> Option<OutsidePieces> {
        let ends = StepPoses::of(&self.surfaces, base, &mover.pose);
        self.is_near = true;
        let outside = self.outside(&ends, near);
        // Most contacts lie on pieces that have left their regions.
        if outside.is_empty() {
            return None;
        }
        let again = self.known.iter().filter_map(|c| mover.remeasured(c, reach));
        let mut found: Vec<Contact> = again.filter(|c| c.gap < -DEPTH_TOLERANCE).collect();
        found.extend(self.corners_inside(&outside, &ends.there, DEPTH_TOLERANCE));
        if found.is_empty() {
            found = self.triangles_inside(&outside, &ends.there);
        }
        if found.is_empty() {
            return Some(OutsidePieces { outside, ends });
        }
        self.learn(&found);
        near.contacts.extend(found);
        None
    }

    /// Finds new regions for pieces that have left theirs, or contacts.
    pub(crate) fn renewed(
        &mut self,
        left: &OutsidePieces,
        mover: &MovingBody<'_>,
        reach: f64,
        near: &mut ContactSet,
    ) -> Result<(), Interrupt> {
        let found = self.renew(&left.outside, &left.ends);
        if self.is_left_to_samples {
            return mover.near_pair(self.surfaces.other, reach, near);
        }
        self.learn(&found);
        near.contacts.extend(found);
        Ok(())
    }

    /// The pieces that are not in their regions at the other end. Notes for every piece how far it may still move.
    fn outside(&mut self, StepPoses { here, there, .. }: &StepPoses, near: &mut ContactSet) -> Vec<usize> {
        let angle = here.rotation.angle_to(&there.rotation);
        let mut outside = Vec::new();
        for (i, piece) in self.pieces.iter_mut().enumerate() {
            let moved = (there * piece.centre - piece.stands).norm() + angle * piece.radius;
            piece.next = if piece.slack > moved {
                Some(piece.slack - moved)
            } else {
                piece.slack_at(&self.surfaces, there, 0.0, &mut self.placed)
            };
            match piece.next {
                Some(slack) => near.clearance = near.clearance.min(slack.max(0.0)),
                None => outside.push(i),
            }
        }
        if !outside.is_empty() {
            near.clearance = 0.0;
        }
        outside
    }

    /// The corners of some pieces that are deeper in the measured solid than `most`.
    fn corners_inside(&mut self, pieces: &[usize], there: &Pose, most: f64) -> Vec<Contact> {
        let mut inside = Vec::new();
        let Self { surfaces, pieces: all, placed, .. } = self;
        for &i in pieces {
            let piece = &mut all[i];
            surfaces.covered.place(&piece.spot.piece, there, placed);
            let slacks = placed.points.iter().map(|p| piece.region.slack(p)).enumerate();
            let mut out: Vec<(usize, f64)> = slacks.filter(|(_, slack)| *slack < -most).collect();
            out.sort_by(|a, b| a.1.total_cmp(&b.1));
            for (k, _) in out.into_iter().take(PROBED_CORNERS) {
                let seen = surfaces.measured.signed_closest(&placed.points[k], piece.spot.guess);
                piece.spot.guess = seen.closest.triangle;
                let gap = seen.signed + surfaces.allowed;
                if gap < -most {
                    let sample = surfaces.covered.corner(&piece.spot.piece, k);
                    let (is_moving, at) = (surfaces.covers_part, (gap, seen.closest));
                    inside.push(Contact::measured(surfaces.other, is_moving, sample, at, surfaces.allowed));
                }
            }
        }
        inside
    }

    /// The corners of measured triangles, and the middles of their sides, that are too deep in the covered solid: of
    /// those triangles whose planes the pieces have passed.
    fn triangles_inside(&mut self, pieces: &[usize], there: &Pose) -> Vec<Contact> {
        let mut inside = Vec::new();
        for &i in pieces {
            let Self { surfaces, pieces: all, placed, .. } = self;
            let piece = &all[i];
            surfaces.covered.place(&piece.spot.piece, there, placed);
            let passed = piece.region.passed(&placed.cloud, DEPTH_TOLERANCE).take(PASSED_TRIANGLES);
            for contact in passed.filter_map(|triangle| pierced(surfaces, piece, triangle, there)) {
                if !inside.iter().any(|c: &Contact| c.is_of_same_point(&contact)) {
                    inside.push(contact);
                }
            }
        }
        inside
    }

    /// Finds regions that hold these pieces at both ends, or contacts that are too deep at the other end.
    fn renew(&mut self, outside: &[usize], ends: &StepPoses) -> Vec<Contact> {
        let mut left = REGIONS_PER_LOOK;
        let (mut found, mut entered) = (Vec::new(), Vec::new());
        for &i in outside {
            let piece = self.pieces[i].clone();
            match self.held(&piece, ends, &mut left, &mut found) {
                Ok(()) => {}
                Err(Uncovered::Entered(contact)) => {
                    entered.push(contact);
                    if entered.len() >= CONTACTS_PER_LOOK {
                        break;
                    }
                }
                Err(Uncovered::Crossed | Uncovered::Unsure) => {
                    self.is_left_to_samples = entered.is_empty();
                    return entered;
                }
            }
        }
        if entered.is_empty() {
            for &i in outside.iter().rev() {
                self.pieces.swap_remove(i);
            }
            self.pieces.extend(found);
        }
        entered
    }

    /// Covers a piece at both ends, or its parts.
    fn held(
        &mut self,
        piece: &RigidPiece,
        ends: &StepPoses,
        left: &mut usize,
        out: &mut Vec<RigidPiece>,
    ) -> Result<(), Uncovered> {
        let mut is_whole = true;
        cover(vec![piece.clone()], |mut piece, rest| {
            // A part may lie in the region of the whole piece.
            if !std::mem::take(&mut is_whole) {
                let at_here = piece.slack_at(&self.surfaces, &ends.here, 0.0, &mut self.placed);
                piece.next = piece.slack_at(&self.surfaces, &ends.there, 0.0, &mut self.placed);
                if let (Some(slack), Some(_)) = (at_here, piece.next) {
                    out.push(RigidPiece { slack, ..piece });
                    return Ok(());
                }
            }
            if *left == 0 {
                return Err(Uncovered::Unsure);
            }
            *left -= 1;
            if let Some(held) = self.held_whole(&piece, ends)? {
                out.push(held);
                return Ok(());
            }
            let part = |part| {
                let spot = CoverPiece { piece: part, ..piece.spot };
                RigidPiece::new(spot, Arc::clone(&piece.region), &self.surfaces, &ends.here)
            };
            rest.extend(self.surfaces.covered.parts(&piece.spot.piece).into_iter().rev().map(part));
            Ok(())
        })
    }

    /// All of a piece in a region that holds it at both ends; `None` if the piece is to be split.
    fn held_whole(&mut self, piece: &RigidPiece, ends: &StepPoses) -> Result<Option<RigidPiece>, Uncovered> {
        self.regions += 1;
        // If a region further ahead failed the last time, it is not tried again at once.
        let goes_far = piece.spot.level == 0 && ends.here != ends.there;
        let far = if goes_far { self.region(piece, &[ends.here, ends.there, ends.ahead]).ok() } else { None };
        let level = usize::from(goes_far && far.is_none());
        match far.map_or_else(|| self.region(piece, &[ends.here, ends.there]), Ok) {
            Ok(region) => {
                let mut piece = RigidPiece { region: Arc::new(region), ..piece.clone() };
                piece.spot.level = level;
                piece.slack =
                    piece.slack_at(&self.surfaces, &ends.here, 0.0, &mut self.placed).unwrap_or(0.0);
                piece.next = piece.slack_at(&self.surfaces, &ends.there, 0.0, &mut self.placed).or(Some(0.0));
                return Ok(Some(piece));
            }
            Err(NoRegion::Amid(triangle)) => {
                if let Some(contact) = pierced(&self.surfaces, piece, triangle, &ends.there) {
                    return Err(Uncovered::Entered(contact));
                }
            }
            Err(NoRegion::Cramped) => {}
        }
        let Piece::Bit(corners) = &piece.spot.piece else { return Ok(None) };
        if piece.radius >= SMALL_BIT_ENTERED {
            return Ok(None);
        }
        if let Some(contact) = self.deepest_on_edges(corners, piece.spot.guess, &ends.there) {
            return Err(Uncovered::Entered(contact));
        }
        if piece.radius >= SMALLEST_BIT {
            return Ok(None);
        }
        let enters = |at: &Pose| self.deepest_on_edges(corners, piece.spot.guess, at).is_some();
        if ends.here != ends.there && ends.between.iter().any(enters) {
            return Err(Uncovered::Crossed);
        }
        Ok(self.before_face(piece, ends))
    }

    /// A region that holds a piece at several poses.
    fn region(&mut self, piece: &RigidPiece, at: &[Pose]) -> Result<FreeRegion, NoRegion> {
        let (surfaces, placed) = (&self.surfaces, &mut self.placed);
        let (mut wanted, mut centres) = (Vec::new(), Bounds::EMPTY);
        for pose in at {
            surfaces.covered.place(&piece.spot.piece, pose, placed);
            wanted.extend_from_slice(&placed.extremes);
            centres = centres.with_point(&placed.centre);
        }
        let middle = centres.centre();
        let around = placed.radius + (centres.max - middle).norm() + CONTACT_STEP;
        let most = piece.most(surfaces);
        let seen = surfaces.measured.signed_closest(&middle, piece.spot.guess);
        let region = surfaces.region((&middle, &seen), around, &wanted, most)?;
        for pose in at {
            surfaces.covered.place(&piece.spot.piece, pose, placed);
            placed.slack_in(&region, most).ok_or(NoRegion::Cramped)?;
        }
        Ok(region)
    }

    /// The deepest point on the edges of a bit, if it is too deep: where edges cross, neither surface has a corner
    /// inside the other. Below the two faces of an edge, the depth along a line has one maximum, which golden
    /// sections find.
    fn deepest_on_edges(&self, corners: &[Point3<f64>; 3], guess: u32, there: &Pose) -> Option<Contact> {
        let surfaces = &self.surfaces;
        let gap = |p: &Point3<f64>| {
            let seen = surfaces.measured.signed_closest(&(there * p), guess);
            (seen.signed + surfaces.allowed, seen.closest)
        };
        let at_corners = corners.map(|p| gap(&p).0);
        let mut deepest: Option<(f64, Point3<f64>)> = None;
        for edge in 0..3 {
            let next = (edge + 1) % 3;
            let (a, b) = (corners[edge], corners[next]);
            if at_corners[edge].min(at_corners[next]) - (b - a).norm() / 2.0 > -DEPTH_TOLERANCE {
                continue;
            }
            let (mut low, mut high) = (0.0, 1.0);
            let at = |u: f64| a + (b - a) * u;
            let (mut u, mut v) = (1.0 - GOLDEN, GOLDEN);
            let (mut of_u, mut of_v) = (gap(&at(u)).0, gap(&at(v)).0);
            for _ in 0..EDGE_SECTIONS {
                if of_u < of_v {
                    (high, v, of_v) = (v, u, of_u);
                    u = high - GOLDEN * (high - low);
                    of_u = gap(&at(u)).0;
                } else {
                    (low, u, of_u) = (u, v, of_v);
                    v = low + GOLDEN * (high - low);
                    of_v = gap(&at(v)).0;
                }
            }
            let found = if of_u < of_v { (of_u, at(u)) } else { (of_v, at(v)) };
            let corner = (at_corners[edge], a);
            for found in [found, corner] {
                if deepest.is_none_or(|(least, _)| found.0 < least) {
                    deepest = Some(found);
                }
            }
        }
        let (_, p) = deepest.filter(|(gap, _)| *gap < -DEPTH_TOLERANCE)?;
        Some(Contact::measured(surfaces.other, surfaces.covers_part, p, gap(&p), surfaces.allowed))
    }

    /// A small bit that is not too deep, in front of the nearest face.
    fn before_face(&mut self, piece: &RigidPiece, ends: &StepPoses) -> Option<RigidPiece> {
        let (surfaces, placed) = (&self.surfaces, &mut self.placed);
        surfaces.covered.place(&piece.spot.piece, &ends.there, placed);
        let (normal, _, triangle) = surfaces.before_face(placed, piece.spot.guess, &Vector3::zeros())?;
        let ball = (placed.centre, AROUND_SMALLEST);
        let region = Arc::new(FreeRegion::known(ball, [(normal, placed.lowest(&normal), triangle)]));
        Some(RigidPiece { region, slack: 0.0, next: Some(0.0), ..piece.clone() })
    }

    /// Keeps contacts for later steps.
    fn learn(&mut self, found: &[Contact]) {
        for contact in found {
            if !self.known.iter().any(|c| c.is_of_same_point(contact)) {
                self.known.push(*contact);
            }
        }
        self.known.drain(..self.known.len().saturating_sub(KEPT_CONTACTS));
    }

    /// Makes the pose of the last query the base; `false` if the cover fails there.
    pub(crate) fn settle(
        &mut self,
        mover: &MovingBody<'_>,
        reach: f64,
        termination: &Termination,
    ) -> Result<bool, Interrupt> {
        let there = self.surfaces.with_part_at(&mover.pose);
        let again = self.known.iter().filter_map(|c| mover.remeasured(c, reach));
        self.known = again.filter(|c| c.gap < reach).collect();
        let outside: Vec<usize> = (0..self.pieces.len()).filter(|&i| self.pieces[i].next.is_none()).collect();
        let (mut left, mut found) = (REGIONS_ON_APPROACH, Vec::new());
        for &i in outside.iter().rev() {
            let ends = StepPoses::at(there);
            let piece = self.pieces.swap_remove(i);
            termination.check()?;
            if self.held(&piece, &ends, &mut left, &mut found).is_err() {
                return Ok(false);
            }
        }
        self.pieces.extend(found);
        for piece in &mut self.pieces {
            piece.stands = there * piece.centre;
            piece.slack = piece.next.unwrap_or(0.0);
        }
        self.steps += 1;
        Ok(self.regions <= REGIONS_PER_MOTION + REGIONS_PER_STEP * self.steps)
    }

    /// Whether nothing is too deep at a pose between the base and the pose of the last query.
    pub(crate) fn is_clear_at(&mut self, between: &MovingBody<'_>) -> bool {
        if self.is_left_to_samples || !self.is_near {
            return !self.is_left_to_samples;
        }
        let there = self.surfaces.with_part_at(&between.pose);
        let more = BULGE_TOLERANCE - DEPTH_TOLERANCE;
        let outside: Vec<usize> = (0..self.pieces.len())
            .filter(|&i| self.pieces[i].slack_at(&self.surfaces, &there, more, &mut self.placed).is_none())
            .collect();
        self.corners_inside(&outside, &there, BULGE_TOLERANCE).is_empty()
    }
}

/// The corner of a measured triangle, or the middle of one of its sides, that is too deep in the covered solid.
fn pierced(surfaces: &SurfacePair<'_>, piece: &RigidPiece, triangle: u32, there: &Pose) -> Option<Contact> {
    if surfaces.covered.surface.is_open() {
        return None;
    }
    let guess = surfaces.covered.triangle_of(&piece.spot.piece).unwrap_or(0);
    surfaces.measured.corners_and_middles(triangle).into_iter().find_map(|point| {
        let p = there.inverse_transform_point(&point);
        let seen = surfaces.covered.surface.signed_closest(&p, guess);
        let at = (seen.signed + surfaces.allowed, seen.closest);
        (at.0 < -DEPTH_TOLERANCE)
            .then(|| Contact::measured(surfaces.other, !surfaces.covers_part, point, at, surfaces.allowed))
    })
}
