//! The boundary to C: failures become a code and a message, and no panic crosses it.

use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

use sbdp_client::ClientError;

use crate::code::SbdpCode;

/// Bytes of a message with its end. The daemon's longest is 16 KiB, and nearly all are below 300 bytes; half of this
/// would cut those with several paths in them.
const MESSAGE: usize = 2040;

/// An error. The caller owns it; its size never changes.
#[repr(C)]
pub struct SbdpError {
    /// A `SbdpCode`.
    pub code: u32,
    /// For `SBDP_CODE_BUSY`: milliseconds to wait before the next try; otherwise 0.
    pub retry_ms: u32,
    /// What happened and what to do: UTF-8, ended by a zero byte, empty on success. A longer message is cut, and
    /// ends in `...`.
    pub message: [c_char; 2040],
}

const _: () = assert!(size_of::<SbdpError>() == 8 + MESSAGE);

/// Why a call fails.
pub(crate) enum Failure {
    Client(ClientError),
    Argument(String),
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        Self::Client(error)
    }
}

impl Failure {
    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self::Argument(message.into())
    }
}

/// Runs what a function does.
///
/// # Safety
/// `error` is null, or points to an error that can be written.
pub(crate) unsafe fn enter(error: *mut SbdpError, run: impl FnOnce() -> Result<(), Failure>) -> SbdpCode {
    // What a panic leaves behind is only freed: so says the message.
    let result = catch_unwind(AssertUnwindSafe(run));
    let (code, retry_ms, message) = match result {
        Ok(Ok(())) => (SbdpCode::Ok, 0, String::new()),
        Ok(Err(Failure::Argument(message))) => (SbdpCode::Argument, 0, message),
        Ok(Err(Failure::Client(e))) => {
            let retry = e.retry_after().map_or(0, |time| u32::try_from(time.as_millis()).unwrap_or(u32::MAX));
            (SbdpCode::of(&e), retry, e.to_string())
        }
        Err(panic) => {
            let said = panic.downcast_ref::<String>().map(String::as_str);
            let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            let message = format!("fault of libsbdp ({said}): free the handles of this call, and report it");
            (SbdpCode::Internal, 0, message)
        }
    };
    // SAFETY: so the caller promises. Only what is said is written: to clear 2 KiB at each call would be in vain.
    unsafe {
        if !error.is_null() {
            (&raw mut (*error).code).write(code as u32);
            (&raw mut (*error).retry_ms).write(retry_ms);
            write_text((&raw mut (*error).message).cast(), &message);
        }
    }
    code
}

/// Runs what cannot fail; a panic gives the value instead.
pub(crate) fn answer<T>(otherwise: T, run: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(run)).unwrap_or(otherwise)
}

/// # Safety
/// `target` has room for `MESSAGE` bytes.
unsafe fn write_text(target: *mut u8, text: &str) {
    const CUT: &str = "...";
    let (mut end, mut tail) = (text.len(), "");
    if end >= MESSAGE {
        tail = CUT;
        end = MESSAGE - 1 - CUT.len();
        while !text.is_char_boundary(end) {
            end -= 1;
        }
    }
    // SAFETY: end + tail + 1 is at most `MESSAGE`.
    unsafe {
        target.copy_from_nonoverlapping(text.as_ptr(), end);
        target.add(end).copy_from_nonoverlapping(tail.as_ptr(), tail.len());
        target.add(end + tail.len()).write(0);
    }
}

/// The value behind a handle.
///
/// # Safety
/// The pointer is null, or comes from this library and was not freed.
pub(crate) unsafe fn behind<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: so the caller promises.
    unsafe { pointer.as_ref() }.ok_or_else(|| Failure::argument(format!("`{name}` is null")))
}

/// The value behind a handle, to be changed.
///
/// # Safety
/// As [`behind`], and no other call uses it meanwhile.
pub(crate) unsafe fn behind_mut<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: so the caller promises.
    unsafe { pointer.as_mut() }.ok_or_else(|| Failure::argument(format!("`{name}` is null")))
}

/// Refuses a null pointer to what is written or read piece by piece.
pub(crate) fn not_null<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() { Err(Failure::argument(format!("`{name}` is null"))) } else { Ok(()) }
}

/// Where a result goes: null until there is one.
///
/// # Safety
/// The pointer is null, or can be written.
pub(crate) unsafe fn out<'a, T>(pointer: *mut *mut T, name: &str) -> Result<&'a mut *mut T, Failure> {
    // SAFETY: so the caller promises. Written before a reference is made: it need not be initialised.
    unsafe {
        if pointer.is_null() {
            return Err(Failure::argument(format!("`{name}` is null")));
        }
        pointer.write(std::ptr::null_mut());
        Ok(&mut *pointer)
    }
}

/// Gives a value to the caller, as a handle.
pub(crate) fn give<T>(value: T) -> *mut T {
    Box::into_raw(Box::new(value))
}

/// Frees a handle and sets it to null.
///
/// # Safety
/// The pointer is null or leads to null, or to a handle that [`give`] gave and that was not freed.
pub(crate) unsafe fn free<T>(handle: *mut *mut T) {
    // SAFETY: so the caller promises.
    let taken = unsafe {
        match handle.as_mut() {
            Some(handle) if !handle.is_null() => {
                Box::from_raw(std::mem::replace(handle, std::ptr::null_mut()))
            }
            _ => return,
        }
    };
    answer((), || drop(taken));
}
