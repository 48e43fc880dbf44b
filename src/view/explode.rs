//! Where parts stand in an exploded view: along their own ways out, just so far that boxes are apart.

use std::collections::{HashMap, HashSet};

use nalgebra::{Point3, Vector3};

use crate::geometry::Bounds;

/// Space between boxes, as a share of the part's longest side.
const GAP: f64 = 0.15;
/// Ways shorter than this share of the part's longest side are none.
const NO_WAY: f64 = 1e-6;

/// Parts that leave a body together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Leaving {
    /// The number of the step.
    pub(super) number: usize,
    /// The step that took the body out which they leave; `None` for the assembly.
    pub(super) of: Option<usize>,
    /// The parts.
    pub(super) parts: Vec<usize>,
    /// Where the middle of the box of all of them goes.
    pub(super) centres: Vec<Point3<f64>>,
}

/// A part that has its place: its box when assembled, and how it is shifted.
#[derive(Debug, Clone, Copy)]
struct Placed {
    bounds: Bounds,
    shift: Vector3<f64>,
}

/// How each part is shifted, by their boxes when assembled and who leaves whom, first to last. Parts go out along their
/// own ways, those that leave last the least far; parts of a group along their ways out of the group, and along that of
/// the group.
/// What is left begins at `shifts`.
pub(super) fn exploded_parts(
    boxes: &[Bounds],
    mut shifts: Vec<Vector3<f64>>,
    leaving: &[Leaving],
) -> Vec<Vector3<f64>> {
    // Of each body, the parts that have their places; at first those that never leave it.
    let mut placed: HashMap<Option<usize>, Vec<usize>> = HashMap::from([(None, (0..boxes.len()).collect())]);
    placed.extend(leaving.iter().map(|l| (Some(l.number), l.parts.clone())));
    for l in leaving {
        let left: HashSet<usize> = l.parts.iter().copied().collect();
        placed.entry(l.of).or_default().retain(|part| !left.contains(part));
    }
    // Backwards, so that a group is arranged before it is shifted.
    for l in leaving.iter().rev() {
        let at = |part: &usize| Placed { bounds: boxes[*part], shift: shifts[*part] };
        let around: Vec<Placed> = placed.get(&l.of).into_iter().flatten().map(at).collect();
        let assembled = l.parts.iter().fold(Bounds::EMPTY, |all, part| all.union(&boxes[*part]));
        let shown = l.parts.iter().fold(Bounds::EMPTY, |all, part| all.union(&at(part).shown()));
        // Parts that were moved aside go from there.
        let centres: Vec<_> = std::iter::once(assembled.centre()).chain(l.centres.iter().copied()).collect();
        let shift = exploded(&shown, &around, &way_out(&assembled, &around, &centres));
        l.parts.iter().for_each(|part| shifts[*part] += shift);
        placed.entry(l.of).or_default().extend(&l.parts);
    }
    shifts
}

/// Multiple of the distance of a unit from the common centre: the largest shift away from it. Units that are linked, with
/// centres close together, need about that. At half, linked rings overlap in the picture; at double, parts become small in it.
const WIDEST: f64 = 2.0;
/// Shifts that are tried up to [`WIDEST`], the first after which the boxes are apart is taken: steps of a tenth of the
/// distance. At half, gaps are up to a fifth wider than needed; at double no visible difference.
const TRIES: u32 = 20;

/// How parts are shifted that nothing takes apart: away from the centre of all, as far as it takes for the boxes of the
/// units, of which each stays together, to be apart. Units with one centre stay together.
pub(super) fn spread(boxes: &[Bounds], units: &[Vec<usize>]) -> Vec<Vector3<f64>> {
    let box_of = |unit: &Vec<usize>| unit.iter().fold(Bounds::EMPTY, |all, &part| all.union(&boxes[part]));
    let own: Vec<Bounds> = units.iter().map(box_of).collect();
    let middle = own.iter().fold(Bounds::EMPTY, |all, bounds| all.union(bounds)).centre();
    let shift = |bounds: &Bounds, amount: f64| (bounds.centre() - middle) * amount;
    let are_apart = |amount: &f64| {
        let there: Vec<Bounds> = own.iter().map(|b| shifted(b, &shift(b, *amount))).collect();
        (0..there.len()).all(|i| !there[..i].iter().any(|other| other.meets(&there[i])))
    };
    let mut amounts = (1..=TRIES).map(|k| WIDEST * f64::from(k) / f64::from(TRIES));
    let amount = amounts.find(are_apart).unwrap_or(WIDEST);
    let mut shifts = vec![Vector3::zeros(); boxes.len()];
    for (unit, bounds) in units.iter().zip(&own) {
        unit.iter().for_each(|&part| shifts[part] = shift(bounds, amount));
    }
    shifts
}

impl Placed {
    fn shown(&self) -> Bounds {
        shifted(&self.bounds, &self.shift)
    }
}

fn shifted(bounds: &Bounds, shift: &Vector3<f64>) -> Bounds {
    Bounds { min: bounds.min + shift, max: bounds.max + shift }
}

