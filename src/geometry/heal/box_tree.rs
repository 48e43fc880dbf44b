//! Boxes in a tree that is quickly built: in the order of the Morton curve (G. M. Morton 1966), eight to a node.

use parry3d_f64::bounding_volume::Aabb;

use crate::termination::Interrupt;

/// Boxes of a node.
const WIDTH: usize = 8;
/// Cells of the curve along each axis, as a power of two: with the number of a triangle they fill 64 bits. At half, cells
/// of two million triangles hold several; more do not fit.
const BITS: u32 = 11;
/// What single precision rounds of coordinates in [0, 1], and more.
const ROUNDING: f32 = 1e-6;

/// A box that is a little too large.
#[derive(Debug, Clone, Copy)]
pub(super) struct LooseBox {
    min: [f32; 3],
    max: [f32; 3],
}

impl LooseBox {
    pub(super) fn of(exact: &Aabb) -> Self {
        let (min, max) = (exact.mins.to_array(), exact.maxs.to_array());
        Self { min: min.map(|x| x as f32 - ROUNDING), max: max.map(|x| x as f32 + ROUNDING) }
    }

    fn union(mut self, other: &Self) -> Self {
        for a in 0..3 {
            self.min[a] = self.min[a].min(other.min[a]);
            self.max[a] = self.max[a].max(other.max[a]);
        }
        self
    }

    #[inline]
    fn meets(&self, other: &Self) -> bool {
        // Without branches.
        (0..3).fold(true, |all, a| all & (self.min[a] <= other.max[a]) & (other.min[a] <= self.max[a]))
    }

    /// The place of its middle along the curve.
    fn code(&self) -> u64 {
        let cell = |a: usize| ((self.min[a] + self.max[a]) * (1 << (BITS - 1)) as f32) as u64;
        let cells = [0, 1, 2].map(|a| cell(a).min((1 << BITS) - 1));
        (0..BITS).rev().fold(0, |code, bit| cells.iter().fold(code, |code, cell| code << 1 | cell >> bit & 1))
    }
}

/// Boxes within the unit cube, named by their places among those that were given.
pub(super) struct BoxTree {
    /// Their names, in the order of the tree.
    order: Vec<u32>,
    /// The boxes in that order; then, level by level, of eight boxes each the one around them; last a single one.
    levels: Vec<Vec<LooseBox>>,
}

impl BoxTree {
    /// The tree of some boxes, fewer than 2³¹.
    pub(super) fn new(boxes: &[LooseBox]) -> Self {
        let number_bits = u64::BITS - 3 * BITS;
        let mut keys: Vec<u64> =
            (0..).zip(boxes).map(|(i, b): (u64, _)| b.code() << number_bits | i).collect();
        keys.sort_unstable();
        let order: Vec<u32> = keys.into_iter().map(|key| (key & ((1 << number_bits) - 1)) as u32).collect();
        let mut level: Vec<_> = order.iter().map(|&i| boxes[i as usize]).collect();
        let mut levels = Vec::new();
        while level.len() > 1 {
            let around = |boxes: &[LooseBox]| boxes.iter().fold(boxes[0], |all, b| all.union(b));
            let above = level.chunks(WIDTH).map(around).collect();
            levels.push(std::mem::replace(&mut level, above));
        }
        levels.push(level);
        Self { order, levels }
    }

    /// Whether any box that meets a region passes a test.
    ///
    /// # Errors
    /// The first error of the test.
    pub(super) fn any_meeting(
        &self,
        region: &LooseBox,
        mut test: impl FnMut(u32) -> Result<bool, Interrupt>,
    ) -> Result<bool, Interrupt> {
        self.any_below(self.levels.len(), 0, region, 0, &mut |i| test(self.order[i]))
    }

    /// How many groups of boxes there are whose pairs are tested together.
    pub(super) fn groups(&self) -> usize {
        self.levels[self.group_level()].len()
    }

