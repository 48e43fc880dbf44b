//! Straight sweeps: which of the parts on the way of one that goes along a line it enters. Whether it enters a
//! part depends on that part alone, and on the way no further than past it; so a change costs only the casts
//! at what changed. Where the way ends, and what is on it, is told afresh.

use nalgebra::Vector3;

use super::motion::add_standing;
use super::pair::add_pose;
use super::records::SweptRecord;
use super::{Digest, Kind, Recall};
use crate::geometry::Pose;
use crate::simulation::{Crossing, Scene, Surroundings, Sweep, straight_sweep_past};
use crate::termination::{Interrupt, Termination};

/// Of the parts that one passed along a line, so many are remembered.
const MOST_PAST: usize = 256;

impl Recall {
    /// What a straight sweep tells ([`straight_sweep`](crate::simulation::straight_sweep)), with what is
    /// remembered of the parts on the way; what is not is looked at, and remembered then.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn sweep(
        &self,
        scene: &Scene,
        surroundings: &Surroundings,
        part: usize,
        start: &Pose,
        direction: &Vector3<f64>,
        termination: &Termination,
    ) -> Result<Option<Sweep>, Interrupt> {
        let mut digest = Digest::new();
        digest.hash(scene.bodies[part].shape.content());
        add_pose(&mut digest, start);
        let key = digest.numbers(direction.iter().copied()).key(Kind::Swept);
        // Read where there is something to ask: mostly a part is out, or blocked by the first one.
        let mut known: Option<SweptRecord> = None;
        let mut is_new = false;
        let enters = |crossing: &Crossing<'_>| {
            let known = known.get_or_insert_with(|| self.get(&key).unwrap_or_default());
            let place = place(scene, part, crossing);
            if let Some((_, entered)) = known.past.iter().find(|(of, _)| *of == place) {
                return Ok(*entered);
            }
            let entered = crossing.enters()?;
            known.past.push((place, entered));
            is_new = true;
            Ok(entered)
        };
        let swept = straight_sweep_past(scene, surroundings, part, start, direction, termination, enters);
        // Also of a sweep that was cut short: what was seen to the end holds.
        if let Some(mut known) = known.filter(|_| is_new) {
            known.past.drain(..known.past.len().saturating_sub(MOST_PAST));
            self.put(key, &known);
        }
        swept
    }
}

/// How a part on the way stands, and how far the way past it goes.
fn place(scene: &Scene, part: usize, crossing: &Crossing<'_>) -> [u8; 16] {
    let mut digest = Digest::new();
    digest.numbers([crossing.travel, crossing.granted]);
    add_standing(&mut digest, scene, part, crossing.other);
    let [first, _]: [[u8; 16]; 2] = bytemuck::cast(digest.finish());
    first
}
