//! Shells: the closed surfaces of a part, each turned outward or, as a void, inward.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::crossing::Surfaces;
use super::orientation::{face_outward, winding_number};
use super::{Draft, Findings, plural};
use crate::geometry::incidence::{Side, Sides};
use crate::geometry::{Solidity, mesh};
use crate::termination::{Interrupt, Termination};

/// Tells the shells of a part without open edges apart, gives each its own vertices and turns
/// it. Where a part is no set of separate manifolds, the winding number must do.
///
/// # Errors
/// The termination condition became true.
pub(super) fn settle(
    draft: &mut Draft,
    one_sided: bool,
    findings: &mut Findings,
    termination: &Termination,
) -> Result<Solidity, Interrupt> {
    if one_sided {
        findings.list.push("a surface with one side only; inside and outside by winding number".into());
        face_outward(draft);
        return Ok(Solidity::Winding);
    }
    let given = draft.triangles.clone();
    turn_patches_outward(draft);
    termination.check()?;
    let Some(pairs) = paired_sides(draft) else {
        findings.list.push(
            "edges where more than two triangles meet without order; inside and outside by winding number"
                .into(),
        );
        draft.triangles = given;
        face_outward(draft);
        return Ok(Solidity::Winding);
    };
    termination.check()?;
    let shell_of = components(draft.triangles.len(), pairs.iter().map(|p| p.triangles));
    separate_vertices(draft, &pairs);
    termination.check()?;
    let shells = Shells::new(draft, &shell_of);
    shells.settle(draft, &given, findings, termination)
}

/// The orientation that makes the volume positive, for every patch of surface over manifold
/// edges. A patch that closes only together with others keeps what it has: it is judged again
/// as part of its shell.
fn turn_patches_outward(draft: &mut Draft) {
    let sides = Sides::of(&draft.triangles);
    let two = |sides: &[Side]| Some(<[Side; 2]>::try_from(sides).ok()?.map(|s| s.triangle));
    let manifold = sides.iter().filter_map(|(_, sides)| two(sides));
    let patch_of = components(draft.triangles.len(), manifold);
    for patch in members(&patch_of).values() {
        if volume(draft, patch) < 0.0 {
            patch.iter().for_each(|&t| draft.triangles[t as usize].swap(1, 2));
        }
    }
}

/// The volume of some of the triangles, seen from one of their corners.
fn volume(draft: &Draft, triangles: &[u32]) -> f64 {
    let triangle = |t: &u32| draft.triangles[*t as usize];
    let Some(first) = triangles.first() else { return 0.0 };
    let about = draft.vertices[triangle(first)[0] as usize];
    mesh::signed_volume(&draft.vertices, triangles.iter().map(triangle), &about)
}

/// Two triangles that continue each other across an edge.
struct Pair {
    edge: [u32; 2],
    triangles: [u32; 2],
}

/// Pairs the triangles at every edge so that solid lies between the two of a pair. `None` if
/// at some edge inside and outside do not alternate.
fn paired_sides(draft: &Draft) -> Option<Vec<Pair>> {
    let all = Sides::of(&draft.triangles);
    let mut pairs = Vec::with_capacity(draft.triangles.len() * 3 / 2);
    for (edge, sides) in all.iter() {
        let mut sides = Cow::Borrowed(sides);
        if sides.len() > 2 {
            let sides = sides.to_mut();
            sort_around(draft, edge, sides);
            // Upwards, the inside lies clockwise of the triangle: a pair begins with a side
            // that travels down.
            let first_down = sides.iter().position(|s| !s.upwards)?;
            sides.rotate_left(first_down);
        }
        for couple in sides.chunks(2) {
            let [a, b] = couple else { return None };
            if a.upwards == b.upwards || (sides.len() > 2 && a.upwards) {
                return None;
            }
            pairs.push(Pair { edge, triangles: [a.triangle, b.triangle] });
        }
    }
    Some(pairs)
}

/// Sorts triangles counter-clockwise around an edge, seen against its upward direction.
fn sort_around(draft: &Draft, [low, high]: [u32; 2], sides: &mut [Side]) {
    let at = |v: u32| draft.vertices[v as usize];
    let axis = at(high) - at(low);
    let away = |side: &Side| -> Vector3<f64> {
        let apex = draft.triangles[side.triangle as usize].into_iter().find(|v| *v != low && *v != high);
        let arm = apex.map_or_else(Vector3::zeros, |v| at(v) - at(low));
        arm - axis * (arm.dot(&axis) / axis.norm_squared())
    };
    let Some(zero) = sides.first().map(away) else { return };
    let side_axis = axis.normalize().cross(&zero);
    let angle = |side: &Side| {
        let arm = away(side);
        arm.dot(&side_axis).atan2(arm.dot(&zero)).rem_euclid(std::f64::consts::TAU)
    };
    sides.sort_by(|a, b| angle(a).total_cmp(&angle(b)).then(a.triangle.cmp(&b.triangle)));
}

/// The least index that each of `count` things is linked to.
pub(in crate::geometry) fn components(count: usize, links: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..count as u32).collect();
    for [a, b] in links {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|i| root(&mut parent, i)).collect()
}

fn root(parent: &mut [u32], mut of: u32) -> u32 {
    while parent[of as usize] != of {
        parent[of as usize] = parent[parent[of as usize] as usize];
        of = parent[of as usize];
    }
    of
}

/// The things of each component, by its least index.
pub(in crate::geometry) fn members(component_of: &[u32]) -> BTreeMap<u32, Vec<u32>> {
    let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (thing, &component) in (0u32..).zip(component_of) {
        members.entry(component).or_default().push(thing);
    }
    members
}

