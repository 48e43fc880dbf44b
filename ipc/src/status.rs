//! The daemon's status.

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, Text, TextWriter, Texts, Writer};

/// Header of a status message; preloaded assemblies and texts follow.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct StatusHeader {
    /// The daemon's process id.
    pub pid: u32,
    /// Version of this protocol.
    pub protocol: u32,
    /// Nanoseconds since the daemon started.
    pub uptime_ns: u64,
    /// How many worker threads there are.
    pub workers: u32,
    /// Requests that a worker runs now.
    pub running: u32,
    /// Requests that wait.
    pub queued: u32,
    /// Requests that may wait.
    pub queue_limit: u32,
    /// Plan requests received since start.
    pub requests: u64,
    /// Plan requests answered with a plan.
    pub done: u64,
    /// Plan requests answered from memory (they also count as done).
    pub remembered: u64,
    /// Plan requests cancelled by the client.
    pub cancelled: u64,
    /// Plan requests that expired before planning began.
    pub expired: u64,
    /// Plan requests refused.
    pub refused: u64,
    /// Plan requests that failed.
    pub failed: u64,
    /// States, over all plans, whose blocking graphs were answered from memory.
    pub graphs_remembered: u64,
    /// Assemblies whose geometry was received (known ones are not sent again).
    pub uploads: u64,
    /// How many preloaded assemblies are listed.
    pub preloaded: u32,
    /// Bytes of text.
    pub text_bytes: u32,
    /// The daemon's version.
    pub version: Text,
}

/// A preloaded assembly.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PreloadRecord {
    /// Its handle.
    pub handle: [u8; 32],
    /// Its name.
    pub name: Text,
}

const _: () = assert!(size_of::<StatusHeader>() == 120 && size_of::<PreloadRecord>() == 40);

/// A status, owned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// The numbers.
    pub numbers: StatusHeader,
    /// The daemon's version.
    pub version: String,
    /// Preloaded assemblies: name and handle.
    pub preloaded: Vec<(String, [u8; 32])>,
}

impl Status {
    /// The message's bytes; fills the counts and text fields of the header itself.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut texts = TextWriter::default();
        let version = texts.add(&self.version);
        let records: Vec<PreloadRecord> = self
            .preloaded
            .iter()
            .map(|(name, handle)| PreloadRecord { handle: *handle, name: texts.add(name) })
            .collect();
        let header = StatusHeader {
            preloaded: records.len() as u32,
            text_bytes: texts.bytes().len() as u32,
            version,
            ..self.numbers
        };
        let mut writer = Writer::default();
        writer.value(header).array(&records).array(texts.bytes());
        writer.finish()
    }

    /// Reads a status.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let numbers: StatusHeader = reader.value("status header")?;
        let records: &[PreloadRecord] = reader.array("preloaded", u64::from(numbers.preloaded))?;
        let texts = Texts(reader.array("texts", u64::from(numbers.text_bytes))?);
        let version = texts.get(numbers.version, "version")?.to_owned();
        let preloaded = records
            .iter()
            .map(|r| Ok((texts.get(r.name, "preload name")?.to_owned(), r.handle)))
            .collect::<Result<_, Malformed>>()?;
        Ok(Self { numbers, version, preloaded })
    }
}
