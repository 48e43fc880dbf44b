//! Preferred groups: parts that the request wants to leave as wholes, as the subassemblies of a CAD tree.
//!
//! Only what hangs together is a unit: a group falls into the components of its parts that touch or enclose each other,
//! at first (the screws of a tree's folder are no unit) and whenever some of it has left.
//!
//! As long as anything else leaves, a part of such a group leaves with the group alone; with a base in it, the group
//! stays. Where nothing else leaves, first the members that hold a group may leave by themselves, as the screws of a
//! bearing unit, or those that stand with a base, as its cover; then the rest is a group again. Where that does not help
//! either, a group is given up for good: one with a base, or else the one that the fewest members hold. Groups inside it
//! are preferred then.

use std::cmp::Reverse;
use std::collections::BTreeSet;

/// By part: those that it touches or that enclose it.
pub(super) type Links = [BTreeSet<usize>];

/// The groups that are to leave as wholes, of the parts that stand.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PreferredGroups {
    /// The members of each that stand, ascending; larger groups first, and each once.
    groups: Vec<Vec<usize>>,
    /// Members that may leave by themselves until a part has left.
    loose: Vec<usize>,
}

impl PreferredGroups {
    /// Given groups, each in any order.
    #[must_use]
    pub fn new(groups: &[Vec<usize>]) -> Self {
        let mut groups = groups.to_vec();
        for group in &mut groups {
            group.sort_unstable();
            group.dedup();
        }
        Self { groups: sorted(groups), loose: Vec::new() }
    }

    /// What is left of them, where some parts stand (ascending), as far as it hangs together.
    pub(super) fn retain(&mut self, standing: &[usize], links: &Links) {
        self.loose.clear();
        let stand = |group: Vec<usize>| {
            group.into_iter().filter(|part| standing.binary_search(part).is_ok()).collect::<Vec<_>>()
        };
        let groups = std::mem::take(&mut self.groups).into_iter();
        let components = groups.flat_map(|group| components(&stand(group), links));
        let is_group = |group: &Vec<usize>| (2..standing.len()).contains(&group.len());
        self.groups = sorted(components.filter(is_group).collect());
    }

    /// Whether a part may not leave by itself.
    pub(super) fn keeps(&self, part: usize) -> bool {
        self.around(part).is_some() && !self.loose.contains(&part)
    }

    /// The largest group that a part belongs to.
    pub(super) fn around(&self, part: usize) -> Option<&[usize]> {
        self.groups.iter().find(|group| group.binary_search(&part).is_ok()).map(Vec::as_slice)
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// The groups that lie in no other.
    pub(super) fn outermost(&self) -> impl Iterator<Item = &Vec<usize>> {
        self.groups.iter().filter(|group| self.around(group[0]) == Some(group))
    }

    /// Lets members leave by themselves until a part has left.
    pub(super) fn loosen(&mut self, members: Vec<usize>) {
        self.loose = members;
    }

    /// Gives a group up.
    pub(super) fn give_up(&mut self, group: &[usize]) {
        self.loose.clear();
        self.groups.retain(|other| other != group);
    }
}

/// In the order of the list.
fn sorted(mut groups: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    groups.sort_by_cached_key(|group| (Reverse(group.len()), group.clone()));
    groups.dedup();
    groups
}

/// The parts of a group (ascending) that hang together, each time ascending.
fn components(group: &[usize], links: &Links) -> Vec<Vec<usize>> {
    let mut rest: BTreeSet<usize> = group.iter().copied().collect();
    let mut components = Vec::new();
    while let Some(first) = rest.pop_first() {
        let (mut component, mut open) = (vec![first], vec![first]);
        while let Some(part) = open.pop() {
            let is_linked = |other: &usize| links[part].contains(other) || links[*other].contains(&part);
            let next: Vec<usize> = rest.iter().copied().filter(is_linked).collect();
            rest.retain(|other| !next.contains(other));
            component.extend(&next);
            open.extend(next);
        }
        component.sort_unstable();
        components.push(component);
    }
    components
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each part of a row touches the next.
    fn row(parts: usize) -> Vec<BTreeSet<usize>> {
        (1..=parts).map(|next| BTreeSet::from([next])).collect()
    }

    #[test]
    fn the_largest_group_keeps_its_members_and_then_those_inside_do() {
        let mut preferred = PreferredGroups::new(&[vec![3, 2], vec![4, 1, 3, 2], vec![5], vec![2, 3]]);
        preferred.retain(&[0, 1, 2, 3, 4, 5], &row(6));
        assert_eq!(preferred.outermost().collect::<Vec<_>>(), [&[1, 2, 3, 4]]);
        assert_eq!([0, 1, 2, 5].map(|part| preferred.keeps(part)), [false, true, true, false]);
        preferred.loosen(vec![1]);
        assert_eq!([1, 2].map(|part| preferred.keeps(part)), [false, true]);
        preferred.retain(&[0, 2, 3, 4, 5], &row(6));
        assert_eq!(preferred.outermost().collect::<Vec<_>>(), [&[2, 3, 4]], "what is left of it is a group");
        preferred.give_up(&[2, 3, 4]);
        assert_eq!(preferred.outermost().collect::<Vec<_>>(), [&[2, 3]]);
        assert_eq!((preferred.keeps(4), preferred.around(3)), (false, Some(&[2, 3][..])));
    }

    #[test]
    fn one_part_is_no_group_and_neither_is_everything() {
        let given = PreferredGroups::new(&[vec![0, 1], vec![0, 1, 2]]);
        let left = |standing: &[usize]| {
            let mut left = given.clone();
            left.retain(
                standing,
                &[BTreeSet::from([2]), BTreeSet::from([0]), BTreeSet::new(), BTreeSet::new()],
            );
            left.outermost().cloned().collect::<Vec<_>>()
        };
        assert_eq!(left(&[0, 1, 2]), [vec![0, 1]]);
        assert_eq!(left(&[0, 1, 2, 3]), [vec![0, 1, 2]]);
        assert!(left(&[0, 1]).is_empty());
        assert_eq!(left(&[0, 2, 3]), [vec![0, 2]]);
        assert!(left(&[2, 3]).is_empty());
    }

    #[test]
    fn a_group_falls_into_what_hangs_together() {
        let mut preferred = PreferredGroups::new(&[vec![0, 1, 2, 3, 4, 6]]);
        preferred.retain(&[0, 1, 2, 3, 4, 5, 6, 7], &row(8));
        assert_eq!(preferred.outermost().collect::<Vec<_>>(), [&[0, 1, 2, 3, 4]]);
        preferred.retain(&[0, 1, 3, 4, 5, 6, 7], &row(8));
        assert_eq!(preferred.outermost().collect::<Vec<_>>(), [&[0, 1], &[3, 4]]);
    }
}
