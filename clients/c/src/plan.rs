//! Whole plans.

use std::ffi::{CStr, CString, c_char};
use std::sync::OnceLock;

use sbdp_client::{Plan, Step};

use crate::border::{Failure, SbdpError, answer, behind, enter, free, not_null};
use crate::code::SbdpCode;
use crate::step::{HeldStep, SbdpStep};
use crate::summary::{HeldSummary, SbdpSummary};

/// A finished plan. Several threads may read it at the same time.
pub struct SbdpPlan {
    steps: Vec<HeldStep>,
    summary: HeldSummary,
    trace: CString,
    /// Made when it is asked for.
    json: OnceLock<CString>,
}

impl SbdpPlan {
    pub(crate) fn new(plan: Plan) -> Self {
        Self {
            steps: plan.steps.into_iter().map(HeldStep::new).collect(),
            summary: HeldSummary::new(plan.summary),
            // JSON has no zero bytes.
            trace: CString::new(plan.trace).unwrap_or_default(),
            json: OnceLock::new(),
        }
    }

    fn json(&self) -> Result<&CStr, Failure> {
        if let Some(json) = self.json.get() {
            return Ok(json);
        }
        let steps: Vec<Step> = self.steps.iter().map(|held| held.step.clone()).collect();
        let json = self.summary.summary().to_json(&steps)?;
        Ok(self.json.get_or_init(|| CString::new(json).unwrap_or_default()))
    }
}

/// How many steps a plan has; 0 for a null plan.
///
/// # Safety
/// `plan` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_step_count(plan: *const SbdpPlan) -> usize {
    // SAFETY: so the caller promises.
    answer(0, || unsafe { plan.as_ref() }.map_or(0, |plan| plan.steps.len()))
}

/// A step, valid until the plan is freed; null if there is none of this number.
///
/// # Safety
/// `plan` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_step(plan: *const SbdpPlan, number: usize) -> *const SbdpStep {
    answer(std::ptr::null(), || {
        // SAFETY: so the caller promises.
        let step = unsafe { plan.as_ref() }.and_then(|plan| plan.steps.get(number));
        step.map_or(std::ptr::null(), HeldStep::to_c)
    })
}

/// Everything about a plan except its steps, valid until it is freed; null for a null plan.
///
/// # Safety
/// `plan` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_summary(plan: *const SbdpPlan) -> *const SbdpSummary {
    // SAFETY: so the caller promises.
    answer(std::ptr::null(), || unsafe { plan.as_ref() }.map_or(std::ptr::null(), |p| p.summary.to_c()))
}

/// Events of the search, if they were requested: whole lines with one JSON object each, valid until the plan is freed;
/// null for a null plan.
///
/// # Safety
/// `plan` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_trace(plan: *const SbdpPlan) -> *const c_char {
    // SAFETY: so the caller promises.
    answer(std::ptr::null(), || unsafe { plan.as_ref() }.map_or(std::ptr::null(), |p| p.trace.as_ptr()))
}

/// The plan as the command line writes it: JSON (`sbdp-plan/2`) in a line with its end, without what only the files of an
/// assembly have (`source`, `groups`, findings while reading). `json` is valid until the plan is freed.
///
/// # Safety
/// `plan` is one of this library's; `json` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_json(
    plan: *const SbdpPlan,
    json: *mut *const c_char,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            not_null(json, "json")?;
            json.write(behind(plan, "plan")?.json()?.as_ptr());
            Ok(())
        })
    }
}

/// Frees a plan.
///
/// # Safety
/// `plan` is null, or points to null or to a plan of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_free(plan: *mut *mut SbdpPlan) {
    // SAFETY: so the caller promises.
    unsafe { free(plan) }
}
