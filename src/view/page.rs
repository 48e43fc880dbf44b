//! A scene as one HTML file that needs no network: opened from disk, it plays.
//!
//! `page/` holds its sources: `index.html`, `style.css`, and the JavaScript in `src/`, bundled with three.js into
//! `dist/page.js`. The bundle is committed, so that no Node is needed to build sbdp; `.ci/view` makes it anew
//! from the lock file and compares the bytes.
//!
//! The scene is embedded as JSON, numbers in bulk as base64 of little-endian arrays: vertices as 16-bit steps
//! along the mesh's longest side, normals as bytes, key frames as single floats about the middle of the assembly.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::illustration::{FREE, HELD, MOVING, STUCK, shots};
use super::layout::layout;
use super::{
    DrawnPart, Instructions, Keyframe, PALETTE, Placement, PlanScene, Rgb, SceneGroup, ScenePart, SceneStep,
    Up,
};
use crate::blocking_graph::DirectionalGraph;
use crate::document::BlockedDocument;
use nalgebra::Point3;

const HTML: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/dist/page.js");

/// The page. The graphs are those of the assembled state; their parts are those of `names`, by place.
///
/// # Errors
/// None that is known: all keys are text.
pub fn page(
    scene: &PlanScene,
    instructions: &Instructions,
    names: &[String],
    graphs: &[DirectionalGraph],
) -> serde_json::Result<String> {
    let data = serde_json::to_string(&data(scene, instructions, names, graphs))?;
    let title = if scene.name.is_empty() { "assembly" } else { &scene.name };
    // In this order: what a name holds is never taken for a placeholder.
    Ok(HTML
        .replace("{{TITLE}}", &escaped(title))
        .replacen("{{STYLE}}", STYLE, 1)
        .replacen("{{SCRIPT}}", SCRIPT, 1)
        .replacen("{{DATA}}", &data.replace('<', "\\u003c"), 1))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('{', "&#123;")
}

/// What the page's `data.js` reads. Offsets are in bytes.
#[derive(Debug, Serialize)]
struct Data<'a> {
    name: &'a str,
    units: Option<&'a str>,
    up: &'static str,
    kind: &'static str,
    status: &'a str,
    verdict: Option<&'a str>,
    duration: f64,
    palette: Vec<String>,
    colours: Colours,
    instructions: Vec<PageInstruction<'a>>,
    meshes: Vec<PageMesh>,
    parts: Vec<PagePart<'a>>,
    steps: Vec<PageStep<'a>>,
    kept_together: &'a [SceneGroup],
    free_together: &'a [SceneGroup],
    blocked: Vec<Stuck<'a>>,
    graphs: Vec<Graph>,
    bytes: String,
}

/// Colours with a meaning, as in the pictures.
#[derive(Debug, Serialize)]
struct Colours {
    moving: String,
    held: String,
    stuck: Vec<String>,
    free: Vec<String>,
}

#[derive(Debug, Serialize)]
struct PageInstruction<'a> {
    heading: Option<&'a str>,
    numbers: String,
    words: &'a str,
    steps: &'a [usize],
    /// Unit direction to the viewer.
    view: [f64; 3],
    hiding: Vec<usize>,
    arrows: Vec<PageArrow>,
}

#[derive(Debug, Serialize)]
struct PageArrow {
    step: usize,
    /// About the middle of the assembly.
    points: Vec<[f32; 3]>,
}

#[derive(Debug, Serialize)]
struct PageMesh {
    /// Length of a step, and where step 0 is.
    step: f64,
    origin: [f64; 3],
    vertices: usize,
    positions: usize,
    normals: usize,
    triangles: [usize; 2],
    edges: [usize; 2],
    /// Bytes of an index.
    index: usize,
}

#[derive(Debug, Serialize)]
struct PagePart<'a> {
    name: &'a str,
    mesh: usize,
    colour: usize,
    fixed: bool,
    stays: bool,
    steps: &'a [usize],
    crosses: Option<f64>,
    handled: Option<[f64; 2]>,
    times: Vec<f64>,
    /// Seven numbers per time, as of `start`.
    keys: usize,
    /// `[x, y, z, qx, qy, qz, qw]`.
    assembled: [f64; 7],
    start: [f64; 7],
    exploded: [f64; 3],
    size: [f64; 3],
}

#[derive(Debug, Serialize)]
struct PageStep<'a> {
    parts: &'a [usize],
    of: Option<usize>,
    body: &'a [usize],
    words: &'a str,
    after: &'a [usize],
    held: &'a [usize],
    begins: f64,
    ends: f64,
}

#[derive(Debug, Serialize)]
struct Stuck<'a> {
    part: Option<usize>,
    by: Vec<usize>,
    action: &'a str,
}

#[derive(Debug, Serialize)]
struct Graph {
    direction: String,
    rows: usize,
    columns: usize,
    /// One per part.
    places: Vec<[f64; 2]>,
    edges: Vec<[usize; 2]>,
}

