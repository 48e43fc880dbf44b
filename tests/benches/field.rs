//! Distance fields against a plain dense grid of the same cells:
//! `cargo bench --bench field -- FOLDER …` for assemblies in folders (or `SBDP_MESHES=FOLDER:…`), else
//! for a torus and a bar. A folder that is no assembly itself is searched one level down.
//!
//! One line per assembly. `built` is what a plan waits for; bricks are filled when they are looked
//! at, here all at once, on all cores. Cells are those of the bricks that the band touches, and all
//! of the box for `dense`, which is measured on one thread and has no signs. Errors are those of
//! interpolated values near the surface against exact triangle distances, in cells; wrong are signs
//! further from the surface than the error bound, on closed meshes, told by solid angles where they
//! differ from those of the exact distance (`of exact`: the latter are wrong); `over` are lower bounds
//! above the distance.

mod folders;

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::{Point3, Vector3};
use sbdp::files::load_assembly;
use sbdp::geometry::{Assembly, Bounds, SourceAssembly, SourceMesh, SourcePart, Surface};
use sbdp::sdf::Field;
use sbdp::termination::Termination;

/// Half-width of the band in cells.
const BAND: f64 = 3.0;
/// Cells in a brick.
const BRICK: usize = 512;
/// Points of each shape at which its field is compared with exact distances: all over the box, and
/// as many beside triangles.
const POINTS: usize = 4000;
/// Dense grids with more cells (512 MB) are not made.
const MOST_DENSE: usize = 1 << 26;
/// A time is the least of so many, as long as they take less than a tenth of a second each.
const RUNS: usize = 3;

fn main() {
    let folders = folders::given();
    println!(
        "| assembly | triangles | bricks | built, ms | filled, ms | Mcells/s | dense Mcells/s | MB built | MB filled | MB dense | error max | mean | wrong signs | of exact | over |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    if folders.is_empty() {
        measure(&fixtures()).print("torus and bar");
    }
    let mut all = Figures::default();
    for folder in &folders {
        let name = folders::name(folder);
        match load_assembly(folder) {
            Ok(source) => {
                let figures = measure(&source);
                figures.print(&name);
                all.add(&figures);
            }
            Err(error) => println!("| {name} | {error} |"),
        }
    }
    if !folders.is_empty() {
        all.print("all");
    }
}

/// A torus, finely tessellated, and a flat bar.
fn fixtures() -> SourceAssembly {
    let (around, across) = (128u32, 48u32);
    let mut torus = SourceMesh::default();
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let (s, c) = (f64::from(i) * std::f64::consts::TAU / f64::from(around)).sin_cos();
        let (v, u) = (f64::from(j) * std::f64::consts::TAU / f64::from(across)).sin_cos();
        torus.vertices.push([(3.0 + u) * c, (3.0 + u) * s, v]);
        let at = |i: u32, j: u32| i % around * across + j % across;
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        torus.triangles.extend([[a, b, c], [a, c, d]]);
    }
    let corner = |i: usize| {
        let pick = |a: usize, lo: f64, hi: f64| if i >> a & 1 == 0 { lo } else { hi };
        [pick(0, -4.0, 4.0), pick(1, -0.5, 0.5), pick(2, 2.0, 2.3)]
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let bar = SourceMesh {
        vertices: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
    };
    let part = |(i, mesh): (usize, _)| SourcePart { name: i.to_string(), origin: "benchmark".into(), mesh };
    let parts = [torus, bar].into_iter().enumerate().map(part).collect();
    SourceAssembly { name: "torus and bar".into(), parts, ..SourceAssembly::default() }
}

/// What was measured, summed over shapes.
#[derive(Default)]
struct Figures {
    triangles: usize,
    bricks: usize,
    built: Duration,
    filled: Duration,
    dense: Duration,
    /// Cells of the dense grids that were made.
    dense_cells: usize,
    /// Bytes built, filled, and of dense grids, made or not.
    bytes: [usize; 3],
    error: Errors,
}

#[derive(Default)]
struct Errors {
    largest: f64,
    sum: f64,
    near: usize,
    wrong: usize,
    /// Those of [`Surface::signed_distance`].
    wrong_exact: usize,
    signs: usize,
    over: usize,
}

