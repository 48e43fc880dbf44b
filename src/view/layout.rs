//! Where the vertices of a blocking graph are drawn: in rows, each part below those that block it, so that what
//! is free stands on top.
//!
//! After Sugiyama, Tagawa and Toda 1981: circles are cut by the heuristic of Eades, Lin and Smyth 1993, parts put
//! into layers by longest paths, and sorted within layers by the means of their neighbours' places. Rows that
//! would get too wide are broken. Crossings are few, not fewest; edges may pass behind parts.

use std::collections::BTreeSet;

/// So many parts stand side by side.
const WIDEST: usize = 10;
/// How often all layers are sorted.
const SWEEPS: usize = 8;

/// Places of vertices, in columns to the right and rows down; the middle column is 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// One per vertex.
    pub places: Vec<[f64; 2]>,
    /// The number of rows.
    pub rows: usize,
    /// The number of columns.
    pub columns: usize,
}

/// Arranges a graph of `count` vertices. An edge has first the part that is blocked, then the one that blocks it.
#[must_use]
pub fn layout(count: usize, edges: &[[usize; 2]]) -> Layout {
    let order = cut(count, edges);
    let mut layers = layers(count, edges, &order);
    let neighbours = neighbours(count, edges);
    let mut x = vec![0.0; count];
    spread(&layers, &mut x);
    for _ in 0..SWEEPS {
        for layer in &mut layers {
            let mean = |v: usize| {
                let near = &neighbours[v];
                if near.is_empty() {
                    x[v]
                } else {
                    near.iter().map(|&n| x[n]).sum::<f64>() / near.len() as f64
                }
            };
            let mut keyed: Vec<(f64, usize)> = layer.iter().map(|&v| (mean(v), v)).collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            *layer = keyed.into_iter().map(|(_, v)| v).collect();
            spread(std::slice::from_ref(layer), &mut x);
        }
    }
    placed(count, &layers)
}

/// The vertices in an order in which few edges point back: mostly blockers before what they block.
fn cut(count: usize, edges: &[[usize; 2]]) -> Vec<usize> {
    let mut blockers = vec![BTreeSet::new(); count];
    let mut blocked = vec![BTreeSet::new(); count];
    for &[part, by] in edges {
        blockers[part].insert(by);
        blocked[by].insert(part);
    }
    let mut left: BTreeSet<usize> = (0..count).collect();
    let (mut front, mut back) = (Vec::new(), Vec::new());
    while !left.is_empty() {
        let free = left.iter().copied().find(|&v| blockers[v].is_empty());
        let last = left.iter().copied().find(|&v| blocked[v].is_empty());
        let most = || {
            left.iter()
                .copied()
                .max_by_key(|&v| (blocked[v].len() as isize - blockers[v].len() as isize, usize::MAX - v))
        };
        let Some(v) = free.or(last).or_else(most) else { break };
        if free.is_none() && last.is_some() {
            back.push(v)
        } else {
            front.push(v)
        }
        left.remove(&v);
        for other in std::mem::take(&mut blocked[v]) {
            blockers[other].remove(&v);
        }
        for other in std::mem::take(&mut blockers[v]) {
            blocked[other].remove(&v);
        }
    }
    front.extend(back.into_iter().rev());
    front
}

/// Layers by the longest chain of blockers above, along edges that agree with the order.
fn layers(count: usize, edges: &[[usize; 2]], order: &[usize]) -> Vec<Vec<usize>> {
    let mut rank = vec![0; count];
    order.iter().enumerate().for_each(|(at, &v)| rank[v] = at);
    let mut above = vec![Vec::new(); count];
    for &[part, by] in edges.iter().filter(|[part, by]| rank[*by] < rank[*part]) {
        above[part].push(by);
    }
    let mut layer = vec![0; count];
    let mut layers: Vec<Vec<usize>> = Vec::new();
    for &v in order {
        layer[v] = above[v].iter().map(|&u| layer[u] + 1).max().unwrap_or(0);
        if layers.len() <= layer[v] {
            layers.push(Vec::new());
        }
        layers[layer[v]].push(v);
    }
    layers.iter_mut().for_each(|l| l.sort_unstable());
    layers
}

fn neighbours(count: usize, edges: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); count];
    for &[a, b] in edges {
        neighbours[a].push(b);
        neighbours[b].push(a);
    }
    neighbours
}

/// Side by side about the middle.
fn spread(layers: &[Vec<usize>], x: &mut [f64]) {
    for layer in layers {
        let middle = (layer.len() as f64 - 1.0) / 2.0;
        layer.iter().enumerate().for_each(|(at, &v)| x[v] = at as f64 - middle);
    }
}

fn placed(count: usize, layers: &[Vec<usize>]) -> Layout {
    let mut out = Layout { places: vec![[0.0; 2]; count], rows: 0, columns: 0 };
    for layer in layers {
        let rows = layer.len().div_ceil(WIDEST).max(1);
        for row in layer.chunks(layer.len().div_ceil(rows).max(1)) {
            let middle = (row.len() as f64 - 1.0) / 2.0;
            for (at, &v) in row.iter().enumerate() {
                out.places[v] = [at as f64 - middle, out.rows as f64];
            }
            out.columns = out.columns.max(row.len());
            out.rows += 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blockers_stand_above_what_they_block() {
        // A stack: 0 under 1 under 2 and 3.
        let l = layout(4, &[[0, 1], [1, 2], [1, 3], [0, 3]]);
        let row = |v: usize| l.places[v][1];
        assert_eq!(([row(0), row(1), row(2), row(3)], l.rows, l.columns), ([2.0, 1.0, 0.0, 0.0], 3, 2));
        assert_eq!((l.places[1][0], l.places[2][0] + l.places[3][0]), (0.0, 0.0));
    }

    #[test]
    fn circles_are_cut_and_wide_rows_broken() {
        let ring: Vec<[usize; 2]> = (0..5).map(|v| [v, (v + 1) % 5]).collect();
        assert_eq!(layout(5, &ring).rows, 5, "one edge is cut");
        let star: Vec<[usize; 2]> = (1..=24).map(|v| [0, v]).collect();
        let l = layout(25, &star);
        assert_eq!((l.rows, l.columns), (4, 8));
        let mut taken: Vec<_> = l.places.iter().map(|p| p.map(|x| (x * 2.0) as i32)).collect();
        taken.sort_unstable();
        taken.dedup();
        assert_eq!(taken.len(), 25, "no two stand at one place");
    }
}
