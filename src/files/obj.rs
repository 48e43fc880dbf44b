//! Wavefront OBJ. Positions and faces count, and the objects and groups that faces belong to. Normals, textures and
//! materials are no geometry of a part and are skipped, whatever state they are in; elements that bound no volume are
//! skipped with a note.

use std::borrow::Cow;
use std::collections::HashMap;

use super::content::{Body, Content, PieceKind, Pieces};
use super::polygon::Triangulator;
use super::text::{decimal_comma, decoded, excerpt};
use crate::geometry::SourceMesh;

/// Reads the text of an OBJ file.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_obj(bytes: &[u8]) -> Result<Content, String> {
    if bytes.contains(&0) {
        return Err("this is binary data, not the text of an OBJ file; export the part again".into());
    }
    let text = decoded(bytes);
    let mut obj = Obj::default();
    for (number, line) in logical_lines(&text) {
        obj.read(number, &line).map_err(|e| format!("line {number}: {e}"))?;
    }
    obj.content(&text)
}

/// What is read so far.
#[derive(Default)]
struct Obj<'a> {
    vertices: Vec<[f64; 3]>,
    /// The corners of all faces, one face after the other.
    corners: Vec<u32>,
    /// By face where its corners end, and the object and the group that it belongs to.
    faces: Vec<(usize, [u32; 2])>,
    /// Names of objects, and of groups.
    names: [Names; 2],
    /// The object and the group that the next face belongs to.
    current: [u32; 2],
    /// The greatest vertex index, and its line.
    greatest: (u32, usize),
    skipped: Skipped<'a>,
}

/// Names in the order in which they came first.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    numbers: HashMap<String, u32>,
}

impl Names {
    fn number(&mut self, name: &str) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = self.list.len() as u32;
        self.numbers.insert(name.to_owned(), number);
        self.list.push(name.to_owned());
        number
    }
}

/// Lines that are skipped, and that someone may miss.
#[derive(Default)]
struct Skipped<'a> {
    /// Points, lines, and faces of fewer than three corners.
    thin: usize,
    /// Free-form curves and surfaces.
    free_form: usize,
    /// Lines that begin with a word that OBJ does not have.
    unknown: usize,
    /// The first of these, with its number.
    first_unknown: Option<(usize, Cow<'a, str>)>,
}

const NOT_GEOMETRY: [&str; 17] = [
    "vn",
    "vt",
    "vp",
    "s",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "call",
    "csh",
];
const FREE_FORM: [&str; 18] = [
    "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end",
    "con", "ctech", "stech", "res", "bzp",
];

impl Obj<'_> {
    fn read(&mut self, number: usize, line: &str) -> Result<(), String> {
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { return Ok(()) };
        match word {
            "v" => self.vertices.push(position(words, line)?),
            "f" => self.face(words, number)?,
            "o" | "g" => {
                let kind = usize::from(word == "g");
                let name = line.trim_start().get(1..).unwrap_or_default().trim();
                self.current[kind] = self.names[kind].number(name) + 1;
            }
            "l" | "p" => self.skipped.thin += 1,
            _ if word.starts_with('#') || NOT_GEOMETRY.contains(&word) => {}
            _ if FREE_FORM.contains(&word) => self.skipped.free_form += 1,
            _ => {
                self.skipped.unknown += 1;
                self.skipped.first_unknown.get_or_insert_with(|| (number, Cow::Owned(excerpt(line))));
            }
        }
        Ok(())
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str>, line: usize) -> Result<(), String> {
        let first = self.corners.len();
        for word in words.take_while(|w| !w.starts_with('#')) {
            let vertex = word.split('/').next().unwrap_or_default();
            let index: i64 =
                vertex.parse().map_err(|_| format!("`{}` is not a vertex index", excerpt(word)))?;
            let corner = self.corner(index)?;
            self.greatest = self.greatest.max((corner, line));
            self.corners.push(corner);
        }
        if self.corners.len() < first + 3 {
            self.corners.truncate(first);
            self.skipped.thin += 1;
            return Ok(());
        }
        self.faces.push((self.corners.len(), self.current));
        Ok(())
    }

    /// Which vertex an index names. Positive ones count from 1 and may be given later in the file; negative ones
    /// count backwards from what was read so far.
    fn corner(&self, index: i64) -> Result<u32, String> {
        let found = self.vertices.len();
        let place = match index {
            1.. => Some(index - 1),
            0 => None,
            _ => i64::try_from(found).ok().and_then(|n| n.checked_add(index)).filter(|place| *place >= 0),
        };
        let place =
            place.ok_or_else(|| format!("vertex index {index} does not exist ({found} vertices so far)"))?;
        u32::try_from(place).map_err(|_| format!("vertex {index} is out of bounds; export the part again"))
    }

    fn content(self, text: &str) -> Result<Content, String> {
        let found = self.vertices.len();
        let (greatest, line) = self.greatest;
        match (found, self.faces.len()) {
            (_, 1..) if greatest as usize >= found => {
                let index = u64::from(greatest) + 1;
                let advice = "export the part again";
                Err(format!("line {line}: vertex {index} is out of bounds, there are {found}; {advice}"))
            }
            (_, 1..) => Ok(self.triangulated()),
            (0, 0) if looks_like_stl(text) => {
                Err("this is the text of an STL file; rename it to .stl".into())
            }
            (0, 0) => Err("no vertices and no faces: not an OBJ file, or an empty one".into()),
            _ => Err("it has vertices but no faces; export it as a triangle mesh".into()),
        }
    }

    fn triangulated(self) -> Content {
        let notes = self.skipped.notes();
        let mut mesh =
            SourceMesh { vertices: self.vertices, triangles: Vec::with_capacity(self.faces.len()) };
        // Objects, unless there is just one and it has groups.
        let count = |kind: usize| {
            self.faces.iter().map(|f| f.1[kind]).collect::<std::collections::BTreeSet<_>>().len()
        };
        let kind = usize::from(count(0) < 2 && count(1) > 1);
        let mut of = Vec::with_capacity(self.faces.len());
        let mut triangulator = Triangulator::default();
        let mut first = 0;
        for (end, keys) in self.faces {
            triangulator.add(&mesh.vertices, &self.corners[first..end], &mut mesh.triangles);
            of.resize(mesh.triangles.len(), keys[kind]);
            first = end;
        }
        // Faces before the first name are a piece without one.
        let mut names = vec![String::new()];
        names.extend(self.names.into_iter().nth(kind).unwrap_or_default().list);
        let kinds = [PieceKind::Objects, PieceKind::Groups];
        let pieces = Pieces { kind: kinds[kind], names, of };
        Content { bodies: vec![Body { path: Vec::new(), mesh, pieces }], notes, ..Content::default() }
    }
}

