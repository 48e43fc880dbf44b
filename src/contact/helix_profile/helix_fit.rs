//! The helix of a thread, from points of its flanks.
//!
//! On the helix of the thread, all turns lie on each other: the distance of a flank's point from the axis depends on its
//! height `u = z − rise · θ` alone. So the true rise is the one at which these distances scatter least about a straight
//! line within each short range of heights, and the same holds for the axis. (Normals would give a false rise: facets on
//! a grid lean all the same way.)

use std::f64::consts::TAU;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::budgets::{HELIX_FIT_SWEEPS, RISE_RANGES};
use crate::geometry::Helix;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{HELIX_FIT_PRECISION, HELIX_FIT_STEP, RISE_PRECISION, RISE_STEP};

use super::range;

/// Of the rises in some ranges (each of one sign, without zero), the one at which the flanks of some surfaces (points in the axis
/// frame) scatter least.
///
/// # Errors
/// The termination condition became true.
pub(super) fn fitted_rise(
    flanks: &[Vec<Point3<f64>>],
    ranges: &[[f64; 2]],
    termination: &Termination,
) -> Result<Option<f64>, Interrupt> {
    let flanks: Vec<Vec<[f64; 3]>> =
        flanks.iter().map(|points| points.iter().map(cylindrical).collect()).collect();
    let scatter = |rise: f64| flanks.iter().map(|points| scatter(points, rise)).sum::<f64>();
    let [low, high] = range(flanks.iter().flatten().map(|[_, z, _]| *z));
    // An error of the rise adds up over the turns.
    let step = |rise: f64| RISE_STEP / (1.0 + ((high - low) / (TAU * rise)).abs());
    let mut tried = Vec::new();
    for [from, to] in ranges {
        let mut rise = *from;
        while rise.abs() <= to.abs() {
            tried.push(rise);
            rise *= 1.0 + step(rise);
        }
    }
    let best = |tried: Vec<f64>| -> Result<Option<f64>, Interrupt> {
        let scatters = tried.into_par_iter().map(|rise| {
            termination.check()?;
            Ok((scatter(rise), rise))
        });
        let scatters: Vec<(f64, f64)> = scatters.collect::<Result<_, Interrupt>>()?;
        let least = scatters.into_iter().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Ok(least.map(|(_, rise)| rise))
    };
    let Some(mut rise) = best(tried)? else { return Ok(None) };
    let mut width = step(rise);
    while width > RISE_PRECISION {
        rise = best((-3..=3).map(|k| rise * (1.0 + f64::from(k) / 3.0 * width)).collect())?.unwrap_or(rise);
        width /= 3.0;
    }
    Ok(Some(rise))
}

/// The helix near the z axis and of some rise at which the flanks of a surface (points in the frame of that axis) scatter
/// least: axis and rise are changed in turn by steps that are halved when none is better (compass search).
///
/// # Errors
/// The termination condition became true.
pub(super) fn fitted_helix(
    flanks: &[Point3<f64>],
    rise: f64,
    termination: &Termination,
) -> Result<Helix, Interrupt> {
    let count = flanks.len().max(1) as f64;
    let middle = Vector3::z() * (flanks.iter().map(|p| p.z).sum::<f64>() / count);
    let radius = flanks.iter().map(|p| p.xy().coords.norm()).sum::<f64>() / count;
    // An error of the rise adds up over the turns.
    let [low, high] = range(flanks.iter().map(|p| p.z));
    let turns = 1.0 + ((high - low) / (TAU * rise)).abs();
    // Shifts and tilts as shares of the radius, about the middle, and the logarithm of the rise times the turns.
    let helix = |by: &[f64; 5]| {
        let tilt = UnitQuaternion::new(Vector3::new(by[2], by[3], 0.0));
        let shift = Translation3::from(Vector3::new(by[0], by[1], 0.0) * radius + middle);
        let axis_from_frame = shift * tilt * Translation3::from(-middle);
        Helix { axis_from_frame, rise: rise * (by[4] / turns).exp() }
    };
    let scatter = |by: &[f64; 5]| {
        let Helix { axis_from_frame, rise } = helix(by);
        let points: Vec<_> = flanks.iter().map(|p| cylindrical(&(axis_from_frame * p))).collect();
        scatter(&points, rise)
    };
    let mut at = [0.0; 5];
    let (mut least, mut step) = (scatter(&at), HELIX_FIT_STEP);
    for _ in 0..HELIX_FIT_SWEEPS {
        termination.check()?;
        if step <= HELIX_FIT_PRECISION {
            break;
        }
        let mut is_better = false;
        for (of, sign) in (0..at.len()).flat_map(|of| [(of, 1.0), (of, -1.0)]) {
            let mut tried = at;
            tried[of] += sign * step;
            let found = scatter(&tried);
            if found < least {
                (at, least, is_better) = (tried, found, true);
            }
        }
        if !is_better {
            step /= 2.0;
        }
    }
    Ok(helix(&at))
}

