//! The helix of a thread, from points of its flanks.
//!
//! On the helix of the thread, all turns lie on each other: the distance of a flank's point from the axis depends on its
//! height `u = z − rise · θ` alone. So the true rise is the one at which these distances scatter least about a straight
//! line within each short range of heights, and the same holds for the axis. A wire has two flanks at one height, which
//! face towards the axis and away from it: each has a line of its own. (Normals would give a false rise: facets on
//! a grid lean all the same way.)

use std::f64::consts::TAU;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::budgets::{FLANK_POINTS, HELIX_FIT_SWEEPS, OCCUPIED_HEIGHTS, RISE_RANGES};
use crate::geometry::{Helix, Pose};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{HELIX_FIT_PRECISION, HELIX_FIT_STEP, RISE_PRECISION, RISE_STEP};

use super::range;
use super::slip::FlankFacet;

/// A point of a flank.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlankPoint {
    at: Point3<f64>,
    /// Whether the flank faces away from the axis there.
    faces_out: bool,
}

impl FlankPoint {
    /// The point in a frame about nearly the same axis.
    pub(super) fn moved(&self, pose: &Pose) -> Self {
        Self { at: pose * self.at, ..*self }
    }

    pub(super) fn radius(&self) -> f64 {
        self.at.xy().coords.norm()
    }

    fn cylindrical(&self) -> CylindricalPoint {
        let Self { at, faces_out } = *self;
        CylindricalPoint { angle: at.y.atan2(at.x), z: at.z, distance: self.radius(), faces_out }
    }
}

/// The same in coordinates about the axis.
#[derive(Debug, Clone, Copy)]
struct CylindricalPoint {
    angle: f64,
    z: f64,
    distance: f64,
    faces_out: bool,
}

/// Of the rises in some ranges (each of one sign, without zero), the one at which the flanks of some surfaces (points in the axis
/// frame) scatter least.
///
/// # Errors
/// The termination condition became true.
pub(super) fn fitted_rise(
    flanks: &[Vec<FlankPoint>],
    ranges: &[[f64; 2]],
    termination: &Termination,
) -> Result<Option<f64>, Interrupt> {
    let flanks: Vec<Vec<CylindricalPoint>> =
        flanks.iter().map(|points| points.iter().map(FlankPoint::cylindrical).collect()).collect();
    let scatter = |rise: f64| flanks.iter().map(|points| scatter(points, rise, RISE_RANGES)).sum::<f64>();
    let [low, high] = range(flanks.iter().flatten().map(|p| p.z));
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

/// The helices near the z axis, of one rise near some rise, at which the flanks of two surfaces (points in the frame of
/// that axis) scatter least: the axes and the rise are changed in turn by steps that are halved when none is better
/// (compass search).
///
/// # Errors
/// The termination condition became true.
pub(super) fn fitted_helices(
    flanks: &[Vec<FlankPoint>; 2],
    rise: f64,
    termination: &Termination,
) -> Result<[Helix; 2], Interrupt> {
    let mut fits = flanks.each_ref().map(|flanks| AxisFit::new(flanks, rise));
    // An error of the rise adds up over the turns.
    let [low, high] = range(flanks.iter().flatten().map(|p| p.at.z));
    let turns = 1.0 + ((high - low) / (TAU * rise)).abs();
    let (mut rise, mut step) = (rise, HELIX_FIT_STEP);
    for _ in 0..HELIX_FIT_SWEEPS {
        termination.check()?;
        if step <= HELIX_FIT_PRECISION {
            break;
        }
        let [own, other] = &mut fits;
        let (own, other) = rayon::join(|| own.improve(step, rise), || other.improve(step, rise));
        let mut is_better = own || other;
        for sign in [1.0, -1.0] {
            let tried = rise * (sign * step / turns).exp();
            let scatters = fits.each_ref().map(|fit| fit.scatter(&fit.place(&fit.by), tried));
            if scatters.iter().sum::<f64>() < fits.iter().map(|fit| fit.least).sum() {
                (rise, is_better) = (tried, true);
                fits.iter_mut().zip(scatters).for_each(|(fit, scatter)| fit.least = scatter);
            }
        }
        if !is_better {
            step /= 2.0;
        }
    }
    Ok(fits.map(|fit| Helix { axis_from_frame: fit.place(&fit.by), rise }))
}

/// The axis of the flanks of a surface, while it is fitted.
#[derive(Debug)]
struct AxisFit<'a> {
    flanks: &'a [FlankPoint],
    middle: Vector3<f64>,
    radius: f64,
    /// The number of ranges of heights within a pitch.
    ranges: usize,
    /// Two shifts as shares of the radius, and two tilts about the middle.
    by: [f64; 4],
    /// How far the flanks scatter about that axis.
    least: f64,
}

