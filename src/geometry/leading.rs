//! What of a surface leads when it is moved: groups of points or edges near each other, of which those that cannot
//! are left out as a whole.

use nalgebra::{Point3, Vector3};

use super::{Bounds, Pose};

/// Items of a group, at most.
const GROUP: usize = 32;

/// Where a point or an edge is, and the box of the normals of the faces that meet there, taken as points.
#[derive(Debug, Clone)]
pub(super) struct LeadingItem {
    pub(super) place: Bounds,
    pub(super) normals: Bounds,
}

impl LeadingItem {
    pub(super) fn new<'a>(
        points: impl IntoIterator<Item = &'a Point3<f64>>,
        normals: &[Vector3<f64>],
    ) -> Self {
        let normals: Vec<_> = normals.iter().map(|n| Point3::from(*n)).collect();
        Self { place: Bounds::of(points), normals: Bounds::of(&normals) }
    }
}

/// The numbers of some items, in groups near each other.
#[derive(Debug, Clone, Default)]
pub(super) struct Groups {
    /// Those of a group one after the other.
    numbers: Vec<u32>,
    groups: Vec<HullGroup>,
}

#[derive(Debug, Clone)]
struct HullGroup {
    /// Where its numbers begin and end.
    range: [u32; 2],
    all: LeadingItem,
}

impl Groups {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.numbers) + size_of_val(&*self.groups)
    }

    pub(super) fn new(items: &[LeadingItem]) -> Self {
        let mut numbers: Vec<u32> = (0..items.len() as u32).collect();
        let mut groups = Vec::new();
        split(items, &mut numbers, 0, &mut groups);
        groups.shrink_to_fit();
        Self { numbers, groups }
    }

    /// The items of which any may lie in a box with a pose and have a normal with more than `steepness`
    /// along a direction, in no order that matters.
    pub(super) fn leading<'s>(
        &'s self,
        box_from_self: &'s Pose,
        within: &'s Bounds,
        direction: &'s Vector3<f64>,
        steepness: f64,
    ) -> impl Iterator<Item = u32> + 's {
        /// Boxes are rounded otherwise than the points in them.
        const ROUNDING: f64 = 1e-9;
        let wanted = move |group: &&HullGroup| {
            group.all.normals.support(direction) > steepness - ROUNDING
                && group.all.place.transformed(box_from_self).grown(ROUNDING).meets(within)
        };
        let all = self.groups.iter().filter(wanted).map(|group| group.range.map(|i| i as usize));
        all.flat_map(|[from, to]| self.numbers[from..to].iter().copied())
    }
}

/// Halves a part of the numbers, which begins at `start`, until the halves are small.
fn split(items: &[LeadingItem], numbers: &mut [u32], start: u32, groups: &mut Vec<HullGroup>) {
    let none = LeadingItem { place: Bounds::EMPTY, normals: Bounds::EMPTY };
    let all = numbers.iter().map(|&i| &items[i as usize]).fold(none, |all, item| LeadingItem {
        place: all.place.union(&item.place),
        normals: all.normals.union(&item.normals),
    });
    if numbers.len() > GROUP {
        let axis = all.place.extents().imax();
        let middle = numbers.len() / 2;
        let along = |i: &u32| {
            let place = &items[*i as usize].place;
            place.min[axis] + place.max[axis]
        };
        numbers.select_nth_unstable_by(middle, |i, j| along(i).total_cmp(&along(j)).then(i.cmp(j)));
        let (low, high) = numbers.split_at_mut(middle);
        split(items, low, start, groups);
        split(items, high, start + middle as u32, groups);
    } else if !numbers.is_empty() {
        groups.push(HullGroup { range: [start, start + numbers.len() as u32], all });
    }
}
