//! Where the fields of the structs stand, and the values in bytes.

use std::collections::BTreeMap;

use sbdp_ipc::summary::report;
use sbdp_ipc::{bytes, error, geometry, headers, plan, progress, revision, status, summary};

use crate::source::{Kind, Source, Struct};

/// A field that is no struct itself: `stats.plan_hit` of a summary header.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) offset: usize,
}

/// Sizes and alignments of the structs, as the compiler has them.
#[derive(Debug)]
pub(crate) struct Layouts<'s> {
    source: &'s Source,
    compiled: BTreeMap<&'static str, (usize, usize)>,
}

macro_rules! compiled {
    ($($module:ident::$name:ident),* $(,)?) => {
        BTreeMap::from([$((
            stringify!($name),
            { is_plain::<$module::$name>(); (size_of::<$module::$name>(), align_of::<$module::$name>()) },
        )),*])
    };
}

/// Without padding, so that each field begins where the one before it ends.
fn is_plain<T: bytemuck::Pod>() {}

impl<'s> Layouts<'s> {
    pub(crate) fn new(source: &'s Source) -> Self {
        let compiled = compiled![
            bytes::Text,
            error::ErrorHeader,
            geometry::HandleResponse,
            geometry::PartRecord,
            geometry::UploadHeader,
            headers::RequestHeader,
            headers::ResponseHeader,
            plan::MovedPart,
            plan::PenaltyRecord,
            plan::PlanRequestHeader,
            plan::StepRecord,
            plan::StepsHeader,
            progress::ProgressSample,
            report::ClearanceRecord,
            report::FallRecord,
            report::FastenerRecord,
            report::HoldRecord,
            report::StabilityRecord,
            report::ToolRecord,
            report::UnstableRecord,
            revision::RevisionHeader,
            status::PreloadRecord,
            status::StatusHeader,
            summary::BlockedRecord,
            summary::GroupRecord,
            summary::OverlapRecord,
            summary::Stats,
            summary::SummaryHeader,
            summary::WarningRecord,
        ];
        let layouts = Self { source, compiled };
        for (name, found) in &source.structs {
            let Some((size, _)) = layouts.compiled.get(name.as_str()) else {
                panic!(
                    "`{name}` is new: add it to the list in ipc/tests/document/layout.rs, and its table to PROTOCOL.md"
                )
            };
            let sum: usize = found.fields.iter().map(|field| layouts.size(&field.kind)).sum();
            assert_eq!(sum, *size, "size of `{name}`");
        }
        layouts
    }

    pub(crate) fn of(&self, name: &str) -> &'s Struct {
        self.source.structs.get(name).unwrap_or_else(|| panic!("there is no struct `{name}`"))
    }

    pub(crate) fn size(&self, kind: &Kind) -> usize {
        match kind {
            Kind::Array(element, count) => self.size(element) * count,
            Kind::Named(name) => match name.as_str() {
                "u8" => 1,
                "u32" | "f32" => 4,
                "u64" | "f64" => 8,
                name => self.compiled.get(name).unwrap_or_else(|| panic!("there is no type `{name}`")).0,
            },
        }
    }

    /// The places in a value at an offset, structs taken apart.
    pub(crate) fn places(&self, name: &str, kind: &Kind, offset: usize) -> Vec<Place> {
        match kind {
            Kind::Named(of) if self.source.structs.contains_key(of) => {
                let mut at = offset;
                let mut places = Vec::new();
                for field in &self.of(of).fields {
                    let name =
                        if name.is_empty() { field.name.clone() } else { format!("{name}.{}", field.name) };
                    places.extend(self.places(&name, &field.kind, at));
                    at += self.size(&field.kind);
                }
                places
            }
            kind => vec![Place { name: name.to_owned(), kind: kind.clone(), offset }],
        }
    }

    /// A number of a header.
    pub(crate) fn number(&self, header: &str, field: &str, bytes: &[u8]) -> usize {
        let places = self.places("", &Kind::Named(header.to_owned()), 0);
        let place = places.iter().find(|p| p.name == field);
        let place = place.unwrap_or_else(|| panic!("`{header}` has no field `{field}`"));
        let end = place.offset + self.size(&place.kind);
        value(&place.kind, &bytes[place.offset..end]).parse().unwrap()
    }

    /// The table of a struct.
    pub(crate) fn table(&self, name: &str) -> String {
        let found = self.of(name);
        let (size, align) = self.compiled[name];
        let mut text = format!("`{name}`: {size} bytes, aligned to {align}");
        if let Some(type_name) = &found.type_name {
            text += &format!(", for iceoryx2 the type `{type_name}`");
        }
        text += &format!(". {}\n\n", found.comment);
        text += "| offset | size | type | field | meaning |\n|---:|---:|---|---|---|\n";
        let mut offset = 0;
        for field in &found.fields {
            let size = self.size(&field.kind);
            text += &format!(
                "| {offset} | {size} | {} | `{}` | {} |\n",
                shown(&field.kind),
                field.name,
                field.comment
            );
            offset += size;
        }
        text
    }
}

/// A type as the tables write it.
pub(crate) fn shown(kind: &Kind) -> String {
    match kind {
        Kind::Named(name) if name.starts_with(char::is_uppercase) => format!("`{name}`"),
        Kind::Named(name) => name.clone(),
        Kind::Array(element, count) => format!("{} × {count}", shown(element)),
    }
}

/// A value in JSON; bytes in hexadecimal.
pub(crate) fn value(kind: &Kind, bytes: &[u8]) -> String {
    match kind {
        Kind::Named(name) => match name.as_str() {
            "u32" => bytemuck::pod_read_unaligned::<u32>(bytes).to_string(),
            "u64" => bytemuck::pod_read_unaligned::<u64>(bytes).to_string(),
            "f32" => format!("{:?}", bytemuck::pod_read_unaligned::<f32>(bytes)),
            "f64" => format!("{:?}", bytemuck::pod_read_unaligned::<f64>(bytes)),
            name => panic!("`{name}` is no number"),
        },
        Kind::Array(element, _) if **element == Kind::Named("u8".to_owned()) => {
            let hexadecimal: String = bytes.iter().map(|b| format!("{b:02x}")).collect();
            format!("\"{hexadecimal}\"")
        }
        Kind::Array(element, count) => {
            let values: Vec<_> = bytes.chunks(bytes.len() / count).map(|b| value(element, b)).collect();
            format!("[{}]", values.join(", "))
        }
    }
}
