//! What one dense part costs by stage, on one thread: `cargo bench --bench dense -- [MOST TRIANGLES] [KIND …]`
//! (default 1,100,000, all kinds).
//!
//! For each kind, parts of 10 thousand, 100 thousand, 1 million and 4 million triangles. Per stage: processor time in
//! microseconds per triangle, the memory above what was there before in bytes per triangle, and the exponent of the
//! time over the triangles. The stages are those that a part goes through once: reading (binary STL and OBJ), healing,
//! then what its shape derives, its distance field, and the admission of an assembly of that part alone.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use sbdp::files::load_assembly;
use sbdp::geometry::{
    Assembly, Shape, SourceAssembly, SourceMesh, SourcePart, Surface, Uniform, content_hash, heal,
    hull_vertices,
};
use sbdp::sdf::Field;
use sbdp::termination::Termination;

const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 4_000_000];
/// What a part is called, and the part with about so many triangles.
type Kind = (&'static str, fn(usize) -> SourceMesh);

const KINDS: [Kind; 6] = [
    ("sphere", sphere),
    ("scan", scan),
    ("knurl", knurl),
    ("holes", holes),
    ("open", open),
    ("pieces", pieces),
];

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the pool is built once");
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let most = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(1_100_000);
    let is_wanted = |kind: &str| arguments.iter().all(|a| a.parse::<usize>().is_ok() || a == kind);
    for (kind, make) in KINDS.iter().filter(|(kind, _)| is_wanted(kind)) {
        let mut table = Table::default();
        for size in SIZES.into_iter().filter(|size| *size <= most) {
            measure(make(size), &mut table);
        }
        println!("{}", table.told(kind));
    }
}

fn measure(mesh: SourceMesh, table: &mut Table) {
    let never = Termination::default();
    let triangles = mesh.triangles.len();
    table.sizes.push(triangles);
    for name in ["part.stl", "part.obj"] {
        let path = std::env::temp_dir().join(format!("sbdp-dense-{}-{name}", std::process::id()));
        write(&path, &mesh);
        table.add(&format!("read {name}"), || load_assembly(&path)).expect("it was just written");
        fs::remove_file(&path).expect("it was written");
    }
    let part = SourcePart { name: "part".into(), origin: "bench".into(), mesh };
    let healed = table.add("heal", || heal(&part)).expect("it can be healed").mesh;
    table.add("hull", || hull_vertices(&healed.vertices));
    let surface = table.add("trees", || Surface::new(&healed));
    table.add("mass", || surface.mass_properties());
    drop(surface);
    let shape = table.add("shape", || Shape::of(healed, &never)).expect("nothing interrupts it");
    table.add("content", || *shape.content());
    table.add("faces", || shape.faces().candidates.len());
    table.add("patches", || shape.patches(&never).map(|p| p.root())).expect("nothing interrupts it");
    table.add("oriented", || shape.oriented().iter().count());
    table.add("samples", || shape.samples().points().len());
    table.add("thickness", || shape.thickness());
    table.add("inner points", || shape.inner_points().len());
    table.add("field", || Field::build(&shape.surface, &never)).expect("nothing interrupts it");
    drop(shape);
    let source = SourceAssembly { name: "bench".into(), parts: vec![part], ..Default::default() };
    table.add("handle", || content_hash(&source));
    table.add("admission", || Assembly::new(&source)).expect("it can be taken in");
}

#[derive(Default)]
struct Table {
    sizes: Vec<usize>,
    /// By stage: seconds and bytes by size.
    stages: BTreeMap<(usize, String), Vec<(f64, f64)>>,
}

