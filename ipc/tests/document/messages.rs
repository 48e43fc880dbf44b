//! The sections of every message, in order. The samples hold them against what the crate writes.

use sbdp_ipc::bytes::padded;
use sbdp_ipc::geometry::{VERTICES_F32, VERTICES_F64};

use crate::layout::{Layouts, shown, value};
use crate::source::Kind;

/// A kind of message.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) name: &'static str,
    pub(crate) sections: Vec<Section>,
}

#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) name: &'static str,
    pub(crate) element: &'static str,
    pub(crate) count: Count,
}

/// How many elements a section has.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Count {
    One,
    /// A field of the header.
    Field(&'static str),
    /// The sum of the numbers in the section before.
    SumBefore,
    /// As far as the message goes.
    Rest,
    /// Vertices and triangles of one part after the other, as the part records say.
    Meshes,
}

/// A section of a message at hand: single values and rows of them.
#[derive(Debug)]
pub(crate) struct Found<'b> {
    pub(crate) name: String,
    pub(crate) element: Kind,
    pub(crate) count: usize,
    pub(crate) offset: usize,
    pub(crate) bytes: &'b [u8],
    /// Whether there is one element by definition: a header.
    pub(crate) single: bool,
}

/// All kinds, in the order of the document.
pub(crate) fn all() -> Vec<Message> {
    use Count::{Field, Meshes, One, Rest, SumBefore};
    let message = |name, sections: &[(&'static str, &'static str, Count)]| Message {
        name,
        sections: sections.iter().map(|&(name, element, count)| Section { name, element, count }).collect(),
    };
    vec![
        message(
            "Plan",
            &[
                ("header", "PlanRequestHeader", One),
                ("fixed", "u32", Field("fixed")),
                ("removed", "u32", Field("removed")),
                ("targets", "u32", Field("targets")),
                ("base", "u32", Field("base")),
                ("keep", "u32", Field("keep")),
                ("keep_out", "u32", Field("keep_out")),
                ("sizes of groups", "u32", Field("groups")),
                ("parts of groups", "u32", SumBefore),
                ("moved", "MovedPart", Field("moved")),
                ("staged", "MovedPart", Field("staged")),
                ("penalty", "PenaltyRecord", Field("penalty")),
            ],
        ),
        message("Have", &[("handle", "u8 × 32", One)]),
        message(
            "Upload",
            &[
                ("header", "UploadHeader", One),
                ("parts", "PartRecord", Field("parts")),
                ("fixed names", "Text", Field("fixed")),
                ("texts", "u8", Field("text_bytes")),
                ("meshes", "", Meshes),
            ],
        ),
        message(
            "Revise",
            &[
                ("header", "RevisionHeader", One),
                ("parts", "PartRecord", Field("parts")),
                ("moved", "MovedPart", Field("moved")),
                ("texts", "u8", Field("text_bytes")),
                ("meshes", "", Meshes),
            ],
        ),
        message(
            "Steps",
            &[
                ("header", "StepsHeader", One),
                ("steps", "StepRecord", Field("steps")),
                ("waypoints", "f64 × 7", Field("waypoints")),
                ("requirements", "u32", Field("requirements")),
                ("parts", "u32", Field("parts")),
            ],
        ),
        message(
            "Summary",
            &[
                ("header", "SummaryHeader", One),
                ("part names", "Text", Field("parts")),
                ("overlaps", "OverlapRecord", Field("overlaps")),
                ("blocked", "BlockedRecord", Field("blocked")),
                ("warnings", "WarningRecord", Field("warnings")),
                ("removed", "u32", Field("removed")),
                ("targets", "u32", Field("targets")),
                ("fixed", "u32", Field("fixed")),
                ("keep", "u32", Field("keep")),
                ("base", "u32", Field("base")),
                ("remaining", "u32", Field("remaining")),
                ("blockers", "u32", Field("blockers")),
                ("poses", "MovedPart", Field("poses")),
                ("kept together", "GroupRecord", Field("kept_together")),
                ("free together", "GroupRecord", Field("free_together")),
                ("parts of groups", "u32", Field("group_parts")),
                ("states", "StabilityRecord", Field("states")),
                ("unstable", "UnstableRecord", Field("unstable")),
                ("falls", "FallRecord", Field("falls")),
                ("holds", "HoldRecord", Field("holds")),
                ("clearances", "ClearanceRecord", Field("clearances")),
                ("fasteners", "FastenerRecord", Field("fasteners")),
                ("tools", "ToolRecord", Field("tools")),
                ("parts of the report", "u32", Field("report_parts")),
                ("texts", "u8", Field("text_bytes")),
            ],
        ),
        message("Error", &[("header", "ErrorHeader", One), ("text", "u8", Field("text_bytes"))]),
        message(
            "Status",
            &[
                ("header", "StatusHeader", One),
                ("preloaded", "PreloadRecord", Field("preloaded")),
                ("texts", "u8", Field("text_bytes")),
            ],
        ),
        message("Handle", &[("header", "HandleResponse", One)]),
        message("Metrics", &[("JSON", "u8", Rest)]),
        message("Trace", &[("lines of JSON", "u8", Rest)]),
    ]
}

