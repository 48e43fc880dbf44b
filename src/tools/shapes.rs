//! The shapes of tools, by the width across flats of the hexagon that they turn.
//!
//! In a tool's frame the fastener's line is the z axis, outward is +z, the outer end of the flats is at z = 0, and the
//! handle points along +x. All lengths are multiples of the width across flats: the standards' tables are nearly
//! proportional, and so the unit of length does not matter.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Mesh, Shape, Solidity};
use crate::termination::{Interrupt, Termination};

/// What turns a hexagon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolKind {
    /// A hexagon socket on a ratchet (ISO 2725), which swings where nothing is in its way.
    Socket,
    /// A flat ring spanner with twelve corners.
    RingSpanner,
    /// A wrench with an open end at 15° to its handle, which is turned over between two swings.
    OpenEndWrench,
    /// A key for hexagon sockets, its short arm in the socket (ISO 2936).
    HexKey,
}

impl ToolKind {
    /// Its name in documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Socket => "socket",
            Self::RingSpanner => "ring_spanner",
            Self::OpenEndWrench => "open_end_wrench",
            Self::HexKey => "hex_key",
        }
    }

    /// The angle in radians by which it has to swing to turn the hexagon on and on; 0 for a ratchet.
    #[must_use]
    pub fn least_swing(self) -> f64 {
        let degrees: f64 = match self {
            Self::Socket => 0.0,
            Self::RingSpanner | Self::OpenEndWrench => 30.0,
            Self::HexKey => 60.0,
        };
        degrees.to_radians()
    }
}

/// Half of the width across the corners of a hexagon, with the room that a tool leaves there.
const CORNERS: f64 = 0.6;
/// The outer radius of a socket: 0.69 (24 mm) to 0.75 (10 mm) by DIN 3124.
const SOCKET: f64 = 0.75;
/// The length of a socket with its ratchet, which swings beyond: 25 mm and 35 mm for 10 to 13 mm.
const SOCKET_LENGTH: f64 = 6.0;
/// From so far above its place a socket or a ring is lowered: over the ends of bolts, which stick out of their nuts by half of
/// this. At half, it need not pass what is right above the fastener; at double, a ceiling keeps tools away that can be
/// brought in under it.
const LIFTED: f64 = 2.0;
/// The outer radius of a ring: 0.75 to 0.8 of common makes, less than ISO 3318 allows.
const RING: f64 = 0.8;
/// The height of a ring: 0.6 to 0.7.
const RING_HEIGHT: f64 = 0.65;
/// Half of the width of a head with an open end: 1.05 to 1.2 of common makes, less than ISO 3318 allows.
const HEAD: f64 = 1.15;
/// Its height: 0.45 to 0.55.
const HEAD_HEIGHT: f64 = 0.5;
/// Half of the width of a handle, and its height.
const HANDLE: [f64; 2] = [0.28, 0.35];
/// The length of a handle from the fastener's line: 12 to 13 for 10 to 19 mm.
const HANDLE_LENGTH: f64 = 12.0;
/// The arms of a key: 4 to 5.6 and 11 to 16 for 10 to 5 mm by ISO 2936.
const KEY_ARMS: [f64; 2] = [5.0, 14.0];
/// Sides of what is round. The outside is drawn around the circle, so it is no narrower.
const SIDES: usize = 24;

/// A tool that is on its hexagon.
#[derive(Debug)]
pub(super) struct Tool {
    pub(super) kind: ToolKind,
    pub(super) shape: Shape,
    /// From where it comes, as a shift of the tool's frame.
    pub(super) approach: Vector3<f64>,
    /// How far it reaches from the origin.
    pub(super) reach: f64,
}

