//! Signs and distance bounds of the bricks that hold no nodes.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::geometry::Surface;

use super::grid::{BAND, BRICK, CELLS, EMPTY, Field, NODES};

impl Field {
    /// Fills `far`: Chebyshev steps to the nearest brick with nodes give a distance that is
    /// never overstated; a component of empty bricks has the sign of any node on its rim.
    pub(super) fn fill_far(&mut self, surface: &Surface) {
        let steps = self.steps_to_surface();
        let inside =
            if surface.is_open() { self.inside_by_winding(surface) } else { self.inside_components() };
        let side = self.cell * CELLS as f64;
        self.far = (0..self.slots.len())
            .map(|b| {
                // An empty brick has no node within the band, so no point nearer than that less a cell.
                let d = ((f64::from(steps[b]) - 1.0) * side).max(BAND * self.cell - self.error_bound());
                (if inside[b] { -d } else { d }) as f32
            })
            .collect();
    }

    fn neighbours(&self, brick: usize, mut visit: impl FnMut(usize, usize, bool)) {
        let [nx, ny, nz] = self.dims;
        let (x, y, z) = (brick % nx, brick / nx % ny, brick / (nx * ny));
        let strides = [1, nx, nx * ny];
        for (axis, (at, n)) in [(x, nx), (y, ny), (z, nz)].into_iter().enumerate() {
            if at > 0 {
                visit(brick - strides[axis], axis, false);
            }
            if at + 1 < n {
                visit(brick + strides[axis], axis, true);
            }
        }
    }

    /// Breadth-first over all 26 neighbours, as three separable sweeps (Chebyshev distance).
    fn steps_to_surface(&self) -> Vec<u16> {
        let [nx, ny, nz] = self.dims;
        let mut d: Vec<u16> = self.slots.iter().map(|&s| if s == EMPTY { 60_000 } else { 0 }).collect();
        // max-metric: a brick's distance is 1 + the least over its 26 neighbours, which two raster
        // passes with the full half-neighbourhoods settle exactly.
        let at = |x: usize, y: usize, z: usize| (z * ny + y) * nx + x;
        for pass in 0..2 {
            for i in 0..nx * ny * nz {
                let k = if pass == 0 { i } else { nx * ny * nz - 1 - i };
                let (x, y, z) = (k % nx, k / nx % ny, k / (nx * ny));
                let mut best = d[k];
                for dz in -1i64..=1 {
                    for dy in -1i64..=1 {
                        for dx in -1i64..=1 {
                            let (u, v, w) = (x as i64 + dx, y as i64 + dy, z as i64 + dz);
                            let inside = u >= 0 && v >= 0 && w >= 0;
                            if inside && u < nx as i64 && v < ny as i64 && w < nz as i64 {
                                best = best.min(d[at(u as usize, v as usize, w as usize)].saturating_add(1));
                            }
                        }
                    }
                }
                d[k] = best.min(d[k]);
            }
        }
        d
    }

    /// Through an opening, inside and outside are one component: each brick is asked for itself.
    fn inside_by_winding(&self, surface: &Surface) -> Vec<bool> {
        let half = Vector3::repeat(self.cell * CELLS as f64 / 2.0);
        let asked = |brick: usize| {
            let winding = || surface.winding(&(self.brick_min(brick) + half));
            self.slots[brick] == EMPTY && winding().is_some_and(|w| w > 0.5)
        };
        (0..self.slots.len()).into_par_iter().map(asked).collect()
    }

    fn inside_components(&self) -> Vec<bool> {
        let n = self.slots.len();
        let mut inside = vec![false; n];
        let mut seen: Vec<bool> = self.slots.iter().map(|&s| s != EMPTY).collect();
        for start in 0..n {
            if seen[start] {
                continue;
            }
            let (mut component, mut sign) = (vec![start], false);
            seen[start] = true;
            let mut head = 0;
            while head < component.len() {
                let brick = component[head];
                head += 1;
                self.neighbours(brick, |other, axis, up| {
                    if self.slots[other] == EMPTY {
                        if !seen[other] {
                            seen[other] = true;
                            component.push(other);
                        }
                    } else {
                        sign |= self.rim_is_inside(self.slots[other], axis, up);
                    }
                });
            }
            for b in component {
                inside[b] = sign;
            }
        }
        inside
    }

    /// The sign at the middle of the face by which a brick with nodes is entered along `axis`.
    fn rim_is_inside(&self, slot: u32, axis: usize, up: bool) -> bool {
        let mut at = [CELLS / 2; 3];
        at[axis] = if up { 0 } else { CELLS };
        self.values[slot as usize * BRICK + (at[2] * NODES + at[1]) * NODES + at[0]] < 0.0
    }
}
