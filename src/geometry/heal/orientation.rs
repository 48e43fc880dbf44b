//! Orientation: all triangles of a surface counter-clockwise from the same side.

use nalgebra::{Point3, Vector3};

use super::{Draft, Findings};
use crate::geometry::incidence::{Side, Sides};
use crate::geometry::mesh;

/// Floods each surface over the edges where exactly two triangles meet and turns the minority of its triangles. Whether
/// some surface has one side only (a Möbius strip): no orientation is consistent.
pub(super) fn orient(draft: &mut Draft, sides: &mut Sides, findings: &mut Findings) -> bool {
    let agree = |sides: &[Side]| !matches!(sides, [a, b] if a.upwards() == b.upwards());
    if sides.iter().all(|(_, sides)| agree(sides)) {
        return false;
    }
    let neighbours = neighbours(draft.triangles.len(), sides);
    let mut flood = Flood { turned: vec![None; draft.triangles.len()], one_sided: false };
    let mut is_turned = vec![false; draft.triangles.len()];
    let mut count = 0;
    for seed in 0..draft.triangles.len() {
        if flood.turned[seed].is_some() {
            continue;
        }
        let surface = flood.run(seed, &neighbours);
        let turned = surface.iter().filter(|&&t| flood.turned[t] == Some(true)).count();
        let minority = 2 * turned <= surface.len();
        for &t in surface.iter().filter(|&&t| flood.turned[t] == Some(minority)) {
            draft.triangles[t].swap(1, 2);
            is_turned[t] = true;
            count += 1;
        }
    }
    sides.turn(|t| is_turned[t as usize]);
    findings.add(count, "triangle", "turned to agree with their neighbours");
    flood.one_sided
}

/// The neighbours of a triangle over manifold edges, and whether they agree with it.
type EdgeNeighbours = [Option<(u32, bool)>; 3];

fn neighbours(triangles: usize, sides: &Sides) -> Vec<EdgeNeighbours> {
    let mut neighbours = vec![EdgeNeighbours::default(); triangles];
    let mut add = |to: u32, neighbour: (u32, bool)| {
        if let Some(free) = neighbours[to as usize].iter_mut().find(|n| n.is_none()) {
            *free = Some(neighbour);
        }
    };
    for (_, sides) in sides.iter() {
        let [a, b] = sides else { continue };
        let agree = a.upwards() != b.upwards();
        add(a.triangle(), (b.triangle(), agree));
        add(b.triangle(), (a.triangle(), agree));
    }
    neighbours
}

struct Flood {
    turned: Vec<Option<bool>>,
    one_sided: bool,
}

impl Flood {
    /// The surface of a seed, its triangles marked by whether they must turn to agree with it.
    fn run(&mut self, seed: usize, neighbours: &[EdgeNeighbours]) -> Vec<usize> {
        self.turned[seed] = Some(false);
        let mut surface = vec![seed];
        let mut next = 0;
        while let Some(&t) = surface.get(next) {
            next += 1;
            let here = self.turned[t] == Some(true);
            for &(other, agree) in neighbours[t].iter().flatten() {
                let wanted = here == agree;
                let other = other as usize;
                match self.turned[other] {
                    None => {
                        self.turned[other] = Some(wanted);
                        surface.push(other);
                    }
                    Some(is) => self.one_sided |= is != wanted,
                }
            }
        }
        surface
    }
}

/// Turns an open part so that its winding number is positive inside in sum. Patches are
/// turned together: one alone may be flat and has no outside of its own.
pub(super) fn face_outward(draft: &mut Draft) {
    // An open surface: seen from its middle.
    let (lo, hi) = mesh::bounds(&draft.vertices);
    let middle = nalgebra::center(&lo, &hi);
    if mesh::signed_volume(&draft.vertices, draft.triangles.iter().copied(), &middle) < 0.0 {
        draft.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
}

/// How often a closed surface winds around a point (van Oosterom and Strackee 1983).
pub(super) fn winding_number(
    vertices: &[Point3<f64>],
    triangles: impl Iterator<Item = [u32; 3]>,
    at: &Point3<f64>,
) -> f64 {
    let solid_angle = |t: [u32; 3]| {
        let [a, b, c]: [Vector3<f64>; 3] = t.map(|v| vertices[v as usize] - at);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let det = a.dot(&b.cross(&c));
        let div = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        2.0 * det.atan2(div)
    };
    triangles.map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