pub(crate) fn of(name: &str) -> Message {
    all().into_iter().find(|m| m.name == name).unwrap_or_else(|| panic!("there is no message `{name}`"))
}

impl Message {
    /// The table of its sections.
    pub(crate) fn table(&self) -> String {
        let mut text = "| section | elements | how many |\n|---|---|---|\n".to_owned();
        for section in &self.sections {
            if let Count::Meshes = section.count {
                text += "| vertices of the first part | f32 × 3 or f64 × 3, as `vertex_kind` says | `vertices` of its record |\n";
                text += "| triangles of the first part | u32 × 3 | `triangles` of its record |\n";
                text += "| and so on for each part | | |\n";
                continue;
            }
            let count = match section.count {
                Count::Field(field) => format!("`{field}`"),
                Count::SumBefore => "the sum of the numbers in the section before".to_owned(),
                Count::Rest => "all bytes of the message".to_owned(),
                Count::One | Count::Meshes => "1".to_owned(),
            };
            text += &format!("| {} | {} | {count} |\n", section.name, shown(&kind(section.element)));
        }
        text
    }

    /// The sections of a message at hand.
    ///
    /// # Panics
    /// They do not fill it exactly.
    pub(crate) fn walk<'b>(&self, layouts: &Layouts<'_>, bytes: &'b [u8]) -> Vec<Found<'b>> {
        let header = self.sections[0].element;
        let mut found: Vec<Found<'b>> = Vec::new();
        let mut at = 0;
        let mut take = |found: &mut Vec<Found<'b>>, name: String, element: Kind, count: usize, single| {
            let end = at + layouts.size(&element) * count;
            found.push(Found { name, element, count, offset: at, bytes: &bytes[at..end], single });
            at = (padded(end as u64) as usize).min(bytes.len());
        };
        for section in &self.sections {
            let (name, element) = (section.name.to_owned(), section.element);
            match section.count {
                Count::One => take(&mut found, name, kind(element), 1, true),
                Count::Field(field) => {
                    let count = layouts.number(header, field, bytes);
                    take(&mut found, name, kind(element), count, false);
                }
                Count::SumBefore => {
                    let before: &[u8] = found.last().map_or(&[], |f| f.bytes);
                    let sum = before.chunks(4).map(|b| bytemuck::pod_read_unaligned::<u32>(b) as usize).sum();
                    take(&mut found, name, kind(element), sum, false);
                }
                Count::Rest => take(&mut found, name, kind(element), bytes.len(), false),
                Count::Meshes => {
                    let records = found.iter().find(|f| f.name == "parts").unwrap();
                    let size = layouts.size(&records.element);
                    let records: Vec<&[u8]> = records.bytes.chunks(size).collect();
                    for (part, record) in records.into_iter().enumerate() {
                        let number = |field| layouts.number("PartRecord", field, record);
                        let vertex = match number("vertex_kind") as u32 {
                            VERTICES_F64 => "f64 × 3",
                            VERTICES_F32 => "f32 × 3",
                            other => panic!("vertex kind {other}"),
                        };
                        let (vertices, triangles) = (number("vertices"), number("triangles"));
                        take(&mut found, format!("vertices of part {part}"), kind(vertex), vertices, false);
                        take(
                            &mut found,
                            format!("triangles of part {part}"),
                            kind("u32 × 3"),
                            triangles,
                            false,
                        );
                    }
                }
            }
        }
        assert_eq!(at, bytes.len(), "the sections of `{}` fill the message", self.name);
        found
    }
}

