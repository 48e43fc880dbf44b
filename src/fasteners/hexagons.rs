//! Regular hexagonal prisms in a surface: six equal flats around a line.

use nalgebra::{Matrix2, Point3, Unit, Vector2, Vector3};

use super::CentreLine;
use super::round_faces::RoundFace;
use crate::geometry::Surface;
use crate::tolerances::{FLAT_SHARE, FLAT_SPREAD, HEXAGON_SPREAD};

/// Six flats around a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hexagon {
    pub(super) line: CentreLine,
    /// Where the flats begin and end along the line.
    pub(super) along: [f64; 2],
    /// The distance of opposite flats.
    pub(super) across_flats: f64,
    /// Whether the flats face the line.
    pub(super) is_socket: bool,
}

impl Hexagon {
    pub(super) fn length(&self) -> f64 {
        self.along[1] - self.along[0]
    }

    /// The round face inside it that is as long.
    pub(super) fn extent(&self) -> RoundFace {
        RoundFace { radius: self.across_flats / 2.0, along: self.along, is_hole: self.is_socket }
    }
}

/// Triangles of a surface that are connected and in one plane.
struct FlatFace {
    normal: Vector3<f64>,
    /// Of the plane along its normal.
    offset: f64,
    area: f64,
    triangles: Vec<u32>,
}

/// The hexagons of a surface, those with the largest flats first.
pub(super) fn hexagons(surface: &Surface) -> Vec<Hexagon> {
    let faces = flat_faces(surface);
    let mut found: Vec<Hexagon> = Vec::new();
    for (i, face) in faces.iter().enumerate() {
        // Largest first: what follows is smaller.
        let alike: Vec<&FlatFace> =
            faces[i..].iter().take_while(|other| other.area >= face.area * (1.0 - HEXAGON_SPREAD)).collect();
        let neighbours =
            alike.iter().filter(|other| (other.normal.dot(&face.normal) - 0.5).abs() < FLAT_SPREAD);
        let hexagons = neighbours.filter_map(|next| hexagon(surface, [face, next], &alike));
        for hexagon in hexagons {
            let is_known = found.iter().any(|known| {
                known.line.to(&hexagon.line.point).norm() <= HEXAGON_SPREAD * hexagon.across_flats
                    && known.line.direction.dot(&hexagon.line.direction).abs() > 1.0 - FLAT_SPREAD
            });
            if !is_known {
                found.push(hexagon);
            }
        }
    }
    found
}

/// The hexagon that has two neighbouring flats, and the other four among faces of their size.
fn hexagon(surface: &Surface, pair: [&FlatFace; 2], alike: &[&FlatFace]) -> Option<Hexagon> {
    let [a, b] = pair.map(|face| face.normal);
    let direction = Unit::try_new(a.cross(&b), f64::EPSILON)?;
    let sides = [a, b, b - a, -a, -b, a - b];
    let is_at = |face: &FlatFace, side: &Vector3<f64>| face.normal.dot(side) > 1.0 - FLAT_SPREAD;
    let flats: Vec<&FlatFace> = sides
        .iter()
        .map(|side| {
            let mut at = alike.iter().filter(|face| is_at(face, side));
            // Another prism has the same normals: then its flats are at other distances, which are compared below.
            at.next().copied().filter(|_| at.next().is_none())
        })
        .collect::<Option<_>>()?;
    // Of opposite flats, the sum of the offsets is the distance, and the difference places the line between them.
    let across: Vec<f64> = (0..3).map(|i| flats[i].offset + flats[i + 3].offset).collect();
    let middle = |i: usize| (flats[i].offset - flats[i + 3].offset) / 2.0;
    let size = across[0].abs();
    let is_regular = across.iter().all(|width| (width - across[0]).abs() <= HEXAGON_SPREAD * size)
        && (middle(1) - middle(0) - middle(2)).abs() <= HEXAGON_SPREAD * size;
    let gram = Matrix2::new(a.dot(&a), a.dot(&b), a.dot(&b), b.dot(&b)).try_inverse()?;
    let along_sides = gram * Vector2::new(middle(0), middle(1));
    let point = Point3::from(a * along_sides.x + b * along_sides.y);
    let line = CentreLine { point, direction };
    let heights = |face: &&FlatFace| {
        let corners = face.triangles.iter().flat_map(|&t| surface.corners(t)).map(|p| line.along(&p));
        corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], at| [lo.min(at), hi.max(at)])
    };
    let along = flats
        .iter()
        .map(heights)
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [from, to]| [lo.min(from), hi.max(to)]);
    // The flats of a hexagon meet at its corners; those of a gear's teeth, which are as regular, do not.
    let whole = size / 3f64.sqrt() * (along[1] - along[0]);
    let meets =
        flats.iter().all(|face| face.area >= whole / 2.0 && face.area <= whole * (1.0 + HEXAGON_SPREAD));
    let is_socket = across[0] < 0.0;
    (is_regular && meets).then_some(Hexagon { line, along, across_flats: size, is_socket })
}

/// The flat faces of a surface, without the smallest, largest first.
fn flat_faces(surface: &Surface) -> Vec<FlatFace> {
    let count = surface.triangles().len();
    let area_of = |t: u32| {
        let [a, b, c] = surface.corners(t);
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    let whole: f64 = (0..count as u32).map(area_of).sum();
    let mut is_taken = vec![false; count];
    let mut faces = Vec::new();
    for seed in 0..count as u32 {
        if std::mem::replace(&mut is_taken[seed as usize], true) {
            continue;
        }
        let normal = surface.face_normal(seed);
        let (mut triangles, mut next, mut area) = (vec![seed], 0, 0.0);
        while let Some(&t) = triangles.get(next) {
            next += 1;
            area += area_of(t);
            for edge in 0..3 {
                let other = surface.neighbour(t, edge);
                let is_flat = other != u32::MAX
                    && !is_taken[other as usize]
                    && surface.face_normal(other).dot(&normal) > 1.0 - FLAT_SPREAD * FLAT_SPREAD;
                if is_flat {
                    is_taken[other as usize] = true;
                    triangles.push(other);
                }
            }
        }
        if area >= FLAT_SHARE * whole {
            let offset = surface.corners(seed)[0].coords.dot(&normal);
            faces.push(FlatFace { normal, offset, area, triangles });
        }
    }
    faces.sort_by(|a, b| b.area.total_cmp(&a.area));
    faces
}
