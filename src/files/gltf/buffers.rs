//! The bytes that a scene refers to, and the numbers in them.

use std::fs;
use std::path::{Path, PathBuf};

use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;

/// All buffers of a document.
pub(super) struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    pub(super) fn read(
        document: &gltf::Document,
        mut blob: Option<Vec<u8>>,
        folder: &Path,
    ) -> Result<Self, String> {
        let read = |buffer: gltf::Buffer<'_>| {
            let data = match buffer.source() {
                Source::Bin => blob.take().ok_or_else(|| "missing binary portion of binary glTF".to_owned()),
                Source::Uri(uri) => read_uri(uri, folder),
            };
            let mut data = data.map_err(|e| format!("buffer {}: {e}", buffer.index()))?;
            // As the crate's own reader does it: announced lengths may be rounded up to whole words.
            data.resize(data.len().next_multiple_of(4), 0);
            if data.len() < buffer.length() {
                return Err(format!("buffer {} is truncated; export the scene again", buffer.index()));
            }
            Ok(data)
        };
        document.buffers().map(read).collect::<Result<_, String>>().map(Self)
    }

    /// Vectors of numbers. Integers are read as the fractions that they stand for if the accessor says so, and as they
    /// are otherwise (KHR_mesh_quantization).
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &gltf::Accessor<'_>,
    ) -> Result<Vec<[f64; N]>, String> {
        let dimensions = match N {
            3 => Dimensions::Vec3,
            _ => Dimensions::Vec4,
        };
        if accessor.dimensions() != dimensions {
            return Err(format!(
                "accessor {} has not vectors of {N} numbers; export the scene again",
                accessor.index()
            ));
        }
        let is_fraction = accessor.normalized();
        let scaled =
            |value: f64, greatest: f64| if is_fraction { (value / greatest).max(-1.0) } else { value };
        let size = accessor.data_type().size();
        let number = |b: &[u8]| match accessor.data_type() {
            DataType::I8 => scaled(f64::from(b[0] as i8), 127.0),
            DataType::U8 => scaled(f64::from(b[0]), 255.0),
            DataType::I16 => scaled(f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            DataType::U16 => scaled(f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            DataType::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            DataType::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        let vector = |b: &[u8]| std::array::from_fn(|i| number(&b[i * size..]));
        Ok(self.elements(accessor)?.map(vector).collect())
    }

    pub(super) fn indices(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<u32>, String> {
        let read: fn(&[u8]) -> u32 = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => |b| u32::from(b[0]),
            (DataType::U16, Dimensions::Scalar) => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            (DataType::U32, Dimensions::Scalar) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => return Err("its indices are not unsigned integers; export the scene again".into()),
        };
        Ok(self.elements(accessor)?.map(read).collect())
    }

    /// The bytes of each element of an accessor.
    fn elements(&self, accessor: &gltf::Accessor<'_>) -> Result<impl Iterator<Item = &[u8]>, String> {
        if accessor.sparse().is_some() {
            return Err("it uses sparse accessors, which are not supported; export without them".into());
        }
        let view = accessor
            .view()
            .ok_or("an accessor without data (a compressed mesh?); export without compression")?;
        let buffer: &[u8] = self.0.get(view.buffer().index()).map_or(&[], Vec::as_slice);
        let end = view.offset().checked_add(view.length());
        let bytes = end.and_then(|end| buffer.get(view.offset()..end));
        let bytes = bytes.and_then(|b| b.get(accessor.offset()..));
        let bytes =
            bytes.ok_or("truncated: an accessor reaches beyond its buffer; export the scene again")?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size).max(size);
        let available = if bytes.len() < size { 0 } else { (bytes.len() - size) / stride + 1 };
        if available < accessor.count() {
            return Err("truncated: an accessor reaches beyond its buffer; export the scene again".into());
        }
        Ok((0..accessor.count()).map(move |i| &bytes[i * stride..i * stride + size]))
    }
}

/// The data in a `data:` URI, or of the file that the URI names.
pub(super) fn read_uri(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    let path = match uri.split_once(':') {
        Some(("data", rest)) => {
            let data = rest.split(";base64,").nth(1).unwrap_or(rest);
            return BASE64.decode(data).map_err(|e| e.to_string());
        }
        Some(("file", rest)) => PathBuf::from(rest.strip_prefix("//").unwrap_or(rest)),
        Some(_) => return Err("unsupported URI scheme".into()),
        None => {
            let name =
                urlencoding::decode(uri).map_err(|_| format!("`{uri}`: rename it to ASCII characters"))?;
            folder.join(&*name)
        }
    };
    fs::read(path).map_err(|e| e.to_string())
}

/// Padding may be missing.
pub(super) const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);