impl Skipped<'_> {
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some((line, text)) = &self.first_unknown {
            let more =
                if self.unknown > 1 { format!(" and {} more", self.unknown - 1) } else { String::new() };
            notes.push(format!("line {line} (`{text}`){more} skipped: no line of an OBJ file begins so"));
        }
        if self.free_form > 0 {
            notes.push(
                "free-form curves and surfaces skipped; export triangles if the part consists of them".into(),
            );
        }
        if self.thin > 0 {
            notes.push(format!(
                "{} points, lines or faces of two corners skipped: they bound no volume",
                self.thin
            ));
        }
        notes
    }
}

fn position<'w>(words: impl Iterator<Item = &'w str>, line: &str) -> Result<[f64; 3], String> {
    let mut position = [0.0; 3];
    let mut words = words;
    for coordinate in &mut position {
        match words.next().map(str::parse) {
            Some(Ok(number)) => *coordinate = number,
            _ => {
                let found = excerpt(line);
                let words: Vec<&str> = line.split_whitespace().skip(1).collect();
                let why = decimal_comma(&words).unwrap_or("a vertex needs three numbers");
                return Err(format!("{why}, found `{found}`"));
            }
        }
    }
    Ok(position)
}

/// Lines with their numbers; a backslash at the end joins the next line on.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = (1usize..).zip(text.lines());
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let Some(start) = first.trim_end().strip_suffix('\\') else {
            return Some((number, Cow::Borrowed(first)));
        };
        let mut joined = start.to_owned();
        for (_, next) in lines.by_ref() {
            joined.push(' ');
            let Some(more) = next.trim_end().strip_suffix('\\') else {
                joined.push_str(next);
                break;
            };
            joined.push_str(more);
        }
        Some((number, Cow::Owned(joined)))
    })
}

