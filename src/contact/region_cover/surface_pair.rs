//! Two surfaces that face each other. One is covered, in pieces; the other is measured, and no piece may enter it.

use nalgebra::{Matrix3, Point3, Translation3, Vector3};

use crate::budgets::PROBES;
use crate::geometry::{FreeRegion, NoRegion, Pose, SignedClosest, Surface, Wanted, separating_direction};
use crate::scene::{PosedPart, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    ENTRY_PROBE, ENTRY_SHARE, HELD, REGION_ROOM, STEEP_COSINE, TILT, TOUCH_INSET, TOUCHED,
};

use super::pieces::{CoveredSurface, Piece, PlacedPiece};

/// A plane that a part may not pass: its normal in the planning frame, and the standing part that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Obstacle {
    pub(crate) normal: Vector3<f64>,
    pub(crate) other: usize,
}

impl Obstacle {
    fn is_like(&self, other: &Self) -> bool {
        self.other == other.other && self.normal.dot(&other.normal) > STEEP_COSINE
    }
}

/// The angles at which a face that is entered counts as an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slope {
    /// Any angle: for points where no region allowed the shift.
    Any,
    /// Only angles at which the point soon gets deeper than any tolerance, and only where no other face of an edge
    /// would let it pass.
    Steep,
}

/// A point of the covered surface that entered the measured one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Witness {
    /// Unshifted, in the measured surface's frame.
    point: Point3<f64>,
    /// The triangle nearest to it.
    triangle: u32,
}

/// A moving and a standing part: the covered and the measured surface, and the poses between their frames.
#[derive(Clone)]
pub(crate) struct SurfacePair<'a> {
    pub(crate) other: usize,
    pub(crate) covered: CoveredSurface<'a>,
    pub(crate) measured: &'a Surface,
    /// Whether the covered surface is the moving part's.
    pub(crate) covers_part: bool,
    /// The pose of the standing part.
    stand: Pose,
    /// At zero shift.
    measured_from_covered: Pose,
    /// Maps a shift of the part to the shift of the covered surface against the measured one: orthogonal.
    pub(crate) shifted: Matrix3<f64>,
    pub(crate) allowed: f64,
}

