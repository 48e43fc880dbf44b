//! Plans as JSON: the contract `sbdp-plan/2`.

use sbdp_ipc::document::{
    BlockedDocument, CacheDocument, FreeGroupDocument, InitialDocument, OverlapDocument, PlanDocument,
    SCHEMA, StatsDocument, StepDocument, WarningDocument,
};
use sbdp_ipc::plan::{StepEnd, StepView};
use sbdp_ipc::summary::Stats;

use crate::error::ClientError;
use crate::step::Step;
use crate::summary::Summary;

impl Summary {
    /// The document of a plan with these steps, as the command line writes it, but for what only the files of the
    /// assembly have: `source`, `groups`, and what was found while the files were read.
    #[must_use]
    pub fn document(&self, steps: &[Step]) -> PlanDocument {
        let poses = self.poses.iter().map(|(part, pose)| (self.part_name(*part).to_owned(), *pose));
        let document = PlanDocument {
            schema: SCHEMA.to_owned(),
            kind: if self.assembly { "assembly" } else { "disassembly" }.to_owned(),
            source: None,
            status: self.status.name().to_owned(),
            reason: self.reason.clone(),
            planner: self.planner.clone(),
            engine: self.engine.clone(),
            units: self.units.clone(),
            parts: self.parts.clone(),
            groups: Vec::new(),
            initial: InitialDocument {
                removed: self.names(&self.removed),
                poses: poses.collect(),
                stability: None,
            },
            targets: self.targets.as_ref().map(|targets| self.names(targets)),
            fixed: self.names(&self.fixed),
            keep: self.names(&self.keep),
            base: self.names(&self.base.parts),
            base_reason: self.base.reason.clone(),
            steps: steps.iter().map(|step| self.step(&step.view())).collect(),
            remaining: self.names(&self.remaining),
            kept_together: self.kept_together.iter().map(|group| self.names(group)).collect(),
            free_together: self
                .free_together
                .iter()
                .map(|g| FreeGroupDocument { parts: self.names(&g.parts), direction: g.direction })
                .collect(),
            blocked: self
                .blocked
                .iter()
                .map(|b| BlockedDocument {
                    part: self.part_name(b.part).to_owned(),
                    by: self.names(&b.by),
                    action: b.action.clone(),
                })
                .collect(),
            overlaps: self
                .overlaps
                .iter()
                .map(|o| OverlapDocument {
                    parts: o.parts.map(|part| self.part_name(part).to_owned()),
                    depth: o.depth,
                })
                .collect(),
            warnings: self
                .warnings
                .iter()
                .map(|w| WarningDocument {
                    part: w.part.map(|part| self.part_name(part).to_owned()),
                    message: w.message.clone(),
                })
                .collect(),
            stats: stats(&self.stats),
        };
        match &self.report {
            Some(report) => document.with_report(report),
            None => document,
        }
    }

    /// That document as JSON, in a line with its end.
    ///
    /// # Errors
    /// The plan cannot be written as JSON.
    pub fn to_json(&self, steps: &[Step]) -> Result<String, ClientError> {
        let json = self.document(steps).to_json();
        json.map(|text| text + "\n")
            .map_err(|error| ClientError::Protocol(format!("the plan has no JSON: {error}")))
    }

    fn names(&self, parts: &[u32]) -> Vec<String> {
        parts.iter().map(|&part| self.part_name(part).to_owned()).collect()
    }

    fn step(&self, step: &StepView<'_>) -> StepDocument {
        let ends = match step.ends {
            StepEnd::Out => "out",
            StepEnd::Aside => "aside",
            StepEnd::In => "in",
        };
        StepDocument {
            parts: self.names(step.parts),
            of: step.of.map(|number| number as usize),
            ends: ends.to_owned(),
            motion: if step.rotates { "rotation" } else { "translation" }.to_owned(),
            path: step.path.to_vec(),
            verified_depth: step.verified_depth,
            requires: step.requires.iter().map(|&number| number as usize).collect(),
            wave: step.wave as usize,
            direction: step.direction,
            stability: None,
            clearance: None,
            tools: None,
        }
    }
}

fn stats(s: &Stats) -> StatsDocument {
    StatsDocument {
        simulations: s.simulations,
        simulations_run: s.simulations_run,
        sweeps: s.sweeps,
        states: s.states,
        // The wire has no room for these.
        load_time_s: None,
        overlap_time_s: None,
        transfer_time_s: None,
        sdf_time_s: s.sdf_time_s,
        static_analysis_time_s: s.static_analysis_time_s,
        path_time_s: s.path_time_s,
        verify_time_s: s.verify_time_s,
        total_time_s: s.total_time_s,
        cache: CacheDocument {
            sdf_hits: s.sdf_hits,
            blocking_hits: s.blocking_hits,
            graph_hits: s.graph_hits,
            motion_hits: s.motion_hits,
            verdict_hits: None,
            plan_hit: s.plan_hit != 0,
        },
    }
}
