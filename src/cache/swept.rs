//! Straight sweeps: which of the parts on the way of one that goes along a line it enters. Whether it enters a
//! part depends on that part alone, and on the way no further than past it; so a change costs only the casts
//! at what changed. Where the way ends, and what is on it, is told afresh.

use super::motion::add_standing;
use super::pair::add_pose;
use super::records::SweptRecord;
use super::{Digest, Key, Kind, Recall};
use crate::contact::ShapeCast;
use crate::simulation::{Sweep, SweepQuestion, straight_sweep_past};
use crate::termination::{Interrupt, Termination};

/// Of the parts that one passed along a line, so many are remembered.
const MOST_PAST: usize = 256;

/// Why a sweep is not told from memory.
enum Untold {
    /// Something on the way is not remembered.
    Unknown,
    Interrupted(Interrupt),
}

impl From<Interrupt> for Untold {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

impl Recall {
    /// What a straight sweep tells, if all that is on its way is remembered: in less time than it takes to have
    /// another thread tell it.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn known_sweep(
        &self,
        question: &SweepQuestion<'_>,
        termination: &Termination,
    ) -> Result<Option<Option<Sweep>>, Interrupt> {
        let Some(known) = self.get::<SweptRecord>(&key(question)) else { return Ok(None) };
        let enters = |cast: &ShapeCast<'_>| known.of(&place(question, cast)).ok_or(Untold::Unknown);
        match straight_sweep_past(question, termination, enters) {
            Ok(swept) => Ok(Some(swept)),
            Err(Untold::Unknown) => Ok(None),
            Err(Untold::Interrupted(interrupt)) => Err(interrupt),
        }
    }

    /// What a straight sweep tells ([`straight_sweep`](crate::simulation::straight_sweep)), with what is
    /// remembered of the parts on the way; what is not is looked at, and remembered then.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn sweep(
        &self,
        question: &SweepQuestion<'_>,
        termination: &Termination,
    ) -> Result<Option<Sweep>, Interrupt> {
        let key = key(question);
        // Read where there is something to ask: mostly a part is out, or blocked by the first one.
        let mut known: Option<SweptRecord> = None;
        let mut is_new = false;
        let enters = |cast: &ShapeCast<'_>| {
            let known = known.get_or_insert_with(|| self.get(&key).unwrap_or_default());
            let place = place(question, cast);
            if let Some(entered) = known.of(&place) {
                return Ok(entered);
            }
            let entered = cast.enters()?;
            known.past.push((place, entered));
            is_new = true;
            Ok(entered)
        };
        let swept = straight_sweep_past(question, termination, enters);
        // Also of a sweep that was cut short: what was seen to the end holds.
        if let Some(mut known) = known.filter(|_| is_new) {
            known.past.drain(..known.past.len().saturating_sub(MOST_PAST));
            self.put(key, &known);
        }
        swept
    }
}

impl SweptRecord {
    fn of(&self, place: &[u8; 16]) -> Option<bool> {
        self.past.iter().find(|(of, _)| of == place).map(|(_, entered)| *entered)
    }
}

fn key(question: &SweepQuestion<'_>) -> Key {
    let mut digest = Digest::new();
    digest.hash(question.scene.bodies[question.part].shape.content());
    add_pose(&mut digest, question.start);
    digest.numbers(question.direction.iter().copied()).key(Kind::Swept)
}

/// How a part on the way stands, and how far the way past it goes.
fn place(question: &SweepQuestion<'_>, cast: &ShapeCast<'_>) -> [u8; 16] {
    let mut digest = Digest::new();
    digest.numbers([cast.travel, cast.margins.granted]);
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
    use crate::scene::Surroundings;
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
    fn swept(recall: &Recall, meshes: Vec<SourceMesh>) -> (Option<Sweep>, usize) {
        let (scene, _) = scene(meshes);
        let around = Surroundings::new(&scene, vec![0, 2, 3]);
        let (start, direction) = (&scene.bodies[1].planning_from_shape, &Vector3::z());
        let question = SweepQuestion { scene: &scene, surroundings: &around, part: 1, start, direction };
        let never = Termination::default();
        let known = recall.known_sweep(&question, &never).unwrap();
        let warm = recall.sweep(&question, &never).unwrap();
        assert_eq!(warm, straight_sweep(&question, &never).unwrap());
        assert!(known.is_none_or(|known| known == warm));
        assert_eq!(recall.known_sweep(&question, &never).unwrap().as_ref(), Some(&warm), "now it is known");
        (warm, recall.get::<SweptRecord>(&key(&question)).map_or(0, |known| known.past.len()))
    }

    #[test]
    fn only_what_changed_on_the_way_is_looked_at_again() {
        let recall = Recall::of(Arc::new(Cache::in_memory(1 << 20)));
        let is_clear = |s: &Option<Sweep>| matches!(s, Some(Sweep::Clear { .. }));
        let (first, looked_at) = swept(&recall, machine(3.0, 3.5));
        assert!(!is_clear(&first) && looked_at == 2, "{first:?}, {looked_at}");
        assert_eq!(swept(&recall, machine(3.0, 3.5)), (first.clone(), looked_at), "all is known");
        // The lid is elsewhere: the block is known.
        assert_eq!(swept(&recall, machine(3.0, 3.25)), (first, looked_at + 1));
        // The way is longer, beside it stands something else: past the block and the lid nothing changed.
        let (longer, then) = swept(&recall, machine(3.75, 3.5));
        assert!(!is_clear(&longer) && then == looked_at + 1, "{then}");
        // And what blocked it does so no more where it is beside.
        let mut aside = machine(3.0, 3.5);
        let lid = aside.pop().unwrap();
        aside.push(moved(lid, &Pose::translation(2.5, 0.0, 0.0)));
        assert!(is_clear(&swept(&recall, aside).0));
    }
}
