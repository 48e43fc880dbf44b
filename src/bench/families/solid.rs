//! Closed solids that the families are made of: no two faces meet in a T-junction, and flat
//! contact faces of neighbours come from the same numbers.

use std::collections::HashMap;
use std::f64::consts::TAU;

use crate::geometry::SourceMesh;

/// Corners of all round outlines: shafts and bores have equally many at equal angles, so the
/// clearance is the same all round.
pub(super) const ROUND: usize = 16;

/// A point across the z axis.
type Flat = [f64; 2];

/// Vertices welded by their coordinates.
#[derive(Default)]
struct Welded {
    mesh: SourceMesh,
    known: HashMap<[i64; 3], u32>,
}

impl Welded {
    fn vertex(&mut self, p: [f64; 3]) -> u32 {
        // On a raster of a millionth: what is written is what is welded.
        let key = p.map(|c| (c * 1e6).round() as i64);
        *self.known.entry(key).or_insert_with(|| {
            self.mesh.vertices.push(key.map(|c| c as f64 / 1e6));
            self.mesh.vertices.len() as u32 - 1
        })
    }

    fn triangle(&mut self, corners: [[f64; 3]; 3]) {
        let t = corners.map(|p| self.vertex(p));
        if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
            self.mesh.triangles.push(t);
        }
    }

    /// A face of four corners, counter-clockwise from outside.
    fn quad(&mut self, [a, b, c, d]: [[f64; 3]; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// The band between two loops of equally many corners, below the flat face between them or
    /// above it (`up`): `outer` counter-clockwise around `inner`.
    fn ring(&mut self, inner: &[Flat], outer: &[Flat], z: f64, up: bool) {
        for (i, j) in sides(inner.len()) {
            let mut quad = [inner[i], outer[i], outer[j], inner[j]].map(|p| at(p, z));
            if !up {
                quad.reverse();
            }
            self.quad(quad);
        }
    }

    /// The wall on a loop, seen from without (`out`) or from within.
    fn wall(&mut self, outline: &[Flat], z: [f64; 2], out: bool) {
        for (i, j) in sides(outline.len()) {
            let (p, q) = (outline[i], outline[j]);
            let mut quad = [at(p, z[0]), at(q, z[0]), at(q, z[1]), at(p, z[1])];
            if !out {
                quad.reverse();
            }
            self.quad(quad);
        }
    }
}

fn at([x, y]: Flat, z: f64) -> [f64; 3] {
    [x, y, z]
}

fn sides(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).map(move |i| (i, (i + 1) % count))
}

/// A circle's corners about a centre.
fn round(radius: f64, [x, y]: Flat) -> Vec<Flat> {
    let angle = |i: usize| i as f64 * TAU / ROUND as f64;
    (0..ROUND).map(|i| [x + radius * angle(i).cos(), y + radius * angle(i).sin()]).collect()
}

/// A body of revolution about z: its outline from the axis, up the outside and back to the axis, as
/// (radius, z).
pub(super) fn turned(outline: &[[f64; 2]]) -> SourceMesh {
    let mut solid = Welded::default();
    for pair in outline.windows(2) {
        let loops = [0, 1].map(|k: usize| round(pair[k][0], [0.0; 2]));
        for (i, j) in sides(ROUND) {
            let [low, high] =
                [0, 1].map(|k: usize| [at(loops[k][i], pair[k][1]), at(loops[k][j], pair[k][1])]);
            solid.quad([low[0], low[1], high[1], high[0]]);
        }
    }
    solid.mesh
}

/// A tube about z.
pub(super) fn tube(inner: f64, outer: f64, z: [f64; 2]) -> SourceMesh {
    pierced(&round(outer, [0.0; 2]), &round(inner, [0.0; 2]), z)
}

/// A prism about z with a bore of as many corners.
fn pierced(outer: &[Flat], inner: &[Flat], z: [f64; 2]) -> SourceMesh {
    let mut solid = Welded::default();
    solid.wall(outer, z, true);
    solid.wall(inner, z, false);
    solid.ring(inner, outer, z[0], false);
    solid.ring(inner, outer, z[1], true);
    solid.mesh
}

