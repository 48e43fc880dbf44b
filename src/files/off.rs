//! OFF (Geomview's Object File Format), as text. Positions and faces count; normals, colours and texture coordinates are
//! skipped. The crate `off-rs` was tried: it keeps single precision only, and refuses counts on the keyword's line.

use super::content::{Body, Content};
use super::polygon::Triangulator;
use super::text::{decimal_comma, decoded, excerpt};
use crate::geometry::SourceMesh;

const AGAIN: &str = "export the part again";

/// Reads an OFF file.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_off(bytes: &[u8]) -> Result<Content, String> {
    let text = decoded(bytes);
    let without_comment = |line: &'_ str| line.split('#').next().unwrap_or_default().trim().len();
    let mut lines = (1usize..)
        .zip(text.lines())
        .map(|(number, line)| (number, line.trim_start()))
        .map(|(number, line)| (number, &line[..without_comment(line)]))
        .filter(|(_, line)| !line.is_empty());
    let (number, first) = lines.next().ok_or_else(|| format!("it holds nothing but comments; {AGAIN}"))?;
    // The keyword may be left out, and counts may follow it at once.
    let counts = match first.find("OFF") {
        Some(place) => {
            check_prefix(&first[..place]).map_err(|e| format!("line {number}: {e}"))?;
            first[place + "OFF".len()..].trim()
        }
        None => first,
    };
    if counts.eq_ignore_ascii_case("binary") {
        return Err("binary OFF is not read; export it as text, or as STL".into());
    }
    let (number, counts) =
        if counts.is_empty() { lines.next().unwrap_or((number, "")) } else { (number, counts) };
    let [vertex_count, face_count] = two_counts(counts)
        .ok_or_else(|| not("two counts", number, counts, "the numbers of vertices and faces"))?;
    let mut missing = |what: &str, count: usize, read: usize| {
        let next = lines.next();
        next.ok_or_else(|| format!("truncated: {count} {what} are announced, and {read} are there; {AGAIN}"))
    };
    // Not all at once: a header may announce more than the file holds.
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    while vertices.len() < vertex_count {
        let (number, line) = missing("vertices", vertex_count, vertices.len())?;
        vertices.push(position(number, line)?);
    }
    let mut triangles = Vec::new();
    let mut triangulator = Triangulator::default();
    let mut thin = 0;
    for face in 0..face_count {
        let (number, line) = missing("faces", face_count, face)?;
        let polygon = corners(number, line, vertices.len())?;
        thin += usize::from(polygon.len() < 3);
        triangulator.add(&vertices, &polygon, &mut triangles);
    }
    let mut notes = Vec::new();
    if thin > 0 {
        notes.push(format!("{thin} faces of fewer than three corners skipped: they bound no volume"));
    }
    if let Some((number, line)) = lines.next() {
        let found = excerpt(line);
        notes.push(format!(
            "line {number} (`{found}`) and all after it are not read: the header announces no more"
        ));
    }
    if triangles.is_empty() {
        return Err("it has no faces; export it as a closed triangle mesh".into());
    }
    let mesh = SourceMesh { vertices, triangles };
    Ok(Content { bodies: vec![Body { mesh, ..Body::default() }], notes, ..Content::default() })
}

/// What stands before `OFF`: texture coordinates (ST), colours (C) and normals (N) follow a vertex's position and are
/// skipped; a fourth coordinate (4) or another dimension (n) makes another position.
fn check_prefix(prefix: &str) -> Result<(), String> {
    let rest = prefix.trim_start_matches("ST").trim_start_matches('C').trim_start_matches('N');
    match rest {
        "" => Ok(()),
        "4" | "n" | "4n" => Err("its vertices do not have three coordinates; export a mesh in space".into()),
        _ => Err(format!("`{}` stands before `OFF`: not an OFF file; {AGAIN}", excerpt(prefix))),
    }
}

/// The numbers of vertices and faces; that of edges is never needed.
fn two_counts(line: &str) -> Option<[usize; 2]> {
    let counts: Vec<usize> = line.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    counts.first_chunk().copied()
}