impl<'a> SurfacePair<'a> {
    /// Covers the moving part's surface, or the standing part's.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn new(
        scene: &'a Scene,
        PosedPart { part, pose: start }: PosedPart<'_>,
        other: usize,
        covers_part: bool,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let (moving, standing) = (&scene.bodies[part], &scene.bodies[other]);
        let stand = standing.planning_from_shape;
        let [mine, theirs] = [moving, standing].map(|body| &body.shape);
        let (covered, measured, turn) = if covers_part {
            (mine, theirs, stand.rotation.inverse())
        } else {
            (theirs, mine, start.rotation.inverse())
        };
        let sense = if covers_part { 1.0 } else { -1.0 };
        Ok(Self {
            other,
            covered: CoveredSurface { surface: &covered.surface, tree: covered.patches(termination)? },
            measured: &measured.surface,
            covers_part,
            stand,
            measured_from_covered: measured_from_covered(&stand, start, covers_part),
            shifted: *turn.to_rotation_matrix().matrix() * sense,
            allowed: scene.allowed.of(part, other),
        })
    }

    /// The sides of a pair that can be covered, the smaller surface first: `true` for the moving part's. The other
    /// surface must be closed, as only closed surfaces can be measured.
    pub(crate) fn coverable_sides(scene: &Scene, part: usize, other: usize) -> Vec<bool> {
        let surface = |i: usize| &scene.bodies[i].shape.surface;
        let size = |i: usize| surface(i).bounds().extents().product();
        let mine_first = size(part) <= size(other);
        let mut sides = vec![mine_first, !mine_first];
        sides.retain(|&covers_part| !surface(if covers_part { other } else { part }).is_open());
        sides
    }

    /// Maps the covered surface's frame to the measured one's with the part at a pose.
    pub(crate) fn with_part_at(&self, pose: &Pose) -> Pose {
        measured_from_covered(&self.stand, pose, self.covers_part)
    }

    /// A convex region around a point in the measured surface's frame. It holds the given points, except that each
    /// may be outside by up to `most`, and it reaches beyond `radius` by some room.
    pub(crate) fn region(
        &self,
        (middle, seen): (&Point3<f64>, &SignedClosest),
        radius: f64,
        points: &[Point3<f64>],
        most: f64,
    ) -> Result<FreeRegion, NoRegion> {
        let wanted = Wanted { points, most, from_behind: true, facing: Vector3::zeros(), spared: 0.0 };
        self.measured.free_region_around(middle, radius * REGION_ROOM, seen, wanted)
    }

    /// Places a piece against the measured surface, with the part shifted by `at`.
    pub(crate) fn place(&self, piece: &Piece, at: &Vector3<f64>, placed: &mut PlacedPiece) {
        let shift = Translation3::from(self.shifted * at);
        self.covered.place(piece, &(shift * self.measured_from_covered), placed);
    }

    /// The plane of the face nearest to a placed piece that leaves its centre the most room `ahead`: its normal, how far
    /// above it the lowest corner is, and its triangle. It serves as the region of a small piece that is no deeper than
    /// allowed, where surfaces cross and there are no regions. Unlike a region this is not certain; paths are verified.
    pub(crate) fn before_face(
        &self,
        piece: &PlacedPiece,
        guess: u32,
        ahead: &Vector3<f64>,
    ) -> Option<(Vector3<f64>, f64, u32)> {
        let closest = self.measured.closest_from(&piece.centre, guess);
        let mut best: Option<(f64, Vector3<f64>)> = None;
        self.measured.feature_normals(&closest, |n| {
            let ends = n.dot(&(piece.centre + ahead - closest.point));
            if best.is_none_or(|(most, _)| ends > most) {
                best = Some((ends, n));
            }
        });
        let (_, normal) = best?;
        let above = |p: &Point3<f64>| normal.dot(&(p - closest.point));
        let gap = piece.points.iter().map(above).fold(f64::INFINITY, f64::min);
        Some((normal, gap, closest.triangle))
    }

    /// Whether a plane separates a triangle of the measured surface from a placed piece, up to `most`.
    pub(crate) fn is_beside(&self, piece: &PlacedPiece, triangle: u32, most: f64) -> bool {
        let corners = self.measured.corners(triangle);
        // A triangle that only touches is beside the piece, too.
        let centre = piece.centre;
        let inset = |p: &Point3<f64>| p + (centre - p) * (most / (centre - p).norm()).clamp(TOUCH_INSET, 1.0);
        let within: Vec<_> = piece.extremes.iter().map(inset).collect();
        separating_direction(&corners, &within, 0.0, None).is_some()
    }

    /// The faces that certainly stop some points of the covered surface (in the measured surface's frame) when the
    /// part moves along a unit vector. Adds the points that show it to `witnesses`.
    pub(crate) fn obstacles(
        &self,
        probes: &[Point3<f64>],
        WantedShift { at, along }: &WantedShift,
        (guess, slope): (u32, Slope),
        witnesses: &mut Vec<Witness>,
    ) -> Vec<Obstacle> {
        let mut obstacles: Vec<Obstacle> = Vec::new();
        let shift = self.shifted * at;
        for p in probes {
            let Some((obstacle, triangle)) = self.obstacle(p, along, (guess, slope)) else { continue };
            if !obstacles.iter().any(|o| o.is_like(&obstacle)) {
                obstacles.push(obstacle);
                witnesses.push(Witness { point: p - shift, triangle });
            }
        }
        obstacles
    }

    /// The faces that stop points which showed obstacles before, at another shift or along another unit vector.
    pub(crate) fn obstacles_seen_by(
        &self,
        witnesses: &[Witness],
        WantedShift { at, along }: &WantedShift,
    ) -> Vec<Obstacle> {
        let shift = self.shifted * at;
        let mut obstacles: Vec<Obstacle> = Vec::new();
        for Witness { point, triangle } in witnesses {
            let seen = self.obstacle(&(point + shift), along, (*triangle, Slope::Any));
            if let Some((obstacle, _)) = seen.filter(|(seen, _)| !obstacles.iter().any(|o| o.is_like(seen))) {
                obstacles.push(obstacle);
            }
        }
        obstacles
    }

    /// The face that a point enters when the part moves along a unit vector, and its triangle.
    fn obstacle(
        &self,
        p: &Point3<f64>,
        along: &Vector3<f64>,
        (guess, slope): (u32, Slope),
    ) -> Option<(Obstacle, u32)> {
        let ahead = self.shifted * along;
        let (normal, triangle) = entered(self.measured, (p, &ahead), (guess, slope), self.allowed)?;
        Some((Obstacle { normal: self.shifted.transpose() * normal, other: self.other }, triangle))
    }

    /// The face of the covered surface that a corner of a measured triangle, or the middle of a side, enters steeply:
    /// a long face may have its own corners far from where it touches.
    pub(crate) fn obstacle_of_triangle(
        &self,
        triangle: u32,
        WantedShift { at, along }: &WantedShift,
        guess: u32,
    ) -> Option<Obstacle> {
        if self.covered.surface.is_open() {
            return None;
        }
        let here = Translation3::from(self.shifted * at) * self.measured_from_covered;
        let ahead = -here.inverse_transform_vector(&(self.shifted * along));
        self.measured.corners_and_middles(triangle).iter().find_map(|p| {
            let p = here.inverse_transform_point(p);
            let (normal, _) =
                entered(self.covered.surface, (&p, &ahead), (guess, Slope::Steep), self.allowed)?;
            Some(Obstacle { normal: self.shifted.transpose() * (here * -normal), other: self.other })
        })
    }

    /// The points of a piece that probably enter first: the corners in front, and the middles of the largest faces
    /// that look ahead, as corners may lie at the rims of holes.
    pub(crate) fn probes_ahead(
        &self,
        piece: &Piece,
        placed: &PlacedPiece,
        WantedShift { at, along }: &WantedShift,
    ) -> Vec<Point3<f64>> {
        let Self { covered: CoveredSurface { surface, tree }, measured_from_covered, shifted, .. } = self;
        let ahead = &(shifted * along);
        let mut probes = placed.points.clone();
        if probes.len() > PROBES {
            let front =
                |p: &Point3<f64>, q: &Point3<f64>| ahead.dot(&q.coords).total_cmp(&ahead.dot(&p.coords));
            probes.select_nth_unstable_by(PROBES, front);
            probes.truncate(PROBES);
        }
        let shift = shifted * at;
        let mut middles = Vec::new();
        let mut middle = |[a, b, c]: [Point3<f64>; 3]| {
            let area = (b - a).cross(&(c - a)).dot(&measured_from_covered.inverse_transform_vector(ahead));
            if area > 0.0 {
                middles.push((area, Point3::from((a.coords + b.coords + c.coords) / 3.0)));
            }
        };
        match *piece {
            Piece::Patch(index) => tree.triangles(index).iter().for_each(|&t| middle(surface.corners(t))),
            Piece::Bit(corners) => middle(corners),
        }
        middles.sort_by(|a, b| b.0.total_cmp(&a.0));
        probes.extend(middles.into_iter().take(PROBES).map(|(_, p)| measured_from_covered * p + shift));
        probes
    }
}

