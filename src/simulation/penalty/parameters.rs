//! The hyper-parameters of the paper's simulation, and what its table leaves open.

use crate::budgets::{MOST_NEWTON_ITERATIONS, MOST_PENALTY_STEPS};
use crate::tolerances::SHORTEST_CONTACT_EDGE;

/// Parameters of the engine `penalty`. Lengths are in the planning frame (longest side of the
/// assembly in (5, 10]), angles in radians, times in seconds of the simulated motion.
///
/// "Table" means the table of hyper-parameters in the paper's appendix, "public code" what its
/// public implementation was seen to do, "own" what neither fixes. The table's path planning
/// timeout (360 s) is not here: deadlines reach an engine as a termination condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PenaltyParameters {
    /// Time of one implicit step, in s. Table: simulation time step, 1e-3.
    pub time_step: f64,
    /// Time after which the velocity is zeroed and the state compared with earlier ones, in s.
    /// Table: path planning time step, 1e-1.
    pub planning_time_step: f64,
    /// Force per depth at one contact point, for a density of 1. Table: contact stiffness, 1e6.
    pub stiffness: f64,
    /// Force per depth and speed of approach at one contact point. Table: contact damping
    /// coefficient, 0.
    pub damping: f64,
    /// Depth beyond that at the assembled pose from which contact acts. Table: penetration
    /// threshold for collision detection, 0.01.
    pub penetration_threshold: f64,
    /// Acceleration that an action's force gives, in length/s². Table: force/torque magnitude of
    /// each action, 100; that it is scaled by the mass: public code.
    pub force: f64,
    /// Angular acceleration that an action's torque gives, as a multiple of `force`, in
    /// 1/(length · rad). Public code, 3.
    pub torque_factor: f64,
    /// States closer than this in translation may be the same. Table: state similarity threshold
    /// (translation), 0.05.
    pub similar_translation: f64,
    /// States closer than this in rotation may be the same, in rad. Table: state similarity
    /// threshold (rotation), 0.5.
    pub similar_rotation: f64,
    /// Contact points are the vertices after edges were halved down to this length. Public code,
    /// 0.5.
    pub longest_edge: f64,
    /// How much deeper than `penetration_threshold` stiffness, impact and the field's error may let
    /// a pair get before a motion is stopped. Own, 0.02: about what paths with the table's values
    /// were measured to need.
    pub yielding: f64,
    /// `penetration_threshold` and `yielding` shrink where the former would exceed this share of
    /// the smallest extent of either part. Own, 1/8; infinite for the paper's fixed threshold, with
    /// which parts thinner than twice the threshold never touch anything.
    pub share_of_extent: f64,
    /// Steps from one waypoint to the next, at most. Own, 5.
    pub steps_per_waypoint: u32,
    /// Zeroings of the velocity after which a motion is given up. Own, 1000 (505 units of free
    /// travel); the paper has its timeout alone.
    pub most_blocks: u32,
    /// Newton iterations of one step, at most. Own, 30.
    pub newton_iterations: u32,
    /// A Newton step that moves no point of the part by more than this is the last, in lengths of
    /// the planning frame. Own, 1e-9.
    pub newton_tolerance: f64,
}

impl Default for PenaltyParameters {
    fn default() -> Self {
        Self {
            time_step: 1e-3,
            planning_time_step: 0.1,
            stiffness: 1e6,
            damping: 0.0,
            penetration_threshold: 0.01,
            force: 100.0,
            torque_factor: 3.0,
            similar_translation: 0.05,
            similar_rotation: 0.5,
            longest_edge: 0.5,
            yielding: 0.02,
            share_of_extent: 0.125,
            steps_per_waypoint: 5,
            most_blocks: 1000,
            newton_iterations: 30,
            newton_tolerance: 1e-9,
        }
    }
}

