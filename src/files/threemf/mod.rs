//! 3MF: an archive with models in it. Every object that the build places is a body, by way of its components; an object
//! with components is a node above them. Core and production extension; materials and slices are no geometry. What else
//! is in it is noted, or refused if the file requires it.
//!
//! `model` reads one model, `package` the archive.

mod model;
mod package;

use std::collections::{BTreeSet, HashMap};
use std::rc::Rc;

use nalgebra::Matrix4;

use self::model::{Model, Reference};
use self::package::Package;
pub(super) use self::package::archive_of;
use super::content::{Body, Content, MAX_DEPTH, MAX_NODES, PieceKind, Pieces, placed};
use super::split::listed;
use super::text::{excerpt, printable};

const AGAIN: &str = "export the assembly again";

/// Reads a 3MF file.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_threemf(bytes: &[u8]) -> Result<Content, String> {
    let mut package = Package::open(bytes)?;
    let main = model_path(&package.main_model()?);
    let mut reader = Reader {
        package: &mut package,
        models: HashMap::new(),
        path: Vec::new(),
        placed: BTreeSet::new(),
        visits: 0,
        content: Content::default(),
    };
    let model = reader.model(&main)?;
    for item in &model.items {
        reader.visit(&main, item, &Matrix4::identity())?;
    }
    let Reader { models, placed, mut content, .. } = reader;
    if content.bodies.is_empty() {
        return Err(format!("its build places no object with a mesh; {AGAIN}"));
    }
    content.units = Some(model.unit.clone());
    content.notes.extend(left_out(&models, &placed));
    let unread: Vec<String> =
        package.models().into_iter().filter(|path| !models.contains_key(&model_path(path))).collect();
    if !unread.is_empty() {
        content.notes.push(format!("nothing in the build refers to {}: not read", listed(&unread)));
    }
    if let Some(settings) = package.slicer_settings() {
        content.notes.push(format!(
            "`{settings}` is not read: where the slicer has several parts in one mesh they are one part here \
             (`--split bodies` makes a part of each separate body)"
        ));
    }
    Ok(content)
}

/// Objects with meshes that the build does not place.
fn left_out(models: &HashMap<String, Rc<Model>>, placed: &BTreeSet<(String, u32)>) -> Option<String> {
    let mut names = Vec::new();
    for (path, model) in models {
        for (number, object) in &model.objects {
            let is_missed = !object.mesh.triangles.is_empty() && !placed.contains(&(path.clone(), *number));
            if is_missed {
                names.push(shown(&object.name, *number));
            }
        }
    }
    names.sort();
    let are = if names.len() == 1 { "is" } else { "are" };
    (!names.is_empty()).then(|| format!("{} {are} not in the build and not read", listed(&names)))
}

fn shown(name: &str, number: u32) -> String {
    if name.trim().is_empty() { format!("object {number}") } else { printable(name) }
}

/// The path of a model in one spelling.
fn model_path(path: &str) -> String {
    format!("/{}", path.trim_start_matches('/').to_ascii_lowercase())
}

struct Reader<'p, 'b> {
    package: &'p mut Package<'b>,
    /// By their paths.
    models: HashMap<String, Rc<Model>>,
    /// The names from the build to the object that is visited.
    path: Vec<String>,
    /// Objects that were visited: their models and numbers.
    placed: BTreeSet<(String, u32)>,
    /// How often objects were.
    visits: usize,
    content: Content,
}

impl Reader<'_, '_> {
    fn model(&mut self, path: &str) -> Result<Rc<Model>, String> {
        if let Some(model) = self.models.get(path) {
            return Ok(model.clone());
        }
        let text = self.package.read(path)?;
        let model = model::parse(&text).map_err(|e| format!("`{}`, {e}", excerpt(path)))?;
        let notes = model.notes.iter().map(|note| format!("`{}`: {note}", excerpt(path)));
        self.content.notes.extend(notes);
        let model = Rc::new(model);
        self.models.insert(path.to_owned(), model.clone());
        Ok(model)
    }

