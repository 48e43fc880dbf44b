//! One model of a 3MF file: its objects, and what its build says of them. By the crate `quick-xml`, since what is not
//! read must be seen: crates for 3MF skip elements that they do not know without a word.

use std::collections::BTreeMap;

use nalgebra::Matrix4;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{PrefixDeclaration, ResolveResult};
use quick_xml::{NsReader, XmlVersion};

use super::super::text::{excerpt, printable};
use super::super::units::known_unit;
use super::AGAIN;
use crate::geometry::SourceMesh;

/// The namespaces of the standard begin so.
const SPACES: [&str; 2] =
    ["http://schemas.microsoft.com/3dmanufacturing/", "http://schemas.3mf.io/3dmanufacturing/"];
/// Parts of the standard that are read or leave geometry alone. A slice is of the same geometry.
const HARMLESS: [&str; 5] = ["core/", "production/", "material/", "slice/", "trianglesets/"];

/// A model.
#[derive(Debug, Default)]
pub(super) struct Model {
    /// Its unit of length.
    pub(super) unit: String,
    /// By number.
    pub(super) objects: BTreeMap<u32, Object>,
    /// What is built.
    pub(super) items: Vec<Reference>,
    /// What was skipped.
    pub(super) notes: Vec<String>,
}

/// Something that may be built.
#[derive(Debug, Default)]
pub(super) struct Object {
    /// Its name, or its part number; may be empty.
    pub(super) name: String,
    /// Whether it only carries others while they are printed.
    pub(super) is_support: bool,
    pub(super) mesh: SourceMesh,
    pub(super) components: Vec<Reference>,
}

/// An object at a place.
#[derive(Debug)]
pub(super) struct Reference {
    /// The object's number.
    pub(super) object: u32,
    /// The model that holds it, if that is another.
    pub(super) model: Option<String>,
    pub(super) pose: Matrix4<f64>,
}

/// Reads a model.
///
/// # Errors
/// What is wrong, with its line.
pub(super) fn parse(text: &str) -> Result<Model, String> {
    let mut reader = NsReader::from_str(text);
    let mut model = Model { unit: "mm".into(), ..Model::default() };
    let mut skipped: BTreeMap<String, usize> = BTreeMap::new();
    let mut current: Option<u32> = None;
    loop {
        let line = |at: u64| 1 + text.as_bytes().iter().take(at as usize).filter(|b| **b == b'\n').count();
        let at = reader.buffer_position();
        let (space, event) =
            reader.read_resolved_event().map_err(|e| format!("line {}: {e}; {AGAIN}", line(at)))?;
        // Without a namespace, as some programs write it.
        let is_core = match &space {
            ResolveResult::Bound(space) => is_of(space.as_ref(), "core/"),
            ResolveResult::Unbound => true,
            ResolveResult::Unknown(_) => false,
        };
        let is_harmless = matches!(&space, ResolveResult::Bound(space) if HARMLESS.iter().any(|h| is_of(space.as_ref(), h)));
        match event {
            Event::Eof => break,
            Event::End(end) if is_core && end.local_name().as_ref() == "object" => current = None,
            Event::Start(element) if !is_core => {
                note_skipped(&mut skipped, &element, is_harmless);
                reader.read_to_end(element.name()).map_err(|e| format!("line {}: {e}; {AGAIN}", line(at)))?;
            }
            Event::Empty(element) if !is_core => note_skipped(&mut skipped, &element, is_harmless),
            Event::Start(element) | Event::Empty(element) => {
                let known = read(&element, &mut model, &mut current)
                    .map_err(|e| format!("line {}: {e}; {AGAIN}", line(at)))?;
                if !known {
                    note_skipped(&mut skipped, &element, false);
                }
            }
            _ => {}
        }
    }
    let elements = |(name, count): (String, usize)| match count {
        1 => format!("`{name}` skipped: it is not read here"),
        _ => format!("{count} of `{name}` skipped: they are not read here"),
    };
    model.notes.extend(skipped.into_iter().map(elements));
    Ok(model)
}

fn is_of(space: &str, part: &str) -> bool {
    SPACES.iter().any(|start| space.strip_prefix(start).is_some_and(|rest| rest.starts_with(part)))
}

fn note_skipped(skipped: &mut BTreeMap<String, usize>, element: &BytesStart<'_>, is_harmless: bool) {
    if !is_harmless {
        *skipped.entry(excerpt(element.name().as_ref())).or_default() += 1;
    }
}