impl<'a> AxisFit<'a> {
    fn new(flanks: &'a [FlankPoint], rise: f64) -> Self {
        let count = flanks.len().max(1) as f64;
        let middle = Vector3::z() * (flanks.iter().map(|p| p.at.z).sum::<f64>() / count);
        let radius = flanks.iter().map(FlankPoint::radius).sum::<f64>() / count;
        let ranges = ranges(flanks, rise);
        let mut fit = Self { flanks, middle, radius, ranges, by: [0.0; 4], least: 0.0 };
        fit.least = fit.scatter(&fit.place(&fit.by), rise);
        fit
    }

    /// `axis_from_frame`.
    fn place(&self, by: &[f64; 4]) -> Pose {
        let tilt = UnitQuaternion::new(Vector3::new(by[2], by[3], 0.0));
        let shift = Translation3::from(Vector3::new(by[0], by[1], 0.0) * self.radius + self.middle);
        shift * tilt * Translation3::from(-self.middle)
    }

    fn scatter(&self, axis_from_frame: &Pose, rise: f64) -> f64 {
        let points: Vec<_> = self.flanks.iter().map(|p| p.moved(axis_from_frame).cylindrical()).collect();
        scatter(&points, rise, self.ranges)
    }

    /// Takes each step that lessens the scatter; whether there was one.
    fn improve(&mut self, step: f64, rise: f64) -> bool {
        let before = self.least;
        for (of, sign) in (0..self.by.len()).flat_map(|of| [(of, 1.0), (of, -1.0)]) {
            let mut tried = self.by;
            tried[of] += sign * step;
            let found = self.scatter(&self.place(&tried), rise);
            if found < self.least {
                (self.by, self.least) = (tried, found);
            }
        }
        self.least < before
    }
}

/// Points spread over some facets, as many on each: the corners alone lie in rows, which do not show how a flank slopes.
/// On a facet they follow a sequence of low discrepancy (M. Roberts 2018, "The unreasonable effectiveness of quasirandom
/// sequences"; the plastic number).
pub(super) fn spread(facets: &[&FlankFacet]) -> Vec<FlankPoint> {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let point = |i: usize| {
        let facet = facets[i * facets.len() / FLANK_POINTS];
        let [a, b, c] = facet.corners;
        let [mut u, mut v] = [PLASTIC, PLASTIC * PLASTIC].map(|step| (0.5 + i as f64 / step).fract());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let faces_out = facet.normal.xy().dot(&facet.middle.xy().coords) > 0.0;
        FlankPoint { at: a + (b - a) * u + (c - a) * v, faces_out }
    };
    let count = if facets.is_empty() { 0 } else { FLANK_POINTS };
    (0..count).map(point).collect()
}

/// Where a point is within the pitch, as a share of it.
fn height_in_pitch(CylindricalPoint { angle, z, .. }: &CylindricalPoint, rise: f64) -> f64 {
    ((z - rise * angle) / (TAU * rise)).rem_euclid(1.0)
}