fn looks_like_stl(text: &str) -> bool {
    text.trim_start().starts_with("solid") || text.contains("facet normal")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<SourceMesh, String> {
        Ok(parse_obj(text.as_bytes())?.bodies.remove(0).mesh)
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn faces_are_read_in_all_their_spellings() {
        for face in [
            "f 1 2 3 4",
            "f -4 -3 -2 -1",
            "f 1//1 2//1 3//1 4//1",
            "f 1/9/9 2/9/9 3/9/9 4/9/9 # q",
            "f 1 2 \\\n3 4",
        ] {
            for ending in ["\n", "\r\n"] {
                let text = format!("# made by hand\no square\n{SQUARE}{face}\n").replace('\n', ending);
                let mesh = read(&text).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{face}");
            }
        }
    }

    #[test]
    fn objects_or_groups_are_pieces_of_one_surface() {
        for (lines, kind, names, of) in [
            (["g a", "g b", "g a"], PieceKind::Groups, vec!["", "a", "b"], [1, 2, 1]),
            (["o x\ng a", "o y", "g b"], PieceKind::Objects, vec!["", "x", "y"], [1, 2, 2]),
            (["o x\ng a", "g b", "g"], PieceKind::Groups, vec!["", "a", "b", ""], [1, 2, 3]),
            (["", "o x", "s 1"], PieceKind::Objects, vec!["", "x"], [0, 1, 1]),
        ] {
            let [a, b, c] = lines;
            let text = format!("{SQUARE}{a}\nusemtl red\nf 1 2 3\n{b}\nf 1 3 4\n{c}\nf 1 2 4\n");
            let body = parse_obj(text.as_bytes()).unwrap().bodies.remove(0);
            assert_eq!((body.mesh.vertices.len(), body.mesh.triangles.len()), (4, 3));
            assert_eq!((body.pieces.kind, &body.pieces.of[..]), (kind, &of[..]), "{text}");
            assert_eq!(body.pieces.names, names);
        }
    }

    #[test]
    fn what_is_skipped_is_noted() {
        for (line, note) in [
            ("vertex 1 2 3", "line 5 (`vertex 1 2 3`) skipped"),
            ("x\ny", "line 5 (`x`) and 1 more skipped"),
            ("l 1 2\nf 1 2", "2 points, lines or faces"),
            ("surf 0 1 0 1 1 2 3", "free-form"),
        ] {
            let content = parse_obj(format!("{SQUARE}{line}\nf 1 2 3\n").as_bytes()).unwrap();
            assert!(content.notes[0].contains(note), "{note}: {:?}", content.notes);
        }
        let content =
            parse_obj(format!("# 1\nmtllib a.mtl\nvn 0 0 1\ns off\n{SQUARE}f 1 2 3\n").as_bytes()).unwrap();
        assert!(content.notes.is_empty(), "{:?}", content.notes);
    }

    #[test]
    fn marks_and_line_ends_move_no_index() {
        let text = format!("\u{feff}{SQUARE}f 1 2 3\n");
        assert_eq!(read(&text).unwrap().vertices[0], [0.0; 3]);
        assert_eq!(read(&text.replace('\n', "\r")).unwrap().triangles, [[0, 1, 2]]);
    }

    #[test]
    fn weights_and_colours_do_not_move_vertices() {
        let mesh = read("v +1e0 0 0 2\nv 0 1 0 .1 .2 .3\nv 0 0 1 0.5 x\nf 1 2 3\n").unwrap();
        assert_eq!(mesh.vertices[0], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_concave_polygon_keeps_its_area_and_turn() {
        let arrow = "v 0 0 0\nv 4 2 0\nv 0 4 0\nv 1 2 0\nv 0.5 1 0\nf 2 3 4 5 1\n";
        let mesh = read(arrow).unwrap();
        assert_eq!(mesh.triangles.len(), 3);
        let doubled: Vec<f64> = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            })
            .collect();
        assert!(doubled.iter().all(|&a| a >= 0.0), "{doubled:?}");
        assert!((doubled.iter().sum::<f64>() - 12.0).abs() < 1e-12, "{doubled:?}");
    }

    #[test]
    fn refusals_say_what_is_wrong() {
        for (text, expected) in [
            ("v 1,5 2 3\n", "line 1: its numbers have decimal commas"),
            ("a\0b", "binary data"),
            ("v 1 2 3\n", "no faces"),
            ("solid ascii\nfacet normal 0 0 1\n", "rename it to .stl"),
            ("hello\n", "not an OBJ"),
            ("v 1 2\nf 1 1 1\n", "line 1"),
            ("v 1 2 3\nf 1 1 0\n", "index 0"),
            ("v 1 2 3\nf 1 1 -2\n", "line 2"),
            ("v 1 2 3\nf 1 1 a\n", "`a` is not a vertex index"),
            ("v 1 2 3\nf 1 1 7\n", "out of bounds"),
            ("v 1 2 3\nf 1 1 9223372036854775807\n", "out of bounds"),
        ] {
            let error = parse_obj(text.as_bytes()).unwrap_err();
            assert!(error.to_lowercase().contains(&expected.to_lowercase()), "{text:?}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse_obj(&bytes);
        }

        #[test]
        fn no_text_makes_it_panic(text in "(v|f|l|p|o|#|\\\\| |\n|-?[0-9]{1,3}|/|\\.|nan|inf|1e999|-9223372036854775808){0,60}") {
            let _ = parse_obj(text.as_bytes());
        }

        #[test]
        fn no_polygon_makes_it_panic(points in proptest::collection::vec(-2i8..3, 12..36)) {
            let vertices: String =
                points.chunks_exact(3).map(|p| format!("v {} {} {}\n", p[0], p[1], p[2])).collect();
            let face: String = (1..=points.len() / 3).map(|i| format!(" {i}")).collect();
            let mesh = read(&format!("{vertices}f{face}\n")).unwrap();
            prop_assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.vertices.len()));
        }
    }
}