/// Reads an element of the core; whether it is one.
fn read(element: &BytesStart<'_>, model: &mut Model, current: &mut Option<u32>) -> Result<bool, String> {
    let local = element.local_name();
    let local = local.as_ref();
    let open = current.and_then(|number| model.objects.get_mut(&number));
    match (local, open) {
        ("vertex", Some(object)) => {
            let [x, y, z] = numbers(element, ["x", "y", "z"])?;
            object.mesh.vertices.push([x, y, z]);
        }
        ("triangle", Some(object)) => {
            let corners = numbers::<u32, 3>(element, ["v1", "v2", "v3"])?;
            let count = object.mesh.vertices.len();
            if let Some(corner) = corners.iter().find(|c| **c as usize >= count) {
                return Err(format!("vertex {corner} does not exist, there are {count}"));
            }
            object.mesh.triangles.push(corners);
        }
        ("component", Some(object)) => object.components.push(reference(element)?),
        ("vertex" | "triangle" | "component", None) => return Err(format!("`{local}` stands in no object")),
        ("item", _) => model.items.push(reference(element)?),
        ("object", _) => {
            let [number] = numbers(element, ["id"])?;
            let name = attribute(element, "name")?.filter(|name| !name.trim().is_empty());
            let name = name.map_or_else(|| attribute(element, "partnumber"), |name| Ok(Some(name)))?;
            let is_support = attribute(element, "type")?.is_some_and(|t| t.ends_with("support"));
            let object = Object { name: name.unwrap_or_default(), is_support, ..Object::default() };
            if model.objects.insert(number, object).is_some() {
                return Err(format!("object {number} stands there twice"));
            }
            *current = Some(number);
        }
        ("model", _) => {
            if let Some(word) = attribute(element, "unit")? {
                let unit =
                    known_unit(&word).ok_or_else(|| format!("its unit `{}` is not known", excerpt(&word)))?;
                model.unit = unit.into();
            }
            check_required(element)?;
        }
        _ => {
            return Ok([
                "resources",
                "build",
                "mesh",
                "vertices",
                "triangles",
                "components",
                "metadata",
                "metadatagroup",
                "basematerials",
                "base",
            ]
            .contains(&local));
        }
    }
    Ok(true)
}

/// Checks that all required extensions are read or leave geometry alone.
fn check_required(element: &BytesStart<'_>) -> Result<(), String> {
    let required = attribute(element, "requiredextensions")?.unwrap_or_default();
    for prefix in required.split_ascii_whitespace() {
        let mut space = None;
        for found in element.attributes().flatten() {
            if found.key.as_namespace_binding() == Some(PrefixDeclaration::Named(prefix)) {
                space = Some(value(&found)?);
            }
        }
        let is_harmless = space.as_ref().is_some_and(|space| HARMLESS.iter().any(|h| is_of(space, h)));
        if !is_harmless {
            let name = printable(space.as_deref().unwrap_or(prefix));
            return Err(format!("it requires the extension `{name}`, which is not read: save it without"));
        }
    }
    Ok(())
}

fn reference(element: &BytesStart<'_>) -> Result<Reference, String> {
    let [object] = numbers(element, ["objectid"])?;
    let mut model = None;
    for found in element.attributes().flatten() {
        // The prefix is the file's choice; no other attribute of these elements is called so.
        if found.key.local_name().as_ref() == "path" && found.key.prefix().is_some() {
            model = Some(value(&found)?.into_owned());
        }
    }
    let pose = match attribute(element, "transform")? {
        None => Matrix4::identity(),
        Some(text) => {
            let numbers: Vec<f64> =
                text.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
            let rows = <[f64; 12]>::try_from(numbers)
                .map_err(|_| format!("a transform needs twelve numbers, found `{}`", excerpt(&text)))?;
            // Four rows of three, to be multiplied from the left: columns here.
            let at = |row: usize, column: usize| match row {
                3 => f64::from(column == 3),
                _ => rows[3 * column + row],
            };
            Matrix4::from_fn(at)
        }
    };
    Ok(Reference { object, model, pose })
}

fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
    element: &BytesStart<'_>,
    names: [&str; N],
) -> Result<[T; N], String> {
    let mut found = [None; N];
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|e| e.to_string())?;
        if let Some(place) = names.iter().position(|name| *name == attribute.key.as_ref()) {
            found[place] = value(&attribute)?.trim().parse().ok();
        }
    }
    let mut numbers = [T::default(); N];
    for ((number, found), name) in numbers.iter_mut().zip(found).zip(names) {
        let missing = || format!("`{}` needs a number `{name}`", excerpt(element.local_name().as_ref()));
        *number = found.ok_or_else(missing)?;
    }
    Ok(numbers)
}

fn attribute(element: &BytesStart<'_>, name: &str) -> Result<Option<String>, String> {
    let found = element.try_get_attribute(name).map_err(|e| e.to_string())?;
    found.map(|a| value(&a).map(|v| v.into_owned())).transpose()
}

fn value<'a>(
    attribute: &quick_xml::events::attributes::Attribute<'a>,
) -> Result<std::borrow::Cow<'a, str>, String> {
    attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| e.to_string())
}
