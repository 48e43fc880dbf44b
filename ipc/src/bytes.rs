//! Reading and writing flat little-endian messages.
//!
//! A message is a header and arrays of plain fixed-width values, each section aligned to 8.
//! The layout is that of little-endian machines; others are refused at compile time.

use bytemuck::Pod;

#[cfg(not(target_endian = "little"))]
compile_error!("the wire format is little-endian and read in place");

/// Alignment of every section. Never 16: see the alignment pitfall in `PROTOCOL.md`.
pub const ALIGNMENT: usize = 8;

/// Why a message cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The message ends before something it announces.
    #[error("the message is truncated: `{section}` ends at byte {needed}, the message at {length}")]
    Truncated {
        /// What was read.
        section: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes there.
        length: u64,
    },
    /// The buffer is not aligned to [`ALIGNMENT`].
    #[error("the message is not aligned to 8 bytes")]
    Misaligned,
    /// A number is outside its range.
    #[error("`{field}` has the illegal value {value}")]
    OutOfRange {
        /// Which field.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// A text is not UTF-8.
    #[error("`{field}` is not valid UTF-8")]
    NotText {
        /// Which field.
        field: &'static str,
    },
}

/// Rounds up to the next multiple of [`ALIGNMENT`]; saturates at the end of the number range.
#[must_use]
pub const fn padded(length: u64) -> u64 {
    match length.checked_add(7) {
        Some(sum) => sum & !7,
        None => u64::MAX,
    }
}

/// Reads sections one after the other out of a message.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Reader<'a> {
    /// Starts at the beginning.
    ///
    /// # Errors
    /// The buffer is not aligned.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Malformed> {
        if !bytes.as_ptr().addr().is_multiple_of(ALIGNMENT) {
            return Err(Malformed::Misaligned);
        }
        Ok(Self { bytes, position: 0 })
    }

    /// An array in place; skips the padding behind it.
    ///
    /// # Errors
    /// The message is too short.
    pub fn array<T: Pod>(&mut self, section: &'static str, count: u64) -> Result<&'a [T], Malformed> {
        let size = size_of::<T>() as u64;
        let length = self.bytes.len() as u64;
        let start = self.position as u64;
        let end = count.checked_mul(size).and_then(|n| n.checked_add(start)).unwrap_or(u64::MAX);
        if end > length {
            return Err(Malformed::Truncated { section, needed: end, length });
        }
        let slice = &self.bytes[self.position..end as usize];
        self.position = padded(end).min(length) as usize;
        bytemuck::try_cast_slice(slice).map_err(|_| Malformed::Misaligned)
    }

    /// A copy of one value.
    ///
    /// # Errors
    /// The message is too short.
    pub fn value<T: Pod>(&mut self, section: &'static str) -> Result<T, Malformed> {
        let one = self.array::<T>(section, 1)?;
        one.first().copied().ok_or(Malformed::Misaligned)
    }
}

/// Writes sections one after the other.
#[derive(Debug, Default)]
pub struct Writer {
    buffer: Vec<u8>,
}

impl Writer {
    /// Appends an array and pads it to [`ALIGNMENT`].
    pub fn array<T: Pod>(&mut self, values: &[T]) -> &mut Self {
        self.buffer.extend_from_slice(bytemuck::cast_slice(values));
        self.buffer.resize(padded(self.buffer.len() as u64) as usize, 0);
        self
    }

    /// Appends one value.
    pub fn value<T: Pod>(&mut self, value: T) -> &mut Self {
        self.array(&[value])
    }

    /// The message.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        self.buffer
    }
}

/// A byte buffer whose start is aligned to [`ALIGNMENT`], so that views can be made over it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AlignedBytes {
    words: Vec<u64>,
    length: usize,
}

impl AlignedBytes {
    /// A buffer of zeros.
    #[must_use]
    pub fn zeroed(length: usize) -> Self {
        Self { words: vec![0; length.div_ceil(8)], length }
    }

    /// A copy.
    #[must_use]
    pub fn copy_of(bytes: &[u8]) -> Self {
        let mut this = Self::zeroed(bytes.len());
        this.as_mut_slice().copy_from_slice(bytes);
        this
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }

    /// The bytes, writable.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.length]
    }
}

/// A text: a range of the message's text section.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Text {
    /// Its first byte, counted from the beginning of the text section.
    pub offset: u32,
    /// How many bytes it has.
    pub length: u32,
}

const _: () = assert!(size_of::<Text>() == 8 && align_of::<Text>() == 4);

/// Collects the texts of a message.
#[derive(Debug, Default)]
pub struct TextWriter {
    bytes: Vec<u8>,
}

impl TextWriter {
    /// Appends a text. Texts beyond 4 GiB in all are cut: no message may be that long anyway.
    pub fn add(&mut self, text: &str) -> Text {
        let room = (u32::MAX as usize).saturating_sub(self.bytes.len());
        let text = if text.len() <= room { text } else { "" };
        let range = Text { offset: self.bytes.len() as u32, length: text.len() as u32 };
        self.bytes.extend_from_slice(text.as_bytes());
        range
    }

    /// The text section.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

/// The text section of a received message.
#[derive(Debug, Clone, Copy)]
pub struct Texts<'a>(pub &'a [u8]);

impl<'a> Texts<'a> {
    /// A checked text.
    ///
    /// # Errors
    /// The range is outside the section, or not UTF-8.
    pub fn get(&self, text: Text, field: &'static str) -> Result<&'a str, Malformed> {
        let start = text.offset as usize;
        let end = start + text.length as usize;
        let range = self.0.get(start..end).ok_or(Malformed::Truncated {
            section: field,
            needed: end as u64,
            length: self.0.len() as u64,
        })?;
        std::str::from_utf8(range).map_err(|_| Malformed::NotText { field })
    }

    /// A text that was checked before; empty if the sender has changed it since.
    #[must_use]
    pub fn get_checked(&self, text: Text) -> &'a str {
        self.get(text, "text").unwrap_or("")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_read_back_in_order() {
        let mut writer = Writer::default();
        writer.value(7_u32).array(&[1.5_f64, 2.5]).array::<u32>(&[1, 2, 3]);
        let bytes = AlignedBytes::copy_of(&writer.finish());
        let mut reader = Reader::new(bytes.as_slice()).unwrap();
        assert_eq!(reader.value::<u32>("a").unwrap(), 7);
        assert_eq!(reader.array::<f64>("b", 2).unwrap(), &[1.5, 2.5]);
        assert_eq!(reader.array::<u32>("c", 3).unwrap(), &[1, 2, 3]);
        assert!(matches!(reader.array::<u64>("d", u64::MAX), Err(Malformed::Truncated { .. })));
    }

    #[test]
    fn a_misaligned_buffer_is_refused() {
        let bytes = AlignedBytes::zeroed(32);
        assert_eq!(Reader::new(&bytes.as_slice()[1..]).unwrap_err(), Malformed::Misaligned);
    }
}
