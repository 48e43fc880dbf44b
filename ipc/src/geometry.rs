//! Uploads: an assembly's meshes on the wire.
//!
//! Sections: [`UploadHeader`], [`PartRecord`] per part, names of fixed parts ([`Text`]), texts,
//! then per part its vertices and its triangles.

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, Text, TextWriter, Texts, padded};

/// The unit of length is known.
pub const UPLOAD_HAS_UNITS: u32 = 1;
/// The part's vertices are f64.
pub const VERTICES_F64: u32 = 0;
/// The part's vertices are f32.
pub const VERTICES_F32: u32 = 1;
/// More parts than this are refused before anything else is read.
pub const MAX_PARTS: u32 = 65_536;

/// Header of an upload.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct UploadHeader {
    /// How many parts there are.
    pub parts: u32,
    /// How many names of parts that may not move there are.
    pub fixed: u32,
    /// [`UPLOAD_HAS_UNITS`], or 0.
    pub flags: u32,
    /// Bytes of text.
    pub text_bytes: u32,
    /// A name for display; not part of the content.
    pub name: Text,
    /// The unit of length, as `mm`; ignored without [`UPLOAD_HAS_UNITS`].
    pub units: Text,
}

/// Header of a part.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct PartRecord {
    /// Its name, unique in the assembly.
    pub name: Text,
    /// [`VERTICES_F64`] or [`VERTICES_F32`].
    pub vertex_kind: u32,
    /// In revisions the place of the part that it replaces, or [`ADDED`](crate::revision::ADDED); in
    /// uploads 0.
    pub place: u32,
    /// How many vertices it has.
    pub vertices: u64,
    /// How many triangles it has.
    pub triangles: u64,
}

const _: () = assert!(size_of::<UploadHeader>() == 32 && size_of::<PartRecord>() == 32);

/// Vertex positions in the user's units and frame, at the assembled pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Vertices<'a> {
    /// Double precision.
    F64(&'a [[f64; 3]]),
    /// Single precision.
    F32(&'a [[f32; 3]]),
}

impl<'a> Vertices<'a> {
    /// How many.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F64(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All of them in double precision.
    pub fn iter(self) -> impl Iterator<Item = [f64; 3]> + 'a {
        let (wide, narrow): (&[[f64; 3]], &[[f32; 3]]) = match self {
            Self::F64(v) => (v, &[]),
            Self::F32(v) => (&[], v),
        };
        wide.iter().copied().chain(narrow.iter().map(|v| v.map(f64::from)))
    }

    fn bytes(&self) -> &'a [u8] {
        match self {
            Self::F64(v) => bytemuck::cast_slice(v),
            Self::F32(v) => bytemuck::cast_slice(v),
        }
    }
}

/// A part to upload, or as received.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part<'a> {
    /// Its name, unique in the assembly.
    pub name: &'a str,
    /// Vertex positions.
    pub vertices: Vertices<'a>,
    /// Vertex indices, counter-clockwise from outside.
    pub triangles: &'a [[u32; 3]],
}

impl<'a> Part<'a> {
    /// Its header, with its name among the texts.
    pub(crate) fn record(&self, place: u32, texts: &mut TextWriter) -> PartRecord {
        PartRecord {
            name: texts.add(self.name),
            vertex_kind: if matches!(self.vertices, Vertices::F64(_)) { VERTICES_F64 } else { VERTICES_F32 },
            place,
            vertices: self.vertices.len() as u64,
            triangles: self.triangles.len() as u64,
        }
    }

    /// Its mesh on the wire, in two pieces.
    pub(crate) fn pieces(&self) -> [&'a [u8]; 2] {
        [self.vertices.bytes(), bytemuck::cast_slice(self.triangles)]
    }

    /// Reads a part; the reader stands at its mesh.
    pub(crate) fn read(
        record: &PartRecord,
        texts: &Texts<'a>,
        reader: &mut Reader<'a>,
    ) -> Result<Self, Malformed> {
        Ok(Self {
            name: texts.get(record.name, "part name")?,
            vertices: read_vertices(reader, record)?,
            triangles: reader.array("triangles", record.triangles)?,
        })
    }
}