impl Table {
    fn add<T>(&mut self, stage: &str, run: impl FnOnce() -> T) -> T {
        // From now on the greatest size is that since now.
        let _ = fs::write("/proc/self/clear_refs", "5");
        let (before, started) = (resident("VmRSS"), processor_time());
        let done = black_box(run());
        let seconds = (processor_time() - started).as_secs_f64();
        let bytes = (resident("VmHWM") - before).max(0.0);
        let known = self.stages.keys().find(|(_, name)| name == stage).cloned();
        let key = known.unwrap_or((self.stages.len(), stage.to_owned()));
        self.stages.entry(key).or_default().push((seconds, bytes));
        done
    }

    fn told(&self, kind: &str) -> String {
        let mut text = format!("| {kind} |");
        self.sizes.iter().for_each(|size| _ = write!(text, " {size} |"));
        _ = write!(text, " exponent |\n|{}\n", "---|".repeat(self.sizes.len() + 2));
        for ((_, stage), costs) in &self.stages {
            _ = write!(text, "| {stage} |");
            for (size, (seconds, bytes)) in self.sizes.iter().zip(costs) {
                let per = |cost: f64| cost / *size as f64;
                _ = write!(text, " {:.2} µs, {:.0} B |", per(*seconds) * 1e6, per(*bytes));
            }
            let points: Vec<_> = self
                .sizes
                .iter()
                .zip(costs)
                .map(|(n, (s, _))| ((*n as f64).ln(), s.max(1e-6).ln()))
                .collect();
            _ = writeln!(text, " {:.2} |", slope(&points));
        }
        text
    }
}

/// The slope of the line that fits some points best.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let along: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    along / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
}

/// Bytes of this process, by their name in its status.
fn resident(name: &str) -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix(name)?.split_whitespace().nth(1)?.parse::<f64>().ok());
    line.unwrap_or(0.0) * 1024.0
}

fn write(path: &Path, mesh: &SourceMesh) {
    let bytes = if path.extension().is_some_and(|e| e == "obj") { obj(mesh).into_bytes() } else { stl(mesh) };
    fs::write(path, bytes).expect("the temporary folder can be written");
}

fn obj(mesh: &SourceMesh) -> String {
    let mut text = String::new();
    mesh.vertices.iter().for_each(|[x, y, z]| _ = writeln!(text, "v {x:.9} {y:.9} {z:.9}"));
    mesh.triangles.iter().for_each(|t| _ = writeln!(text, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1));
    text
}

