//! Plans as they arrive.

use std::ffi::{CString, c_char};
use std::task::Poll;
use std::time::Duration;

use sbdp_client::{Event, PlanStream, Stage, Subject};

use crate::border::{Failure, SbdpError, behind, behind_mut, enter, free, give, not_null, out};
use crate::client::SbdpClient;
use crate::code::SbdpCode;
use crate::geometry::{SbdpHandle, SbdpMeshes};
use crate::input::required;
use crate::options::{SbdpPlanOptions, read_plan_options};
use crate::plan::SbdpPlan;
use crate::step::{HeldStep, SbdpStep};
use crate::summary::{HeldSummary, SbdpSummary};

/// The kind of an event.
#[repr(u32)]
pub enum SbdpEventKind {
    /// The plan has ended, and nothing follows.
    End = 0,
    /// Nothing arrived in time; the stream continues.
    Pending = 1,
    /// Planning made progress: see `progress`.
    Progress = 2,
    /// A step, in order: see `step`.
    Step = 3,
    /// Events of the search: see `trace`.
    Trace = 4,
    /// The request was sent to another daemon: the steps and the trace so far are void, and come again from the first.
    Restarted = 5,
    /// The end of the plan: see `summary`.
    Done = 6,
}

/// The stages of a request.
#[repr(u32)]
pub enum SbdpStage {
    /// Building distance fields.
    Sdf = 0,
    /// Searching and verifying.
    Search = 1,
    /// Finding the paths to where insertions begin.
    Transfer = 2,
}

/// What the daemon is doing. Some samples are dropped on purpose.
#[derive(Clone, Copy, Default)]
#[repr(C)]
pub struct SbdpProgress {
    /// A `SbdpStage`.
    pub stage: u32,
    /// Units of the stage done.
    pub done: u32,
    /// Units of the stage in all.
    pub total: u32,
    /// What the search tries: 1 + the index of the part, plus 2³¹ if the part is turned and not only pushed; 0 if that
    /// is not known.
    pub tried: u32,
    /// Simulations so far.
    pub simulations: u64,
}

/// An event. It and everything that it points to is valid until the next call on the stream. Later versions may add
/// fields at its end.
#[repr(C)]
pub struct SbdpEvent {
    /// A `SbdpEventKind`.
    pub kind: u32,
    /// Zero.
    pub reserved: u32,
    /// The step, or null.
    pub step: *const SbdpStep,
    /// Whole lines with one JSON object each, or null.
    pub trace: *const c_char,
    /// The summary, or null. It is valid until the stream is freed.
    pub summary: *const SbdpSummary,
    /// The progress; all zero for other events.
    pub progress: SbdpProgress,
}

/// A plan as it arrives, for one thread at a time. Freeing it cancels the request. It may outlive its client.
pub struct SbdpStream {
    /// None after a panic.
    stream: Option<PlanStream>,
    event: SbdpEvent,
    step: Option<HeldStep>,
    trace: CString,
    summary: Option<Box<HeldSummary>>,
}

impl SbdpStream {
    pub(crate) fn new(stream: PlanStream) -> Self {
        let none = SbdpEvent {
            kind: SbdpEventKind::End as u32,
            reserved: 0,
            step: std::ptr::null(),
            trace: std::ptr::null(),
            summary: std::ptr::null(),
            progress: SbdpProgress::default(),
        };
        Self { stream: Some(stream), event: none, step: None, trace: CString::default(), summary: None }
    }

    fn read(
        &mut self,
        next: impl FnOnce(&mut PlanStream) -> Result<Poll<Option<Event>>, sbdp_client::ClientError>,
    ) -> Result<*const SbdpEvent, Failure> {
        self.step = None;
        let stream =
            self.stream.as_mut().ok_or_else(|| Failure::argument("`stream` failed before: free it"))?;
        let came = next(stream)?;
        let event = &mut self.event;
        (event.step, event.trace, event.summary) = (std::ptr::null(), std::ptr::null(), std::ptr::null());
        event.progress = SbdpProgress::default();
        let kind = match came {
            Poll::Pending => SbdpEventKind::Pending,
            Poll::Ready(None) => SbdpEventKind::End,
            Poll::Ready(Some(Event::Restarted)) => SbdpEventKind::Restarted,
            Poll::Ready(Some(Event::Progress(progress))) => {
                event.progress = SbdpProgress {
                    stage: match progress.stage {
                        Stage::Sdf => SbdpStage::Sdf,
                        Stage::Search => SbdpStage::Search,
                        Stage::Transfer => SbdpStage::Transfer,
                    } as u32,
                    done: progress.done,
                    total: progress.total,
                    tried: progress.tried.map_or(0, |tried| (tried.part + 1) | u32::from(tried.turns) << 31),
                    simulations: progress.simulations,
                };
                SbdpEventKind::Progress
            }
            Poll::Ready(Some(Event::Step(step))) => {
                event.step = self.step.insert(HeldStep::new(step)).to_c();
                SbdpEventKind::Step
            }
            Poll::Ready(Some(Event::Trace(lines))) => {
                // JSON has no zero bytes.
                self.trace = CString::new(lines).unwrap_or_default();
                event.trace = self.trace.as_ptr();
                SbdpEventKind::Trace
            }
            Poll::Ready(Some(Event::Done(summary))) => {
                event.summary = self.summary.insert(Box::new(HeldSummary::new(summary))).to_c();
                SbdpEventKind::Done
            }
        };
        event.kind = kind as u32;
        Ok(event)
    }
}

