//! Turns a disassembly plan into the assembly plan.

use std::time::Instant;

use crate::assembling::{Assembling, Hindrance, Unfinished, Waiting};
use crate::geometry::{Assembly, Waypoint};
use crate::plan::{Blocked, Plan, PlanStatus, Warning};
use crate::search::{PlanSink, Progress, Removal, Stage, Staging};
use crate::termination::{Interrupt, Termination};

use super::answer;
use super::prepared::Prepared;

/// In plans, the action of a part that cannot be put in from where it waits.
const INSERTION: &str = "insertion";

/// What an assembly plan is made from.
pub(super) struct AssemblyPlanner<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) prepared: &'a Prepared,
    /// The disassembly, in the planning frame.
    pub(super) removals: &'a [Removal],
    pub(super) staging: &'a Staging,
}

impl AssemblyPlanner<'_> {
    /// The assembly plan of a disassembly plan. Its request was received at `received`.
    pub(super) fn plan(
        &self,
        mut plan: Plan,
        received: Instant,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Plan {
        let started = Instant::now();
        let Prepared { scene, verifier, .. } = self.prepared;
        let waiting = self.waiting();
        let remain = &plan.remaining;
        let assembling = Assembling::new(scene, verifier, self.removals, remain, &waiting, termination);
        let total = self.removals.len() as u32;
        let mut steps = Vec::new();
        let ended = assembling.run(|insertion| {
            let step = answer::insertion(self.assembly, &insertion);
            sink.step(&step);
            steps.push(step);
            let (done, simulations) = (steps.len() as u32, plan.stats.simulations);
            sink.progress(Progress { stage: Stage::Transfer, done, total, simulations, tried: None });
        });
        plan.poses = self.starts(&plan, &assembling);
        plan.steps = steps;
        plan.warnings.extend(self.unused());
        if let Err(unfinished) = ended {
            self.explain(&mut plan, unfinished);
        }
        plan.stats.transfer_time_s = Some(started.elapsed().as_secs_f64());
        plan.stats.total_time_s = received.elapsed().as_secs_f64();
        plan
    }

    fn waiting(&self) -> Waiting {
        let pose = |(part, w): &(usize, Waypoint)| (*part, answer::pose(self.assembly, *part, w));
        match self.staging {
            Staging::None => Waiting::Nowhere,
            Staging::Beside(given) => Waiting::Beside(given.iter().map(pose).collect()),
        }
    }

    /// The parts whose start pose differs from the pose that was given, with that start pose.
    fn starts(&self, plan: &Plan, assembling: &Assembling<'_>) -> Vec<(usize, Waypoint)> {
        let starts = assembling.starts();
        let stays = |part: &usize| starts.iter().all(|(p, _)| p != part);
        let mut poses: Vec<_> = plan.poses.iter().filter(|(part, _)| stays(part)).copied().collect();
        poses.extend(starts.iter().map(|(part, pose)| (*part, answer::waypoint(self.assembly, *part, pose))));
        poses.sort_by_key(|(part, _)| *part);
        poses
    }

    /// Warns of staging poses that were given for parts that do not move.
    fn unused(&self) -> Vec<Warning> {
        let Staging::Beside(given) = self.staging else { return Vec::new() };
        let moves = |part: usize| self.removals.iter().any(|r| r.alone() == Some(part));
        let idle = given.iter().map(|(part, _)| *part).filter(|&part| !moves(part));
        let message = "its staging pose is not used: the plan does not put it in alone";
        idle.map(|part| Warning { part: Some(part), message: message.to_owned() }).collect()
    }

    /// Says why not all parts are in place.
    fn explain(&self, plan: &mut Plan, unfinished: Unfinished) {
        let (part, what, by) = match unfinished {
            Unfinished::Hindered(part, what, by) => (part, what, by),
            Unfinished::Interrupted(interrupt) => {
                let (status, reason) = match interrupt {
                    Interrupt::Cancelled => (PlanStatus::Cancelled, "cancelled"),
                    Interrupt::DeadlinePassed => {
                        (PlanStatus::Timeout, "the deadline passed before all parts were in place")
                    }
                };
                // If the search ended for the same reason, its own message stays.
                if plan.status != status {
                    (plan.status, plan.reason) = (status, Some(reason.to_owned()));
                }
                return;
            }
        };
        let names: Vec<&str> = by.iter().map(|&p| plan.part_name(p)).collect();
        let (name, names) = (plan.part_name(part), names.join(", "));
        // Only the order and the ways in that the disassembly gives are tried: nothing is proved.
        let (status, reason) = match what {
            Hindrance::WaitsIn => {
                (PlanStatus::Exhausted, format!("The staging pose of {name} puts it into {names}."))
            }
            Hindrance::InsertionMeets => {
                (PlanStatus::Exhausted, format!("Where {name} is inserted, {names} would wait."))
            }
            Hindrance::NoWay(samples) => {
                let reason = format!(
                    "no way was found from the staging pose of {name} to where its insertion begins \
                     (RRT-Connect, {samples} random poses)"
                );
                (PlanStatus::Partial, reason)
            }
        };
        (plan.status, plan.reason) = (status, Some(reason));
        plan.blocked.push(Blocked { part, by, action: INSERTION.to_owned() });
    }
}
