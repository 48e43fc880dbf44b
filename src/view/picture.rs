//! Blocking graphs as pictures: DOT, for Graphviz and the like, and SVG.
//!
//! An arrow points from a part to one that keeps it from going in the direction, so what no arrow leaves from
//! is free to go. DOT has all parts and arrows. SVG is for people: equal parts that are blocked alike are one box, and
//! arrows that follow from others are left out (`quotient.rs`).

use std::fmt::Write;

use super::layout::{Layout, layout};
use super::quotient::{Quotient, quotient};
use super::words::part_word;
use crate::blocking_graph::DirectionalGraph;

/// SVG lengths: a column, a row, a part's box, and the border of a direction's picture with its title.
const COLUMN: f64 = 140.0;
const ROW: f64 = 74.0;
const NODE: [f64; 2] = [124.0, 28.0];
const BORDER: f64 = 24.0;
const TITLE: f64 = 34.0;
/// SVG length: a line of the legend.
const LINE: f64 = 18.0;
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
    /// Of each part, its class: parts of one class are equal.
    pub classes: &'a [usize],
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

    /// One of the graphs as an SVG image.
    #[must_use]
    pub fn svg(&self, graph: &DirectionalGraph) -> String {
        let at = |part: usize| self.present.binary_search(&part).ok();
        let edges: Vec<_> = graph.edges.iter().filter_map(|[p, b]| Some([at(*p)?, at(*b)?])).collect();
        let classes: Vec<usize> = self.present.iter().map(|&part| self.classes[part]).collect();
        let quotient = quotient(&classes, &edges);
        let layout = layout(quotient.groups.len(), &quotient.edges);
        let width = layout.columns.max(4) as f64 * COLUMN + 2.0 * BORDER;
        let lines = legend(&quotient);
        let bottom = layout.rows as f64 * ROW + TITLE + BORDER;
        let height = bottom + lines.len() as f64 * LINE + BORDER / 2.0;
        let mut body = format!("<g transform=\"translate({:.1} 0)\">\n", width / 2.0);
        let _ = writeln!(
            body,
            "<text class=\"title\" x=\"{:.1}\" y=\"24\">{}</text>",
            BORDER - width / 2.0,
            escaped(&self.title(graph))
        );
        self.panel(&layout, &quotient, &mut body);
        for (k, line) in lines.iter().enumerate() {
            let (x, y) = (BORDER - width / 2.0, bottom + (k as f64 + 0.5) * LINE);
            let _ = writeln!(body, "<text class=\"legend\" x=\"{x:.1}\" y=\"{y:.1}\">{line}</text>");
        }
        body.push_str("</g>\n");
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\">\n<title>Blocking graph of {}, {}</title>\n{STYLE}{body}</svg>\n",
            escaped(self.name),
            graph.direction
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

    fn panel(&self, layout: &Layout, quotient: &Quotient, body: &mut String) {
        let place = |group: usize| {
            let [x, y] = layout.places[group];
            [x * COLUMN, y * ROW + TITLE + NODE[1]]
        };
        for &[group, by] in &quotient.edges {
            let mutual = quotient.edges.contains(&[by, group]);
            // One line with two heads is enough.
            if !mutual || group < by {
                body.push_str(&arrow(place(group), place(by), mutual));
            }
        }
        for (k, group) in quotient.groups.iter().enumerate() {
            let names: Vec<&str> = group.iter().map(|&at| self.parts[self.present[at]].as_str()).collect();
            let own = if quotient.holds_itself[k] { " ↺" } else { "" };
            let label = match names[..] {
                [only] => shortened(only),
                _ => format!("{} × {}{own}", names.len(), shortened(&part_word(names[0]))),
            };
            body.push_str(&node(place(k), &label, &names.join(", "), !quotient.is_blocked[k]));
        }
    }
}

