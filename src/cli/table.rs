//! Plain tables for people.

/// Columns of text, each as wide as its widest cell.
#[derive(Debug, Default)]
pub(super) struct TextTable {
    rows: Vec<Vec<String>>,
}

impl TextTable {
    pub(super) fn new(header: &[&str]) -> Self {
        Self { rows: vec![header.iter().map(|&h| h.to_owned()).collect()] }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The rows as lines, two blanks between columns.
    pub(super) fn render(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let length = |cell: &String| cell.chars().count();
        let width = |c: usize| self.rows.iter().filter_map(|r| r.get(c)).map(length).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let mut text = String::new();
        for row in &self.rows {
            let cells: Vec<String> = row.iter().zip(&widths).map(|(c, &w)| format!("{c:<w$}")).collect();
            text.push_str(cells.join("  ").trim_end());
            text.push('\n');
        }
        text
    }
}

/// A few names, and how many there are besides.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    /// Count of names. At half, pairs look like many; at double, the table is wider than most terminals.
    const NAMED: usize = 3;
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.get(..NAMED) {
        Some(few) if names.len() > NAMED => format!("{} and {} more", few.join(", "), names.len() - NAMED),
        _ => names.join(", "),
    }
}

/// Bytes in few digits, in powers of 1024, as the configuration counts them.
pub(super) fn bytes(count: u64) -> String {
    const UNITS: [&str; 4] = ["kB", "MB", "GB", "TB"];
    if count < 1024 {
        return format!("{count} B");
    }
    let (mut value, mut unit) = (count as f64 / 1024.0, UNITS[0]);
    for larger in &UNITS[1..] {
        if value >= 1000.0 {
            (value, unit) = (value / 1024.0, larger);
        }
    }
    if value < 10.0 { format!("{value:.1} {unit}") } else { format!("{value:.0} {unit}") }
}

/// Seconds in few digits, in the unit that suits them.
pub(super) fn duration(seconds: f64) -> String {
    let whole = seconds as u64;
    match seconds {
        s if s < 0.9995e-3 => format!("{:.0} µs", s * 1e6),
        s if s < 9.95e-3 => format!("{:.1} ms", s * 1e3),
        s if s < 0.9995 => format!("{:.0} ms", s * 1e3),
        s if s < 119.5 => format!("{s:.1} s"),
        _ if whole < 7200 => format!("{} min", whole / 60),
        _ if whole < 172_800 => with_rest(format!("{} h", whole / 3600), whole / 60 % 60, "min"),
        _ => with_rest(format!("{} days", whole / 86_400), whole / 3600 % 24, "h"),
    }
}

/// A time with what is left in the next smaller unit.
fn with_rest(time: String, rest: u64, unit: &str) -> String {
    if rest == 0 { time } else { format!("{time} {rest} {unit}") }
}

/// A length in few digits, with its unit if known.
pub(super) fn length(value: f64, units: Option<&str>) -> String {
    let magnitude = value.abs();
    let number = match magnitude {
        _ if magnitude == 0.0 => "0".to_owned(),
        _ if !(1e-3..1e6).contains(&magnitude) => format!("{value:.2e}"),
        _ if magnitude < 1.0 => format!("{value:.4}"),
        _ if magnitude < 100.0 => format!("{value:.2}"),
        _ => format!("{value:.0}"),
    };
    units.map_or(number.clone(), |u| format!("{number} {u}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut table = TextTable::new(&["part", "length"]);
        table.row(["ä".into(), "1".into()]);
        table.row(["housing".into(), String::new()]);
        assert_eq!(table.render(), "part     length\nä        1\nhousing\n");
    }

    #[test]
    fn bytes_and_times_have_the_unit_that_suits_them() {
        let sizes = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1536, "1.5 kB"),
            (10 << 10, "10 kB"),
            (1_048_575, "1.0 MB"),
            (5 << 40, "5.0 TB"),
        ];
        for (count, text) in sizes {
            assert_eq!(bytes(count), text);
        }
        let times = [
            (0.0, "0 µs"),
            (8.9e-5, "89 µs"),
            (2.31e-3, "2.3 ms"),
            (0.1234, "123 ms"),
            (1.26, "1.3 s"),
            (125.0, "2 min"),
            (7200.0, "2 h"),
            (7384.0, "2 h 3 min"),
            (180_000.0, "2 days 2 h"),
        ];
        for (seconds, text) in times {
            assert_eq!(duration(seconds), text);
        }
    }

    #[test]
    fn lengths_are_short() {
        let cases = [
            (0.0, "0"),
            (1e-9, "1.00e-9"),
            (0.012, "0.0120"),
            (12.345, "12.35"),
            (1234.5, "1234"),
            (3e8, "3.00e8"),
        ];
        for (value, text) in cases {
            assert_eq!(length(value, None), text);
        }
        assert_eq!(length(2.0, Some("mm")), "2.00 mm");
    }
}