/// Bytes of a message with a front and further pieces, each padded to 8 bytes.
pub(crate) fn length_of<'p>(front: &[u8], pieces: impl Iterator<Item = &'p [u8]>) -> usize {
    front.len() + pieces.map(|p| padded(p.len() as u64) as usize).sum::<usize>()
}

/// Writes such a message to the front of `out`; false if it does not fit.
pub(crate) fn write_pieces<'p>(
    front: &'p [u8],
    pieces: impl Iterator<Item = &'p [u8]>,
    out: &mut [u8],
) -> bool {
    let mut position = 0;
    for piece in std::iter::once(front).chain(pieces) {
        let Some(target) = out.get_mut(position..position + piece.len()) else { return false };
        target.copy_from_slice(piece);
        position = padded((position + piece.len()) as u64) as usize;
    }
    position <= out.len()
}

/// An assembly to upload, or as received.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Assembly<'a> {
    /// A name for display; not part of the content.
    pub name: &'a str,
    /// The unit of length, if known (`mm`).
    pub units: Option<&'a str>,
    /// The parts; part numbers in requests and plans are places in this list.
    pub parts: Vec<Part<'a>>,
    /// Names of parts that may not move.
    pub fixed: Vec<&'a str>,
}

impl<'a> Assembly<'a> {
    /// Everything before the meshes.
    fn front(&self) -> Vec<u8> {
        let mut texts = TextWriter::default();
        let records: Vec<PartRecord> = self.parts.iter().map(|part| part.record(0, &mut texts)).collect();
        let fixed: Vec<Text> = self.fixed.iter().map(|n| texts.add(n)).collect();
        let header = UploadHeader {
            parts: records.len() as u32,
            fixed: fixed.len() as u32,
            flags: if self.units.is_some() { UPLOAD_HAS_UNITS } else { 0 },
            name: texts.add(self.name),
            units: texts.add(self.units.unwrap_or("")),
            text_bytes: texts.bytes().len() as u32,
        };
        let mut writer = crate::bytes::Writer::default();
        writer.value(header).array(&records).array(&fixed).array(texts.bytes());
        writer.finish()
    }

    /// The pieces of the message in order; each is padded to 8 bytes when written.
    fn pieces(&self) -> impl Iterator<Item = &'a [u8]> + '_ {
        self.parts.iter().flat_map(Part::pieces)
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

    /// Reads an upload. The meshes are borrowed from `bytes`: pass a private copy if the sender
    /// is not trusted to leave them alone.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let header: UploadHeader = reader.value("upload header")?;
        if header.parts > MAX_PARTS {
            return Err(Malformed::OutOfRange { field: "parts", value: u64::from(header.parts) });
        }
        let records: &[PartRecord] = reader.array("part records", u64::from(header.parts))?;
        let fixed: &[Text] = reader.array("fixed names", u64::from(header.fixed))?;
        let texts = Texts(reader.array("texts", u64::from(header.text_bytes))?);
        let mut parts = Vec::with_capacity(records.len());
        for record in records {
            parts.push(Part::read(record, &texts, &mut reader)?);
        }
        let units = texts.get(header.units, "units")?;
        Ok(Self {
            name: texts.get(header.name, "name")?,
            units: (header.flags & UPLOAD_HAS_UNITS != 0).then_some(units),
            parts,
            fixed: fixed.iter().map(|t| texts.get(*t, "fixed name")).collect::<Result<_, _>>()?,
        })
    }
}

fn read_vertices<'a>(reader: &mut Reader<'a>, record: &PartRecord) -> Result<Vertices<'a>, Malformed> {
    match record.vertex_kind {
        VERTICES_F64 => Ok(Vertices::F64(reader.array("vertices", record.vertices)?)),
        VERTICES_F32 => Ok(Vertices::F32(reader.array("vertices", record.vertices)?)),
        kind => Err(Malformed::OutOfRange { field: "vertex_kind", value: u64::from(kind) }),
    }
}

/// The answer to `Have`, `Upload` and `Revise`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct HandleResponse {
    /// Handle of the assembly.
    pub handle: [u8; 32],
    /// 1 if the daemon knows the assembly, else 0.
    pub known: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

const _: () = assert!(size_of::<HandleResponse>() == 40);
