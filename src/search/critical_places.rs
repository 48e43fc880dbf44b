//! The places at which a part that moves along an axis meets something new, from the
//! [critical coordinates](critical_coordinates) of all parts.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::budgets::CELLS_PER_CAST;
use crate::geometry::{Pose, critical_coordinates, edge_centres};
use crate::scene::Scene;
use crate::simulation::Axis;
use crate::tolerances::ROUNDED;

/// Coordinates along an axis, each list ascending, and of equal ones the first.
#[derive(Debug, Clone, Default)]
pub(super) struct AxisCoordinates {
    pub(super) critical: Vec<f64>,
    /// Of the centres of round edges.
    pub(super) centres: Vec<f64>,
}

impl AxisCoordinates {
    /// Those of a part at a pose, given the centres of its round edges in its shape's frame.
    pub(super) fn of(scene: &Scene, part: usize, pose: &Pose, axis: Axis, centres: &[Point3<f64>]) -> Self {
        let axis = axis.unit().into_inner();
        let here = axis.dot(&pose.translation.vector);
        let in_shape = pose.rotation.inverse() * axis;
        let critical = critical_coordinates(&scene.bodies[part].shape.surface, &in_shape);
        let centres = centres.iter().map(|p| in_shape.dot(&p.coords)).collect();
        let [critical, centres] = [critical, centres].map(|mut found: Vec<f64>| {
            found.iter_mut().for_each(|x| *x += here);
            distinct(found)
        });
        Self { critical, centres }
    }

    /// The places between two coordinates of a translation at which a critical coordinate of the part (without
    /// translation) is one of these, and those at which a centre is; ascending.
    pub(super) fn places(&self, mine: &Self, between: [f64; 2]) -> [Vec<f64>; 2] {
        [
            alignments(&self.critical, &mine.critical, between),
            alignments(&self.centres, &mine.centres, between),
        ]
    }
}

/// The coordinates of parts.
#[derive(Debug, Default)]
pub(super) struct CriticalCoordinates {
    /// At their assembled poses, by part and axis.
    assembled: HashMap<(usize, usize), AxisCoordinates>,
    /// By part: the centres of its round edges, in its shape's frame.
    centres: HashMap<usize, Vec<Point3<f64>>>,
}

impl CriticalCoordinates {
    /// Those of a part at a pose.
    pub(super) fn of(&mut self, scene: &Scene, part: usize, pose: &Pose, axis: Axis) -> AxisCoordinates {
        let found = || edge_centres(&scene.bodies[part].shape.surface);
        let centres = self.centres.entry(part).or_insert_with(found);
        AxisCoordinates::of(scene, part, pose, axis, centres)
    }

    /// Those of some parts as assembled.
    pub(super) fn of_all(
        &mut self,
        scene: &Scene,
        parts: &[usize],
        (index, axis): (usize, Axis),
    ) -> AxisCoordinates {
        let mut all = AxisCoordinates::default();
        for &part in parts {
            if !self.assembled.contains_key(&(part, index)) {
                let own = self.of(scene, part, &scene.bodies[part].planning_from_shape, axis);
                self.assembled.insert((part, index), own);
            }
            let AxisCoordinates { critical, centres } = &self.assembled[&(part, index)];
            all.critical.extend_from_slice(critical);
            all.centres.extend_from_slice(centres);
        }
        AxisCoordinates { critical: distinct(all.critical), centres: distinct(all.centres) }
    }
}

fn sorted(mut list: Vec<f64>) -> Vec<f64> {
    list.sort_by(f64::total_cmp);
    list
}

/// Sorted, and of equal ones the first.
fn distinct(list: Vec<f64>) -> Vec<f64> {
    let mut list = sorted(list);
    list.dedup_by(|a, b| *a - *b < ROUNDED);
    list
}

/// The places between two coordinates of a translation, ascending, at which a coordinate of the part is one of the
/// standing parts'.
pub(super) fn alignments(still: &[f64], mine: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let between = |&here: &f64| {
        let first = still.partition_point(|there| there - here <= low + ROUNDED);
        let last = still.partition_point(|there| there - here < high - ROUNDED);
        still[first..last.max(first)].iter().map(move |there| there - here)
    };
    sorted(mine.iter().flat_map(between).collect())
}

/// The places to stop at between two coordinates: the ends, those where centres fall together, the middles between
/// critical places, and those where several of these fall together. Of too many, those amid the longest stretches are
/// left out last.
pub(super) fn stops(critical: &[f64], centred: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let mut stops: Vec<(f64, f64)> =
        [low, high].iter().chain(centred).map(|&at| (f64::INFINITY, at)).collect();
    let mut from = low;
    for together in critical.chunk_by(|a, b| b - a < ROUNDED) {
        stops.push((together[0] - from, (from + together[0]) / 2.0));
        if together.len() > 1 {
            stops.push((f64::INFINITY, together[0]));
        }
        from = together[0];
    }
    stops.push((high - from, (from + high) / 2.0));
    stops.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
    stops.truncate(CELLS_PER_CAST);
    sorted(stops.into_iter().map(|(_, at)| at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cast_stops_between_critical_places_and_where_several_fall_together() {
        // A slot from 0 to 10 with a window from 4 to 6, and a part from 0 to 1 in it.
        let critical = alignments(&[0.0, 4.0, 6.0, 10.0], &[0.0, 1.0], [0.0, 9.0]);
        assert_eq!(critical, [3.0, 4.0, 5.0, 6.0]);
        assert_eq!(stops(&critical, &[], [0.0, 9.0]), [0.0, 1.5, 3.5, 4.5, 5.5, 7.5, 9.0]);
        // The window is as wide as the part.
        let critical = alignments(&[0.0, 4.0, 5.0, 10.0], &[0.0, 1.0], [0.0, 9.0]);
        assert_eq!(stops(&critical, &[], [0.0, 9.0]), [0.0, 1.5, 3.5, 4.0, 4.5, 7.0, 9.0]);
        // A round window has its centre at 4.6.
        assert_eq!(stops(&critical, &[4.1], [0.0, 9.0]), [0.0, 1.5, 3.5, 4.0, 4.1, 4.5, 7.0, 9.0]);
    }
}
