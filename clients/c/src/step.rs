//! Steps in C.

use sbdp_client::Step;

use crate::border::{SbdpError, enter, not_null, out};
use crate::code::SbdpCode;

/// Where a step leaves its parts.
#[repr(u32)]
pub enum SbdpStepEnd {
    /// Clear of everything that they stood with.
    Out = 0,
    /// Elsewhere among the others, where they stay until a later step moves them again.
    Aside = 1,
    /// In their places: in assembly plans.
    In = 2,
}

/// A verified step. The library owns it and everything that it points to. Later versions may add fields at its end, so
/// copy fields, not the struct.
#[repr(C)]
pub struct SbdpStep {
    /// Its number; the first is 0.
    pub number: u32,
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts
    /// belong; `UINT32_MAX` for none. A group is taken apart as it stood in the assembly.
    pub of: u32,
    /// A `SbdpStepEnd`.
    pub ends: u32,
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: u32,
    /// Whether the path turns the parts.
    pub rotates: bool,
    /// Whether the last leg of the path has a `direction`: it does not only turn.
    pub has_direction: bool,
    /// The parts that move, as one body.
    pub parts: *const u32,
    /// How many.
    pub part_count: usize,
    /// Their motions from where they stand when the step begins (in an assembly plan: when it ends), so that the
    /// first (the last) is the identity. A motion is the shift x, y, z, then the unit quaternion w, x, y, z.
    pub path: *const [f64; 7],
    /// How many.
    pub waypoint_count: usize,
    /// Numbers of the steps that must be done before this exact path is free, ascending.
    pub required: *const u32,
    /// How many.
    pub required_count: usize,
    /// The deepest overlap along the path beyond that of the assembled pose, in the input's units.
    pub verified_depth: f64,
    /// The unit vector of the path's last leg, in the input's frame.
    pub direction: [f64; 3],
}

/// A step behind a `SbdpStep`: a pointer to one is a pointer to the other.
#[repr(C)]
pub(crate) struct HeldStep {
    fields: SbdpStep,
    pub(crate) step: Step,
}

impl HeldStep {
    pub(crate) fn new(step: Step) -> Self {
        let view = step.view();
        let fields = SbdpStep {
            number: view.number,
            of: view.of.unwrap_or(u32::MAX),
            ends: view.ends as u32,
            wave: view.wave,
            rotates: view.rotates,
            has_direction: view.direction.is_some(),
            parts: view.parts.as_ptr(),
            part_count: view.parts.len(),
            path: view.path.as_ptr(),
            waypoint_count: view.path.len(),
            required: view.requires.as_ptr(),
            required_count: view.requires.len(),
            verified_depth: view.verified_depth,
            direction: view.direction.unwrap_or_default(),
        };
        Self { fields, step }
    }

    pub(crate) fn to_c(&self) -> *const SbdpStep {
        std::ptr::from_ref(self).cast()
    }
}

/// Keeps a step beyond the next call on its stream, or beyond its plan; to be freed by `sbdp_step_free`. Nothing is
/// copied.
///
/// # Safety
/// `step` is one of this library's that is still valid; `kept` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_step_keep(
    step: *const SbdpStep,
    kept: *mut *mut SbdpStep,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let kept = out(kept, "kept")?;
            not_null(step, "step")?;
            let held = HeldStep::new((*step.cast::<HeldStep>()).step.clone());
            *kept = Box::into_raw(Box::new(held)).cast();
            Ok(())
        })
    }
}

/// Frees a step that was kept.
///
/// # Safety
/// `step` is null, or points to null or to a step of `sbdp_step_keep`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_step_free(step: *mut *mut SbdpStep) {
    // SAFETY: so the caller promises; it was made as a `HeldStep`.
    unsafe { crate::border::free(step.cast::<*mut HeldStep>()) }
}
