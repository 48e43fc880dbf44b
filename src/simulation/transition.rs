//! The contract between search and the engines.

use std::borrow::Cow;
use std::time::Duration;

use nalgebra::Vector3;

use crate::geometry::Pose;
use crate::scene::{Scene, StandingParts};
use crate::termination::{Interrupt, Termination};

use super::Action;

/// How a motion ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// The part's hull is apart from the hull of everything that remains, along this direction.
    Disassembled(Vector3<f64>),
    /// Contact stopped it: no combination of the remaining freedoms follows the action.
    Collision {
        /// The parts whose contacts hold it, ascending.
        with: Vec<usize>,
    },
    /// It neither came out nor got stuck.
    Undecided {
        /// Why the motion was given up.
        reason: Cow<'static, str>,
        /// Parts it touched on the way, ascending.
        touched: Vec<usize>,
    },
}

impl End {
    /// The word for it in traces, and the parts that it met.
    #[must_use]
    pub fn described(self) -> (&'static str, Vec<usize>) {
        match self {
            Self::Disassembled(_) => ("disassembled", Vec::new()),
            Self::Collision { with } => ("collision", with),
            Self::Undecided { touched, .. } => ("undecided", touched),
        }
    }
}

/// A part's motion under one action.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Poses of the part's shape in the planning frame, the start first. In contact they are a
    /// contact step apart at most, in free space as far as the clearance allows.
    pub path: Vec<Pose>,
    /// Indices in the path, ascending, of the poses at which the hulls were tested.
    pub asked: Vec<u32>,
    /// How it ended.
    pub end: End,
    /// It was not simulated, but known.
    pub recalled: bool,
    /// How long a search waited for it on one thread; zero until a search has measured it.
    pub time: Duration,
}

impl Motion {
    /// A motion that was simulated.
    #[must_use]
    pub fn simulated(path: Vec<Pose>, asked: Vec<u32>, end: End) -> Self {
        Self { path, asked, end, recalled: false, time: Duration::ZERO }
    }
}

/// The direction that is tried first when an engine asks, for the `number`-th time (from 0), whether a
/// part is out: at first none, then against the force.
#[must_use]
pub fn asked_again(action: &Action, number: usize) -> Option<Vector3<f64>> {
    Some(-action.force()).filter(|f| number > 0 && f.norm() > 0.5)
}

/// A simulation engine: f(s, a, p).
///
/// Contract (one test suite for all engines): the same input gives the same motion to the bit;
/// the path starts at `start`; no pair is deeper along it than its allowed penetration and the engine's own
/// declared tolerance; `Disassembled` is returned only with a direction that separates the hulls.
pub trait TransitionFunction: Sync {
    /// The engine's name in requests and plans.
    fn name(&self) -> &'static str;

    /// How much deeper than the allowed penetration a pair may get, in the planning frame.
    fn depth_tolerance(&self) -> f64;

    /// Its name in the keys of remembered motions; none if they are not to be remembered. Who has one looks
    /// at standing parts only as the broad phase finds them, in ascending order, and asks whether a part
    /// is out with [`asked_again`].
    fn remembered_as(&self) -> Option<&str> {
        None
    }

    /// Moves `part` from `start` under `action` among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    fn simulate(
        &self,
        scene: &Scene,
        surroundings: &StandingParts,
        part: usize,
        start: &Pose,
        action: Action,
        termination: &Termination,
    ) -> Result<Motion, Interrupt>;
}
