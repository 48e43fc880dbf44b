//! Triangles given more than once.

use std::collections::HashMap;

use super::{Draft, Findings};
use crate::geometry::incidence::Sides;

/// Drops repetitions of triangles; the sides of those that are left. Two that face each other are either one triangle
/// given with both orientations, or the wall between two bodies that touch: what leaves fewer edges open decides.
pub(super) fn drop_repeated(draft: &mut Draft, findings: &mut Findings) -> Sides {
    let sides = Sides::of(&draft.triangles);
    if !any_repeated(&draft.triangles, &sides) {
        return sides;
    }
    let groups = groups(&draft.triangles);
    let before = draft.triangles.len();
    let keep = |walls: bool| -> Vec<[u32; 3]> {
        let mut kept: Vec<usize> = groups.values().filter_map(|g| g.survivor(walls)).collect();
        kept.sort_unstable();
        kept.into_iter().map(|i| draft.triangles[i]).collect()
    };
    let (with, without) = (keep(true), keep(false));
    let (sides_with, sides_without) = (Sides::of(&with), Sides::of(&without));
    let annihilate = !without.is_empty() && sides_without.open_edges() <= sides_with.open_edges();
    let sides;
    (draft.triangles, sides) = if annihilate { (without, sides_without) } else { (with, sides_with) };
    findings.add(before - draft.triangles.len(), "duplicate triangle", "dropped");
    sides
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

/// Whether any two triangles have the same corners: they have their edges in common, too.
fn any_repeated(triangles: &[[u32; 3]], sides: &Sides) -> bool {
    let mut apexes = Vec::new();
    sides.iter().filter(|(_, at_edge)| at_edge.len() > 1).any(|([low, high], at_edge)| {
        apexes.clear();
        let apex = |t: [u32; 3]| t[0] ^ t[1] ^ t[2] ^ low ^ high;
        apexes.extend(at_edge.iter().map(|side| apex(triangles[side.triangle() as usize])));
        apexes.sort_unstable();
        apexes.windows(2).any(|pair| pair[0] == pair[1])
    })
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
