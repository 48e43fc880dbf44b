//! Clients.

use std::ffi::{CString, c_char, c_void};
use std::time::Duration;

use sbdp_client::{Change, Client, ConnectOptions, Interrupt};

use crate::border::{Failure, SbdpError, answer, behind, enter, free, give, not_null, out};
use crate::code::SbdpCode;
use crate::geometry::{SbdpAssembly, SbdpHandle, SbdpPart, read_assembly, read_part, write_handle};
use crate::input::{Versioned, array, optional, required, text, versioned};
use crate::options::{SbdpMovedPart, moved_parts};

/// A client of one daemon. Threads may share it. It receives one plan at a time: connect several clients for more.
pub struct SbdpClient {
    pub(crate) client: Client,
}

/// How to find the daemon, and how long to wait for it. All zero except `struct_size` is the default, as is a null
/// pointer.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpConnectOptions {
    /// `sizeof` this struct. Fields beyond it have their defaults.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The daemon's runtime folder; null for `$SBDP_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR/sbdp`, else `/tmp/sbdp-UID`.
    pub runtime_dir: *const c_char,
    /// How long the daemon may take for an answer that needs no planning; null for 10 s.
    pub timeout_ns: *const u64,
    /// How long the daemon may take to check and heal an upload; null for 300 s.
    pub upload_timeout_ns: *const u64,
    /// How long to wait for a new daemon when the one in use goes away; null for 10 s, 0 to report it at once.
    pub reconnect_ns: *const u64,
    /// For how long to repeat a request automatically while the daemon is busy; null for not at all.
    pub busy_wait_ns: *const u64,
    /// How long to poll for an answer before going to sleep; null for the default, 0 for not at all.
    pub poll_ns: *const u64,
    /// Called at least every 50 ms by calls that wait for the daemon, on their thread; not by `sbdp_stream_poll` and
    /// `sbdp_stream_next` while the daemon plans. Not 0 ends the call with `SBDP_CODE_INTERRUPTED`. It must not throw,
    /// and must live as long as the client and its streams and sessions. May be null.
    pub interrupt: Option<unsafe extern "C" fn(data: *mut c_void) -> i32>,
    /// The argument of `interrupt`.
    pub interrupt_data: *mut c_void,
}

// SAFETY: it begins with its size, and has but numbers, pointers and a function that may be null.
unsafe impl Versioned for SbdpConnectOptions {}

/// A function of the caller with its data.
struct Callback {
    function: unsafe extern "C" fn(data: *mut c_void) -> i32,
    data: *mut c_void,
}

// SAFETY: the header demands a function that any thread may call.
unsafe impl Send for Callback {}
// SAFETY: as above.
unsafe impl Sync for Callback {}

impl Callback {
    fn is_wanted(&self) -> bool {
        // SAFETY: the header demands that both live as long as the client.
        unsafe { (self.function)(self.data) != 0 }
    }
}

/// # Safety
/// The pointer is null, or points to options whose pointers and counts are valid.
unsafe fn read_connect_options(options: *const SbdpConnectOptions) -> Result<ConnectOptions, Failure> {
    // SAFETY: so the caller promises.
    unsafe {
        let given = versioned(options, "options")?;
        let usual = ConnectOptions::default();
        let time = |pointer, name, usual| {
            Ok::<_, Failure>(optional(pointer, name)?.map_or(usual, Duration::from_nanos))
        };
        let interrupt = given.interrupt.map(|function| {
            let callback = Callback { function, data: given.interrupt_data };
            Interrupt::new(move || callback.is_wanted())
        });
        Ok(ConnectOptions {
            runtime_dir: text(given.runtime_dir, "options->runtime_dir")?.map(Into::into),
            timeout: time(given.timeout_ns, "options->timeout_ns", usual.timeout)?,
            upload_timeout: time(
                given.upload_timeout_ns,
                "options->upload_timeout_ns",
                usual.upload_timeout,
            )?,
            reconnect: time(given.reconnect_ns, "options->reconnect_ns", usual.reconnect)?,
            busy_wait: time(given.busy_wait_ns, "options->busy_wait_ns", usual.busy_wait)?,
            poll: time(given.poll_ns, "options->poll_ns", usual.poll)?,
            interrupt,
        })
    }
}

/// Connects to a daemon. `options` may be null.
///
/// # Safety
/// `options` is null or valid with everything that it points to; `client` and `error` are null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_connect(
    options: *const SbdpConnectOptions,
    client: *mut *mut SbdpClient,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let client = out(client, "client")?;
            *client = give(SbdpClient { client: Client::connect_with(read_connect_options(options)?)? });
            Ok(())
        })
    }
}

/// Frees a client. Its streams and sessions remain valid.
///
/// # Safety
/// `client` is null, or points to null or to a client of this library that no other call uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_free(client: *mut *mut SbdpClient) {
    // SAFETY: so the caller promises.
    unsafe { free(client) }
}