/// Angle, height and distance of a point.
fn cylindrical(p: &Point3<f64>) -> [f64; 3] {
    [p.y.atan2(p.x), p.z, p.xy().coords.norm()]
}

/// The sum of squared deviations of distances from the straight line through those of their range of heights.
fn scatter(points: &[[f64; 3]], rise: f64) -> f64 {
    let pitch = TAU * rise;
    let mut ranges = [Moments::default(); RISE_RANGES];
    for [angle, z, distance] in points {
        let height = ((z - rise * angle) / pitch).rem_euclid(1.0) * RISE_RANGES as f64;
        let range = (height as usize).min(RISE_RANGES - 1);
        ranges[range].add(height - range as f64, *distance);
    }
    ranges.iter().map(Moments::deviation).sum()
}

/// Sums over points (x, y).
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        (self.x, self.y) = (self.x + x, self.y + y);
        (self.xx, self.xy, self.yy) = (self.xx + x * x, self.xy + x * y, self.yy + y * y);
    }

    /// The sum of squared deviations of y from its regression line on x.
    fn deviation(&self) -> f64 {
        let count = self.count.max(1.0);
        let [xx, xy, yy] = [
            self.xx - self.x * self.x / count,
            self.xy - self.x * self.y / count,
            self.yy - self.y * self.y / count,
        ];
        // Points of one height make no line.
        yy - if xx > 1e-9 * count { xy * xy / xx } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{surface, thread};
    use crate::geometry::{Pose, Surface};

    #[test]
    fn the_axis_of_a_displaced_thread_is_found() {
        let rise = 0.5 / TAU;
        let place = Pose::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.004, -0.006, 0.4));
        for mesh in thread(3.0, 0.5) {
            let surface = surface(mesh);
            let points: Vec<_> = flanks(&surface).iter().map(|p| place * p).collect();
            let found = fitted_helix(&points, rise * 1.001, &Termination::default()).unwrap();
            let axis_from_thread = found.axis_from_frame * place;
            for z in [0.0, 3.0] {
                let at = axis_from_thread * Point3::new(0.0, 0.0, z);
                assert!(at.xy().coords.norm() < 1e-3, "{at}");
            }
            assert!((found.rise / rise - 1.0).abs() < 1e-4, "{}", found.rise / rise);
        }
    }

    /// Corners of the flanks of a thread along z.
    fn flanks(surface: &Surface) -> Vec<Point3<f64>> {
        let corners = (0..surface.triangles().len() as u32).map(|t| surface.corners(t));
        let is_flank = |c: &[Point3<f64>; 3]| {
            let normal = (c[1] - c[0]).cross(&(c[2] - c[0])).normalize();
            (0.15..0.97).contains(&normal.z.abs())
        };
        corners.filter(is_flank).flatten().collect()
    }

    #[test]
    fn the_rise_is_found_in_a_wide_range_of_either_sign() {
        for pitch in [0.3, 0.8] {
            let flanks = thread(3.0, pitch).map(|mesh| flanks(&surface(mesh)));
            let rise = pitch / TAU;
            for ranges in
                [&[[0.4 * rise, 3.0 * rise]][..], &[[-10.0 * rise, -0.3 * rise], [0.3 * rise, 10.0 * rise]]]
            {
                let found = fitted_rise(&flanks, ranges, &Termination::default()).unwrap().unwrap() * TAU;
                // There are eight rows of points to a pitch.
                assert!((found / pitch - 1.0).abs() < 5e-3, "{found} of {pitch}");
            }
            assert_eq!(fitted_rise(&flanks, &[], &Termination::default()), Ok(None));
        }
    }
}