impl Figures {
    fn add(&mut self, other: &Self) {
        self.triangles += other.triangles;
        self.bricks += other.bricks;
        self.built += other.built;
        self.filled += other.filled;
        self.dense += other.dense;
        self.dense_cells += other.dense_cells;
        self.bytes = std::array::from_fn(|k| self.bytes[k] + other.bytes[k]);
        let (mine, other) = (&mut self.error, &other.error);
        mine.largest = mine.largest.max(other.largest);
        mine.sum += other.sum;
        mine.near += other.near;
        mine.wrong += other.wrong;
        mine.wrong_exact += other.wrong_exact;
        mine.signs += other.signs;
        mine.over += other.over;
    }

    fn print(&self, name: &str) {
        let rate = |cells: usize, time: Duration| cells as f64 / time.as_secs_f64().max(1e-9) / 1e6;
        let [built, filled, dense] = self.bytes.map(|b| b as f64 / f64::from(1 << 20));
        let e = &self.error;
        println!(
            "| {name} | {} | {} | {:.2} | {:.1} | {:.1} | {:.1} | {built:.2} | {filled:.1} | {dense:.0} | {:.3} | \
             {:.4} | {} of {} | {} | {} |",
            self.triangles,
            self.bricks,
            self.built.as_secs_f64() * 1e3,
            self.filled.as_secs_f64() * 1e3,
            rate(self.bricks * BRICK, self.built + self.filled),
            rate(self.dense_cells, self.dense),
            e.largest,
            e.sum / e.near.max(1) as f64,
            e.wrong,
            e.signs,
            e.wrong_exact,
            e.over,
        );
    }
}

/// The least time that something takes, with what came of it last.
fn least<T>(mut run: impl FnMut() -> T) -> (Duration, T) {
    let mut timed = || {
        let started = Instant::now();
        let out = run();
        (started.elapsed(), out)
    };
    let (mut best, mut out) = timed();
    for _ in 1..RUNS {
        if best > Duration::from_millis(100) {
            break;
        }
        let (time, next) = timed();
        (best, out) = (best.min(time), next);
    }
    (best, out)
}

fn measure(source: &SourceAssembly) -> Figures {
    let assembly = Assembly::new(source).expect("the meshes can be used");
    let mut sum = Figures::default();
    for shape in &assembly.shapes {
        let surface = &shape.surface;
        let build = || Field::build(surface, &Termination::default()).expect("nobody cancels");
        let (built, unfilled) = least(|| build().memory());
        let (whole, field) = least(|| {
            let field = build();
            field.fill();
            field
        });
        let filled = whole.saturating_sub(built);
        let (cells, _) = dense_size(surface, field.cell());
        let dense = (cells <= MOST_DENSE).then(|| least(|| dense_grid(surface, field.cell())).0);
        sum.add(&Figures {
            triangles: surface.triangles().len(),
            bricks: field.bricks(),
            built,
            filled,
            dense: dense.unwrap_or_default(),
            dense_cells: if dense.is_some() { cells } else { 0 },
            bytes: [unfilled, field.memory(), cells * 8],
            error: errors(surface, &field),
        });
    }
    sum
}

fn errors(surface: &Arc<Surface>, field: &Field) -> Errors {
    let mut out = Errors::default();
    for p in spread(&surface.bounds().grown(4.0 * field.cell())).chain(beside(surface, field.cell())) {
        let (mut exact, estimate) = (surface.signed_distance(&p), field.estimate(&p));
        out.over += usize::from(estimate.lower_bound > exact.abs() + 1e-9);
        let (told, beyond) = (!surface.is_open(), exact.abs() > field.error_bound());
        out.signs += usize::from(told && beyond);
        // Where the two signs differ, the solid angles of all triangles decide.
        if told && (estimate.value < 0.0) != (exact < 0.0) {
            let inside = winding(surface, &p) > 0.5;
            out.wrong += usize::from(beyond && (estimate.value < 0.0) != inside);
            out.wrong_exact += usize::from(beyond && (exact < 0.0) != inside);
            exact = if inside { -exact.abs() } else { exact.abs() };
        }
        // All corners of the cell are in the band then.
        if exact.abs() < (BAND - 3f64.sqrt()) * field.cell() {
            let error = (estimate.value.abs() - exact.abs()).abs() / field.cell();
            let error = if surface.is_open() { error } else { (estimate.value - exact).abs() / field.cell() };
            out.near += 1;
            out.sum += error;
            out.largest = out.largest.max(error);
        }
    }
    out
}