/// A type from how the tables write it.
pub(crate) fn kind(text: &str) -> Kind {
    match text.split_once(" × ") {
        Some((element, count)) => Kind::Array(Box::new(kind(element)), count.parse().unwrap()),
        None => Kind::Named(text.to_owned()),
    }
}

/// Longest line of bytes in a dump.
const LONGEST: usize = 32;

/// A message as lines: where, the bytes, and what they are.
pub(crate) fn dump(layouts: &Layouts<'_>, message: &Message, bytes: &[u8]) -> String {
    let mut text = String::new();
    let mut end = 0;
    for found in message.walk(layouts, bytes) {
        text += &padding(bytes, end, found.offset);
        end = found.offset + found.bytes.len();
        if found.element == kind("u8") {
            text += &lines_of_text(&found);
            continue;
        }
        let size = layouts.size(&found.element);
        for index in 0..found.count {
            let name = if found.single { found.name.clone() } else { format!("{}[{index}]", found.name) };
            for place in layouts.places(&name, &found.element, found.offset + index * size) {
                let bytes = &bytes[place.offset..place.offset + layouts.size(&place.kind)];
                text += &lines_of_value(&place.name, &place.kind, place.offset, bytes);
            }
        }
    }
    text + &padding(bytes, end, bytes.len())
}

/// A user header as lines.
pub(crate) fn dump_header(layouts: &Layouts<'_>, name: &str, bytes: &[u8]) -> String {
    let places = layouts.places("", &kind(name), 0);
    let lines = places.iter().map(|place| {
        let bytes = &bytes[place.offset..place.offset + layouts.size(&place.kind)];
        lines_of_value(&place.name, &place.kind, place.offset, bytes)
    });
    lines.collect()
}

fn line(offset: usize, bytes: &[u8], what: &str) -> String {
    let hexadecimal: String = bytes.iter().map(|b| format!("{b:02x}")).collect();
    format!("{offset:>5}  {hexadecimal}  {what}\n")
}

fn lines_of_value(name: &str, of: &Kind, offset: usize, bytes: &[u8]) -> String {
    match of {
        Kind::Array(element, count) if bytes.len() > LONGEST => {
            let size = bytes.len() / count;
            let lines = bytes.chunks(size).enumerate();
            lines
                .map(|(i, b)| lines_of_value(&format!("{name}[{i}]"), element, offset + i * size, b))
                .collect()
        }
        of => line(offset, bytes, &format!("{name} = {}", value(of, bytes))),
    }
}

fn lines_of_text(found: &Found<'_>) -> String {
    let pieces = found.bytes.chunks(LONGEST).enumerate();
    let lines = pieces.map(|(i, bytes)| {
        let text = std::str::from_utf8(bytes).unwrap();
        line(found.offset + i * LONGEST, bytes, &format!("{} = {text:?}", found.name))
    });
    lines.collect()
}

fn padding(bytes: &[u8], from: usize, to: usize) -> String {
    if from == to { String::new() } else { line(from, &bytes[from..to], "padding") }
}