/// The normal of a face that a point certainly enters by more than allowed on its way along a unit vector, and the
/// nearest triangle.
fn entered(
    surface: &Surface,
    (p, ahead): (&Point3<f64>, &Vector3<f64>),
    (guess, slope): (u32, Slope),
    allowed: f64,
) -> Option<(Vector3<f64>, u32)> {
    let SignedClosest { signed, closest } = surface.signed_closest(p, guess);
    let now = -signed;
    let (mut least, mut most): (Option<Vector3<f64>>, Option<Vector3<f64>>) = (None, None);
    surface.feature_normals(&closest, |n| {
        let speed = n.dot(ahead);
        if least.is_none_or(|m| speed > m.dot(ahead)) {
            least = Some(n);
        }
        if most.is_none_or(|m| speed < m.dot(ahead)) {
            most = Some(n);
        }
    });
    let blocking = |n: &Vector3<f64>| n.dot(ahead) < -TILT;
    if slope == Slope::Steep && least?.dot(&most?) < STEEP_COSINE {
        return None;
    }
    // A point that touches enters below every face that it touches, at any angle.
    let touches = (-TOUCHED..=HELD).contains(&(now - allowed));
    let is_flat = slope == Slope::Any && touches && least.as_ref().is_some_and(blocking);
    let is_certain = is_flat || {
        let then = surface.signed_closest(&(p + ahead * ENTRY_PROBE), closest.triangle);
        -then.signed > now.max(allowed) + ENTRY_SHARE * ENTRY_PROBE
    };
    // At a convex edge it is enough to stay above either face. If neither stops the point, the edge is reentrant.
    let normal = is_certain.then_some(least.filter(blocking).or(most.filter(blocking))?)?;
    Some((normal, closest.triangle))
}