/// How often a surface winds around a point, by the solid angle of each triangle (A. van Oosterom and
/// J. Strackee 1983).
fn winding(surface: &Surface, p: &Point3<f64>) -> f64 {
    let angle = |t: u32| {
        let [a, b, c] = surface.corners(t).map(|x| x - p);
        let [u, v, w] = [a.norm(), b.norm(), c.norm()];
        let below = u * v * w + a.dot(&b) * w + b.dot(&c) * u + c.dot(&a) * v;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    };
    (0..surface.triangles().len() as u32).map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Points all over a box (R₃ sequence of M. Roberts 2018).
fn spread(bounds: &Bounds) -> impl Iterator<Item = Point3<f64>> {
    let (min, size) = (bounds.min, bounds.extents());
    (1..=POINTS).map(move |i| min + step(i).component_mul(&size))
}

fn step(i: usize) -> Vector3<f64> {
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_5];
    Vector3::from(STEPS).map(|s| (i as f64 * s).fract())
}

/// Points up to three cells off the surface, on triangles in turn.
fn beside(surface: &Surface, cell: f64) -> impl Iterator<Item = Point3<f64>> {
    let count = surface.triangles().len();
    (1..=POINTS).map(move |i| {
        let t = (i * count / POINTS + i * 31) % count;
        let [a, b, c] = surface.corners(t as u32);
        let at = step(i);
        let (u, v) = if at.x + at.y > 1.0 { (1.0 - at.x, 1.0 - at.y) } else { (at.x, at.y) };
        let on = a + (b - a) * u + (c - a) * v;
        on + surface.face_normal(t as u32) * ((at.z * 2.0 - 1.0) * BAND * cell)
    })
}

fn dense_size(surface: &Surface, cell: f64) -> (usize, [usize; 3]) {
    let size = surface.bounds().grown(BAND * cell).extents() / cell;
    let dims = [0, 1, 2].map(|a| size[a].ceil() as usize + 1);
    (dims.iter().product(), dims)
}

/// Distances and nearest triangles on all nodes of the box, by scatter of each triangle.
fn dense_grid(surface: &Surface, cell: f64) -> (Vec<f32>, Vec<u32>) {
    let (count, dims) = dense_size(surface, cell);
    let origin = surface.bounds().grown(BAND * cell).min;
    let (mut squared, mut nearest) = (vec![(BAND * cell).powi(2) as f32; count], vec![u32::MAX; count]);
    for t in 0..surface.triangles().len() as u32 {
        let corners = surface.corners(t);
        let normal = surface.face_normal(t);
        let b = Bounds::of(&corners).grown(BAND * cell);
        let lo = [0, 1, 2].map(|a| ((b.min[a] - origin[a]) / cell).max(0.0).ceil() as usize);
        let hi = [0, 1, 2].map(|a| (((b.max[a] - origin[a]) / cell) as usize).min(dims[a] - 1));
        for (z, y) in (lo[2]..=hi[2]).flat_map(|z| (lo[1]..=hi[1]).map(move |y| (z, y))) {
            for x in lo[0]..=hi[0] {
                let p = origin + Vector3::new(x as f64, y as f64, z as f64) * cell;
                let i = (z * dims[1] + y) * dims[0] + x;
                if normal.dot(&(p - corners[0])).powi(2) as f32 >= squared[i] {
                    continue;
                }
                let d = surface.closest_on(t, &p).distance.powi(2) as f32;
                if d < squared[i] {
                    (squared[i], nearest[i]) = (d, t);
                }
            }
        }
    }
    (squared, nearest)
}
