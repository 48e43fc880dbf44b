//! Where two parts that stand touch: the points at which they can press on each other.
//!
//! Two rigid bodies that touch along a plane press on each other somewhere in the common area. Whatever the pressure
//! and the friction there, the corners of the area's convex hull can carry the same force and torque, so corners are all
//! that statics needs. They come from faces that lie on each other (clipped triangle by triangle), from corners of one
//! part on faces of the other, and from edges that cross.

use nalgebra::{Point3, Vector3};

use crate::budgets::{CONTACT_CORNERS, CONTACTS_PER_PAIR, LONG_STEPS_PER_POLL};
use crate::geometry::{Bounds, ConvexEdge, Corner, Feature, Pose, area_normal};
use crate::scene::{Body, BroadPhase, Scene};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::{CONTACT_CONE, CROSSED_EDGES, OPPOSED_COSINE, STEEP_COSINE};

/// A point at which two parts can press on each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ContactPoint {
    /// Where, in the planning frame: half-way between the two surfaces.
    pub(super) point: Point3<f64>,
    /// The unit normal, towards the first part: the direction in which the second one can push it.
    pub(super) normal: Vector3<f64>,
}

impl ContactPoint {
    /// The same for the two parts in the other order.
    pub(super) fn flipped(self) -> Self {
        Self { normal: -self.normal, ..self }
    }
}

/// A triangle where it stands.
struct Facet {
    corners: [Point3<f64>; 3],
    normal: Vector3<f64>,
}

/// An edge where it stands.
struct Edge {
    ends: [Point3<f64>; 2],
    normals: [Vector3<f64>; 2],
}

/// The points at which two parts of a scene can press on each other, where their surfaces are no further apart than a
/// gap and no deeper in each other than they are assembled.
///
/// # Errors
/// The termination condition became true.
pub(super) fn contacts_between(
    scene: &Scene,
    [a, b]: [usize; 2],
    gap: f64,
    termination: &Termination,
) -> Result<Vec<ContactPoint>, Interrupt> {
    let poll = Poll::every(LONG_STEPS_PER_POLL, Some(termination));
    let bodies = [a, b].map(|part| &scene.bodies[part]);
    let within = bodies[0].bounds.grown(gap).intersection(&bodies[1].bounds.grown(gap));
    let reach = gap.max(scene.allowed.of(a, b));
    let mut found = Vec::new();
    on_faces(bodies, &within, reach, &poll, &mut found)?;
    at_corners(bodies, &within, reach, &poll, &mut |contact| found.push(contact))?;
    at_corners([bodies[1], bodies[0]], &within, reach, &poll, &mut |contact| found.push(contact.flipped()))?;
    at_crossings(bodies, &within, reach, &poll, &mut found)?;
    Ok(spread(hulls(found, reach)))
}

/// Adds the corners of the areas in which faces of one lie on faces of the other.
fn on_faces(
    [a, b]: [&Body; 2],
    within: &Bounds,
    reach: f64,
    poll: &Poll<'_>,
    found: &mut Vec<ContactPoint>,
) -> Result<(), Interrupt> {
    let facets = |body: &Body| -> Result<Vec<Facet>, Interrupt> {
        let (surface, pose) = (&body.shape.surface, &body.planning_from_shape);
        let mut facets = Vec::new();
        for t in 0..surface.triangles().len() as u32 {
            poll.check()?;
            let corners = surface.corners(t).map(|p| pose * p);
            if Bounds::of(&corners).meets(within) {
                facets.push(Facet { corners, normal: pose.rotation * surface.face_normal(t) });
            }
        }
        Ok(facets)
    };
    let (of_a, of_b) = (facets(a)?, facets(b)?);
    let tree = BroadPhase::new(&of_b.iter().map(|f| Bounds::of(&f.corners)).collect::<Vec<_>>());
    for facet in &of_a {
        poll.check()?;
        for other in tree.meeting(&Bounds::of(&facet.corners).grown(reach)) {
            common_area(facet, &of_b[other], reach, found);
        }
    }
    Ok(())
}

/// Adds the corners of the area in which two triangles lie on each other.
fn common_area(a: &Facet, b: &Facet, reach: f64, found: &mut Vec<ContactPoint>) {
    let facing = a.normal.dot(&b.normal);
    if facing > -OPPOSED_COSINE {
        return;
    }
    // Above the plane of b, along its normal.
    let height = |p: &Point3<f64>| (a.corners[0] - p).dot(&a.normal) / facing;
    let on_plane = |p: &Point3<f64>| p - b.normal * (p - b.corners[0]).dot(&b.normal);
    let mut area: Vec<Point3<f64>> = a.corners.iter().map(on_plane).collect();
    for side in 0..3 {
        let (from, to) = (b.corners[side], b.corners[(side + 1) % 3]);
        let inward = b.normal.cross(&(to - from));
        area = clipped(&area, |p| (p - from).dot(&inward));
    }
    let Some((first, rest)) = area.split_first() else { return };
    let size: Vector3<f64> = rest.windows(2).map(|pair| area_normal(first, &pair[0], &pair[1])).sum();
    // Triangles that only meet along a line have neighbours with an area, or none carries anything.
    if size.norm() <= f64::EPSILON * Bounds::of(&b.corners).extents().norm_squared() {
        return;
    }
    let corners = area.iter().map(|p| (p, height(p))).filter(|(_, height)| height.abs() <= reach);
    found.extend(
        corners.map(|(p, height)| ContactPoint { point: p + b.normal * (height / 2.0), normal: b.normal }),
    );
}

