//! The line of JSON in which a converter says what it found.

use serde::Deserialize;

use super::ConvertedStep;
use crate::files::text::printable;

/// The version of the contract that is understood.
const CONTRACT: u32 = 1;

/// Units of length, with their millimetres.
const UNITS: [(&str, f64); 6] =
    [("µm", 1e-3), ("mm", 1.0), ("cm", 10.0), ("m", 1e3), ("in", 25.4), ("ft", 304.8)];

/// Warnings of a converter that are kept. One for each product of a large assembly would hide all others.
const MOST_WARNINGS: usize = 200;

/// What a converter says. Other keys are left alone.
#[derive(Debug, Deserialize)]
pub(super) struct Report {
    #[serde(rename = "sbdp-step")]
    contract: u32,
    unit: String,
    /// mm.
    deflection: f64,
    #[serde(default)]
    warnings: Vec<String>,
}

impl Report {
    /// The report in what a converter wrote to stdout; else what is wrong, after "the converter PROGRAM".
    pub(super) fn parse(stdout: &[u8]) -> Result<Self, String> {
        let text = String::from_utf8_lossy(stdout);
        let line = text.lines().rfind(|line| !line.trim().is_empty());
        let line = line.ok_or("ended without its line of JSON on stdout: it does not keep the contract")?;
        let report: Self = serde_json::from_str(line)
            .map_err(|e| format!("wrote a line to stdout that is not the contract's JSON ({e})"))?;
        if report.contract != CONTRACT {
            return Err(format!(
                "keeps version {} of the contract, not {CONTRACT}; install another one",
                report.contract
            ));
        }
        Ok(report)
    }

    /// The report with the scene that belongs to it.
    pub(super) fn into_converted(self, glb: Vec<u8>) -> Result<ConvertedStep, String> {
        let known = UNITS.iter().find(|(name, _)| *name == self.unit);
        let (_, millimetres) = known.ok_or_else(|| {
            format!("names the unit `{}`, which is none of the contract's", printable(&self.unit))
        })?;
        if !(self.deflection.is_finite() && self.deflection > 0.0) {
            return Err(format!("has a deflection of {}", self.deflection));
        }
        let mut warnings: Vec<String> =
            self.warnings.iter().take(MOST_WARNINGS).map(|w| printable(w)).collect();
        if let Some(more) = self.warnings.len().checked_sub(MOST_WARNINGS).filter(|more| *more > 0) {
            warnings.push(format!("and {more} more warnings of the converter"));
        }
        Ok(ConvertedStep { glb, resolution: self.deflection / millimetres, unit: self.unit, warnings })
    }
}
