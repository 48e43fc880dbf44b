//! A cache of covers for shifts, for pairs where motions begin.
//!
//! Six pushes from a state, its static analysis, and the same part tried again after another one left all need the
//! same regions first. An entry is a function of its key alone, so a motion does not depend on which other motion
//! came first. The entry of an assembled pair is found in a scene of the two parts alone, at rounded poses, so it
//! does not depend on which congruent pair came first either.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use nalgebra::Vector3;

use crate::budgets::REMEMBERED_SHIFT_PIECES;
use crate::geometry::{Pose, Shape};
use crate::scene::{CongruentPair, PosedPart, Scene, grouped};
use crate::termination::Interrupt;
use crate::tolerances::CONGRUENT_PAIR_DISTANCE;

use super::piece::ShiftPiece;

/// A part where its motion begins, and one standing part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StartPair<'a> {
    pub(crate) moving: PosedPart<'a>,
    pub(crate) other: usize,
    /// The key of its entry, if it stands for a canonical pair.
    kept_as: Option<StartKey>,
}

impl<'a> StartPair<'a> {
    pub(crate) fn new(moving: PosedPart<'a>, other: usize) -> Self {
        Self { moving, other, kept_as: None }
    }
}

/// A cover of all of one surface of a pair, at zero shift.
#[derive(Debug, Clone)]
pub(crate) struct StartCover {
    /// Whether the covered surface is the moving part's.
    pub(crate) covers_part: bool,
    /// `None` if no cover was found.
    pub(crate) pieces: Option<Arc<Vec<ShiftPiece>>>,
    /// The number of regions that were computed.
    pub(crate) regions: usize,
}

impl StartCover {
    /// The same pair with the other part moving.
    fn mirrored(&self) -> Self {
        let pieces = self.pieces.as_deref().map(|pieces| mirrored(pieces));
        Self { covers_part: !self.covers_part, pieces, regions: self.regions }
    }
}

/// The cover of a pair after it was changed to allow a direction.
#[derive(Debug, Clone)]
pub(crate) struct ShiftWay {
    /// Normals (planning frame) of the obstacles; empty if the direction is free.
    pub(crate) blocked: Vec<Vector3<f64>>,
    /// The pieces that allow the direction, or the former ones if an obstacle stops it; `None` if no cover was found.
    pub(crate) pieces: Option<Arc<Vec<ShiftPiece>>>,
    /// The number of new pieces, which are the last ones.
    pub(crate) found: usize,
    /// The number of regions that were computed.
    pub(crate) regions: usize,
}

impl ShiftWay {
    fn mirrored(&self) -> Self {
        let blocked = self.blocked.iter().map(|n| -n).collect();
        let pieces = self.pieces.as_deref().map(|pieces| mirrored(pieces));
        Self { blocked, pieces, found: self.found, regions: self.regions }
    }
}

fn size(pieces: Option<&Arc<Vec<ShiftPiece>>>) -> usize {
    1 + pieces.map_or(0, |pieces| pieces.len())
}

fn memory(pieces: Option<&Vec<ShiftPiece>>) -> usize {
    pieces.map_or(0, |pieces| pieces.iter().map(ShiftPiece::memory).sum())
}

fn mirrored(pieces: &[ShiftPiece]) -> Arc<Vec<ShiftPiece>> {
    Arc::new(pieces.iter().map(ShiftPiece::mirrored).collect())
}

/// The cache of a scene.
#[derive(Debug, Default)]
pub struct ShiftCoverCache {
    kept: Mutex<CacheEntries>,
    /// For each assembled pair, the first pair that is congruent to it.
    firsts: OnceLock<HashMap<(usize, usize), (usize, usize)>>,
}

#[derive(Debug, Default)]
struct CacheEntries {
    gathered: HashMap<StartKey, Arc<StartCover>>,
    ways: HashMap<(StartKey, [u64; 3], bool), Arc<ShiftWay>>,
    /// The number of pieces in entries that may be dropped.
    count: usize,
}

impl CacheEntries {
    /// Makes room for `pieces` more: drops the entries of displaced pairs and of directions.
    fn make_room(&mut self, pieces: usize) {
        self.count += pieces;
        if self.count > REMEMBERED_SHIFT_PIECES {
            self.gathered.retain(|key, _| key.start.is_none());
            self.ways.clear();
            self.count = pieces;
        }
    }
}

/// The key of a pair: for assembled pairs without a start pose, otherwise with its bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct StartKey {
    part: usize,
    other: usize,
    start: Option<[u64; 7]>,
}

