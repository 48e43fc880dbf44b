//! Wavefront OBJ. Positions and faces count; everything else (normals, textures, groups,
//! materials, lines) is no geometry of a part and is skipped, whatever state it is in.

use std::borrow::Cow;

use earcut::Earcut;
use nalgebra::{Point3, Vector3};

use crate::geometry::SourceMesh;

/// Reads the text of an OBJ file.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_obj(bytes: &[u8]) -> Result<SourceMesh, String> {
    if bytes.is_empty() {
        return Err("the file is empty (0 bytes); export the part again".into());
    }
    if bytes.contains(&0) {
        return Err("this is binary data, not the text of an OBJ file; export the part again".into());
    }
    let text = String::from_utf8_lossy(bytes);
    let geometry = geometry_lines(&text)?;
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut geometry.as_bytes(), &options, no_materials)
        .map_err(|e| format!("{e}; export the part again"))?;
    let mut mesh = SourceMesh::default();
    for model in &models {
        append_model(&mut mesh, &model.mesh)?;
    }
    Ok(mesh)
}

/// The lines that hold positions and faces, reduced to what tobj must see: a position's
/// weight or colour and a face's texture and normal indices could only be grounds for refusal.
fn geometry_lines(text: &str) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let (mut positions, mut faces) = (0usize, 0usize);
    let mut greatest = (0, 0);
    for (number, line) in logical_lines(text) {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                positions += 1;
                push_position(&mut out, words).ok_or_else(|| {
                    format!("line {number}: a vertex needs three numbers, found `{}`", short(&line))
                })?;
            }
            Some("f") => {
                faces += 1;
                let index =
                    push_face(&mut out, words, positions).map_err(|e| format!("line {number}: {e}"))?;
                greatest = greatest.max((index, number));
            }
            _ => {}
        }
    }
    // A face may come before its vertices.
    if usize::try_from(greatest.0).is_ok_and(|index| index > positions) {
        let (index, line) = greatest;
        return Err(format!(
            "line {line}: vertex {index} is out of bounds, there are {positions}; export the part again"
        ));
    }
    match (positions, faces) {
        (_, 1..) => Ok(out),
        (0, 0) if looks_like_stl(text) => Err("this is the text of an STL file; rename it to .stl".into()),
        (0, 0) => Err("no vertices and no faces: not an OBJ file, or an empty one".into()),
        _ => Err("it has vertices but no faces; export it as a triangle mesh".into()),
    }
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

fn push_position<'a>(out: &mut String, words: impl Iterator<Item = &'a str>) -> Option<()> {
    let numbers: Vec<&str> = words.take(3).take_while(|w| w.parse::<f64>().is_ok()).collect();
    let [x, y, z] = numbers[..] else { return None };
    out.extend(["v ", x, " ", y, " ", z, "\n"]);
    Some(())
}

/// Returns the greatest index.
fn push_face<'a>(
    out: &mut String,
    words: impl Iterator<Item = &'a str>,
    positions: usize,
) -> Result<i64, String> {
    out.push('f');
    let mut greatest = 0;
    for word in words.take_while(|w| !w.starts_with('#')) {
        let vertex = word.split('/').next().unwrap_or_default();
        let index: i64 = vertex.parse().map_err(|_| format!("`{word}` is not a vertex index"))?;
        check_index(index, positions)?;
        greatest = greatest.max(index);
        out.extend([" ", vertex]);
    }
    out.push('\n');
    Ok(greatest)
}

/// tobj says only that some index is out of bounds. Negative ones count backwards from what
/// was read so far; one beyond that may still be given later in the file.
fn check_index(index: i64, positions: usize) -> Result<(), String> {
    let backwards = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
    if index == 0 || (index < 0 && backwards > positions) {
        return Err(format!("vertex index {index} does not exist ({positions} vertices so far)"));
    }
    Ok(())
}

fn looks_like_stl(text: &str) -> bool {
    text.trim_start().starts_with("solid") || text.contains("facet normal")
}

fn short(line: &str) -> String {
    line.chars().filter(|c| !c.is_control()).take(40).collect()
}

