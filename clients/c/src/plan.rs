//! Whole plans.

use std::ffi::{CString, c_char};

use sbdp_client::Plan;

use crate::border::{answer, free};
use crate::step::{HeldStep, SbdpStep};
use crate::summary::{HeldSummary, SbdpSummary};

/// A finished plan. Several threads may read it at the same time.
pub struct SbdpPlan {
    steps: Vec<HeldStep>,
    summary: HeldSummary,
    trace: CString,
}

impl SbdpPlan {
    pub(crate) fn new(plan: Plan) -> Self {
        Self {
            steps: plan.steps.into_iter().map(HeldStep::new).collect(),
            summary: HeldSummary::new(plan.summary),
            // JSON has no zero bytes.
            trace: CString::new(plan.trace).unwrap_or_default(),
        }
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

/// Frees a plan.
///
/// # Safety
/// `plan` is null, or points to null or to a plan of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_plan_free(plan: *mut *mut SbdpPlan) {
    // SAFETY: so the caller promises.
    unsafe { free(plan) }
}