fn plan(
    client: &SbdpClient,
    subject: impl Into<Subject>,
    options: &sbdp_client::PlanOptions,
) -> Result<SbdpStream, Failure> {
    Ok(SbdpStream::new(client.client.plan(subject, options)?))
}

/// Requests a plan of an uploaded assembly. `options` may be null.
///
/// # Safety
/// All pointers are valid; `stream` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_plan(
    client: *const SbdpClient,
    handle: *const SbdpHandle,
    options: *const SbdpPlanOptions,
    stream: *mut *mut SbdpStream,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let stream = out(stream, "stream")?;
            let handle: sbdp_client::Handle = required(handle, "handle")?.into();
            *stream = give(plan(behind(client, "client")?, handle, &read_plan_options(options)?)?);
            Ok(())
        })
    }
}

/// Requests a plan of meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
///
/// # Safety
/// All pointers are valid; `stream` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_plan_meshes(
    client: *const SbdpClient,
    meshes: *const SbdpMeshes,
    options: *const SbdpPlanOptions,
    stream: *mut *mut SbdpStream,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let stream = out(stream, "stream")?;
            let kept = behind(meshes, "meshes")?.kept.clone();
            *stream = give(plan(behind(client, "client")?, kept, &read_plan_options(options)?)?);
            Ok(())
        })
    }
}

/// Reads steps in shared memory from now on, without a copy. Steps of two messages may then be kept; a call that needs
/// a third fails with `SBDP_CODE_VIEWS_HELD`, and nothing is lost.
///
/// # Safety
/// `stream` is one of this library's; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_read_in_place(
    stream: *mut SbdpStream,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let stream = behind_mut(stream, "stream")?;
            stream.stream = stream.stream.take().map(PlanStream::in_place);
            Ok(())
        })
    }
}

/// Waits for the next event, as long as the daemon lives; `SBDP_EVENT_KIND_END` after the end. After an error the
/// stream is over, except after `SBDP_CODE_VIEWS_HELD`.
///
/// # Safety
/// `stream` is one of this library's that no other call uses; `event` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_next(
    stream: *mut SbdpStream,
    event: *mut *const SbdpEvent,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            not_null(event, "event")?;
            event.write(std::ptr::null());
            let stream = behind_mut(stream, "stream")?;
            event.write(stream.read(|s| s.next_event().map(Poll::Ready))?);
            Ok(())
        })
    }
}

/// The next event if it arrives within a time, which may be 0; otherwise `SBDP_EVENT_KIND_PENDING`.
///
/// # Safety
/// As `sbdp_stream_next`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_poll(
    stream: *mut SbdpStream,
    within_ns: u64,
    event: *mut *const SbdpEvent,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            not_null(event, "event")?;
            event.write(std::ptr::null());
            let stream = behind_mut(stream, "stream")?;
            event.write(stream.read(|s| s.poll_event(Duration::from_nanos(within_ns)))?);
            Ok(())
        })
    }
}

/// Asks the daemon to stop soon. The stream continues until its end, whose status is then `cancelled`, unless the plan
/// was ready before.
///
/// # Safety
/// `stream` is one of this library's that no other call uses; `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_cancel(stream: *mut SbdpStream, error: *mut SbdpError) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            if let Some(stream) = &mut behind_mut(stream, "stream")?.stream {
                stream.cancel();
            }
            Ok(())
        })
    }
}

/// Waits for the end of the plan and keeps everything. Frees the stream, also after an error.
///
/// # Safety
/// `stream` points to a stream of this library that no other call uses; `plan` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_to_end(
    stream: *mut *mut SbdpStream,
    plan: *mut *mut SbdpPlan,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let plan = out(plan, "plan")?;
            not_null(stream, "stream")?;
            not_null(*stream, "*stream")?;
            let taken = Box::from_raw(std::mem::replace(&mut *stream, std::ptr::null_mut())).stream;
            let taken = taken.ok_or_else(|| Failure::argument("`stream` failed before"))?;
            *plan = give(SbdpPlan::new(taken.plan_to_end()?));
            Ok(())
        })
    }
}

/// Frees a stream, and cancels its request if it has not ended.
///
/// # Safety
/// `stream` is null, or points to null or to a stream of this library that no other call uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_stream_free(stream: *mut *mut SbdpStream) {
    // SAFETY: so the caller promises.
    unsafe { free(stream) }
}
