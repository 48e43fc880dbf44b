//! `PROTOCOL.md` has everything that the definitions of this crate say. What stands between its markers is made of them, and
//! compared here; with `SBDP_UPDATE=1` it is written.

mod exchange;
mod layout;
mod messages;
mod numbers;
mod samples;
mod services;
mod source;

use std::path::Path;

use layout::Layouts;
use source::Source;

const BEGIN: &str = "<!-- generated: ";
const END: &str = "<!-- end -->\n";

/// All that is made, by the names in the markers.
fn made() -> Vec<(String, String)> {
    let source = Source::read();
    let layouts = Layouts::new(&source);
    let mut made = numbers::tables(&source);
    made.extend(source.structs.keys().map(|name| (format!("struct {name}"), layouts.table(name))));
    made.extend(messages::all().iter().map(|message| (format!("message {}", message.name), message.table())));
    made.push(("services".to_owned(), services::table()));
    made.extend(exchange::dumps(&layouts));
    made
}

/// The document with what is made between its markers.
fn filled(document: &str, made: &[(String, String)]) -> String {
    let mut missing: Vec<&str> = made.iter().map(|(name, _)| name.as_str()).collect();
    let mut pieces = document.split(BEGIN);
    let mut text = pieces.next().unwrap_or("").to_owned();
    for piece in pieces {
        let (name, rest) = piece.split_once(" -->\n").expect("a marker ends with ` -->`");
        let (_, after) = rest.split_once(END).unwrap_or_else(|| panic!("`{name}` has no `{}`", END.trim()));
        let (_, table) =
            made.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("nothing makes `{name}`"));
        let place = missing.iter().position(|n| *n == name);
        missing.remove(place.unwrap_or_else(|| panic!("`{name}` is there twice")));
        text += &format!("{BEGIN}{name} -->\n{table}{END}{after}");
    }
    assert!(missing.is_empty(), "PROTOCOL.md lacks the markers {missing:?}");
    text
}

#[test]
fn the_document_is_of_the_definitions() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("PROTOCOL.md");
    let document = std::fs::read_to_string(&path).unwrap();
    let expected = filled(&document, &made());
    if std::env::var_os("SBDP_UPDATE").is_some() {
        std::fs::write(&path, expected).unwrap();
        return;
    }
    for (number, (is, should)) in document.lines().zip(expected.lines()).enumerate() {
        assert_eq!(is, should, "PROTOCOL.md:{}: run this test with SBDP_UPDATE=1", number + 1);
    }
    assert_eq!(document, expected, "PROTOCOL.md: run this test with SBDP_UPDATE=1");
}

#[test]
fn what_differs_is_found() {
    let made = [("a".to_owned(), "| 1 |\n".to_owned())];
    let document = "text\n<!-- generated: a -->\n| 2 |\n<!-- end -->\nmore\n";
    assert_eq!(filled(document, &made), document.replace('2', "1"));
}