/// A number of ranges within a pitch of which [`RISE_RANGES`] have points: a wire takes up little of a pitch.
fn ranges(flanks: &[FlankPoint], rise: f64) -> usize {
    let mut taken = [false; OCCUPIED_HEIGHTS];
    for point in flanks {
        let height = height_in_pitch(&point.cylindrical(), rise) * OCCUPIED_HEIGHTS as f64;
        taken[(height as usize).min(OCCUPIED_HEIGHTS - 1)] = true;
    }
    let count = taken.iter().filter(|is_taken| **is_taken).count().max(1);
    RISE_RANGES * OCCUPIED_HEIGHTS / count
}

/// The sum of squared deviations of distances from the straight line through those about their height. A point counts for
/// the lines of two ranges, by how near it is to the middle of each: so the sum changes steadily with the helix.
fn scatter(points: &[CylindricalPoint], rise: f64, count: usize) -> f64 {
    let mut sides = [vec![Moments::default(); count], vec![Moments::default(); count]];
    for point in points {
        let ranges = &mut sides[usize::from(point.faces_out)];
        let height = height_in_pitch(point, rise) * count as f64;
        let range = (height as usize).min(count - 1);
        let above = height - range as f64;
        ranges[range].add(1.0 - above, above, point.distance);
        ranges[(range + 1) % count].add(above, above - 1.0, point.distance);
    }
    sides.iter().flatten().map(Moments::deviation).sum()
}

/// Weighted sums over points (x, y).
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn add(&mut self, weight: f64, x: f64, y: f64) {
        self.weight += weight;
        (self.x, self.y) = (self.x + weight * x, self.y + weight * y);
        self.xx += weight * x * x;
        self.xy += weight * x * y;
        self.yy += weight * y * y;
    }

    /// The weighted sum of squared deviations of y from its regression line on x.
    fn deviation(&self) -> f64 {
        if self.weight == 0.0 {
            return 0.0;
        }
        let [xx, xy, yy] = [
            self.xx - self.x * self.x / self.weight,
            self.xy - self.x * self.y / self.weight,
            self.yy - self.y * self.y / self.weight,
        ];
        // Points of one height make no line.
        yy - if xx > 1e-9 * self.weight { xy * xy / xx } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{surface, thread};
    use crate::geometry::Surface;
    use crate::tolerances::FLANK_LEAN;

    #[test]
    fn the_helix_of_a_displaced_thread_is_found() {
        let rise = 0.5 / TAU;
        let place = Pose::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.004, -0.006, 0.4));
        let points = thread(3.0, 0.5).map(|mesh| flanks(&surface(mesh), &place));
        let found = fitted_helices(&points, rise * 1.001, &Termination::default()).unwrap();
        for helix in found {
            let axis_from_thread = helix.axis_from_frame * place;
            for z in [0.0, 3.0] {
                let at = axis_from_thread * Point3::new(0.0, 0.0, z);
                assert!(at.xy().coords.norm() < 1e-3, "{at}");
            }
            assert!((helix.rise / rise - 1.0).abs() < 1e-4, "{}", helix.rise / rise);
        }
    }

    /// Points of the flanks of a thread along z, at a pose.
    fn flanks(surface: &Surface, pose: &Pose) -> Vec<FlankPoint> {
        let facets: Vec<FlankFacet> = (0..surface.triangles().len() as u32)
            .filter(|t| {
                let facet = FlankFacet::of(&surface.corners(*t));
                facet.is_some_and(|f| (FLANK_LEAN[0]..FLANK_LEAN[1]).contains(&f.normal.z.abs()))
            })
            .filter_map(|t| FlankFacet::of(&surface.corners(t).map(|p| pose * p)))
            .collect();
        spread(&facets.iter().collect::<Vec<_>>())
    }

    #[test]
    fn the_rise_is_found_in_a_wide_range_of_either_sign() {
        for pitch in [0.3, 0.8] {
            let flanks = thread(3.0, pitch).map(|mesh| flanks(&surface(mesh), &Pose::default()));
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