    /// Adds what a reference in a model places.
    fn visit(&mut self, from: &str, reference: &Reference, parent: &Matrix4<f64>) -> Result<(), String> {
        let path = reference.model.as_deref().map_or_else(|| from.to_owned(), model_path);
        let (model, number) = (self.model(&path)?, reference.object);
        let object = model
            .objects
            .get(&number)
            .ok_or_else(|| format!("`{}`: object {number} does not exist; {AGAIN}", excerpt(&path)))?;
        let name = shown(&object.name, number);
        self.visits += 1;
        if self.path.len() >= MAX_DEPTH || self.visits > MAX_NODES {
            return Err(format!(
                "`{name}` holds itself, or there are more than {MAX_NODES} objects; {AGAIN}"
            ));
        }
        self.placed.insert((path.clone(), number));
        if object.is_support {
            self.content.notes.push(format!("`{name}` skipped: it supports others while they are printed"));
            return Ok(());
        }
        let pose = parent * reference.pose;
        self.path.push(object.name.clone());
        if !object.mesh.triangles.is_empty() {
            let (mesh, is_mirrored) = placed(&object.mesh, &pose);
            if is_mirrored {
                self.content
                    .notes
                    .push(format!("`{name}` is mirrored: its transform has a negative determinant"));
            }
            let mut path = self.path.clone();
            // What has no name, nor anything above it, is known by its number.
            if path.iter().all(|name| name.trim().is_empty()) {
                path.push(format!("object{number}"));
            }
            let pieces = Pieces { kind: PieceKind::Nodes, ..Pieces::default() };
            self.content.bodies.push(Body { path, mesh, pieces });
        } else if object.components.is_empty() {
            self.content
                .notes
                .push(format!("`{name}` skipped: it has neither a mesh nor components that are read here"));
        }
        for component in &object.components {
            self.visit(&path, component, &pose)?;
        }
        self.path.pop();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::package::{MODEL_PATH, RELATIONSHIPS, RELATIONSHIPS_PATH, archive};
    use super::*;
    use proptest::prelude::*;

    /// A plate, two bolts in a unit of components, of which one is turned, and an object that is never built.
    const MODEL: &str = r##"<?xml version="1.0" encoding="UTF-8"?>
<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
 xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02" requiredextensions="m">
 <metadata name="Title">Test</metadata>
 <resources>
  <m:colorgroup id="9"><m:color color="#FFFFFF"/></m:colorgroup>
  <object id="1" name="bolt &amp; nut" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
   <vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
   <triangle v1="0" v2="1" v3="3" p1="0" pid="9"/><triangle v1="1" v2="2" v3="3"/><triangle v1="2" v2="0" v3="3"/></triangles></mesh></object>
  <object id="2" partnumber="unit"><components><component objectid="1"/>
   <component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 0 0"/></components></object>
  <object id="3"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>
   <triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>
 </resources>
 <build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/></build>
</model>"##;

    fn parse(model: &str) -> Result<Content, String> {
        parse_threemf(&archive_of(model.as_bytes()).unwrap())
    }

    #[test]
    fn objects_stand_where_the_build_places_them() {
        let content = parse(MODEL).unwrap();
        assert_eq!(content.units.as_deref(), Some("in"));
        let [first, second] = &content.bodies[..] else { panic!("two bolts") };
        assert_eq!(first.path, ["unit", "bolt & nut"]);
        assert_eq!(first.mesh.vertices[3], [0.0, 0.0, 6.0]);
        assert_eq!(first.mesh.triangles[0], [0, 2, 1]);
        // x becomes y, and y becomes -x, then ten along x.
        assert_eq!(second.mesh.vertices[..3], [[10.0, 0.0, 5.0], [10.0, 1.0, 5.0], [9.0, 0.0, 5.0]]);
        assert_eq!(content.notes, ["`object 3` is not in the build and not read"]);
        let file = archive_of(MODEL.as_bytes()).unwrap();
        let assembly = super::super::parse_file("a.3mf", &file, None).unwrap();
        let names: Vec<&str> = assembly.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!((names, assembly.units.as_deref()), (vec!["bolt & nut", "bolt & nut-2"], Some("in")));
    }

    #[test]
    fn other_models_are_read_where_the_build_refers_to_them() {
        let production = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06";
        let main = format!(
            r#"<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" xmlns:p="{production}" requiredextensions="p">
<resources/><build><item objectid="1" p:path="/3D/Objects/Bolt.model" p:UUID="x"/></build></model>"#
        );
        let files = [
            (RELATIONSHIPS_PATH, RELATIONSHIPS),
            (MODEL_PATH, &main),
            ("3D/objects/bolt.model", MODEL),
            ("3D/other.model", MODEL),
            ("Metadata/Slic3r_PE_model.config", "<config/>"),
        ];
        let bytes = |(name, text): (&'static str, &'_ str)| (name, text.to_owned().into_bytes());
        let content = parse_threemf(&archive(&files.map(bytes)).unwrap()).unwrap();
        assert_eq!((content.bodies.len(), content.units.as_deref()), (1, Some("mm")));
        let notes = content.notes.join("\n");
        for expected in ["`object 3` is not in the build", "`3D/other.model`", "Slic3r_PE_model.config"] {
            assert!(notes.contains(expected), "{expected}: {notes}");
        }
        let absent = parse_threemf(&archive(&[files[0], files[1]].map(bytes)).unwrap()).unwrap_err();
        assert!(absent.contains("`/3d/objects/bolt.model` is not in the archive"), "{absent}");
    }

    #[test]
    fn what_is_not_read_is_noted() {
        for (from, to, expected) in [
            (
                "</triangles></mesh></object>\n  <object id=\"2\"",
                "</triangles><b:beamlattice radius=\"1\"><b:beams/></b:beamlattice></mesh></object>\n  <object id=\"2\"",
                "`b:beamlattice` skipped",
            ),
            ("<metadata name", "<hologram/><metadata name", "`hologram` skipped"),
            ("type=\"model\"", "type=\"support\"", "supports others"),
            ("0 1 0 -1 0 0", "0 1 0 1 0 0", "is mirrored"),
            ("<components>", "<components><component objectid=\"4\"/>", "neither a mesh nor components"),
        ] {
            let changed = MODEL.replacen(from, to, 1);
            let changed = changed.replace("</resources>", "<object id=\"4\"/></resources>");
            assert_ne!(changed, MODEL);
            let found = parse(&changed);
            let notes = match &found {
                Ok(content) => content.notes.join("\n"),
                // Both bolts are supports then.
                Err(reason) => format!("{reason}: supports others"),
            };
            assert!(notes.contains(expected), "{expected}: {notes}");
        }
    }

    #[test]
    fn damage_is_refused() {
        for (from, to, expected) in [
            (
                "requiredextensions=\"m\"",
                "requiredextensions=\"m b\"",
                "beamlattice/2017/02`, which is not read",
            ),
            ("unit=\"inch\"", "unit=\"furlong\"", "line 2: its unit `furlong` is not known"),
            ("x=\"1\"", "x=\"one\"", "line 8: `vertex` needs a number `x`"),
            ("v3=\"1\"", "v3=\"4\"", "vertex 4 does not exist, there are 4"),
            ("0 1 0 -1 0 0 0 0 1 10 0 0", "0 1 0 -1", "needs twelve numbers, found `0 1 0 -1`"),
            ("<component objectid=\"1\"/>", "<component objectid=\"2\"/>", "holds itself"),
            ("<component objectid=\"1\"/>", "<component objectid=\"7\"/>", "object 7 does not exist"),
            ("<object id=\"3\"", "<object id=\"1\"", "object 1 stands there twice"),
            ("<item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 0 0 5\"/>", "", "places no object"),
            ("</mesh>", "</mash>", "export the assembly again"),
        ] {
            let changed = MODEL.replacen(from, to, 1);
            assert_ne!(changed, MODEL, "{from}");
            let error = parse(&changed).unwrap_err();
            assert!(error.contains(expected), "{expected}: {error}");
        }
        let whole = archive_of(MODEL.as_bytes()).unwrap();
        for length in [0, 4, 100, whole.len() - 30] {
            assert!(parse_threemf(&whole[..length]).is_err());
        }
        assert!(parse_threemf(&archive(&[("a.txt", b"")]).unwrap()).unwrap_err().contains("main model"));
    }

    #[test]
    fn an_archive_that_unpacks_to_far_more_than_itself_is_refused() {
        let bomb = format!("{}{}", MODEL, " ".repeat(40 << 20));
        assert!(parse(&bomb).unwrap_err().contains("times as large as the file"));
        // Few objects that hold each other again and again.
        let nested: String = (10..50)
            .map(|n| format!(r#"<object id="{n}"><components><component objectid="{0}"/><component objectid="{0}"/></components></object>"#, n + 1))
            .collect();
        let nested = MODEL.replace("</resources>", &format!("{nested}<object id=\"50\"/></resources>"));
        let error = parse(&nested.replace("item objectid=\"2\"", "item objectid=\"10\"")).unwrap_err();
        assert!(error.contains("more than 20000 objects"), "{error}");
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(at in 0usize..2000, with: Vec<u8>) {
            let mut bytes = archive_of(MODEL.as_bytes()).unwrap();
            let at = at.min(bytes.len());
            let end = (at + with.len()).min(bytes.len());
            bytes.splice(at..end, with);
            let _ = parse_threemf(&bytes);
        }

        #[test]
        fn no_text_makes_it_panic(at in 0usize..2000, with in "[<>/\"=a-z0-9 &;-]{0,30}") {
            let mut model = MODEL.to_owned();
            let at = model.floor_char_boundary(at.min(model.len()));
            let end = model.floor_char_boundary((at + with.len()).min(model.len()));
            model.replace_range(at..end, &with);
            let _ = parse(&model);
        }
    }
}
