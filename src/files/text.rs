//! Text as files have it: with or without a byte-order mark, with any line ends, in any encoding that keeps ASCII.

use std::borrow::Cow;

/// The text of bytes: without a byte-order mark, lines ended by `\n` or `\r\n`. What is not UTF-8 (a name in
/// Latin-1) becomes the replacement character.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = String::from_utf8_lossy(bytes);
    // As written by old Macs, and by programs that follow them.
    if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n").into() } else { text }
}

/// A line for a message: its beginning, with control characters escaped.
pub(super) fn excerpt(line: &str) -> String {
    const LENGTH: usize = 40;
    let trimmed = line.trim();
    let short: String = trimmed.chars().take(LENGTH).collect();
    let more = if short.len() < trimmed.len() { "…" } else { "" };
    format!("{}{more}", printable(&short))
}

/// A name with control characters escaped, as `\u{7}`: no file's content may steer a terminal.
pub(super) fn printable(name: &str) -> String {
    let is_hidden = |c: char| {
        c.is_control()
            || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !name.contains(is_hidden) {
        return name.to_owned();
    }
    let escaped = |c: char| if is_hidden(c) { c.escape_default().to_string() } else { c.to_string() };
    name.chars().map(escaped).collect()
}

/// Why a word is no number, if a comma stands where a point belongs.
pub(super) fn decimal_comma(words: &[&str]) -> Option<&'static str> {
    let is_number = |w: &str| w.parse::<f64>().is_ok();
    let by_comma = |w: &&str| w.contains(',') && !is_number(w) && is_number(&w.replacen(',', ".", 1));
    words.iter().any(by_comma).then_some("its numbers have decimal commas; export with decimal points")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_and_line_ends_do_not_count() {
        for bytes in [&b"a\nb"[..], b"\xef\xbb\xbfa\nb", b"a\rb", b"a\r\nb"] {
            assert_eq!(decoded(bytes).lines().collect::<Vec<_>>(), ["a", "b"]);
        }
        assert_eq!(decoded(b"na\xefve"), "na\u{fffd}ve");
    }

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(printable("bolt\x1b[2J\u{202e}"), "bolt\\u{1b}[2J\\u{202e}");
        assert_eq!(excerpt(&"x".repeat(50)), format!("{}…", "x".repeat(40)));
    }

    #[test]
    fn decimal_commas_are_told_from_other_words() {
        assert!(decimal_comma(&["1,5", "2", "3"]).is_some());
        for words in [["1.5", "2", "3"], ["a,b", "2", "3"], ["1,2,3", "0", "0"]] {
            assert!(decimal_comma(&words).is_none(), "{words:?}");
        }
    }
}
