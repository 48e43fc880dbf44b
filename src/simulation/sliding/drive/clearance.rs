//! Gives a pose clearance: one pose of a simulation, displaced so that the contacts near it have gaps.
//!
//! It answers which small displacement of one pose makes room before all standing parts, from the contacts that were
//! measured there. Which whole path keeps to the middle of a thread, two surfaces and their helix determine:
//! [`path_on_thread`](crate::contact::helix_profile::path_on_thread).

use nalgebra::{Vector3, Vector6};

use crate::budgets::CLEARANCE_ROUNDS;
use crate::contact::constraint::VelocityConstraint;
use crate::contact::sampled::MovingBody;
use crate::geometry::Pose;
use crate::scene::StandingParts;
use crate::termination::Interrupt;
use crate::tolerances::{CLEARANCE, CLEARANCE_REACH, CLEARANCE_SPEED, DEPTH_TOLERANCE};

use super::super::super::projection::project;
use super::{Drive, KnownConstraints};

impl Drive {
    /// The pose in the middle of the play around the body's pose: the smallest correction that gives all contacts the
    /// largest possible gap at once, and as much room one way along `axis` (a unit vector) as the other.
    pub(in super::super) fn with_clearance(
        &self,
        mover: &MovingBody<'_>,
        axis: &Vector3<f64>,
        standing_parts: &StandingParts,
    ) -> Result<Option<Pose>, Interrupt> {
        let mut here = *mover;
        let mut close = here.near(standing_parts, CLEARANCE_REACH)?;
        for round in 0..CLEARANCE_ROUNDS {
            let least = close.contacts.iter().map(|c| c.gap).fold(f64::INFINITY, f64::min);
            mover.check()?;
            if round > 0 && least >= CLEARANCE * 0.5 {
                break;
            }
            let KnownConstraints { rows, .. } = self.chosen(&here, &close, &Vector6::zeros())?;
            let margins = (0..5).map(|halving| CLEARANCE / f64::from(1 << halving)).chain([0.0]);
            let correction = margins.filter(|m| *m > least).find_map(|margin| {
                let scale = |r: &VelocityConstraint| VelocityConstraint {
                    a: r.a.component_div(&self.metric),
                    b: r.b - margin,
                    ..*r
                };
                let scaled: Vec<VelocityConstraint> = rows.iter().map(scale).collect();
                project(&Vector6::zeros(), &scaled)
            });
            let mut twist = correction.map_or(Vector6::zeros(), |c| c.w.component_div(&self.metric));
            if let Some(along) = middle(&rows, &twist, axis) {
                twist += Vector6::new(axis.x, axis.y, axis.z, 0.0, 0.0, 0.0) * along;
            }
            if twist == Vector6::zeros() || twist.norm() > CLEARANCE_REACH {
                break;
            }
            here.pose = self.displaced(&here, &twist);
            close = here.near(standing_parts, CLEARANCE_REACH)?;
        }
        Ok(close.contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE).then_some(here.pose))
    }
}

/// How far along an axis, after a twist, the middle is between the constraints on either side; `None` if there are
/// none, or they leave no room.
fn middle(rows: &[VelocityConstraint], twist: &Vector6<f64>, axis: &Vector3<f64>) -> Option<f64> {
    let (mut back, mut forth) = (f64::NEG_INFINITY, f64::INFINITY);
    for row in rows {
        let (gap, speed) = (row.a.dot(twist) + row.b, row.a.fixed_rows::<3>(0).dot(axis));
        if speed > CLEARANCE_SPEED {
            back = back.max(-gap / speed);
        } else if speed < -CLEARANCE_SPEED {
            forth = forth.min(-gap / speed);
        }
    }
    let middle = f64::midpoint(back, forth);
    (back < forth && middle.is_finite()).then_some(middle)
}
