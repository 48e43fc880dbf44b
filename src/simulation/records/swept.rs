//! Straight sweeps: which of the parts on its way a part enters that goes along a line. Whether it enters another part
//! depends on that part alone, so a change costs only the casts at what changed. Where the way ends, and which parts are
//! on it, is computed again.

use super::SOURCES;
use crate::budgets::PARTS_PER_LINE;
use crate::cache::{Digest, RecordKey, RecordKind, RequestCache, Storage};
use crate::contact::ShapeCast;
use crate::geometry::add_pose;
use crate::scene::add_standing;
use crate::simulation::{Sweep, SweepQuestion, straight_sweep_past};
use crate::termination::{Interrupt, Termination};

/// Which parts a part enters along a line.
pub(crate) static SWEPT: RecordKind =
    RecordKind::of::<SweptPast>(13, "swept", Storage::MemoryAndDisk, SOURCES);

/// By hashes of how a part on the way stands and how far the way past it goes: whether it is entered. The last ones that
/// were cast at come last.
type SweptPast = Vec<([u8; 16], bool)>;

/// Why the cache does not answer a sweep.
enum UnknownSweep {
    /// A part on the way is not remembered.
    Missing,
    Interrupted(Interrupt),
}

impl From<Interrupt> for UnknownSweep {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

/// What a straight sweep finds, if all parts on its way are remembered: that takes less time than to give the sweep to
/// another thread.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn known_sweep(
    cache: &RequestCache,
    question: &SweepQuestion<'_>,
    termination: &Termination,
) -> Result<Option<Option<Sweep>>, Interrupt> {
    let Some(known) = cache.get::<SweptPast>(&key(question)) else { return Ok(None) };
    let enters = |cast: &ShapeCast<'_>| entered(&known, &place(question, cast)).ok_or(UnknownSweep::Missing);
    match straight_sweep_past(question, termination, enters) {
        Ok(swept) => Ok(Some(swept)),
        Err(UnknownSweep::Missing) => Ok(None),
        Err(UnknownSweep::Interrupted(interrupt)) => Err(interrupt),
    }
}

/// What a straight sweep finds ([`straight_sweep`](crate::simulation::straight_sweep)). It casts at the parts on the way
/// that are not remembered, which are then remembered.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn remembered_sweep(
    cache: &RequestCache,
    question: &SweepQuestion<'_>,
    termination: &Termination,
) -> Result<Option<Sweep>, Interrupt> {
    remembered_sweep_past(cache, question, termination, |_, enters| enters)
}

/// All parts that a part enters along a line on its way out of its surroundings, ascending; `None` where no way out
/// along it is found.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn remembered_obstacles(
    cache: &RequestCache,
    question: &SweepQuestion<'_>,
    termination: &Termination,
) -> Result<Option<Vec<usize>>, Interrupt> {
    let mut obstacles = Vec::new();
    let swept = remembered_sweep_past(cache, question, termination, |other, enters| {
        obstacles.extend(enters.then_some(other));
        false
    })?;
    Ok(swept.map(|_| obstacles))
}

/// What a straight sweep finds, with a function that says whether it ends at a part on the way, given whether it enters
/// that part.
fn remembered_sweep_past(
    cache: &RequestCache,
    question: &SweepQuestion<'_>,
    termination: &Termination,
    mut ends_at: impl FnMut(usize, bool) -> bool,
) -> Result<Option<Sweep>, Interrupt> {
    let key = key(question);
    // Read when it is needed: mostly a part is out, or blocked by the first one on its way.
    let mut known: Option<SweptPast> = None;
    let mut is_new = false;
    let enters = |cast: &ShapeCast<'_>| {
        let known = known.get_or_insert_with(|| cache.get(&key).unwrap_or_default());
        let place = place(question, cast);
        if let Some(entered) = entered(known, &place) {
            return Ok(ends_at(cast.other, entered));
        }
        let entered = cast.enters()?;
        known.push((place, entered));
        is_new = true;
        Ok(ends_at(cast.other, entered))
    };
    let swept = straight_sweep_past(question, termination, enters);
    // Also of an interrupted sweep: each cast that ended holds.
    if let Some(mut known) = known.filter(|_| is_new) {
        known.drain(..known.len().saturating_sub(PARTS_PER_LINE));
        cache.put(key, &known);
    }
    swept
}

