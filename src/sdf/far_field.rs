//! Signs and distance bounds of the bricks that hold no nodes.

use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};

use super::grid::{EMPTY, Grid};
use super::nodes::{BAND, CELLS};

impl Grid {
    /// Fills `far`. Bricks fewer than `n` steps away (Chebyshev) do not touch the band, so a path to the surface is at
    /// least `n - 1` sides and the half-width of the band long. A component of empty bricks has the sign of any of its
    /// points.
    pub(super) fn fill_far(&mut self) {
        let steps = self.steps_to_surface();
        let (side, band) = (self.cell * CELLS as f64, BAND * self.cell);
        let bound = |steps: u16| (f64::from(steps.saturating_sub(1)) * side + band) as f32;
        self.far = steps.into_iter().map(bound).collect();
        if self.surface.is_open() {
            self.far_inside = vec![OnceLock::new(); self.slots.len()];
        } else {
            self.sign_components();
        }
    }

    /// The signed bound of a brick without nodes.
    pub(super) fn far(&self, brick: usize) -> f64 {
        let bound = f64::from(self.far[brick]);
        // Through an opening, inside and outside are one component: each brick is asked for itself.
        let ask = || self.surface.winding(&self.middle(brick)).is_some_and(|w| w > 0.5);
        let inside = self.far_inside.get(brick).is_some_and(|known| *known.get_or_init(ask));
        if inside { -bound } else { bound }
    }

    fn middle(&self, brick: usize) -> Point3<f64> {
        self.brick_min(brick) + Vector3::repeat(self.cell * CELLS as f64 / 2.0)
    }

    fn neighbours(&self, brick: usize, mut visit: impl FnMut(usize)) {
        let [nx, ny, nz] = self.dims;
        let (x, y, z) = (brick % nx, brick / nx % ny, brick / (nx * ny));
        let strides = [1, nx, nx * ny];
        for (axis, (at, n)) in [(x, nx), (y, ny), (z, nz)].into_iter().enumerate() {
            if at > 0 {
                visit(brick - strides[axis]);
            }
            if at + 1 < n {
                visit(brick + strides[axis]);
            }
        }
    }

    /// Chebyshev distance in bricks by two raster passes, each with the half of the 26 neighbours
    /// that lies behind it (A. Rosenfeld and J. Pfaltz 1966).
    fn steps_to_surface(&self) -> Vec<u16> {
        let [nx, ny, nz] = self.dims.map(|n| n as i64);
        let mut d: Vec<u16> = self.slots.iter().map(|&s| if s == EMPTY { 60_000 } else { 0 }).collect();
        let count = d.len();
        let behind: Vec<[i64; 3]> = (0..13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]).collect();
        for sense in [1i64, -1] {
            for i in 0..count {
                let k = if sense == 1 { i } else { count - 1 - i };
                if d[k] == 0 {
                    continue;
                }
                let (x, y, z) = (k as i64 % nx, k as i64 / nx % ny, k as i64 / (nx * ny));
                for [dx, dy, dz] in &behind {
                    let (u, v, w) = (x + sense * dx, y + sense * dy, z + sense * dz);
                    let inside = u >= 0 && v >= 0 && w >= 0 && u < nx && v < ny && w < nz;
                    if inside {
                        d[k] = d[k].min(d[((w * ny + v) * nx + u) as usize].saturating_add(1));
                    }
                }
            }
        }
        d
    }

    fn sign_components(&mut self) {
        let mut seen: Vec<bool> = self.slots.iter().map(|&s| s != EMPTY).collect();
        for start in 0..self.slots.len() {
            if seen[start] {
                continue;
            }
            let inside = self.surface.signed_distance(&self.middle(start)) < 0.0;
            let mut component = vec![start];
            seen[start] = true;
            while let Some(brick) = component.pop() {
                if inside {
                    self.far[brick] = -self.far[brick];
                }
                self.neighbours(brick, |other| {
                    if !std::mem::replace(&mut seen[other], true) {
                        component.push(other);
                    }
                });
            }
        }
    }
}