fn data<'a>(
    scene: &'a PlanScene,
    instructions: &'a Instructions,
    names: &[String],
    graphs: &[DirectionalGraph],
) -> Data<'a> {
    let middle = scene.bounds().centre();
    let mut bytes = Vec::new();
    let meshes = scene.drawn.iter().map(|m| mesh(m, &mut bytes)).collect();
    let parts = scene.parts.iter().map(|p| part(p, &middle, &mut bytes)).collect();
    Data {
        name: &scene.name,
        units: scene.units.as_deref(),
        up: match scene.up {
            Up::Y => "y",
            Up::Z => "z",
        },
        kind: scene.kind.name(),
        status: &scene.status,
        verdict: scene.verdict.as_deref(),
        duration: scene.duration(),
        palette: PALETTE.iter().map(css).collect(),
        colours: Colours {
            moving: css(&MOVING),
            held: css(&HELD),
            stuck: STUCK.iter().map(css).collect(),
            free: FREE.iter().map(css).collect(),
        },
        instructions: page_instructions(scene, instructions, &middle),
        meshes,
        parts,
        steps: scene.steps.iter().map(step).collect(),
        kept_together: &scene.kept_together,
        free_together: &scene.free_together,
        blocked: scene.blocked.iter().map(|b| stuck(scene, b)).collect(),
        graphs: graphs.iter().map(|g| graph(scene, names, g)).collect(),
        bytes: STANDARD.encode(&bytes),
    }
}

fn css([r, g, b]: &Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn page_instructions<'a>(
    scene: &PlanScene,
    instructions: &'a Instructions,
    middle: &Point3<f64>,
) -> Vec<PageInstruction<'a>> {
    let point = |p: &Point3<f64>| [0, 1, 2].map(|a| (p[a] - middle[a]) as f32);
    let instructions = instructions.list.iter().zip(shots(scene, instructions));
    let told = instructions.map(|(instruction, shot)| {
        let arrows = shot.arrows.iter();
        let arrow = |a: &super::arrow::Arrow| PageArrow {
            step: a.step,
            points: a.points.iter().map(point).collect(),
        };
        PageInstruction {
            heading: instruction.heading.as_deref(),
            numbers: instruction.numbers(),
            words: &instruction.words,
            steps: &instruction.steps,
            view: shot.back.into(),
            hiding: shot.hiding.clone(),
            arrows: arrows.map(arrow).collect(),
        }
    });
    told.collect()
}

/// Appends numbers where any may begin; where that is.
fn append(bytes: &mut Vec<u8>, numbers: &[u8]) -> usize {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend_from_slice(numbers);
    bytes.len() - numbers.len()
}

fn mesh(mesh: &DrawnPart, bytes: &mut Vec<u8>) -> PageMesh {
    let of =
        |pick: fn(f32, f32) -> f32, a: usize| mesh.positions.iter().map(|p| p[a]).reduce(pick).unwrap_or(0.0);
    let origin = [0, 1, 2].map(|a| of(f32::min, a));
    let longest = (0..3).map(|a| of(f32::max, a) - origin[a]).fold(f32::MIN_POSITIVE, f32::max);
    let step = f64::from(longest) / f64::from(u16::MAX);
    let steps = |p: &[f32; 3]| [0, 1, 2].map(|a| (f64::from(p[a] - origin[a]) / step).round() as u16);
    // Four numbers per vertex: graphics cards want them aligned.
    let positions =
        mesh.positions.iter().map(steps).flat_map(|[x, y, z]| [x, y, z, 0]).flat_map(u16::to_le_bytes);
    let byte = |x: f32| (x * 127.0).round() as i8;
    let normals =
        mesh.normals.iter().flat_map(|n| [byte(n[0]), byte(n[1]), byte(n[2]), 0]).flat_map(i8::to_le_bytes);
    let wide = mesh.positions.len() > usize::from(u16::MAX);
    let indices = |list: &[u32]| -> Vec<u8> {
        let short = |i: &u32| (*i as u16).to_le_bytes();
        if wide {
            list.iter().flat_map(|i| i.to_le_bytes()).collect()
        } else {
            list.iter().flat_map(short).collect()
        }
    };
    let (triangles, edges) = (mesh.triangles.as_flattened(), mesh.edges.as_flattened());
    PageMesh {
        step,
        origin: origin.map(f64::from),
        vertices: mesh.positions.len(),
        positions: append(bytes, &positions.collect::<Vec<_>>()),
        normals: append(bytes, &normals.collect::<Vec<_>>()),
        triangles: [append(bytes, &indices(triangles)), triangles.len()],
        edges: [append(bytes, &indices(edges)), edges.len()],
        index: if wide { 4 } else { 2 },
    }
}

fn placed(placement: &Placement, middle: &Point3<f64>) -> [f64; 7] {
    let [x, y, z] = (placement.centre - middle).into();
    let [i, j, k, w] = placement.rotation.coords.into();
    [x, y, z, i, j, k, w]
}