fn position(number: usize, line: &str) -> Result<[f64; 3], String> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let numbers: Vec<f64> = words.iter().take(3).map_while(|word| word.parse().ok()).collect();
    let found = numbers.first_chunk().copied();
    found.ok_or_else(|| match decimal_comma(&words) {
        Some(why) => format!("line {number}: {why}, found `{}`", excerpt(line)),
        None => not("three numbers", number, line, "a vertex"),
    })
}

fn corners(number: usize, line: &str, vertices: usize) -> Result<Vec<u32>, String> {
    let mut words = line.split_ascii_whitespace();
    let count: usize = words
        .next()
        .and_then(|word| word.parse().ok())
        .ok_or_else(|| not("the number of its corners", number, line, "a face"))?;
    let all: Vec<&str> = words.take(count).collect();
    if all.len() < count {
        return Err(not("as many vertices as it announces", number, line, "a face"));
    }
    let corner = |word: &str| match word.parse::<u32>() {
        Ok(corner) if (corner as usize) < vertices => Ok(corner),
        _ => Err(format!(
            "line {number}: vertex {} does not exist, there are {vertices}; {AGAIN}",
            excerpt(word)
        )),
    };
    all.into_iter().map(corner).collect()
}

fn not(wanted: &str, number: usize, line: &str, what: &str) -> String {
    format!("line {number}: {what} needs {wanted}, found `{}`; {AGAIN}", excerpt(line))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "OFF # of a square and a triangle\n4 2 0\n0 0 0\n1 0 0\n\n1 1 0\n0 1 0.5\n4 0 1 2 3 255 0 0\n3 0 3 1\n";

    #[test]
    fn all_spellings_are_read() {
        for text in [
            TEXT.to_owned(),
            TEXT.replacen("OFF # of a square and a triangle\n", "OFF", 1),
            TEXT.replacen("OFF # of a square and a triangle\n", "", 1),
            TEXT.replace("OFF", "STCNOFF").replace("1 0 0\n", "1 0 0 0.1 0.2 0.3 1\n"),
            TEXT.replace("4 2 0", "4 2").replace('\n', "\r\n"),
        ] {
            let mesh = parse_off(text.as_bytes()).unwrap().bodies.remove(0).mesh;
            assert_eq!(mesh.vertices[3], [0.0, 1.0, 0.5], "{text}");
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], "{text}");
        }
    }

    #[test]
    fn nothing_is_lost_without_a_word() {
        for (text, note) in [
            (TEXT.to_owned() + "3 0 1 2\n", "line 10 (`3 0 1 2`) and all after it"),
            (TEXT.replace("3 0 3 1", "2 0 3"), "1 faces of fewer than three corners"),
        ] {
            let notes = parse_off(text.as_bytes()).unwrap().notes;
            assert!(notes[0].contains(note), "{notes:?}");
        }
        for (text, expected) in [
            (TEXT.replace("3 0 3 1\n", ""), "truncated: 2 faces are announced, and 1 are there"),
            (
                TEXT.replace("4 2 0", "400000000000 2 0"),
                "truncated: 400000000000 vertices are announced, and 6 are there",
            ),
            (TEXT.replace("4 2 0", "four"), "line 2: the numbers of vertices and faces"),
            (TEXT.replace("1 1 0", "1,5 1 0"), "line 6: its numbers have decimal commas"),
            (TEXT.replace("0 3 1", "0 3 4"), "line 9: vertex 4 does not exist, there are 4"),
            (TEXT.replace("3 0 3 1", "3 0 3"), "line 9: a face needs as many vertices"),
            (TEXT.replace("OFF", "4OFF"), "three coordinates"),
            (TEXT.replace("OFF", "xOFF"), "`x` stands before"),
            ("OFF BINARY\n".into(), "binary OFF"),
            ("# nothing\n".into(), "nothing but comments"),
            ("OFF\n3 0 0\n0 0 0\n0 0 1\n0 1 0\n".into(), "no faces"),
        ] {
            let error = parse_off(text.as_bytes()).unwrap_err();
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(OFF|ST|C|N|4|n|BINARY|#|\n| |-1|0|1|2|3|9999999999|1e400|é){0,60}") {
            let _ = parse_off(text.as_bytes());
        }
    }
}
