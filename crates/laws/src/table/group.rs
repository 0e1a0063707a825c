//! [`Group`]: the rows that have one value in a column.

use super::{Column, Table};

/// The rows that have one value in a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    pub column: String,
    /// The cell as text.
    pub value: String,
}

impl Group {
    /// Whether a row is in it.
    pub(super) fn has(&self, table: &Table, row: usize) -> bool {
        table.column(&self.column).is_some_and(|cells| cell(cells, row) == self.value)
    }
}

/// A cell as text; empty if it is missing.
pub(super) fn cell(column: &Column, row: usize) -> String {
    match column {
        Column::Text(cells) | Column::Written { cells, .. } => cells[row].trim().to_string(),
        Column::Number(cells) if cells[row].is_nan() => String::new(),
        Column::Number(cells) => cells[row].to_string(),
    }
}

/// The values of some rows, each once, without the empty one.
pub(super) fn distinct(column: &Column, rows: &[usize]) -> Vec<String> {
    let mut seen = std::collections::HashSet::new();
    let cells = rows.iter().map(|row| cell(column, *row));
    cells.filter(|cell| !cell.is_empty() && seen.insert(cell.clone())).collect()
}