fn measured_from_covered(stand: &Pose, part: &Pose, covers_part: bool) -> Pose {
    if covers_part { stand.inverse() * part } else { part.inverse() * stand }
}

/// The shift at which a piece is, and the direction in which it is to go on.
#[derive(Clone, Copy)]
pub(crate) struct WantedShift {
    pub(crate) at: Vector3<f64>,
    /// A unit vector, or zero.
    pub(crate) along: Vector3<f64>,
}

/// A piece that is to be covered, and what helps to find its region.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CoverPiece {
    pub(crate) piece: Piece,
    /// A triangle of the measured surface near it.
    pub(crate) guess: u32,
    /// Which of the lengths ahead its last region allowed: 0 is the longest.
    pub(crate) level: usize,
    /// How far outside its region it may be beyond the allowed penetration, in the planning frame.
    pub(crate) held: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cells, cuboid, scene};

    #[test]
    fn a_long_pin_touches_with_its_faces_where_it_has_no_corners() {
        // A square pin through a plate: the plate's corners about the hole lie on the pin's faces.
        let plate = cells([&[-2.0, -0.5, 0.5, 2.0], &[-2.0, -0.5, 0.5, 2.0], &[-0.5, 0.5]], |c| {
            c[0] != 1 || c[1] != 1
        });
        let pin = cuboid([-0.5, -0.5, -4.0], [0.5, 0.5, 4.0]);
        let (scene, _) = scene([plate, pin]);
        let start = scene.bodies[1].planning_from_shape;
        let pair =
            SurfacePair::new(&scene, PosedPart::new(1, &start), 0, true, &Termination::default()).unwrap();
        let mut placed = PlacedPiece::default();
        let still = Vector3::zeros();
        pair.place(&pair.covered.root().unwrap(), &still, &mut placed);
        for u in [Vector3::x(), -Vector3::y(), Vector3::new(0.6, 0.8, 0.0), Vector3::z(), -Vector3::z()] {
            assert!(
                pair.obstacles(
                    &placed.points,
                    &WantedShift { at: still, along: u },
                    (0, Slope::Any),
                    &mut Vec::new()
                )
                .is_empty()
            );
            let of_triangle = |t| pair.obstacle_of_triangle(t, &WantedShift { at: still, along: u }, 0);
            let found = (0..pair.measured.triangles().len() as u32).filter_map(of_triangle);
            let found: Vec<Obstacle> = found.collect();
            assert_eq!(found.is_empty(), u.z != 0.0, "{u}");
            for Obstacle { normal, other } in found {
                assert!(other == 0 && normal.dot(&u) < 0.0 && normal.z.abs() < 1e-9, "{normal}");
            }
        }
    }
}