/// Gives every fan of triangles its own copy of a vertex, so that surfaces that touch in an
/// edge or a point share no vertex and each has pseudo-normals of its own.
fn separate_vertices(draft: &mut Draft, pairs: &[Pair]) {
    let corner = |draft: &Draft, triangle: u32, vertex: u32| {
        let t = &draft.triangles[triangle as usize];
        3 * triangle + (0u32..3).zip(t).find(|(_, v)| **v == vertex).map_or(0, |(k, _)| k)
    };
    let links = pairs.iter().flat_map(|p| {
        let [a, b] = p.triangles;
        p.edge.map(|v| [corner(draft, a, v), corner(draft, b, v)])
    });
    let fan_of = components(draft.triangles.len() * 3, links);
    let mut owner: Vec<Option<u32>> = vec![None; draft.vertices.len()];
    let mut copies = BTreeMap::new();
    for (corner, &fan) in fan_of.iter().enumerate() {
        let vertex = &mut draft.triangles[corner / 3][corner % 3];
        let first = *owner[*vertex as usize].get_or_insert(fan);
        if first != fan {
            *vertex = *copies.entry(fan).or_insert_with(|| {
                draft.vertices.push(draft.vertices[*vertex as usize]);
                (draft.vertices.len() - 1) as u32
            });
        }
    }
}

/// The closed shells of a part.
struct Shells {
    triangles: Vec<Vec<u32>>,
    boxes: Vec<(Point3<f64>, Point3<f64>)>,
}

impl Shells {
    fn new(draft: &Draft, shell_of: &[u32]) -> Self {
        let triangles: Vec<Vec<u32>> = members(shell_of).into_values().collect();
        let corners = |t: &u32| draft.triangles[*t as usize].map(|v| draft.vertices[v as usize]);
        let boxes = triangles
            .iter()
            .map(|shell| mesh::bounds(&shell.iter().flat_map(corners).collect::<Vec<_>>()))
            .collect();
        Self { triangles, boxes }
    }

    fn settle(
        &self,
        draft: &mut Draft,
        given: &[[u32; 3]],
        findings: &mut Findings,
        termination: &Termination,
    ) -> Result<Solidity, Interrupt> {
        let count = self.triangles.len();
        for shell in 0..count {
            if volume(draft, &self.triangles[shell]) < 0.0 {
                self.flip(draft, shell);
            }
        }
        let surfaces = Surfaces::new(draft, &self.triangles, termination);
        let mut depth = vec![0; count];
        let mut meet = vec![false; count];
        for (i, j) in (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j))) {
            if !overlap(&self.boxes[i], &self.boxes[j]) {
                continue;
            }
            termination.check()?;
            if surfaces.meet(i, j)? {
                (meet[i], meet[j]) = (true, true);
            } else if self.contains(draft, i, j) {
                depth[j] += 1;
            } else if self.contains(draft, j, i) {
                depth[i] += 1;
            }
        }
        let voids: Vec<usize> = (0..count).filter(|&i| depth[i] % 2 == 1).collect();
        voids.iter().for_each(|&i| self.flip(draft, i));
        findings.add(voids.len(), "inner shell", "taken as a void");
        findings.add(self.turned(draft, given), "shell", "turned, for it was inside out");
        let meeting = meet.iter().filter(|m| **m).count();
        findings.add(meeting, "shell", "that cross or touch; inside and outside by winding number");
        let mut crossing = 0;
        for shell in 0..count {
            crossing += usize::from(surfaces.crosses_itself(shell)?);
        }
        if crossing > 0 {
            let shells = plural(crossing, "shell");
            let verb = if crossing == 1 { "crosses itself" } else { "cross themselves" };
            findings.list.push(format!("{crossing} {shells} {verb}; inside and outside by winding number"));
        }
        Ok(if meeting + crossing > 0 { Solidity::Winding } else { Solidity::Closed })
    }

    fn of(&self, draft: &Draft, shell: usize) -> impl Iterator<Item = [u32; 3]> {
        self.triangles[shell].iter().map(|&t| draft.triangles[t as usize])
    }

    fn flip(&self, draft: &mut Draft, shell: usize) {
        self.triangles[shell].iter().for_each(|&t| draft.triangles[t as usize].swap(1, 2));
    }

    /// Whether `inner`, which does not meet `outer`, lies in it.
    fn contains(&self, draft: &Draft, outer: usize, inner: usize) -> bool {
        let ((lo, hi), (least, greatest)) = (&self.boxes[outer], &self.boxes[inner]);
        let within = (0..3).all(|k| lo[k] <= least[k] && greatest[k] <= hi[k]);
        let Some(inside) = self.of(draft, inner).next() else { return false };
        let point = draft.vertices[inside[0] as usize];
        within && winding_number(&draft.vertices, self.of(draft, outer), &point) > 0.5
    }

    /// How many shells travel the other way than given. Vertices may have been copied since:
    /// positions in the triangle tell.
    fn turned(&self, draft: &Draft, given: &[[u32; 3]]) -> usize {
        let place = |v: u32| draft.vertices[v as usize];
        let same = |t: u32| place(draft.triangles[t as usize][1]) == place(given[t as usize][1]);
        self.triangles.iter().filter(|shell| shell.first().is_some_and(|&t| !same(t))).count()
    }
}

fn overlap(a: &(Point3<f64>, Point3<f64>), b: &(Point3<f64>, Point3<f64>)) -> bool {
    (0..3).all(|k| a.0[k] <= b.1[k] && b.0[k] <= a.1[k])
}