/// What the picture means.
fn legend(quotient: &Quotient) -> Vec<String> {
    let mut lines =
        vec!["An arrow points from a part to one that blocks it. Green boxes: not blocked.".to_owned()];
    if quotient.groups.iter().any(|group| group.len() > 1) {
        lines.push(
            "n × name: equal parts that are blocked alike, each by at least one of the box its arrow"
                .to_owned(),
        );
        lines.push(
            "points to (↺: also by one another). Rest the pointer on a box to read all names.".to_owned(),
        );
    }
    if quotient.left_out > 0 {
        let arrows = if quotient.left_out == 1 {
            "1 arrow".to_owned()
        } else {
            format!("{} arrows", quotient.left_out)
        };
        lines.push(format!("Left out: {arrows} to boxes that other arrows lead to by way of further boxes."));
    }
    lines
}

const STYLE: &str = "<defs><marker id=\"head\" viewBox=\"0 0 10 10\" refX=\"9\" refY=\"5\" markerWidth=\"9\" \
markerHeight=\"9\" markerUnits=\"userSpaceOnUse\" orient=\"auto-start-reverse\"><path d=\"M0 0L10 5L0 10z\" fill=\"#556\"/></marker></defs>\n\
<style>svg{background:#fff;font:12px sans-serif}.title{font-size:16px;font-weight:600}.legend{fill:#4a5668}\
path.edge{fill:none;stroke:#556;stroke-width:1.2}rect{fill:#eef1f6;stroke:#556}\
.free rect{fill:#d3f0e4;stroke:#00694c;stroke-width:2}g.node text{text-anchor:middle}</style>\n";

fn node([x, y]: [f64; 2], label: &str, names: &str, is_free: bool) -> String {
    let [w, h] = NODE;
    let class = if is_free { "node free" } else { "node" };
    format!(
        "<g class=\"{class}\"><title>{}</title><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w}\" height=\"{h}\" rx=\"6\"/>\
         <text x=\"{x:.1}\" y=\"{:.1}\">{}</text></g>\n",
        escaped(names),
        x - w / 2.0,
        y - h / 2.0,
        y + 4.0,
        escaped(label),
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
        see(&Picture {
            name: "pair",
            parts: &parts,
            present: &[0, 1, 2],
            classes: &[0, 1, 2],
            graphs: &graphs,
        })
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
        let [up, right] = with_picture(|p| [p.svg(&p.graphs[0]), p.svg(&p.graphs[1])]);
        let count = |svg: &str, what: &str| svg.matches(what).count();
        assert_eq!(
            [&up, &right].map(|svg| (count(svg, "<rect"), count(svg, "class=\"edge\""))),
            [(3, 2), (3, 1)]
        );
        assert_eq!(count(&right, "marker-start"), 1, "what blocks each other has one line");
        assert_eq!([&up, &right].map(|svg| count(svg, "node free")), [2, 1]);
        assert!(up.contains("bolt &quot;M8&quot; &lt;1&gt;") && up.contains(">a-name-that-…<"), "{up}");
        assert_eq!((count(&up, "<g"), count(&up, "NaN")), (count(&up, "</g>"), 0));
    }

    #[test]
    fn equal_parts_are_one_box_and_the_legend_says_so() {
        let parts = ["plate", "bolt-1", "bolt-2", "washer-1", "washer-2"].map(String::from);
        let edges = vec![[0, 1], [0, 2], [0, 3], [0, 4], [3, 1], [4, 2]];
        let graphs = [DirectionalGraph { direction: Action::translations()[4], edges }];
        let picture = Picture {
            name: "plate",
            parts: &parts,
            present: &[0, 1, 2, 3, 4],
            classes: &[0, 1, 1, 3, 3],
            graphs: &graphs,
        };
        let svg = picture.svg(&graphs[0]);
        assert_eq!((svg.matches("<rect").count(), svg.matches("class=\"edge\"").count()), (3, 2));
        for words in
            [">2 × bolt-1<", "<title>washer-1, washer-2</title>", "Left out: 1 arrow ", "blocked alike"]
        {
            assert!(svg.contains(words), "{words}: {svg}");
        }
    }
}
