//! Blocking graphs as pictures: DOT, for Graphviz and the like, and SVG.
//!
//! An arrow points from a part to one that keeps it from going in the direction, so what no arrow leaves from
//! is free to go.

use std::fmt::Write;

use super::layout::{Layout, layout};
use crate::blocking_graph::DirectionalGraph;

/// SVG lengths: a column, a row, a part's box, and the border of a direction's picture with its title.
const COLUMN: f64 = 112.0;
const ROW: f64 = 74.0;
const NODE: [f64; 2] = [96.0, 28.0];
const BORDER: f64 = 24.0;
const TITLE: f64 = 34.0;
/// Longer names are cut; the whole name is in the tooltip.
const MOST_LETTERS: usize = 13;

/// The graphs of one state.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The assembly's name.
    pub name: &'a str,
    /// Names of all parts.
    pub parts: &'a [String],
    /// Parts that are there, ascending.
    pub present: &'a [usize],
    /// One graph per direction.
    pub graphs: &'a [DirectionalGraph],
}

impl Picture<'_> {
    /// As one DOT graph, with a cluster per direction.
    #[must_use]
    pub fn dot(&self) -> String {
        let mut text = format!("digraph {} {{\n  node [shape=box, style=rounded];\n", quoted(self.name));
        for (i, graph) in self.graphs.iter().enumerate() {
            let _ = writeln!(text, "  subgraph cluster_{i} {{\n    label={};", quoted(&self.title(graph)));
            for &part in self.present {
                let _ = writeln!(text, "    d{i}p{part} [label={}];", quoted(&self.parts[part]));
            }
            for [part, by] in &graph.edges {
                let _ = writeln!(text, "    d{i}p{part} -> d{i}p{by};");
            }
            text.push_str("  }\n");
        }
        text.push_str("}\n");
        text
    }

    /// As an SVG image, directions below each other.
    #[must_use]
    pub fn svg(&self) -> String {
        let panels: Vec<(Layout, &DirectionalGraph)> =
            self.graphs.iter().map(|g| (self.arranged(g), g)).collect();
        let width =
            panels.iter().map(|(l, _)| l.columns).max().unwrap_or(0).max(4) as f64 * COLUMN + 2.0 * BORDER;
        let (mut body, mut top) = (String::new(), 0.0);
        for (layout, graph) in &panels {
            let _ = writeln!(body, "<g transform=\"translate({:.1} {top:.1})\">", width / 2.0);
            let _ = writeln!(
                body,
                "<text class=\"title\" x=\"{:.1}\" y=\"24\">{}</text>",
                BORDER - width / 2.0,
                escaped(&self.title(graph))
            );
            self.panel(layout, graph, &mut body);
            body.push_str("</g>\n");
            top += layout.rows as f64 * ROW + TITLE + BORDER;
        }
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{top:.0}\" \
             viewBox=\"0 0 {width:.0} {top:.0}\">\n<title>Blocking graphs of {}</title>\n{STYLE}{body}</svg>\n",
            escaped(self.name)
        )
    }

    fn title(&self, graph: &DirectionalGraph) -> String {
        let blocked = self.present.iter().filter(|p| graph.edges.iter().any(|[part, _]| part == *p)).count();
        format!(
            "{}: {} of {} parts are not blocked",
            graph.direction,
            self.present.len() - blocked,
            self.present.len()
        )
    }

    /// Vertices by their place in `present`.
    fn arranged(&self, graph: &DirectionalGraph) -> Layout {
        let at = |part: usize| self.present.binary_search(&part).ok();
        let edges: Vec<_> = graph.edges.iter().filter_map(|[p, b]| Some([at(*p)?, at(*b)?])).collect();
        layout(self.present.len(), &edges)
    }

    fn panel(&self, layout: &Layout, graph: &DirectionalGraph, body: &mut String) {
        let place = |part: usize| {
            let [x, y] = self.present.binary_search(&part).map_or([0.0; 2], |at| layout.places[at]);
            [x * COLUMN, y * ROW + TITLE + NODE[1]]
        };
        for &[part, by] in &graph.edges {
            let mutual = graph.edges.contains(&[by, part]);
            // One line with two heads is enough.
            if !mutual || part < by {
                body.push_str(&arrow(place(part), place(by), mutual));
            }
        }
        for &part in self.present {
            let is_free = !graph.edges.iter().any(|[p, _]| *p == part);
            body.push_str(&node(place(part), &self.parts[part], is_free));
        }
    }
}