impl Tool {
    /// A tool for a hexagon of some width across flats whose flats are as long as `length`.
    pub(super) fn new(
        kind: ToolKind,
        across_flats: f64,
        length: f64,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let s = across_flats;
        let length = length / s;
        // A head that is lower than the flats is in their middle.
        let bottom = |height: f64| -(0.95 * length).min((length + height) / 2.0);
        let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new(), solidity: Solidity::Winding };
        let approach = match kind {
            ToolKind::Socket => {
                add_ring(&mut mesh, [CORNERS, SOCKET], [-0.95 * length, SOCKET_LENGTH - length]);
                Vector3::z() * LIFTED
            }
            ToolKind::RingSpanner => {
                let low = bottom(RING_HEIGHT);
                add_ring(&mut mesh, [CORNERS, RING], [low, low + RING_HEIGHT]);
                let middle = low + RING_HEIGHT / 2.0;
                add_handle(&mut mesh, RING - 0.05, middle);
                Vector3::z() * LIFTED
            }
            ToolKind::OpenEndWrench => {
                let low = bottom(HEAD_HEIGHT);
                let heights = [low, low + HEAD_HEIGHT];
                // Two jaws as long as the flats, and what joins them towards the handle.
                for [from, to] in [[-HEAD, -0.51], [0.51, HEAD]] {
                    add_box(&mut mesh, [-0.3, from, heights[0]], [0.6, to, heights[1]]);
                }
                add_box(&mut mesh, [CORNERS, -HEAD, heights[0]], [HEAD, HEAD, heights[1]]);
                add_handle(&mut mesh, HEAD - 0.05, low + HEAD_HEIGHT / 2.0);
                Vector3::x() * (2.0 * HEAD)
            }
            ToolKind::HexKey => {
                let [short, long] = KEY_ARMS;
                let top = short - length;
                add_prism(&mut mesh, 0.5, [-0.95 * length, top]);
                add_box(&mut mesh, [-0.5, -0.5, top - 1.0], [long, 0.5, top]);
                Vector3::z() * (length + 0.5)
            }
        };
        mesh.vertices.iter_mut().for_each(|p| *p *= s);
        let reach = mesh.vertices.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
        Ok(Self { kind, shape: Shape::of(mesh, termination)?, approach: approach * s, reach })
    }
}

fn add_handle(mesh: &mut Mesh, from: f64, middle: f64) {
    let [half, height] = HANDLE;
    add_box(mesh, [from, -half, middle - height / 2.0], [HANDLE_LENGTH, half, middle + height / 2.0]);
}

fn add_box(mesh: &mut Mesh, lo: [f64; 3], hi: [f64; 3]) {
    add_column(mesh, &[[lo[0], lo[1]], [hi[0], lo[1]], [hi[0], hi[1]], [lo[0], hi[1]]], [lo[2], hi[2]]);
}

fn add_prism(mesh: &mut Mesh, radius: f64, heights: [f64; 2]) {
    add_column(mesh, &circle(radius), heights);
}

/// Corners of a regular polygon around a circle, counter-clockwise.
fn circle(radius: f64) -> Vec<[f64; 2]> {
    let step = std::f64::consts::TAU / SIDES as f64;
    let outer = radius / (step / 2.0).cos();
    (0..SIDES).map(|i| (i as f64 * step).sin_cos()).map(|(sin, cos)| [outer * cos, outer * sin]).collect()
}

/// A convex column over a polygon, counter-clockwise.
fn add_column(mesh: &mut Mesh, corners: &[[f64; 2]], heights: [f64; 2]) {
    let (first, n) = (mesh.vertices.len() as u32, corners.len() as u32);
    let at = |height: f64| corners.iter().map(move |c| Point3::new(c[0], c[1], height));
    mesh.vertices.extend(heights.into_iter().flat_map(at));
    add_sides(mesh, [first, first + n], n);
    for i in 1..n - 1 {
        mesh.triangles.push([first, first + i + 1, first + i]);
        mesh.triangles.push([first + n, first + n + i, first + n + i + 1]);
    }
}

/// A tube about z.
fn add_ring(mesh: &mut Mesh, [inner, outer]: [f64; 2], heights: [f64; 2]) {
    let (first, n) = (mesh.vertices.len() as u32, SIDES as u32);
    for (radius, height) in [(outer, 0), (outer, 1), (inner, 1), (inner, 0)] {
        let corners = circle(radius).into_iter().map(|c| Point3::new(c[0], c[1], heights[height]));
        mesh.vertices.extend(corners);
    }
    for ring in 0..4 {
        add_sides(mesh, [first + ring * n, first + (ring + 1) % 4 * n], n);
    }
}

/// The band between two loops of `n` vertices.
fn add_sides(mesh: &mut Mesh, [low, high]: [u32; 2], n: u32) {
    for i in 0..n {
        let next = (i + 1) % n;
        mesh.triangles.push([low + i, low + next, high + next]);
        mesh.triangles.push([low + i, high + next, high + i]);
    }
}
