//! Reading arguments from C.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;

use crate::border::Failure;

/// Bytes of the longest options that are taken. Today's longest have 232, and an uninitialised `struct_size` is mostly
/// far larger than this. Half of it would do as well; at double, more such sizes would be read behind the caller's
/// struct.
const LONGEST_OPTIONS: usize = 4096;

/// A struct that begins with `struct_size: u32` and may grow at its end.
///
/// # Safety
/// All bytes zero are a value, and so is every other pattern.
pub(crate) unsafe trait Versioned: Copy {}

/// A caller's struct, as far as it goes: what an older caller does not know is zero. What a newer one knows more of
/// must be.
///
/// # Safety
/// The pointer is null, or leads to as many bytes as the struct says.
pub(crate) unsafe fn versioned<T: Versioned>(pointer: *const T, name: &str) -> Result<T, Failure> {
    let mut value = MaybeUninit::<T>::zeroed();
    if !pointer.is_null() {
        aligned(pointer, name)?;
        // SAFETY: each such struct begins with its size.
        let size = unsafe { pointer.cast::<u32>().read() } as usize;
        if !(size_of::<u32>()..=LONGEST_OPTIONS).contains(&size) {
            let told = format!("`{name}->struct_size` is {size}: set it to sizeof *{name}");
            return Err(Failure::argument(told));
        }
        let known = size.min(size_of::<T>());
        // SAFETY: the caller's struct has `size` bytes, and this one has room for what is known of them.
        let unknown = unsafe {
            value.as_mut_ptr().cast::<u8>().copy_from_nonoverlapping(pointer.cast(), known);
            std::slice::from_raw_parts(pointer.cast::<u8>().add(known), size - known)
        };
        if unknown.iter().any(|byte| *byte != 0) {
            let told = format!("`{name}` asks for what this library does not know: use a newer libsbdp");
            return Err(Failure::argument(told));
        }
    }
    // SAFETY: every pattern is a value.
    Ok(unsafe { value.assume_init() })
}

/// An array.
///
/// # Safety
/// The pointer is null, or leads to `count` values that stay as they are for the call.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(Failure::argument(format!("`{name}` is null, but its count is {count}")));
    }
    aligned(pointer, name)?;
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Failure::argument(format!("the count of `{name}` is {count}: no array is that long")));
    }
    // SAFETY: the caller promises it, and the rest was checked.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// A value that may be left out.
///
/// # Safety
/// The pointer is null, or leads to a value.
pub(crate) unsafe fn optional<T: Copy>(pointer: *const T, name: &str) -> Result<Option<T>, Failure> {
    // SAFETY: so the caller promises; an array of one.
    let read = unsafe { array(pointer, usize::from(!pointer.is_null()), name) }?;
    Ok(read.first().copied())
}

/// A value that must be there.
///
/// # Safety
/// As [`optional`].
pub(crate) unsafe fn required<T: Copy>(pointer: *const T, name: &str) -> Result<T, Failure> {
    // SAFETY: so the caller promises.
    unsafe { optional(pointer, name) }?.ok_or_else(|| Failure::argument(format!("`{name}` is null")))
}

/// A text that may be left out.
///
/// # Safety
/// The pointer is null, or leads to bytes that end with zero.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a str>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: so the caller promises.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map(Some).map_err(|_| Failure::argument(format!("`{name}` is not UTF-8")))
}

/// A text that must be there.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn required_text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    // SAFETY: so the caller promises.
    unsafe { text(pointer, name) }?.ok_or_else(|| Failure::argument(format!("`{name}` is null")))
}

fn aligned<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_aligned() {
        return Ok(());
    }
    Err(Failure::argument(format!("`{name}` is not aligned to {} bytes", align_of::<T>())))
}
