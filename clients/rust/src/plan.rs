//! A plan as a whole.

use crate::error::ClientError;
use crate::step::Step;
use crate::stream::{Event, PlanStream};
use crate::summary::Summary;

/// A finished plan: everything that a stream yields, with part names.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The steps in order.
    pub steps: Vec<Step>,
    /// Everything else.
    pub summary: Summary,
    /// Events of the search, if the trace was requested: lines with one JSON object each.
    pub trace: String,
}

impl Plan {
    /// The names of the parts that a step moves.
    pub fn names<'a>(&'a self, step: &'a Step) -> impl Iterator<Item = &'a str> + 'a {
        step.view().parts.iter().map(|&part| self.summary.part_name(part))
    }

    /// The steps that move a part, in order.
    ///
    /// # Errors
    /// There is no part of this name.
    pub fn steps_of<'a>(&'a self, name: &str) -> Result<impl Iterator<Item = &'a Step> + 'a, ClientError> {
        let part = part_named(self.summary.parts.iter().map(String::as_str), name)?;
        Ok(self.steps.iter().filter(move |step| step.view().parts.contains(&part)))
    }

    /// The plan as the command line writes it: JSON (`sbdp-plan/2`) in a line with its end, but for what only the files of
    /// the assembly have (`source`, `groups`, findings while reading).
    ///
    /// # Errors
    /// The plan cannot be written as JSON.
    pub fn to_json(&self) -> Result<String, ClientError> {
        self.summary.to_json(&self.steps)
    }
}

/// The number of a part.
pub(crate) fn part_named<'n>(
    mut names: impl Iterator<Item = &'n str>,
    name: &str,
) -> Result<u32, ClientError> {
    let found = names.position(|n| n == name);
    found.map(|place| place as u32).ok_or_else(|| ClientError::NoSuchPart { name: name.to_owned() })
}

impl PlanStream {
    /// Waits for the end of the plan and keeps everything in memory of this process.
    ///
    /// # Errors
    /// The daemon refused, failed or died.
    pub fn plan_to_end(self) -> Result<Plan, ClientError> {
        let (mut stream, mut steps, mut trace) = (self.copied(), Vec::new(), String::new());
        while let Some(event) = stream.next_event()? {
            match event {
                Event::Progress(_) => {}
                Event::Step(step) => steps.push(step),
                Event::Trace(lines) => trace += &lines,
                Event::Restarted => {
                    steps.clear();
                    trace.clear();
                }
                Event::Done(summary) => return Ok(Plan { steps, summary, trace }),
            }
        }
        Err(ClientError::Protocol("the plan ended without its summary".to_owned()))
    }
}