fn part<'a>(part: &'a ScenePart, middle: &Point3<f64>, bytes: &mut Vec<u8>) -> PagePart<'a> {
    let numbers = |k: &Keyframe| placed(&k.placement, middle).map(|x| x as f32);
    let keys: Vec<u8> = part.keys.iter().flat_map(numbers).flat_map(f32::to_le_bytes).collect();
    PagePart {
        name: &part.name,
        mesh: part.drawn,
        colour: part.colour,
        fixed: part.fixed,
        stays: part.stays,
        steps: &part.steps,
        crosses: part.crosses,
        handled: part.handled,
        times: part.keys.iter().map(|k| k.time).collect(),
        keys: append(bytes, &keys),
        assembled: placed(&part.assembled, middle),
        start: placed(&part.start, middle),
        exploded: part.exploded.into(),
        size: part.bounds.extents().into(),
    }
}

fn step(step: &SceneStep) -> PageStep<'_> {
    PageStep {
        parts: &step.parts,
        of: step.of,
        body: &step.body,
        words: &step.words,
        after: &step.after,
        held: &step.held,
        begins: step.begins,
        ends: step.ends,
    }
}

fn place(scene: &PlanScene, name: &str) -> Option<usize> {
    scene.parts.iter().position(|p| p.name == name)
}

fn stuck<'a>(scene: &PlanScene, blocked: &'a BlockedDocument) -> Stuck<'a> {
    Stuck {
        part: place(scene, &blocked.part),
        by: blocked.by.iter().filter_map(|n| place(scene, n)).collect(),
        action: &blocked.action,
    }
}

fn graph(scene: &PlanScene, names: &[String], graph: &DirectionalGraph) -> Graph {
    let at = |part: usize| names.get(part).and_then(|n| place(scene, n));
    let edges: Vec<_> = graph.edges.iter().filter_map(|[p, b]| Some([at(*p)?, at(*b)?])).collect();
    let layout = layout(scene.parts.len(), &edges);
    let (rows, columns) = (layout.rows, layout.columns);
    Graph { direction: graph.direction.to_string(), rows, columns, places: layout.places, edges }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, source};
    use crate::geometry::Assembly;
    use crate::simulation::Action;
    use crate::view::document::tests::plan;

    fn scene(name: &str) -> PlanScene {
        let assembly = Assembly { name: name.into(), ..Assembly::new(&source(block_on_plate())).unwrap() };
        PlanScene::new(&assembly, Up::Z, &plan()).unwrap()
    }

    fn written(scene: &PlanScene) -> String {
        let names = ["0", "1"].map(String::from);
        let graph = DirectionalGraph { direction: Action::translations()[4], edges: vec![[0, 1]] };
        page(scene, &Instructions::of(&plan(), None), &names, &[graph]).unwrap()
    }

    /// The scene as the page's script reads it.
    fn embedded(page: &str) -> serde_json::Value {
        let begin = page.find("id=\"scene\">").unwrap() + "id=\"scene\">".len();
        let end = begin + page[begin..].find("</script>").unwrap();
        serde_json::from_str(&page[begin..end]).unwrap()
    }

    #[test]
    fn positions_are_rounded_by_half_a_step_at_most() {
        let scene = scene("pair");
        let data = embedded(&written(&scene));
        let bytes = STANDARD.decode(data["bytes"].as_str().unwrap()).unwrap();
        for (drawn, mesh) in scene.drawn.iter().zip(data["meshes"].as_array().unwrap()) {
            let step = mesh["step"].as_f64().unwrap();
            let at = mesh["positions"].as_u64().unwrap() as usize;
            for (v, position) in drawn.positions.iter().enumerate() {
                for (a, x) in position.iter().enumerate() {
                    let place = at + v * 8 + a * 2;
                    let steps = u16::from_le_bytes([bytes[place], bytes[place + 1]]);
                    let read = mesh["origin"][a].as_f64().unwrap() + f64::from(steps) * step;
                    assert!((read - f64::from(*x)).abs() <= 0.51 * step, "{read} is not {x}");
                }
            }
        }
        assert_eq!(data["graphs"][0]["edges"], serde_json::json!([[0, 1]]));
        assert_eq!(
            (&data["parts"][1]["steps"], &data["steps"][0]["parts"], data["kind"].as_str()),
            (&serde_json::json!([0]), &serde_json::json!([1]), Some("disassembly"))
        );
    }

    #[test]
    fn names_cannot_break_the_page() {
        let wild = "</script><b>{{DATA}}{{SCRIPT}}";
        let page = written(&scene(wild));
        assert_eq!(embedded(&page)["name"], wild);
        assert!(!page.contains(wild) && !page.contains("<b>"));
        assert_eq!(page.matches("</script>").count(), written(&scene("pair")).matches("</script>").count());
    }
}
