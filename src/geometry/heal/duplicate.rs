//! Triangles given more than once.

use std::collections::HashMap;

use super::{Draft, Findings};
use crate::geometry::incidence::open_edges;

/// Drops repetitions of triangles. Two that face each other are either one triangle given
/// with both orientations, or the wall between two bodies that touch: what leaves fewer edges
/// open decides.
pub(super) fn drop_repeated(draft: &mut Draft, findings: &mut Findings) {
    if !any_repeated(&draft.triangles) {
        return;
    }
    let groups = groups(&draft.triangles);
    let before = draft.triangles.len();
    let keep = |walls: bool| -> Vec<[u32; 3]> {
        let mut kept: Vec<usize> = groups.values().filter_map(|g| g.survivor(walls)).collect();
        kept.sort_unstable();
        kept.into_iter().map(|i| draft.triangles[i]).collect()
    };
    let (with, without) = (keep(true), keep(false));
    let annihilate = !without.is_empty() && open_edges(&without) <= open_edges(&with);
    draft.triangles = if annihilate { without } else { with };
    findings.add(before - draft.triangles.len(), "duplicate triangle", "dropped");
}

/// Occurrences of one triangle, by direction of travel.
#[derive(Default)]
struct EqualTriangles {
    forwards: Vec<usize>,
    backwards: Vec<usize>,
}

impl EqualTriangles {
    /// The occurrence that stays.
    fn survivor(&self, walls: bool) -> Option<usize> {
        let balanced = self.forwards.len() == self.backwards.len();
        if balanced && !walls {
            return None;
        }
        let majority =
            if self.forwards.len() >= self.backwards.len() { &self.forwards } else { &self.backwards };
        majority.first().copied()
    }
}

/// Whether any two triangles have the same corners.
fn any_repeated(triangles: &[[u32; 3]]) -> bool {
    let sorted = |t: &[u32; 3]| {
        let mut corners = *t;
        corners.sort_unstable();
        corners
    };
    let mut corners: Vec<[u32; 3]> = triangles.iter().map(sorted).collect();
    corners.sort_unstable();
    corners.windows(2).any(|pair| pair[0] == pair[1])
}

fn groups(triangles: &[[u32; 3]]) -> HashMap<[u32; 3], EqualTriangles> {
    let mut groups: HashMap<[u32; 3], EqualTriangles> = HashMap::with_capacity(triangles.len());
    for (index, &[a, b, c]) in triangles.iter().enumerate() {
        let [x, y, z] = match a.min(b).min(c) {
            least if least == a => [a, b, c],
            least if least == b => [b, c, a],
            _ => [c, a, b],
        };
        let group = groups.entry([x, y.min(z), y.max(z)]).or_default();
        if y < z { group.forwards.push(index) } else { group.backwards.push(index) }
    }
    groups
}
