//! A plan as a sheet of instructions: one HTML file with pictures in it, to be read on a screen or on paper.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{Illustration, Instructions, PlanScene};

const STYLE: &str = include_str!("sheet.css");

/// A row of the table of parts: equal parts are one.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Row<'a> {
    names: Vec<&'a str>,
    /// In which instructions they move.
    moved: Vec<String>,
}

/// The sheet. Parts are equal if they are of one class (one per part of the scene).
#[must_use]
pub fn sheet(
    scene: &PlanScene,
    classes: &[usize],
    instructions: &Instructions,
    pictures: &[Illustration],
) -> String {
    let name = if scene.name.is_empty() { "assembly" } else { &scene.name };
    let title = format!("{name} – {}", instructions.title);
    let mut body = format!("<h1>{}</h1>\n", escaped(&title));
    if let Some(verdict) = &instructions.verdict {
        let _ = writeln!(body, "<p class=\"verdict\">{}</p>", escaped(verdict));
    }
    if let Some(before) = &instructions.before {
        let _ = writeln!(body, "<p>{}</p>", escaped(before));
    }
    let of = |instruction: Option<usize>, name: &str| {
        let is_it =
            |p: &&Illustration| p.instruction == instruction && (instruction.is_some() || p.name == name);
        pictures.iter().find(is_it).map(figure).unwrap_or_default()
    };
    body.push_str(&of(None, "overview"));
    body.push_str(&table(&rows(scene, classes, instructions)));
    for (k, instruction) in instructions.list.iter().enumerate() {
        if let Some(heading) = &instruction.heading {
            let _ = writeln!(body, "<h2>{}</h2>", escaped(heading));
        }
        let _ = writeln!(
            body,
            "<section class=\"step\">\n<p><b>{}</b> {}.</p>\n{}</section>",
            instruction.numbers(),
            escaped(&instruction.words),
            of(Some(k), "")
        );
    }
    for sentence in &instructions.rest {
        let _ = writeln!(body, "<p>{}</p>", escaped(sentence));
    }
    let stuck = of(None, "stuck");
    if !instructions.stuck.is_empty() || !stuck.is_empty() {
        let _ = writeln!(body, "<section class=\"stuck\">\n<h2>What is stuck</h2>\n{stuck}<ul>");
        for line in &instructions.stuck {
            let _ = writeln!(body, "<li>{}</li>", escaped(line));
        }
        body.push_str("</ul>\n");
        if let Some(left_out) = &instructions.left_out {
            let _ = writeln!(body, "<p>{}</p>", escaped(left_out));
        }
        body.push_str("</section>\n");
    }
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">\n\
         <title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escaped(&title)
    )
}

fn figure(picture: &Illustration) -> String {
    format!(
        "<img alt=\"{}\" src=\"data:image/png;base64,{}\">\n",
        escaped(&picture.text),
        STANDARD.encode(&picture.png)
    )
}

fn rows<'a>(scene: &'a PlanScene, classes: &[usize], instructions: &Instructions) -> Vec<Row<'a>> {
    let mut rows: Vec<(Option<usize>, Row<'a>)> = Vec::new();
    for (place, part) in scene.parts.iter().enumerate() {
        let class = classes.get(place).copied();
        let moves = |step: &usize| scene.steps[*step].parts.contains(&place);
        let own = instructions.list.iter().filter(|i| i.steps.iter().any(moves)).map(|i| i.numbers());
        let known = rows.iter().position(|(other, _)| class.is_some() && *other == class);
        let at = known.unwrap_or(rows.len());
        if known.is_none() {
            rows.push((class, Row { names: Vec::new(), moved: Vec::new() }));
        }
        let row = &mut rows[at].1;
        row.names.push(&part.name);
        for numbers in own {
            if !row.moved.contains(&numbers) {
                row.moved.push(numbers);
            }
        }
    }
    rows.into_iter().map(|(_, row)| row).collect()
}

fn table(rows: &[Row<'_>]) -> String {
    let mut text =
        "<table>\n<caption>Parts</caption>\n<tr><th>Number</th><th>Parts</th><th>Steps</th></tr>\n"
            .to_owned();
    for Row { names, moved } in rows {
        let moved = if moved.is_empty() { "–".to_owned() } else { moved.join(", ") };
        let _ = writeln!(
            text,
            "<tr><td>{}</td><td>{}</td><td>{moved}</td></tr>",
            names.len(),
            escaped(&names.join(", "))
        );
    }
    text.push_str("</table>\n");
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
