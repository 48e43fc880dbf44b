//! The nodes of one brick: which triangle is nearest to each, how far it is, on which side.

use nalgebra::Vector3;

use crate::geometry::{Closest, Surface};

use super::facet::{ACROSS, Facet, FacetLanes, POINTS};
use super::nodes::{BAND, BRICK, CELLS, FAR_NODE, Lattice, NODES, Nodes, beside, place};
use super::rim::sign;

/// Lattices along a brick's side.
const LATTICES: usize = NODES / ACROSS;
const _: () = assert!(NODES == LATTICES * ACROSS && LATTICES == ACROSS, "a lattice of lattices");

/// A brick to be measured.
pub(super) struct Brick<'a> {
    pub(super) surface: &'a Surface,
    pub(super) lattice: Lattice,
}

/// The triangles that may be nearest in a brick, in single precision.
#[derive(Default)]
struct Facets {
    of: Vec<u32>,
    facets: Vec<Facet>,
    /// Triangles too thin for single precision: each may be nearest anywhere.
    thin: Vec<u32>,
    /// The error of distances, in cells.
    rounding: f32,
}

/// The nearest triangle to a node, so far.
#[derive(Clone, Copy)]
struct Nearest {
    triangle: u32,
    distance: f64,
    foot: Foot,
}

/// Where its closest point is.
#[derive(Clone, Copy)]
enum Foot {
    /// Inside the face; how high above it the node is, in cells.
    Face(f64),
    Other(Closest),
}

impl Nearest {
    const NONE: Self = Self { triangle: FAR_NODE, distance: f64::INFINITY, foot: Foot::Face(f64::INFINITY) };

    #[inline]
    fn consider(&mut self, triangle: u32, distance: f64, foot: Foot) {
        if distance < self.distance {
            *self = Self { triangle, distance, foot };
        }
    }
}

impl Brick<'_> {
    /// Distances and nearest triangles at the nodes, given all triangles that the band reaches
    /// from: single precision drops those that cannot be nearest, first for 27 nodes together, then
    /// for each; what is left is measured in double precision.
    pub(super) fn nodes(&self, triangles: &[u32]) -> Nodes {
        let facets = self.facets(triangles);
        let mut out = Nodes { values: [f32::NAN; BRICK], nearest: [FAR_NODE; BRICK] };
        let around = |f: &Facet| f.squared_distances(&[0.0; 3], ACROSS as f32);
        let distances: Vec<FacetLanes> = facets.facets.iter().map(around).collect();
        let (mut left, mut squared) = (Vec::new(), Vec::new());
        for lattice in 0..POINTS {
            facets.may_be_nearest(&distances, lattice, &mut left);
            if left.is_empty() && facets.thin.is_empty() {
                continue;
            }
            self.measure(&facets, lattice, &left, &mut squared, &mut out);
        }
        self.sign_untouched(&mut out);
        out
    }

    fn facets(&self, triangles: &[u32]) -> Facets {
        let middle = self.lattice.origin + Vector3::repeat((CELLS / 2) as f64 * self.lattice.cell);
        let mut out = Facets::default();
        for &t in triangles {
            match Facet::new(&self.surface.corners(t), &middle, self.lattice.cell) {
                Some(facet) => {
                    out.rounding = out.rounding.max(1e-6 * (facet.extent() + 16.0));
                    out.facets.push(facet);
                    out.of.push(t);
                }
                None => out.thin.push(t),
            }
        }
        out
    }

    /// Measures the nodes of one lattice against the facets that are `left`.
    fn measure(
        &self,
        facets: &Facets,
        lattice: usize,
        left: &[u32],
        squared: &mut Vec<FacetLanes>,
        out: &mut Nodes,
    ) {
        let corner = place(lattice, LATTICES) * ACROSS;
        let centre = corner.map(|x| (x + 1) as f32 - (CELLS / 2) as f32);
        squared.clear();
        squared
            .extend(left.iter().map(|&k| facets.facets[k as usize].squared_distances(&centre.into(), 1.0)));
        let limits = limits(squared, facets.rounding);
        let mut best = [Nearest::NONE; POINTS];
        for (&k, squared) in left.iter().zip(squared.iter()) {
            let (facet, t) = (&facets.facets[k as usize], facets.of[k as usize]);
            for i in chosen(squared, &limits) {
                let at = (corner + place(i, ACROSS)).map(|x| x as f64 - (CELLS / 2) as f64);
                match facet.height_over(&at) {
                    Some(height) if !self.surface.is_folded(t) => {
                        best[i].consider(t, height.abs() * self.lattice.cell, Foot::Face(height));
                    }
                    _ => self.consider(t, node(&corner, i), &mut best[i]),
                }
            }
        }
        for (&t, i) in facets.thin.iter().flat_map(|t| (0..POINTS).map(move |i| (t, i))) {
            self.consider(t, node(&corner, i), &mut best[i]);
        }
        for (i, found) in best.iter().enumerate() {
            if found.distance < BAND * self.lattice.cell {
                let i = node(&corner, i);
                out.nearest[i] = found.triangle;
                out.values[i] = match (self.surface.rim(), &found.foot) {
                    (Some(_), _) => found.distance,
                    (None, Foot::Face(height)) => height * self.lattice.cell,
                    (None, Foot::Other(closest)) => self.surface.signed(&self.lattice.node_at(i), closest),
                } as f32;
            }
        }
    }

    fn consider(&self, t: u32, node: usize, best: &mut Nearest) {
        let found = self.surface.closest_on(t, &self.lattice.node_at(node));
        best.consider(t, found.distance, Foot::Other(found));
    }

    /// Signs of what lies outside the band, or of all nodes if the surface is open.
    fn sign_untouched(&self, out: &mut Nodes) {
        let band = (BAND * self.lattice.cell) as f32;
        if let Some(rim) = self.surface.rim() {
            for v in out.values.iter_mut().filter(|v| v.is_nan()) {
                *v = band;
            }
            return sign(rim, self.surface, &self.lattice, &mut out.values);
        }
        if out.nearest.iter().all(|&t| t == FAR_NODE) {
            // The band passes between the nodes, or beside the brick: all lie on one side.
            out.values[0] = band.copysign(self.surface.signed_distance(&self.lattice.origin) as f32);
        }
        spread_signs(&mut out.values, band);
    }
}

