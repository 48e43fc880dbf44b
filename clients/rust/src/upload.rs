//! Uploading assemblies.

use sbdp_ipc::bytes::Reader;
use sbdp_ipc::clock;
use sbdp_ipc::geometry::{Assembly, HandleResponse, Part};
use sbdp_ipc::headers::RequestKind;
use sbdp_ipc::plan::Waypoint;
use sbdp_ipc::revision::Revision;

use crate::client::Client;
use crate::connection::Through;
use crate::content_hash;
use crate::error::ClientError;
use crate::options::{Handle, moved_part};

/// Changes of an assembly that the daemon knows. Parts are named by their indices in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Change<'a> {
    /// Parts with another mesh, given at the assembled pose; the part's name stays.
    pub replaced: Vec<(u32, Part<'a>)>,
    /// Further parts; they get the indices after all others.
    pub added: Vec<Part<'a>>,
    /// Parts that stand elsewhere: the rigid motion of the (new) mesh from where it was (input units and
    /// frame).
    pub moved: Vec<(u32, Waypoint)>,
}

impl Client {
    /// Uploads an assembly and returns its handle. The daemon is asked first whether it
    /// knows the content, so that uploading again copies nothing.
    ///
    /// # Errors
    /// The geometry is refused (the message names part and reason), or the daemon is gone.
    pub fn upload(&self, assembly: &Assembly<'_>) -> Result<Handle, ClientError> {
        let handle = content_hash(assembly);
        if self.knows(handle)? {
            self.note_uploaded(handle);
            return Ok(handle);
        }
        let answered = self.send_meshes(assembly)?;
        if answered != handle {
            return Err(ClientError::Protocol(format!(
                "it names the assembly {answered} where the content gives {handle}"
            )));
        }
        self.note_uploaded(handle);
        Ok(handle)
    }

    /// Whether the daemon knows an assembly.
    ///
    /// # Errors
    /// The daemon is gone or does not answer.
    pub fn knows(&self, handle: Handle) -> Result<bool, ClientError> {
        let header = Self::header(RequestKind::Have, 0);
        let fill = |out: &mut [u8]| out.copy_from_slice(&handle.0);
        let answer = self.ask("have", Through::Ask, header, handle.0.len(), fill, self.options().timeout)?;
        let response: HandleResponse = Reader::new(answer.as_slice())?.value("handle")?;
        Ok(response.known != 0)
    }

    /// Uploads the changes of an assembly that the daemon knows, and returns the handle of the
    /// changed assembly. The daemon keeps everything that it knows about the unchanged parts.
    ///
    /// # Errors
    /// The daemon does not know the base (any more), the geometry is refused, or the daemon is gone.
    pub fn revise(&self, base: Handle, change: &Change<'_>) -> Result<Handle, ClientError> {
        let revision = Revision {
            base: base.0,
            replaced: change.replaced.clone(),
            added: change.added.clone(),
            moved: change.moved.iter().map(moved_part).collect(),
        };
        let fill = |out: &mut [u8]| revision.encode_into(out);
        self.hand_over("revise", RequestKind::Revise, revision.encoded_len(), fill)
    }

    fn send_meshes(&self, assembly: &Assembly<'_>) -> Result<Handle, ClientError> {
        let fill = |out: &mut [u8]| assembly.encode_into(out);
        self.hand_over("upload", RequestKind::Upload, assembly.encoded_len(), fill)
    }

    /// Meshes travel through a port of their own, just as large as needed: its memory goes back to the
    /// system when the daemon has answered.
    fn hand_over(
        &self,
        what: &'static str,
        kind: RequestKind,
        length: usize,
        encode: impl Fn(&mut [u8]) -> bool,
    ) -> Result<Handle, ClientError> {
        check_shared_memory(length as u64)?;
        let mut header = Self::header(kind, 0);
        // Nobody reads what comes later.
        header.consumed = clock::deadline_in(self.options().upload_timeout);
        let fill = |out: &mut [u8]| {
            let fits = encode(out);
            debug_assert!(fits, "the port was made as long as the message");
        };
        let answer =
            self.ask(what, Through::Upload(length), header, length, fill, self.options().upload_timeout)?;
        let response: HandleResponse = Reader::new(answer.as_slice())?.value("handle")?;
        Ok(Handle(response.handle))
    }
}

/// Shared memory that runs full is a SIGBUS on touch, not an error. Another process may still
/// take what is free now; what is left of that risk is stated in `PROTOCOL.md`.
fn check_shared_memory(needed: u64) -> Result<(), ClientError> {
    let Ok(stat) = rustix::fs::statvfs("/dev/shm") else { return Ok(()) };
    let free = stat.f_bavail.saturating_mul(stat.f_frsize);
    // A file system without a limit reports no blocks at all.
    if stat.f_blocks > 0 && needed > free {
        return Err(ClientError::SharedMemory { needed, free });
    }
    Ok(())
}