fn stl(mesh: &SourceMesh) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for t in &mesh.triangles {
        bytes.extend([0; 12]);
        let corners = t.iter().flat_map(|v| mesh.vertices[*v as usize]);
        bytes.extend(corners.flat_map(|x| (x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// All vertices are on the hull.
fn sphere(triangles: usize) -> SourceMesh {
    round(triangles, |p| p)
}

/// A lumpy ball, rough by a thousandth of its size.
fn scan(triangles: usize) -> SourceMesh {
    let mut random = Uniform::seeded(b"scan");
    round(triangles, |[x, y, z]| {
        let r = 1.0
            + 0.1 * (3.0 * x).sin() * (4.0 * y).cos()
            + 0.002 * (random.number() - 0.5)
            + 0.05 * (5.0 * z).sin();
        [x * r, y * r, z * r]
    })
}

/// A sphere with a hole.
fn open(triangles: usize) -> SourceMesh {
    let mut mesh = sphere(triangles);
    mesh.triangles.retain(|t| t.iter().any(|v| mesh.vertices[*v as usize][2] < 0.9));
    mesh
}

/// Many small boxes.
fn pieces(triangles: usize) -> SourceMesh {
    let count = (triangles as f64 / 12.0).cbrt().round() as i64;
    let mut mesh = SourceMesh::default();
    for at in 0..count.pow(3) {
        let at = [at % count, at / count % count, at / count.pow(2)].map(|x| x as f64);
        let first = mesh.vertices.len() as u32;
        let corner = |i: usize| [0, 1, 2].map(|a| at[a] + if i >> a & 1 == 1 { 0.7 } else { 0.0 });
        mesh.vertices.extend((0..8).map(corner));
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            mesh.triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(|v| first + v)));
        }
    }
    mesh
}

/// The faces of an octahedron in small triangles, each corner brought to the unit sphere and then moved.
fn round(triangles: usize, mut moved: impl FnMut([f64; 3]) -> [f64; 3]) -> SourceMesh {
    let n = ((triangles as f64 / 8.0).sqrt().round() as i64).max(1);
    let mut numbers = BTreeMap::new();
    let mut mesh = SourceMesh::default();
    for signs in 0..8 {
        let sign = [0, 1, 2].map(|a| if signs >> a & 1 == 1 { -1 } else { 1 });
        let mut corner = |i: i64, j: i64| {
            let at = [i * sign[0], j * sign[1], (n - i - j) * sign[2]];
            *numbers.entry(at).or_insert_with(|| {
                let length = (at.iter().map(|x| x * x).sum::<i64>() as f64).sqrt();
                mesh.vertices.push(moved(at.map(|x| x as f64 / length)));
                mesh.vertices.len() as u32 - 1
            })
        };
        let mut faces = Vec::new();
        for i in 0..n {
            for j in 0..n - i {
                faces.push([(i, j), (i + 1, j), (i, j + 1)]);
                if i + j + 1 < n {
                    faces.push([(i + 1, j), (i + 1, j + 1), (i, j + 1)]);
                }
            }
        }
        for face in faces {
            let [a, b, c] = face.map(|(i, j)| corner(i, j));
            mesh.triangles.push(if sign.iter().product::<i64>() > 0 { [a, b, c] } else { [a, c, b] });
        }
    }
    mesh
}

/// A plate with pyramids on it, each of some hundred triangles.
fn knurl(triangles: usize) -> SourceMesh {
    plate(
        triangles,
        |_, _| true,
        |x, y| {
            let rise = |t: f64| (t * 40.0).fract().min(1.0 - (t * 40.0).fract());
            0.1 + 0.02 * rise(x).min(rise(y))
        },
    )
}

/// A plate with square holes.
fn holes(triangles: usize) -> SourceMesh {
    plate(triangles, |x, y| ((x * 30.0) as i64 % 3, (y * 30.0) as i64 % 3) != (1, 1), |_, _| 0.1)
}

/// A plate on the unit square in small squares, where it is solid, and of some height.
fn plate(triangles: usize, is_solid: fn(f64, f64) -> bool, height: fn(f64, f64) -> f64) -> SourceMesh {
    let n = ((triangles as f64 / 4.0).sqrt().round() as i64).max(1);
    let at = |i: i64| i as f64 / n as f64;
    let solid = |i: i64, j: i64| {
        (0..n).contains(&i) && (0..n).contains(&j) && is_solid(at(i) + 0.5 / n as f64, at(j) + 0.5 / n as f64)
    };
    let mut numbers = BTreeMap::new();
    let mut mesh = SourceMesh::default();
    let mut corner = |i: i64, j: i64, top: bool| {
        *numbers.entry((i, j, top)).or_insert_with(|| {
            mesh.vertices.push([at(i), at(j), if top { height(at(i), at(j)) } else { 0.0 }]);
            mesh.vertices.len() as u32 - 1
        })
    };
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| solid(i, j)) {
        let around = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let beside = [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)];
        let [low, high] = [false, true].map(|top| around.map(|(i, j)| corner(i, j, top)));
        mesh.triangles.extend([[high[0], high[1], high[2]], [high[0], high[2], high[3]]]);
        mesh.triangles.extend([[low[0], low[2], low[1]], [low[0], low[3], low[2]]]);
        for (k, _) in beside.iter().enumerate().filter(|(_, (i, j))| !solid(*i, *j)) {
            let next = (k + 1) % 4;
            mesh.triangles.extend([[low[k], low[next], high[next]], [low[k], high[next], high[k]]]);
        }
    }
    mesh
}
