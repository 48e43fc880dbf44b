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