/// Uploads an assembly. One that the daemon knows is not copied again.
///
/// # Safety
/// All pointers are valid; `handle` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_upload(
    client: *const SbdpClient,
    assembly: *const SbdpAssembly,
    handle: *mut SbdpHandle,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let client = &behind(client, "client")?.client;
            let assembly = read_assembly(assembly)?;
            not_null(handle, "handle")?;
            write_handle(handle, client.upload(&assembly)?)
        })
    }
}

/// Whether the daemon knows an assembly.
///
/// # Safety
/// All pointers are valid; `known` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_knows(
    client: *const SbdpClient,
    handle: *const SbdpHandle,
    known: *mut bool,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let client = &behind(client, "client")?.client;
            let handle = required(handle, "handle")?;
            not_null(known, "known")?;
            known.write(client.knows(handle.into())?);
            Ok(())
        })
    }
}

/// Changes of an assembly that the daemon knows.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpChange {
    /// `sizeof` this struct. Fields beyond it count as zero.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Numbers of the parts with another mesh.
    pub replaced: *const u32,
    /// Their meshes, given at the assembled pose. Names stay: the ones given here are ignored.
    pub replaced_by: *const SbdpPart,
    /// How many of both.
    pub replaced_count: usize,
    /// Further parts; they get the numbers after all others.
    pub added: *const SbdpPart,
    /// How many.
    pub added_count: usize,
    /// Parts that stand elsewhere: the motion of the (new) mesh from where it was.
    pub moved: *const SbdpMovedPart,
    /// How many.
    pub moved_count: usize,
}

// SAFETY: it begins with its size, and has but numbers and pointers.
unsafe impl Versioned for SbdpChange {}

/// # Safety
/// The pointer is null, or points to a change whose pointers and counts are valid.
unsafe fn read_change<'a>(change: *const SbdpChange) -> Result<Change<'a>, Failure> {
    // SAFETY: so the caller promises.
    unsafe {
        not_null(change, "change")?;
        let given = versioned(change, "change")?;
        let places = array(given.replaced, given.replaced_count, "change->replaced")?;
        let meshes = array(given.replaced_by, given.replaced_count, "change->replaced_by")?;
        let added = array(given.added, given.added_count, "change->added")?;
        let parts = |parts: &[SbdpPart]| {
            parts.iter().enumerate().map(|(n, part)| read_part(part, n)).collect::<Result<Vec<_>, _>>()
        };
        Ok(Change {
            replaced: places.iter().copied().zip(parts(meshes)?).collect(),
            added: parts(added)?,
            moved: moved_parts(given.moved, given.moved_count, "change->moved")?,
        })
    }
}

/// Uploads the changes of an assembly that the daemon knows. `revised` receives the handle of the changed assembly.
///
/// # Safety
/// All pointers are valid; `revised` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_revise(
    client: *const SbdpClient,
    base: *const SbdpHandle,
    change: *const SbdpChange,
    revised: *mut SbdpHandle,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let client = &behind(client, "client")?.client;
            let base = required(base, "base")?;
            let change = read_change(change)?;
            not_null(revised, "revised")?;
            write_handle(revised, client.revise(base.into(), &change)?)
        })
    }
}

/// All metrics of the daemon: a JSON object, to be freed by `sbdp_text_free`.
///
/// # Safety
/// `client` is one of this library's; `metrics` and `error` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_metrics(
    client: *const SbdpClient,
    metrics: *mut *mut c_char,
    error: *mut SbdpError,
) -> SbdpCode {
    // SAFETY: so the caller promises.
    unsafe {
        enter(error, || {
            let metrics = out(metrics, "metrics")?;
            let told = behind(client, "client")?.client.metrics()?;
            // JSON has no zero bytes.
            *metrics = CString::new(told).unwrap_or_default().into_raw();
            Ok(())
        })
    }
}

/// Frees a text of this library.
///
/// # Safety
/// `text` is null, or points to null or to a text of `sbdp_client_metrics`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_text_free(text: *mut *mut c_char) {
    // SAFETY: so the caller promises.
    unsafe {
        if let Some(text) = text.as_mut().filter(|text| !text.is_null()) {
            drop(CString::from_raw(std::mem::replace(text, std::ptr::null_mut())));
        }
    }
}

/// The daemon's process id; 0 for a null client.
///
/// # Safety
/// `client` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_daemon_pid(client: *const SbdpClient) -> u32 {
    // SAFETY: so the caller promises.
    answer(0, || unsafe { client.as_ref() }.map_or(0, |client| client.client.pid()))
}

/// How often this client has followed a daemon that was restarted; 0 for a null client.
///
/// # Safety
/// `client` is null or one of this library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sbdp_client_restarts(client: *const SbdpClient) -> u32 {
    // SAFETY: so the caller promises.
    answer(0, || unsafe { client.as_ref() }.map_or(0, |client| client.client.restarts()))
}