/// What of a convex polygon has no negative height (Sutherland and Hodgman).
fn clipped(polygon: &[Point3<f64>], height: impl Fn(&Point3<f64>) -> f64) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (at_p, at_q) = (height(p), height(q));
        if at_p >= 0.0 {
            kept.push(*p);
        }
        if (at_p < 0.0) != (at_q < 0.0) {
            kept.push(p + (q - p) * (at_p / (at_p - at_q)));
        }
    }
    kept
}

/// Shows the corners of the first one that lie on faces of the second one.
fn at_corners(
    [a, b]: [&Body; 2],
    within: &Bounds,
    reach: f64,
    poll: &Poll<'_>,
    visit: &mut impl FnMut(ContactPoint),
) -> Result<(), Interrupt> {
    let surface = &b.shape.surface;
    let to_b = b.planning_from_shape.inverse() * a.planning_from_shape;
    for vertex in a.shape.surface.vertices() {
        poll.check()?;
        if !within.contains(&(a.planning_from_shape * vertex)) {
            continue;
        }
        let p = to_b * vertex;
        let Some(closest) = surface.closest(&p, reach).filter(|c| c.feature == Feature::Face) else {
            continue;
        };
        let mut normal = surface.face_normal(closest.triangle);
        // A wall holds what is on either side.
        if surface.is_wall() && (p - closest.point).dot(&normal) < 0.0 {
            normal = -normal;
        }
        let middle = closest.point + (p - closest.point) / 2.0;
        let pose = &b.planning_from_shape;
        visit(ContactPoint { point: pose * middle, normal: pose.rotation * normal });
    }
    Ok(())
}

/// Adds the points at which convex edges of both cross.
fn at_crossings(
    bodies: [&Body; 2],
    within: &Bounds,
    reach: f64,
    poll: &Poll<'_>,
    found: &mut Vec<ContactPoint>,
) -> Result<(), Interrupt> {
    let edges = |body: &Body| -> Result<Vec<Edge>, Interrupt> {
        let (edges, pose) = (body.shape.convex_edges(), &body.planning_from_shape);
        let mut standing = Vec::new();
        for edge in edges.all() {
            poll.check()?;
            let edge = edge_at(pose, edge, edges.ends_of(edge));
            if Bounds::of(&edge.ends).meets(within) {
                standing.push(edge);
            }
        }
        Ok(standing)
    };
    let (of_a, of_b) = (edges(bodies[0])?, edges(bodies[1])?);
    let tree = BroadPhase::new(&of_b.iter().map(|e| Bounds::of(&e.ends)).collect::<Vec<_>>());
    for edge in &of_a {
        poll.check()?;
        let near = tree.meeting(&Bounds::of(&edge.ends).grown(reach));
        found.extend(near.into_iter().filter_map(|other| crossing(edge, &of_b[other], reach)));
    }
    Ok(())
}