impl PenaltyParameters {
    /// All parameters by name, in the order of their numbers on the wire.
    #[must_use]
    pub fn named(&self) -> [(&'static str, f64); 16] {
        [
            ("time-step", self.time_step),
            ("planning-time-step", self.planning_time_step),
            ("stiffness", self.stiffness),
            ("damping", self.damping),
            ("penetration-threshold", self.penetration_threshold),
            ("force", self.force),
            ("torque-factor", self.torque_factor),
            ("similar-translation", self.similar_translation),
            ("similar-rotation", self.similar_rotation),
            ("longest-edge", self.longest_edge),
            ("yielding", self.yielding),
            ("share-of-extent", self.share_of_extent),
            ("steps-per-waypoint", f64::from(self.steps_per_waypoint)),
            ("most-blocks", f64::from(self.most_blocks)),
            ("newton-iterations", f64::from(self.newton_iterations)),
            ("newton-tolerance", self.newton_tolerance),
        ]
    }

    /// The paper's parameters, but for those given by name.
    ///
    /// # Errors
    /// A name that is not known, a value that the parameter cannot have, or what [`Self::validate`] finds.
    pub fn with<'n>(given: impl IntoIterator<Item = (&'n str, f64)>) -> Result<Self, String> {
        let mut out = Self::default();
        for (name, value) in given {
            let whole = || {
                let is_whole = value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value);
                is_whole
                    .then_some(value as u32)
                    .ok_or(format!("`{name}` is {value}; it must be a whole number"))
            };
            match name {
                "time-step" => out.time_step = value,
                "planning-time-step" => out.planning_time_step = value,
                "stiffness" => out.stiffness = value,
                "damping" => out.damping = value,
                "penetration-threshold" => out.penetration_threshold = value,
                "force" => out.force = value,
                "torque-factor" => out.torque_factor = value,
                "similar-translation" => out.similar_translation = value,
                "similar-rotation" => out.similar_rotation = value,
                "longest-edge" => out.longest_edge = value,
                "yielding" => out.yielding = value,
                "share-of-extent" => out.share_of_extent = value,
                "steps-per-waypoint" => out.steps_per_waypoint = whole()?,
                "most-blocks" => out.most_blocks = whole()?,
                "newton-iterations" => out.newton_iterations = whole()?,
                "newton-tolerance" => out.newton_tolerance = value,
                _ => {
                    let known = out.named().map(|(name, _)| name).join(", ");
                    return Err(format!("`{name}` is no parameter; there are {known}"));
                }
            }
        }
        out.validate()?;
        Ok(out)
    }

    /// # Errors
    /// The name and value of a parameter with which no motion could be simulated.
    pub fn validate(&self) -> Result<(), String> {
        let positive = [
            ("time-step", self.time_step),
            ("planning-time-step", self.planning_time_step),
            ("stiffness", self.stiffness),
            ("force", self.force),
            ("torque-factor", self.torque_factor),
            ("similar-translation", self.similar_translation),
            ("similar-rotation", self.similar_rotation),
            ("longest-edge", self.longest_edge),
            ("newton-tolerance", self.newton_tolerance),
            ("steps-per-waypoint", f64::from(self.steps_per_waypoint)),
            ("most-blocks", f64::from(self.most_blocks)),
            ("newton-iterations", f64::from(self.newton_iterations)),
        ];
        let not_negative = [
            ("damping", self.damping),
            ("penetration-threshold", self.penetration_threshold),
            ("yielding", self.yielding),
        ];
        let bad = |x: f64, least: bool| !x.is_finite() || if least { x <= 0.0 } else { x < 0.0 };
        if let Some((name, x)) = positive.into_iter().find(|(_, x)| bad(*x, true)) {
            return Err(format!("`{name}` is {x}; it must be positive"));
        }
        if let Some((name, x)) = not_negative.into_iter().find(|(_, x)| bad(*x, false)) {
            return Err(format!("`{name}` is {x}; it must not be negative"));
        }
        if self.share_of_extent.is_nan() || self.share_of_extent <= 0.0 {
            return Err(format!(
                "`share-of-extent` is {}; it must be positive, or `inf`",
                self.share_of_extent
            ));
        }
        if self.planning_time_step < self.time_step {
            return Err("`planning-time-step` is shorter than `time-step`".to_owned());
        }
        if self.longest_edge < SHORTEST_CONTACT_EDGE {
            let given = self.longest_edge;
            return Err(format!("`longest-edge` is {given}; it must be at least {SHORTEST_CONTACT_EDGE}"));
        }
        if self.newton_iterations > MOST_NEWTON_ITERATIONS {
            let given = self.newton_iterations;
            return Err(format!(
                "`newton-iterations` is {given}; it must be at most {MOST_NEWTON_ITERATIONS}"
            ));
        }
        let steps = u64::from(self.most_blocks) * u64::from(self.block_steps());
        if steps > MOST_PENALTY_STEPS {
            return Err(format!(
                "`most-blocks` times the steps of a block, `planning-time-step` / `time-step`, is {steps}; \
                 it must be at most {MOST_PENALTY_STEPS}"
            ));
        }
        Ok(())
    }

    /// Steps between two zeroings of the velocity.
    #[must_use]
    pub fn block_steps(&self) -> u32 {
        (self.planning_time_step / self.time_step).round().max(1.0) as u32
    }

    /// How much deeper than its allowed penetration a pair may get, in the planning frame.
    #[must_use]
    pub fn depth_tolerance(&self) -> f64 {
        self.penetration_threshold + self.yielding
    }

    /// What the tolerances of a pair are multiplied with whose smallest extent is `extent`.
    #[must_use]
    pub(super) fn scale_for(&self, extent: f64) -> f64 {
        (extent * self.share_of_extent / self.penetration_threshold).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_take_all_memory_or_could_not_be_interrupted_is_refused_by_name() {
        for (name, value, word) in [
            ("longest-edge", 1e-4, "at least 0.05"),
            ("newton-iterations", 1001.0, "at most 1000"),
            ("most-blocks", 10_001.0, "at most 1000000"),
            ("time-step", 1e-12, "at most 1000000"),
        ] {
            let refused = PenaltyParameters::with([(name, value)]).unwrap_err();
            assert!(refused.contains(word), "{name}: {refused}");
        }
        assert!(PenaltyParameters::with([("most-blocks", 10_000.0), ("longest-edge", 0.05)]).is_ok());
    }
}
