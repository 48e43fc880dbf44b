//! Revisions: changes of an assembly that the daemon knows.
//!
//! Sections: [`RevisionHeader`], [`PartRecord`] per part with a mesh, [`MovedPart`]s, texts, then per
//! part with a mesh its vertices and its triangles.

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, TextWriter, Texts, Writer};
use crate::geometry::{MAX_PARTS, Part, PartRecord, length_of, write_pieces};
use crate::plan::MovedPart;

/// Place of a part that replaces none.
pub const ADDED: u32 = u32::MAX;

/// Header of a revision.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct RevisionHeader {
    /// Handle of the assembly that is revised.
    pub base: [u8; 32],
    /// How many parts have a mesh: those that replace one, and those that are added.
    pub parts: u32,
    /// How many parts stand elsewhere.
    pub moved: u32,
    /// Bytes of text.
    pub text_bytes: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

const _: () = assert!(size_of::<RevisionHeader>() == 48 && align_of::<RevisionHeader>() <= 8);

/// Changes of a known assembly, to send or as received.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Revision<'a> {
    /// Handle of the assembly that is revised.
    pub base: [u8; 32],
    /// Parts with another mesh: their places, and the mesh. Names stay: the one given here is
    /// ignored.
    pub replaced: Vec<(u32, Part<'a>)>,
    /// Further parts; they get the places after all others.
    pub added: Vec<Part<'a>>,
    /// Parts that stand elsewhere.
    pub moved: Vec<MovedPart>,
}

impl<'a> Revision<'a> {
    fn parts(&self) -> impl Iterator<Item = (u32, &Part<'a>)> {
        let replaced = self.replaced.iter().map(|(place, part)| (*place, part));
        replaced.chain(self.added.iter().map(|part| (ADDED, part)))
    }

    /// Everything before the meshes.
    fn front(&self) -> Vec<u8> {
        let mut texts = TextWriter::default();
        let records: Vec<PartRecord> =
            self.parts().map(|(place, part)| part.record(place, &mut texts)).collect();
        let mut writer = Writer::default();
        writer.value(RevisionHeader {
            base: self.base,
            parts: records.len() as u32,
            moved: self.moved.len() as u32,
            text_bytes: texts.bytes().len() as u32,
            reserved: 0,
        });
        writer.array(&records).array(&self.moved).array(texts.bytes());
        writer.finish()
    }

    fn pieces(&self) -> impl Iterator<Item = &'a [u8]> + '_ {
        self.parts().flat_map(|(_, part)| part.pieces())
    }

    /// Bytes of the message.
    #[must_use]
    pub fn encoded_len(&self) -> usize {
        length_of(&self.front(), self.pieces())
    }

    /// Writes the message to the front of `out`; false if it does not fit.
    pub fn encode_into(&self, out: &mut [u8]) -> bool {
        write_pieces(&self.front(), self.pieces(), out)
    }

    /// Reads a revision. The meshes are borrowed from `bytes`, as those of an upload.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let header: RevisionHeader = reader.value("revision header")?;
        if header.parts > MAX_PARTS {
            return Err(Malformed::OutOfRange { field: "parts", value: u64::from(header.parts) });
        }
        let records: &[PartRecord] = reader.array("part records", u64::from(header.parts))?;
        let moved = reader.array("moved", u64::from(header.moved))?.to_vec();
        let texts = Texts(reader.array("texts", u64::from(header.text_bytes))?);
        let mut revision = Self { base: header.base, moved, ..Self::default() };
        for record in records {
            let part = Part::read(record, &texts, &mut reader)?;
            match record.place {
                ADDED => revision.added.push(part),
                place => revision.replaced.push((place, part)),
            }
        }
        Ok(revision)
    }
}
