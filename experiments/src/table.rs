//! Tables, as CSV for programs and as Markdown for people.

use std::fmt::Write as _;

/// Rows of cells under column heads.
pub(crate) struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows; " | " separates its heads.
    pub(crate) fn new(heads: &str) -> Self {
        Self {
            heads: heads.split(" | ").map(str::to_owned).collect(),
            rows: Vec::new(),
        }
    }

    /// A table with one row for each item.
    pub(crate) fn of<T>(
        heads: &str,
        items: impl IntoIterator<Item = T>,
        row: impl FnMut(T) -> Vec<String>,
    ) -> Self {
        Self {
            rows: items.into_iter().map(row).collect(),
            ..Self::new(heads)
        }
    }

    pub(crate) fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// As RFC 4180 defines it, with line feeds only.
    pub(crate) fn to_csv(&self) -> String {
        let mut text = String::new();
        for row in std::iter::once(&self.heads).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            text.push_str(&cells.join(","));
            text.push('\n');
        }
        text
    }

    /// All columns are aligned to the right.
    pub(crate) fn to_markdown(&self) -> String {
        let mut text = format!("| {} |\n", self.heads.join(" | "));
        let marks = vec!["---:"; self.heads.len()];
        // Writing to a string cannot fail.
        let _ = writeln!(text, "|{}|", marks.join("|"));
        for row in &self.rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
        text
    }
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_with_commas_are_quoted() {
        let mut table = Table::new("name | n");
        table.row(vec!["a, \"b\"".to_owned(), "1".to_owned()]);
        assert_eq!(table.to_csv(), "name,n\n\"a, \"\"b\"\"\",1\n");
        assert_eq!(
            table.to_markdown(),
            "| name | n |\n|---:|---:|\n| a, \"b\" | 1 |\n"
        );
    }
}
