//! Planning again while an assembly is being taken apart.

use std::ffi::c_char;
use std::time::Duration;

use sbdp_client::{Handle, Session, Subject};

use crate::border::{Failure, SbdpError, behind, behind_mut, enter, free, give, not_null, out};
use crate::client::SbdpClient;
use crate::code::SbdpCode;
use crate::geometry::{SbdpHandle, SbdpMeshes};
use crate::input::{array, optional, required, required_text};
use crate::options::{SbdpMovedPart, SbdpPlanOptions, read_plan_options};
use crate::step::{HeldStep, SbdpStep};
use crate::stream::SbdpStream;

/// An assembly that is being taken apart: what has happened to it, and plans for the rest. For one thread at a time.
pub struct SbdpSession {
    session: Session,
}

/// # Safety
/// `options` is null, or leads to options, and what these point to is as they say.
unsafe fn begin(
    client: &SbdpClient,
    subject: impl Into<Subject>,
    options: *const SbdpPlanOptions,
) -> Result<SbdpSession, Failure> {
    // SAFETY: so the caller promises.
    let options = unsafe { read_plan_options(options) }?;
    Ok(SbdpSession { session: client.client.session(subject, options)? })
}

/// Begins a session about an uploaded assembly. Sends nothing yet. `options` may be null.
///
/// # Safety
/// All pointers are valid; `session` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_session(
    client: *const SbdpClient,
    handle: *const SbdpHandle,
    options: *const SbdpPlanOptions,
    session: *mut *mut SbdpSession,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let session = out(session, "session")?;
            let handle: Handle = required(handle, "handle")?.into();
            *session = give(begin(behind(client, "client")?, handle, options)?);
            Ok(())
        })
    }
}

/// Begins a session about meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
///
/// # Safety
/// All pointers are valid; `session` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_session_meshes(
    client: *const SbdpClient,
    meshes: *const SbdpMeshes,
    options: *const SbdpPlanOptions,
    session: *mut *mut SbdpSession,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let session = out(session, "session")?;
            let kept = behind(meshes, "meshes")?.kept.clone();
            *session = give(begin(behind(client, "client")?, kept, options)?);
            Ok(())
        })
    }
}

/// What happened to an assembly, for its session.
///
/// # Safety
/// `session` is null or one of this library's that no other call uses; `error` can be written.
unsafe fn tell(
    session: *mut SbdpSession,
    error: *mut SbdpError,
    happened: impl FnOnce(&mut Session) -> Result<(), Failure>,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe { enter(error, || happened(&mut behind_mut(session, "session")?.session)) }
}

/// The number of a part, of a session about meshes.
///
/// # Safety
/// All pointers are valid; `part` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_part(
    session: *const SbdpSession,
    name: *const c_char,
    part: *mut u32,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            not_null(part, "part")?;
            let name = required_text(name, "name")?;
            part.write(behind(session, "session")?.session.part(name)?);
            Ok(())
        })
    }
}

/// Records that these parts are out.
///
/// # Safety
/// All pointers are valid, and no other call uses the session; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_executed(
    session: *mut SbdpSession,
    parts: *const u32,
    part_count: usize,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            session.executed(array(parts, part_count, "parts")?);
            Ok(())
        })
    }
}

/// Records that a step of the last plan was done: its parts are out, or stand where the step left them.
///
/// # Safety
/// All pointers are valid, and no other call uses the session; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_performed(
    session: *mut SbdpSession,
    step: *const SbdpStep,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises; a step of this library is a `HeldStep`.
    unsafe {
        tell(session, error, |session| {
            session.performed(&behind(step.cast::<HeldStep>(), "step")?.step);
            Ok(())
        })
    }
}

/// Records that this part does not move: until it is freed, plans leave it in place. It is no longer a target.
///
/// # Safety
/// `session` is one of this library's that no other call uses; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_stuck(
    session: *mut SbdpSession,
    part: u32,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            session.stuck(part);
            Ok(())
        })
    }
}

/// Records that this part moves again.
///
/// # Safety
/// `session` is one of this library's that no other call uses; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_freed(
    session: *mut SbdpSession,
    part: u32,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            session.freed(part);
            Ok(())
        })
    }
}

/// Records that this part stands elsewhere.
///
/// # Safety
/// All pointers are valid, and no other call uses the session; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_moved(
    session: *mut SbdpSession,
    moved: *const SbdpMovedPart,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            let moved = required(moved, "moved")?;
            session.moved(moved.part, moved.motion);
            Ok(())
        })
    }
}

/// From the next plan on: time after which the daemon answers with the plan so far; null for none.
///
/// # Safety
/// All pointers are valid, and no other call uses the session; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_set_timeout(
    session: *mut SbdpSession,
    timeout_ns: *const u64,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            session.options_mut().timeout = optional(timeout_ns, "timeout_ns")?.map(Duration::from_nanos);
            Ok(())
        })
    }
}

/// Plans how the rest comes apart from how it stands now.
///
/// # Safety
/// `session` is one of this library's that no other call uses; `stream` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_replan(
    session: *mut SbdpSession,
    stream: *mut *mut SbdpStream,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        tell(session, error, |session| {
            let stream = out(stream, "stream")?;
            *stream = give(SbdpStream::new(session.replan()?));
            Ok(())
        })
    }
}

/// Frees a session. Its streams remain valid.
///
/// # Safety
/// `session` is null, or points to null or to a session of this library that no other call uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_session_free(session: *mut *mut SbdpSession) {
    // SAFETY: so the caller promises.
    unsafe { free(session) }
}