fn entered(known: &SweptPast, place: &[u8; 16]) -> Option<bool> {
    known.iter().find(|(of, _)| of == place).map(|(_, entered)| *entered)
}

fn key(question: &SweepQuestion<'_>) -> RecordKey {
    let mut digest = Digest::new();
    digest.hash(question.scene.bodies[question.part].shape.content());
    add_pose(&mut digest, question.start);
    digest.numbers(question.direction.iter().copied()).key(&SWEPT)
}

/// The hash of how a part on the way stands, and of how far the way past it goes.
fn place(question: &SweepQuestion<'_>, cast: &ShapeCast<'_>) -> [u8; 16] {
    let mut digest = Digest::new();
    digest.numbers([cast.travel, cast.margins.allowed]);
    add_standing(&mut digest, question.scene, question.part, cast.other);
    let [first, _]: [[u8; 16]; 2] = bytemuck::cast(digest.finish());
    first
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Vector3;

    use super::*;
    use crate::cache::Cache;
    use crate::fixtures::{cuboid, moved, peg_in_hole, scene};
    use crate::geometry::{Pose, SourceMesh};
    use crate::scene::StandingParts;
    use crate::simulation::straight_sweep;

    /// A peg in a blind hole, a post that makes its way out longer than the hole is deep, and a lid over it at
    /// some height.
    fn machine(post: f64, lid: f64) -> Vec<SourceMesh> {
        let [block, peg] = peg_in_hole(0.0);
        let post = cuboid([2.6, 2.6, 0.0], [3.0, 3.0, post]);
        vec![
            block,
            peg,
            post,
            moved(cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 0.1]), &Pose::translation(0.0, 0.0, lid)),
        ]
    }

    /// What a sweep of the peg upwards tells, and how many pairs were cast for it.
    fn swept(cache: &RequestCache, meshes: Vec<SourceMesh>) -> (Option<Sweep>, usize) {
        let (scene, _) = scene(meshes);
        let around = StandingParts::new(&scene, vec![0, 2, 3]);
        let (start, direction) = (&scene.bodies[1].planning_from_shape, &Vector3::z());
        let question = SweepQuestion { scene: &scene, standing_parts: &around, part: 1, start, direction };
        let never = Termination::default();
        let known = known_sweep(cache, &question, &never).unwrap();
        let warm = remembered_sweep(cache, &question, &never).unwrap();
        assert_eq!(warm, straight_sweep(&question, &never).unwrap());
        assert!(known.is_none_or(|known| known == warm));
        assert_eq!(known_sweep(cache, &question, &never).unwrap().as_ref(), Some(&warm), "now it is known");
        (warm, cache.get::<SweptPast>(&key(&question)).map_or(0, |known| known.len()))
    }

    #[test]
    fn only_what_changed_on_the_way_is_looked_at_again() {
        let cache = &RequestCache::of(Arc::new(Cache::in_memory(1 << 20, &[])));
        let is_clear = |s: &Option<Sweep>| matches!(s, Some(Sweep::Clear { .. }));
        let (first, looked_at) = swept(cache, machine(3.0, 3.5));
        assert!(!is_clear(&first) && looked_at == 2, "{first:?}, {looked_at}");
        assert_eq!(swept(cache, machine(3.0, 3.5)), (first.clone(), looked_at), "all is known");
        // The lid is elsewhere: the block is known.
        assert_eq!(swept(cache, machine(3.0, 3.25)), (first, looked_at + 1));
        // The way is longer, beside it stands something else: past the block and the lid nothing changed.
        let (longer, then) = swept(cache, machine(3.75, 3.5));
        assert!(!is_clear(&longer) && then == looked_at + 1, "{then}");
        // And what blocked it does so no more where it is beside.
        let mut aside = machine(3.0, 3.5);
        let lid = aside.pop().unwrap();
        aside.push(moved(lid, &Pose::translation(2.5, 0.0, 0.0)));
        assert!(is_clear(&swept(cache, aside).0));
    }
}