fn append_model(mesh: &mut SourceMesh, model: &tobj::Mesh) -> Result<(), String> {
    let base = u32::try_from(mesh.vertices.len()).map_err(|_| "too many vertices")?;
    mesh.vertices.extend(model.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
    let mut corners = &model.indices[..];
    let all_triangles = model.face_arities.is_empty();
    let arities: Cow<'_, [u32]> =
        if all_triangles { vec![3; corners.len() / 3].into() } else { (&model.face_arities).into() };
    let mut earcut = Earcut::new();
    for &arity in arities.iter() {
        let (face, rest) = corners.split_at_checked(arity as usize).ok_or("a face without vertices")?;
        corners = rest;
        let polygon: Vec<u32> = face.iter().map(|i| base + i).collect();
        triangulate(&mesh.vertices, &polygon, &mut earcut, &mut mesh.triangles);
    }
    Ok(())
}

/// Splits a polygon: convex ones into a fan, concave ones by ear clipping in the plane that
/// fits best.
fn triangulate(
    vertices: &[[f64; 3]],
    polygon: &[u32],
    earcut: &mut Earcut<f64>,
    triangles: &mut Vec<[u32; 3]>,
) {
    let points: Vec<Point3<f64>> = polygon.iter().map(|&v| Point3::from(vertices[v as usize])).collect();
    let normal = polygon_normal(&points);
    if polygon.len() <= 3 || is_convex(&points, &normal) {
        triangles.extend((2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]));
        return;
    }
    let (u, v) = plane_axes(&normal);
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [p.coords.dot(&u), p.coords.dot(&v)]).collect();
    let mut ears: Vec<u32> = Vec::new();
    earcut.earcut_slice(&flat, &[], &mut ears);
    for ear in ears.chunks_exact(3) {
        let [a, b, c] = [ear[0], ear[1], ear[2]].map(|i| i as usize);
        let keeps_turn = (points[b] - points[a]).cross(&(points[c] - points[a])).dot(&normal) >= 0.0;
        let (b, c) = if keeps_turn { (b, c) } else { (c, b) };
        triangles.push([polygon[a], polygon[b], polygon[c]]);
    }
}

/// Newell's normal: right also for concave and slightly warped polygons.
fn polygon_normal(points: &[Point3<f64>]) -> Vector3<f64> {
    let Some(first) = points.first() else { return Vector3::zeros() };
    points.windows(2).map(|w| (w[0] - first).cross(&(w[1] - first))).sum()
}

fn is_convex(points: &[Point3<f64>], normal: &Vector3<f64>) -> bool {
    let n = points.len();
    (0..n).all(|i| {
        let (a, b, c) = (points[i], points[(i + 1) % n], points[(i + 2) % n]);
        // A straight corner would make a fan from it degenerate: ear clipping handles it.
        (b - a).cross(&(c - b)).dot(normal) > 0.0
    })
}

fn plane_axes(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let unit = normal.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let away = if unit.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = away.cross(&unit).normalize();
    (u, unit.cross(&u))
}

#[cfg(test)]
mod tests {
    use super::parse_obj;
    use proptest::prelude::*;

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
                let mesh = parse_obj(text.as_bytes()).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{face}");
            }
        }
    }

    #[test]
    fn groups_share_their_vertices() {
        let mesh = parse_obj(format!("{SQUARE}g a\nusemtl red\nf 1 2 3\ng b\nf 1 3 4\n").as_bytes()).unwrap();
        assert_eq!(mesh.vertices.len(), 4);
        assert_eq!(mesh.triangles.len(), 2);
    }

    #[test]
    fn weights_and_colours_do_not_move_vertices() {
        let mesh = parse_obj(b"v +1e0 0 0 2\nv 0 1 0 .1 .2 .3\nv 0 0 1 0.5 x\nf 1 2 3\n").unwrap();
        assert_eq!(mesh.vertices[0], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_concave_polygon_keeps_its_area_and_turn() {
        let arrow = "v 0 0 0\nv 4 2 0\nv 0 4 0\nv 1 2 0\nv 0.5 1 0\nf 2 3 4 5 1\n";
        let mesh = parse_obj(arrow.as_bytes()).unwrap();
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
            ("", "0 bytes"),
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
            let mesh = parse_obj(format!("{vertices}f{face}\n").as_bytes()).unwrap();
            prop_assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.vertices.len()));
        }
    }
}