impl Facets {
    /// The facets that may be the nearest to a node of a lattice, given the distances of all from
    /// the middles of all lattices.
    fn may_be_nearest(&self, distances: &[FacetLanes], lattice: usize, left: &mut Vec<u32>) {
        /// From the middle of a lattice to its corner.
        const RADIUS: f32 = 1.732_051;
        let least = distances.iter().map(|d| d[lattice]).fold(f32::INFINITY, f32::min).sqrt();
        let reach = (least + 2.0 * RADIUS + 2.0 * self.rounding).min(BAND as f32 + RADIUS + self.rounding);
        left.clear();
        left.extend((0..distances.len() as u32).filter(|&k| distances[k as usize][lattice] <= reach * reach));
    }
}

/// The points of a lattice at which a distance does not exceed its limit, in order.
fn chosen(squared: &FacetLanes, limits: &FacetLanes) -> impl Iterator<Item = usize> {
    let within = |i: usize| u32::from(squared[i] <= limits[i]) << i;
    let mut left = (0..POINTS).fold(0, |all, i| all | within(i));
    std::iter::from_fn(move || {
        let next = left.trailing_zeros() as usize;
        left &= left.wrapping_sub(1);
        (next < POINTS).then_some(next)
    })
}

/// Up to where a triangle may be the nearest to each node, squared; nowhere beyond the band.
fn limits(squared: &[FacetLanes], rounding: f32) -> FacetLanes {
    let mut out = [f32::INFINITY; size_of::<FacetLanes>() / size_of::<f32>()];
    for distances in squared {
        for (l, d) in out.iter_mut().zip(distances) {
            *l = if *d < *l { *d } else { *l };
        }
    }
    let beyond = (BAND as f32 + rounding).powi(2);
    for l in &mut out {
        let reach = l.sqrt() + 2.0 * rounding;
        *l = if *l > beyond { -1.0 } else { reach * reach };
    }
    out
}

/// A brick's node, by the lowest one of a lattice and its number in that.
fn node(corner: &Vector3<usize>, i: usize) -> usize {
    let at = corner + place(i, ACROSS);
    (at.z * NODES + at.y) * NODES + at.x
}

/// Gives nodes outside the band the band's half-width with the sign of the nodes beside them: no
/// surface passes between neighbours of which one is outside the band. At least one node has a sign.
fn spread_signs(values: &mut [f32; BRICK], band: f32) {
    let mut unset: Vec<usize> = (0..BRICK).filter(|&i| values[i].is_nan()).collect();
    while !unset.is_empty() {
        unset.retain(|&i| match beside(i).into_iter().find(|&j| !values[j].is_nan()) {
            Some(j) => {
                values[i] = band.copysign(values[j]);
                false
            }
            None => true,
        });
        // To and fro: most are reached at once.
        unset.reverse();
    }
}
