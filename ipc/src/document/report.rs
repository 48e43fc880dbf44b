//! What a plan means where it is carried out, in the words of the contract.

use serde::{Deserialize, Serialize};

use super::PlanDocument;
use crate::summary::report::{Clearance, Closest, Fastener, Report, Stability, Tool, Unstable};

/// How the parts of a state stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StabilityDocument {
    /// The least coefficient of friction with which all that does not fall stands: 0 where contacts alone hold it.
    pub needs_friction: f64,
    /// What falls, by parts that are connected with each other.
    pub unstable: Vec<UnstableDocument>,
    /// Parts of which it is not known whether they stand.
    pub unknown: Vec<String>,
}

/// Connected parts of which some fall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnstableDocument {
    /// What falls.
    pub falls: Vec<FallDocument>,
    /// Sets of parts, each of which is enough to hold: the smallest ones that were found.
    pub hold: Vec<Vec<String>>,
    /// Forces exist that would hold all of them, but only if something pressed them together that does not.
    pub needs_clamping: bool,
}

/// A part that falls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FallDocument {
    /// The part.
    pub part: String,
    /// The unit vector along which its centre of mass begins to move if nothing rubs.
    pub direction: [f64; 3],
}

/// How near the moving parts of a step pass the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClearanceDocument {
    /// The standing parts that touch moving ones as the step begins: they do not count here.
    pub touching: Vec<String>,
    /// Where the step passes other parts the nearest; null if there are no others.
    pub closest: Option<ClosestDocument>,
}

/// How near one part passes another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClosestDocument {
    /// The part that moves.
    pub moving: String,
    /// The part that stands.
    pub standing: String,
    /// The least distance on the way.
    pub distance: f64,
    /// It is certain that they come no nearer than this.
    pub at_least: f64,
    /// How far the two are apart as they stand.
    pub assembled: f64,
    /// The segment of the path, 0 for that from its first waypoint to its second.
    pub segment: u32,
    /// How far along the segment, from 0 to 1.
    pub share: f64,
    /// A point of the moving and one of the standing surface there; null where they meet.
    pub points: Option<[[f64; 3]; 2]>,
}

/// A tool that turns the fastener that a step takes off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolDocument {
    /// `socket`, `ring_spanner`, `open_end_wrench` or `hex_key`.
    pub tool: String,
    /// Its size: the width across the flats of the fastener.
    pub size: f64,
    /// Degrees through which it swings; 360 for all around, 0 if there is no way to the fastener.
    pub swing: f64,
    /// Degrees that it needs to swing.
    pub needs: f64,
    /// It has room enough to turn the fastener.
    pub fits: bool,
    /// The parts that end its swing, or are in its way.
    pub blocked_by: Vec<String>,
}

/// The names of parts.
#[derive(Debug, Clone, Copy)]
pub struct PartNames<'a>(pub &'a [String]);

impl PartNames<'_> {
    fn one(&self, part: u32) -> String {
        self.0.get(part as usize).map_or("?", String::as_str).to_owned()
    }

    fn all(&self, parts: &[u32]) -> Vec<String> {
        parts.iter().map(|&part| self.one(part)).collect()
    }

    /// How the parts of a state stand, with names.
    #[must_use]
    pub fn stability(&self, state: &Stability) -> StabilityDocument {
        let unstable = |u: &Unstable| UnstableDocument {
            falls: u
                .falls
                .iter()
                .map(|&(part, direction)| FallDocument { part: self.one(part), direction })
                .collect(),
            hold: u.hold.iter().map(|set| self.all(set)).collect(),
            needs_clamping: u.needs_clamping,
        };
        StabilityDocument {
            needs_friction: state.needs_friction,
            unstable: state.unstable.iter().map(unstable).collect(),
            unknown: self.all(&state.unknown),
        }
    }

    /// How near a step passes other parts, with names.
    #[must_use]
    pub fn clearance(&self, step: &Clearance) -> ClearanceDocument {
        ClearanceDocument {
            touching: self.all(&step.touching),
            closest: step.closest.as_ref().map(|closest| self.closest(closest)),
        }
    }

    /// How near one part passes another, with names.
    #[must_use]
    pub fn closest(&self, closest: &Closest) -> ClosestDocument {
        ClosestDocument {
            moving: self.one(closest.moving),
            standing: self.one(closest.standing),
            distance: closest.distance,
            at_least: closest.at_least,
            assembled: closest.assembled,
            segment: closest.segment,
            share: closest.share,
            points: closest.points,
        }
    }

    /// The tools that turn a fastener, with names.
    #[must_use]
    pub fn tools(&self, fastener: &Fastener) -> Vec<ToolDocument> {
        let tool = |tool: &Tool| ToolDocument {
            tool: tool.name().to_owned(),
            size: fastener.size,
            swing: tool.swing,
            needs: tool.needs,
            fits: tool.fits,
            blocked_by: self.all(&tool.blocked_by),
        };
        fastener.tools.iter().map(tool).collect()
    }
}

impl PlanDocument {
    /// The document with a report about it: one entry for each step, and for the states one more before the first step.
    #[must_use]
    pub fn with_report(mut self, report: &Report) -> Self {
        let names = PartNames(&self.parts);
        let stands = |state: usize| Some(names.stability(report.stability.as_ref()?.get(state)?));
        self.initial.stability = stands(0);
        for (number, step) in self.steps.iter_mut().enumerate() {
            step.stability = stands(number + 1);
            step.clearance =
                report.clearance.as_ref().and_then(|steps| steps.get(number)).map(|c| names.clearance(c));
            let fastener = report.tools.as_ref().and_then(|steps| steps.get(number));
            step.tools = fastener.map(|fastener| fastener.as_ref().map_or_else(Vec::new, |f| names.tools(f)));
        }
        self
    }
}