/// The key that stands for a pair: the same for congruent pairs, and for both parts of a pair.
struct CanonicalStart {
    key: StartKey,
    /// The pair for which the entry is computed, unless it is this one.
    alone: Option<CongruentPair>,
    /// Whether the other part moves in the canonical pair.
    is_mirrored: bool,
}

impl ShiftCoverCache {
    /// The cache of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Arc<Self> {
        scene.memo.of()
    }

    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        let kept = self.lock();
        let gathered = kept.gathered.values().map(|g| memory(g.pieces.as_deref()));
        let ways = kept.ways.values().map(|w| memory(w.pieces.as_deref()));
        gathered.sum::<usize>() + ways.sum::<usize>()
    }

    /// The cover of a pair at zero shift; `find` computes it if it is not cached.
    pub(crate) fn gathered(
        &self,
        scene: &Scene,
        place: &StartPair<'_>,
        find: impl Fn(&Scene, &StartPair<'_>) -> Result<StartCover, Interrupt>,
    ) -> Result<Arc<StartCover>, Interrupt> {
        let CanonicalStart { key, alone, is_mirrored } = self.canonical(scene, place);
        let known = self.lock().gathered.get(&key).cloned();
        let found = if let Some(known) = known {
            known
        } else {
            let found = Arc::new(at_place(scene, place, alone, key, &find)?);
            let mut kept = self.lock();
            kept.make_room(if key.start.is_some() { size(found.pieces.as_ref()) } else { 0 });
            kept.gathered.insert(key, Arc::clone(&found));
            found
        };
        Ok(if is_mirrored { Arc::new(found.mirrored()) } else { found })
    }

    /// The cover of a pair that allows a unit vector, for the next step or as far as possible; `find` computes it if
    /// it is not cached.
    pub(crate) fn way(
        &self,
        scene: &Scene,
        place: &StartPair<'_>,
        (u, far): (&Vector3<f64>, bool),
        find: impl Fn(&Scene, &StartPair<'_>, &Vector3<f64>) -> Result<ShiftWay, Interrupt>,
    ) -> Result<Arc<ShiftWay>, Interrupt> {
        let CanonicalStart { key: pair_key, alone, is_mirrored } = self.canonical(scene, place);
        // Adding zero turns −0 into 0.
        let u = if is_mirrored { -u } else { *u } + Vector3::zeros();
        let key = (pair_key, <[f64; 3]>::from(u).map(f64::to_bits), far);
        let known = self.lock().ways.get(&key).cloned();
        let found = if let Some(known) = known {
            known
        } else {
            let find = |scene: &Scene, place: &StartPair<'_>| find(scene, place, &u);
            let found = Arc::new(at_place(scene, place, alone, pair_key, &find)?);
            let mut kept = self.lock();
            kept.make_room(size(found.pieces.as_ref()));
            kept.ways.insert(key, Arc::clone(&found));
            found
        };
        Ok(if is_mirrored { Arc::new(found.mirrored()) } else { found })
    }

    fn canonical(&self, scene: &Scene, place: &StartPair<'_>) -> CanonicalStart {
        let StartPair { moving: PosedPart { part, pose: start }, other, kept_as } = *place;
        if let Some(key) = kept_as {
            return CanonicalStart { key, alone: None, is_mirrored: false };
        }
        if start != &scene.bodies[part].planning_from_shape {
            let key = StartKey { part, other, start: Some(bits(start)) };
            return CanonicalStart { key, alone: None, is_mirrored: false };
        }
        let in_order = ordered(scene, part, other);
        let (part, other) = self.first_alike(scene, in_order);
        let alone = Some(CongruentPair::shifted(scene, part, &scene.bodies[part].planning_from_shape, other));
        let is_mirrored = in_order != (place.moving.part, place.other);
        CanonicalStart { key: StartKey { part, other, start: None }, alone, is_mirrored }
    }

    fn first_alike(&self, scene: &Scene, pair: (usize, usize)) -> (usize, usize) {
        let firsts = self.firsts.get_or_init(|| {
            let pairs = scene.broad_phase.pairs(CONGRUENT_PAIR_DISTANCE);
            let pairs: Vec<_> = pairs.into_iter().map(|(a, b)| ordered(scene, a, b)).collect();
            let (first, group_of) = grouped(pairs.iter().map(|&(a, b)| alike(scene, a, b)));
            let first_of: Vec<_> = group_of.into_iter().map(|group| pairs[first[group]]).collect();
            pairs.into_iter().zip(first_of).collect()
        });
        firsts.get(&pair).copied().unwrap_or(pair)
    }

    /// A mutex that was poisoned still holds a consistent cache: it is plain data.
    fn lock(&self) -> MutexGuard<'_, CacheEntries> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Computes an entry for a pair, or for its canonical pair.
fn at_place<T>(
    scene: &Scene,
    place: &StartPair<'_>,
    alone: Option<CongruentPair>,
    key: StartKey,
    find: &dyn Fn(&Scene, &StartPair<'_>) -> Result<T, Interrupt>,
) -> Result<T, Interrupt> {
    let Some(pair) = alone else { return find(scene, place) };
    // Entries that are computed on the way go into the same cache.
    let alone = Scene { memo: scene.memo.clone(), ..pair.scene(scene) };
    find(&alone, &StartPair { moving: PosedPart::new(0, &pair.poses[0]), other: 1, kept_as: Some(key) })
}

/// What two congruent pairs have in common: shapes, poses and allowed penetration.
fn alike(scene: &Scene, a: usize, b: usize) -> ([*const Shape; 2], [[u64; 7]; 2], u64) {
    let pair = CongruentPair::shifted(scene, a, &scene.bodies[a].planning_from_shape, b);
    let shapes = pair.parts.map(|part| Arc::as_ptr(&scene.bodies[part].shape));
    (shapes, pair.poses.map(|pose| bits(&pose)), scene.allowed.of(a, b).to_bits())
}

/// Orders two parts by size.
fn ordered(scene: &Scene, a: usize, b: usize) -> (usize, usize) {
    let size = |i: usize| scene.bodies[i].bounds.extents().max();
    if (size(a), a) <= (size(b), b) { (a, b) } else { (b, a) }
}

fn bits(pose: &Pose) -> [u64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(f64::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, moved, scene};
    use crate::geometry::SourceMesh;
    use crate::scene::StandingParts;
    use crate::simulation::{Action, Axis, End, Motion, SlidingEngine, TransitionFunction};
    use crate::termination::Termination;

    /// Three posts, each on its foot, alike but for rounding, and a wall beside.
    fn meshes() -> Vec<SourceMesh> {
        let pairs = [-4.9, -2.3, 0.3].map(|x: f64| {
            let foot = cuboid([-0.7, -0.8, 0.0], [0.9, 1.0, 0.5]);
            let post = cuboid([-0.3, -0.4, 0.5], [0.5, 0.6, 2.0]);
            [foot, post].map(|mesh| moved(mesh, &Pose::translation(x, 0.1, 0.0)))
        });
        pairs.into_iter().flatten().chain([cuboid([2.3, -4.0, 0.0], [2.6, 4.0, 3.0])]).collect()
    }

    fn motion(scene: &Scene, part: usize, lift: f64, action: Action) -> Motion {
        let standing = (0..scene.bodies.len()).filter(|&i| i != part).collect();
        let around = StandingParts::new(scene, standing);
        let start = Pose::translation(0.0, 0.0, lift) * scene.bodies[part].planning_from_shape;
        SlidingEngine.simulate(scene, &around, part, &start, action, &Termination::default()).unwrap()
    }

    #[test]
    fn motions_do_not_depend_on_what_was_asked_before() {
        let meshes = meshes();
        let questions: Vec<_> = (0..meshes.len())
            .flat_map(|part| [0.0, 0.25].map(|lift| (part, lift)))
            .flat_map(|(part, lift)| Action::translations().into_iter().map(move |a| (part, lift, a)))
            .collect();
        let (remembering, _) = scene(meshes.clone());
        for &(part, lift, action) in questions.iter().rev() {
            let warm = motion(&remembering, part, lift, action);
            assert_eq!(warm, motion(&remembering, part, lift, action), "asked again");
            let (fresh, _) = scene(meshes.clone());
            assert_eq!(warm, motion(&fresh, part, lift, action), "part {part} up by {lift}, {action}");
        }
    }

    #[test]
    fn pairs_that_stand_alike_are_kept_once_for_either_part() {
        let (scene, _) = scene(meshes());
        let [up, down] = [true, false].map(|positive| Action::Push(Axis::Z, positive));
        for (part, action) in [(1, down), (3, down), (5, down), (0, up), (4, up)] {
            let Motion { path, end, .. } = motion(&scene, part, 0.0, action);
            let with = vec![part ^ 1];
            assert_eq!((path.len(), end), (1, End::Collision { with }), "{part} {action}");
        }
        let kept = ShiftCoverCache::of(&scene);
        let kept = kept.lock();
        assert_eq!(kept.gathered.iter().filter(|(key, _)| key.part ^ 1 == key.other).count(), 1);
    }
}