const STYLE: &str = "<defs><marker id=\"head\" viewBox=\"0 0 10 10\" refX=\"9\" refY=\"5\" markerWidth=\"9\" \
markerHeight=\"9\" markerUnits=\"userSpaceOnUse\" orient=\"auto-start-reverse\"><path d=\"M0 0L10 5L0 10z\" fill=\"#556\"/></marker></defs>\n\
<style>svg{background:#fff;font:12px sans-serif}.title{font-size:16px;font-weight:600}\
path.edge{fill:none;stroke:#556;stroke-width:1.2}rect{fill:#eef1f6;stroke:#556}\
.free rect{fill:#d3f0e4;stroke:#00694c;stroke-width:2}g.node text{text-anchor:middle}</style>\n";

fn node([x, y]: [f64; 2], name: &str, is_free: bool) -> String {
    let [w, h] = NODE;
    let class = if is_free { "node free" } else { "node" };
    format!(
        "<g class=\"{class}\"><title>{}</title><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w}\" height=\"{h}\" rx=\"6\"/>\
         <text x=\"{x:.1}\" y=\"{:.1}\">{}</text></g>\n",
        escaped(name),
        x - w / 2.0,
        y - h / 2.0,
        y + 4.0,
        escaped(&shortened(name)),
    )
}

/// From the side of one box to the side of the other; within a row as an arc above.
fn arrow(from: [f64; 2], to: [f64; 2], mutual: bool) -> String {
    let start = if mutual { " marker-start=\"url(#head)\"" } else { "" };
    let half = NODE[1] / 2.0;
    let path = if from[1] == to[1] {
        let y = from[1] - half;
        let rise = 18.0 + 0.06 * (from[0] - to[0]).abs();
        let lift = y - rise;
        format!("M{:.1} {y:.1}C{:.1} {lift:.1} {:.1} {lift:.1} {:.1} {y:.1}", from[0], from[0], to[0], to[0])
    } else {
        let side = if to[1] < from[1] { -half } else { half };
        let (y0, y1) = (from[1] + side, to[1] - side);
        let bend = (y1 - y0) * 0.4;
        format!(
            "M{:.1} {y0:.1}C{:.1} {:.1} {:.1} {:.1} {:.1} {y1:.1}",
            from[0],
            from[0],
            y0 + bend,
            to[0],
            y1 - bend,
            to[0]
        )
    };
    format!("<path class=\"edge\" d=\"{path}\" marker-end=\"url(#head)\"{start}/>\n")
}

fn shortened(name: &str) -> String {
    if name.chars().count() <= MOST_LETTERS {
        return name.to_owned();
    }
    let head: String = name.chars().take(MOST_LETTERS - 1).collect();
    format!("{head}…")
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}

/// Characters that no XML may hold are left out.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => {}
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Action;

    fn with_picture<T>(see: impl FnOnce(&Picture<'_>) -> T) -> T {
        let parts = ["plate", "bolt \"M8\" <1>", "a-name-that-is-too-long"].map(String::from);
        let directions = Action::translations();
        let graphs = [
            DirectionalGraph { direction: directions[4], edges: vec![[0, 1], [0, 2]] },
            DirectionalGraph { direction: directions[0], edges: vec![[0, 1], [1, 0]] },
        ];
        see(&Picture { name: "pair", parts: &parts, present: &[0, 1, 2], graphs: &graphs })
    }

    #[test]
    fn dot_has_a_cluster_per_direction() {
        let dot = with_picture(|p| p.dot());
        assert!(dot.starts_with("digraph \"pair\" {") && dot.ends_with("}\n}\n"), "{dot}");
        for line in [
            "label=\"+z: 2 of 3 parts are not blocked",
            "d0p1 [label=\"bolt \\\"M8\\\" <1>\"]",
            "d0p0 -> d0p1;",
            "d1p1 -> d1p0;",
        ] {
            assert!(dot.contains(line), "{line}\n{dot}");
        }
    }

    #[test]
    fn svg_draws_parts_and_arrows_once() {
        let svg = with_picture(|p| p.svg());
        assert_eq!((svg.matches("<rect").count(), svg.matches("class=\"edge\"").count()), (6, 3));
        assert_eq!(svg.matches("marker-start").count(), 1, "what blocks each other has one line");
        assert_eq!(svg.matches("node free").count(), 2 + 1);
        assert!(svg.contains("bolt &quot;M8&quot; &lt;1&gt;") && svg.contains(">a-name-that-…<"), "{svg}");
        assert_eq!((svg.matches("<g").count(), svg.matches("NaN").count()), (svg.matches("</g>").count(), 0));
    }
}
