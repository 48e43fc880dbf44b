//! Markdown for the reports: tables, and numbers and names as cells show them.

/// A planner as the paper writes it.
pub(super) fn title(planner: &str) -> String {
    super::title(planner).replace('*', "\\*")
}

/// A number with about three digits; thousands as in the paper.
pub(super) fn number(x: f64) -> String {
    match x {
        0.0 => "0".to_owned(),
        x if x < 1.0 => format!("{x:.3}"),
        x if x < 10.0 => format!("{x:.2}"),
        x if x < 100.0 => format!("{x:.1}"),
        x if x < 1000.0 => format!("{x:.0}"),
        x => format!("{:.1}K", x / 1000.0),
    }
}

pub(super) fn optional<T>(value: Option<T>, text: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "–".to_owned(), text)
}

pub(super) fn bold(text: String, yes: bool) -> String {
    if yes { format!("**{text}**") } else { text }
}

/// A name as a cell shows it. Names come from folders: none of their characters may end the cell.
pub(super) fn cell(name: &str) -> String {
    name.replace('|', "\\|").replace('\n', " ")
}

/// A table in Markdown.
pub(super) struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new<S: ToString>(header: &[S]) -> Self {
        Self { header: header.iter().map(S::to_string).collect(), rows: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    pub(super) fn render(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.header.len()));
        let rows: String = self.rows.iter().map(|r| line(r)).collect();
        line(&self.header) + &rule + &rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits_or_so() {
        let shown = [0.0, 0.0123, 1.234, 12.34, 123.4, 1234.0, 12345.0].map(number);
        assert_eq!(shown, ["0", "0.012", "1.23", "12.3", "123", "1.2K", "12.3K"]);
    }

    #[test]
    fn a_name_cannot_break_a_table() {
        let mut table = Table::new(&["a"]);
        table.row([cell("x|y\nz")]);
        assert_eq!(table.render(), "| a |\n|---|\n| x\\|y z |\n");
    }
}