/// A toothed wheel about z with a bore; tooth 0 points along x if `phase` (in teeth) is 0.
pub(super) fn gear(teeth: usize, phase: f64, radii: [f64; 3], z: [f64; 2]) -> SourceMesh {
    let [bore, root, tip] = radii;
    let pitch = TAU / teeth as f64;
    // Tooth flanks, as shares of the pitch either side of the tooth's middle, and where they end.
    let corners = [(-0.2, root), (-0.1, tip), (0.1, tip), (0.2, root)];
    let polar = |angle: f64, radius: f64| [radius * angle.cos(), radius * angle.sin()];
    let angles = (0..teeth).flat_map(|t| corners.map(|(c, r)| ((t as f64 + phase + c) * pitch, r)));
    let (mut outer, mut inner) = (Vec::new(), Vec::new());
    for (angle, radius) in angles {
        outer.push(polar(angle, radius));
        inner.push(polar(angle, bore));
    }
    pierced(&outer, &inner, z)
}

/// A plate of square tiles in the xy plane from the origin, some with a bore in the middle.
pub(super) fn plate(
    tiles: [usize; 2],
    tile: f64,
    z: [f64; 2],
    bore: impl Fn(usize, usize) -> Option<f64>,
) -> SourceMesh {
    let mut solid = Welded::default();
    for (i, j) in (0..tiles[0]).flat_map(|i| (0..tiles[1]).map(move |j| (i, j))) {
        let middle = [(i as f64 + 0.5) * tile, (j as f64 + 0.5) * tile];
        let border = square(middle, tile);
        match bore(i, j) {
            Some(radius) => {
                let rim = round(radius, middle);
                solid.wall(&rim, z, false);
                solid.ring(&rim, &border, z[0], false);
                solid.ring(&rim, &border, z[1], true);
            }
            None => {
                let point = vec![middle; ROUND];
                solid.ring(&point, &border, z[0], false);
                solid.ring(&point, &border, z[1], true);
            }
        }
        // Where no tile follows: the sides towards +x, +y, −x, −y, a quarter of the border each.
        let ends = [i + 1 == tiles[0], j + 1 == tiles[1], i == 0, j == 0];
        for (side, _) in ends.into_iter().enumerate().filter(|(_, end)| *end) {
            for step in 0..ROUND / 4 {
                let k = (side * ROUND / 4 + ROUND - ROUND / 8 + step) % ROUND;
                let (p, q) = (border[k], border[(k + 1) % ROUND]);
                solid.quad([at(p, z[0]), at(q, z[0]), at(q, z[1]), at(p, z[1])]);
            }
        }
    }
    solid.mesh
}

/// A square's border, as many corners as a circle has, starting in the middle of the side at +x.
fn square([x, y]: Flat, side: f64) -> Vec<Flat> {
    let quarter = ROUND / 4;
    let place = |i: usize| {
        let along = ((i + quarter / 2) % quarter) as f64 / quarter as f64 - 0.5;
        let half = side / 2.0;
        match (i + quarter / 2) / quarter % 4 {
            0 => [x + half, y + along * side],
            1 => [x - along * side, y + half],
            2 => [x - half, y - along * side],
            _ => [x + along * side, y - half],
        }
    };
    (0..ROUND).map(place).collect()
}

/// The solid made of the filled cells of a grid with the given planes; all its grid faces are there,
/// so it is closed without T-junctions.
pub(crate) fn cells(planes: [&[f64]; 3], filled: impl Fn([usize; 3]) -> bool) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    let mut known: HashMap<[usize; 3], u32> = HashMap::new();
    let count = planes.map(|p| p.len() - 1);
    for i in 0..count.iter().product() {
        let cell = [i % count[0], i / count[0] % count[1], i / (count[0] * count[1])];
        if !filled(cell) {
            continue;
        }
        for axis in 0..3 {
            for up in [false, true] {
                let mut beside = cell;
                beside[axis] = cell[axis].wrapping_add(if up { 1 } else { usize::MAX });
                if beside[axis] < count[axis] && filled(beside) {
                    continue;
                }
                let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[s, t]| {
                    let mut node = cell;
                    node[axis] += usize::from(up);
                    node[(axis + 1) % 3] += s;
                    node[(axis + 2) % 3] += t;
                    *known.entry(node).or_insert_with(|| {
                        mesh.vertices.push(std::array::from_fn(|a| planes[a][node[a]]));
                        mesh.vertices.len() as u32 - 1
                    })
                });
                if !up {
                    quad.reverse();
                }
                mesh.triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
            }
        }
    }
    mesh
}

/// A solid elsewhere.
pub(super) fn moved(mut mesh: SourceMesh, by: [f64; 3]) -> SourceMesh {
    mesh.vertices.iter_mut().for_each(|v| *v = std::array::from_fn(|a| v[a] + by[a]));
    mesh
}

/// A solid with x and y exchanged.
pub(super) fn across(mut mesh: SourceMesh) -> SourceMesh {
    mesh.vertices.iter_mut().for_each(|v| v.swap(0, 1));
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}