/// The unit direction of a part's way out: to the first of the points along its path (of the middle of its box,
/// from the assembled place) where its box is clear of all others as assembled, else to the last. Zero if it
/// does not move.
fn way_out(part: &Bounds, around: &[Placed], centres: &[Point3<f64>]) -> Vector3<f64> {
    let Some(first) = centres.first() else { return Vector3::zeros() };
    let size = part.extents().max();
    let is_clear = |c: &&Point3<f64>| {
        let shift = *c - first;
        let there = shifted(part, &shift);
        shift.norm() > size / 2.0 && !around.iter().any(|o| o.bounds.meets(&there))
    };
    let end = centres.iter().find(is_clear).or(centres.last()).unwrap_or(first);
    (end - first).try_normalize(size * NO_WAY).unwrap_or_else(Vector3::zeros)
}

/// How a part is shifted along the unit vector `way` so that its box is clear of the others where these are shown,
/// and no part that was behind it comes to stand before it.
fn exploded(part: &Bounds, around: &[Placed], way: &Vector3<f64>) -> Vector3<f64> {
    if *way == Vector3::zeros() {
        return *way;
    }
    let behind = around.iter().filter(|o| meeting(&o.bounds, part, way).is_some());
    let mut at = behind.map(|o| o.shift.dot(way)).fold(0.0, f64::max);
    let grown = part.grown(part.extents().max() * GAP);
    let mut met: Vec<[f64; 2]> = around.iter().filter_map(|o| meeting(&grown, &o.shown(), way)).collect();
    met.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for [from, to] in met {
        if from > at {
            break;
        }
        at = f64::max(at, to);
    }
    way * at
}

/// From where to where a box that is shifted along a direction meets another, if it ever does.
fn meeting(moving: &Bounds, other: &Bounds, way: &Vector3<f64>) -> Option<[f64; 2]> {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for a in 0..3 {
        let (near, far) = (other.min[a] - moving.max[a], other.max[a] - moving.min[a]);
        if way[a].abs() < 1e-9 {
            if near > 0.0 || far < 0.0 {
                return None;
            }
        } else {
            let (s, t) = (near / way[a], far / way[a]);
            from = from.max(s.min(t));
            to = to.min(s.max(t));
        }
    }
    (from < to && to > 0.0).then_some([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(lo: [f64; 3], side: f64) -> Bounds {
        let min = Point3::from(lo);
        Bounds { min, max: min + Vector3::repeat(side) }
    }

    fn still(bounds: Bounds) -> Placed {
        Placed { bounds, shift: Vector3::zeros() }
    }

    #[test]
    fn a_part_stops_behind_all_that_it_passes() {
        let around = [[0.0; 3], [0.0, 0.0, 1.2], [0.0, 0.0, 9.0], [5.0; 3]].map(|lo| still(cube(lo, 1.0)));
        let shift = exploded(&cube([0.0; 3], 1.0), &around, &Vector3::z());
        assert!((shift.z - 2.35).abs() < 1e-12 && shift.xy().norm() == 0.0, "{shift}");
        assert_eq!(exploded(&cube([0.0; 3], 1.0), &around, &Vector3::zeros()), Vector3::zeros());
    }

    #[test]
    fn what_is_left_is_drawn_apart_by_its_centres_and_groups_stay_together() {
        let boxes = [
            cube([0.0; 3], 2.0),
            cube([1.5, 0.0, 0.0], 2.0),
            cube([1.5, 0.0, 2.0], 2.0),
            cube([9.0; 3], 1.0),
        ];
        let shifts = spread(&boxes, &[vec![0], vec![1, 2]]);
        assert_eq!((shifts[1], shifts[3]), (shifts[2], Vector3::zeros()));
        assert!(shifts[0].x < 0.0 && shifts[1].x > 0.0, "{shifts:?}");
        assert!(!shifted(&boxes[0], &shifts[0]).meets(&shifted(&boxes[1], &shifts[1])));
        assert_eq!(spread(&boxes, &[vec![0]])[0], Vector3::zeros());
    }

    #[test]
    fn what_is_outside_stays_outside() {
        // A plate that went far away, on which a nut sits: there were room for it where the plate was.
        let plate = Placed { bounds: cube([0.0; 3], 1.0), shift: Vector3::z() * 5.0 };
        let shift = exploded(&cube([0.4, 0.4, 1.0], 0.2), &[plate], &Vector3::z());
        assert!((shift.z - 5.03).abs() < 1e-12, "{shift}");
    }

    #[test]
    fn the_way_out_is_where_it_first_gets_clear() {
        let around = [still(cube([0.0; 3], 1.0))];
        let part = cube([0.0; 3], 1.0);
        let staged = [[0.5, 0.5, 0.5], [0.5, 0.5, 3.0], [9.0, 0.5, 3.0]].map(Point3::from);
        assert!((way_out(&part, &around, &staged) - Vector3::z()).norm() < 1e-12);
        assert_eq!(way_out(&part, &around, &staged[..1]), Vector3::zeros());
    }
}