fn edge_at(pose: &Pose, edge: &ConvexEdge, [(from, _), (to, _)]: [Corner<'_>; 2]) -> Edge {
    Edge { ends: [pose * from, pose * to], normals: edge.normals.map(|n| pose.rotation * n) }
}

/// The point at which two edges cross, if they press on each other there.
fn crossing(a: &Edge, b: &Edge, reach: f64) -> Option<ContactPoint> {
    let [u, v] = [a, b].map(|edge| edge.ends[1] - edge.ends[0]);
    let across = u.cross(&v);
    if across.norm() <= CROSSED_EDGES * u.norm() * v.norm() {
        return None;
    }
    let between = b.ends[0] - a.ends[0];
    let squared = across.norm_squared();
    let along_a = between.cross(&v).dot(&across) / squared;
    let along_b = between.cross(&u).dot(&across) / squared;
    if ![along_a, along_b].iter().all(|share| (0.0..=1.0).contains(share)) {
        return None;
    }
    let (on_a, on_b) = (a.ends[0] + u * along_a, b.ends[0] + v * along_b);
    let normal = across / squared.sqrt();
    let normal =
        [normal, -normal].into_iter().find(|n| is_below(n, &b.normals) && is_below(&-n, &a.normals))?;
    ((on_a - on_b).dot(&normal).abs() <= reach)
        .then(|| ContactPoint { point: on_a + (on_b - on_a) / 2.0, normal })
}

/// Whether a direction leads out of an edge between its two faces.
fn is_below(direction: &Vector3<f64>, [m, n]: &[Vector3<f64>; 2]) -> bool {
    let (cosine, along_m, along_n) = (m.dot(n), direction.dot(m), direction.dot(n));
    let sine_squared = 1.0 - cosine * cosine;
    let least = -CONTACT_CONE * sine_squared;
    sine_squared > 0.0 && along_m - cosine * along_n >= least && along_n - cosine * along_m >= least
}

/// Of points on one plane, up to a height, only the corners of their convex hull.
fn hulls(mut contacts: Vec<ContactPoint>, height: f64) -> Vec<ContactPoint> {
    let mut kept = Vec::new();
    while let Some(first) = contacts.first().copied() {
        let is_alike = |contact: &ContactPoint| {
            contact.normal.dot(&first.normal) > STEEP_COSINE
                && (contact.point - first.point).dot(&first.normal).abs() <= height
        };
        let (alike, rest): (Vec<_>, Vec<_>) = contacts.into_iter().partition(is_alike);
        contacts = rest;
        kept.extend(hull(alike, &first.normal));
    }
    kept
}

/// The corners of the convex hull of points seen along a normal: of many, those that are furthest in evenly spread
/// directions.
fn hull(mut contacts: Vec<ContactPoint>, normal: &Vector3<f64>) -> Vec<ContactPoint> {
    let x = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let y = normal.cross(&x);
    let seen = |contact: &ContactPoint| [contact.point.coords.dot(&x), contact.point.coords.dot(&y)];
    contacts.sort_by(|a, b| {
        let ([ax, ay], [bx, by]) = (seen(a), seen(b));
        ax.total_cmp(&bx).then(ay.total_cmp(&by))
    });
    /// Share of the area's size, squared: a corner that stands out by less is none. Coordinates are rounded by 1e-7 of the
    /// size in files with single precision. At half and double no effect is known.
    const ROUNDING: f64 = 1e-9;
    let rounding = ROUNDING * Bounds::of(contacts.iter().map(|c| &c.point)).extents().norm_squared();
    // Andrew's monotone chain.
    let chain = |points: &mut dyn Iterator<Item = &ContactPoint>| {
        let mut chain: Vec<ContactPoint> = Vec::new();
        for &contact in points {
            // Whether q is no corner between p and the new point. What stands out by rounding alone is none; but of points
            // on a line that rounding has put in another order, one that is not between the two is.
            let is_passed = |p: &ContactPoint, q: &ContactPoint| {
                let ([px, py], [qx, qy], [rx, ry]) = (seen(p), seen(q), seen(&contact));
                let turns = (qx - px) * (ry - py) - (qy - py) * (rx - px);
                let goes_on = (qx - px) * (rx - qx) + (qy - py) * (ry - qy);
                turns < -rounding || turns <= rounding && goes_on > -rounding
            };
            while let [.., p, q] = &chain[..]
                && is_passed(p, q)
            {
                chain.pop();
            }
            chain.push(contact);
        }
        chain.pop();
        chain
    };
    let (lower, upper) = (chain(&mut contacts.iter()), chain(&mut contacts.iter().rev()));
    let corners = [lower, upper].concat();
    match corners.len() {
        0 => contacts.into_iter().take(1).collect(),
        count if count <= CONTACT_CORNERS => corners,
        _ => {
            let mut chosen: Vec<usize> = (0..CONTACT_CORNERS)
                .filter_map(|i| {
                    let (sine, cosine) =
                        (std::f64::consts::TAU * i as f64 / CONTACT_CORNERS as f64).sin_cos();
                    let reach = |c: &ContactPoint| seen(c)[0] * cosine + seen(c)[1] * sine;
                    (0..corners.len()).max_by(|&i, &j| reach(&corners[i]).total_cmp(&reach(&corners[j])))
                })
                .collect();
            chosen.sort_unstable();
            chosen.dedup();
            chosen.into_iter().map(|i| corners[i]).collect()
        }
    }
}

/// Of many contacts, those that are furthest from each other, in place and normal.
fn spread(contacts: Vec<ContactPoint>) -> Vec<ContactPoint> {
    if contacts.len() <= CONTACTS_PER_PAIR {
        return contacts;
    }
    let size = Bounds::of(contacts.iter().map(|c| &c.point)).extents().norm().max(f64::MIN_POSITIVE);
    let apart =
        |a: &ContactPoint, b: &ContactPoint| (a.point - b.point).norm() / size + (a.normal - b.normal).norm();
    let mut chosen = vec![contacts[0]];
    let mut distances: Vec<f64> = contacts.iter().map(|c| apart(c, &contacts[0])).collect();
    while chosen.len() < CONTACTS_PER_PAIR {
        let furthest =
            (0..contacts.len()).max_by(|&i, &j| distances[i].total_cmp(&distances[j])).unwrap_or(0);
        chosen.push(contacts[furthest]);
        for (distance, contact) in distances.iter_mut().zip(&contacts) {
            *distance = distance.min(apart(contact, &contacts[furthest]));
        }
    }
    chosen
}