    /// Whether any pair of boxes that meet, one of them in a group and the other in it or in a later one, passes a test.
    /// Every pair has one such group.
    ///
    /// # Errors
    /// The first error of the test.
    pub(super) fn any_pair(
        &self,
        group: usize,
        mut test: impl FnMut(u32, u32) -> Result<bool, Interrupt>,
    ) -> Result<bool, Interrupt> {
        let level = self.group_level();
        let Some(region) = self.levels[level].get(group) else { return Ok(false) };
        let mut test = |i: usize, j: usize| test(self.order[i], self.order[j]);
        self.any_below(self.levels.len(), 0, region, level, &mut |other| {
            Ok(other >= group && self.any_pair_of(level, [group, other], &mut test)?)
        })
    }

    /// Groups have 512 boxes: enough for a task, and some for every thread.
    fn group_level(&self) -> usize {
        3.min(self.levels.len() - 1)
    }

    /// Whether any box of level `to` that meets a region, below one of level `from`, passes a test.
    fn any_below(
        &self,
        from: usize,
        at: usize,
        region: &LooseBox,
        to: usize,
        test: &mut impl FnMut(usize) -> Result<bool, Interrupt>,
    ) -> Result<bool, Interrupt> {
        if from == to {
            return test(at);
        }
        let level = &self.levels[from - 1];
        for child in children(at, level) {
            if level[child].meets(region) && self.any_below(from - 1, child, region, to, test)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether any pair of boxes that meet, below two of a level, passes a test; below one, each pair once.
    fn any_pair_of(
        &self,
        level: usize,
        [i, j]: [usize; 2],
        test: &mut impl FnMut(usize, usize) -> Result<bool, Interrupt>,
    ) -> Result<bool, Interrupt> {
        if level == 0 {
            return Ok(i != j && test(i, j)?);
        }
        let (here, below) = (&self.levels[level], &self.levels[level - 1]);
        let mut others = [0; WIDTH];
        let mut count = 0;
        for child in children(j, below).filter(|&child| below[child].meets(&here[i])) {
            others[count] = child;
            count += 1;
        }
        for child in children(i, below).filter(|&child| below[child].meets(&here[j])) {
            for &other in &others[..count] {
                let is_met = (i != j || other >= child) && below[child].meets(&below[other]);
                if is_met && self.any_pair_of(level - 1, [child, other], test)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

/// The places of the boxes below one, on their level.
fn children(at: usize, level: &[LooseBox]) -> std::ops::Range<usize> {
    WIDTH * at..(WIDTH * (at + 1)).min(level.len())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use parry3d_f64::math::Vector;

    use super::*;
    use crate::fixtures::spread;

    fn boxes(count: usize, size: f64) -> Vec<LooseBox> {
        let corner = |p: nalgebra::Point3<f64>| Vector::new(p.x, p.y, p.z);
        let at = |p| Aabb::new(corner(p), corner(p) + Vector::splat(size));
        spread([0.0; 3], [1.0 - size; 3], count).map(|p| LooseBox::of(&at(p))).collect()
    }

    #[test]
    fn every_pair_that_meets_is_told_once_and_every_box_that_meets_a_region() {
        for (count, size) in [(0, 0.1), (1, 0.1), (7, 0.9), (9, 0.4), (600, 0.1), (5000, 0.03)] {
            let boxes = boxes(count, size);
            let tree = BoxTree::new(&boxes);
            let mut told = Vec::new();
            for group in 0..tree.groups() {
                let mut tell = |i: u32, j: u32| {
                    told.push((i.min(j), i.max(j)));
                    Ok(false)
                };
                assert_eq!(tree.any_pair(group, &mut tell), Ok(false));
            }
            let pairs: BTreeSet<_> = told.iter().copied().collect();
            assert_eq!(pairs.len(), told.len(), "none is told twice");
            let numbers = 0..count as u32;
            let meet = |i: u32, j: u32| boxes[i as usize].meets(&boxes[j as usize]);
            let met = numbers.clone().flat_map(|i| (i + 1..count as u32).map(move |j| (i, j)));
            assert_eq!(pairs, met.filter(|&(i, j)| meet(i, j)).collect());
            if let Some(region) = boxes.first() {
                let mut found = BTreeSet::new();
                let mut tell = |i: u32| {
                    found.insert(i);
                    Ok(false)
                };
                assert_eq!(tree.any_meeting(region, &mut tell), Ok(false));
                assert_eq!(found, numbers.filter(|&i| meet(0, i)).collect());
                assert_eq!(tree.any_meeting(region, |i| Ok(i == 0)), Ok(true));
            }
        }
    }
}
