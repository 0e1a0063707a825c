//! A table as columns of numbers and text.

/// The columns of a file, all of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Names and values in the order of the file; no name comes twice.
    pub columns: Vec<(String, Column)>,
    /// Data rows, the header not counted.
    pub n_rows: usize,
    /// Sentences for a person: columns that were not read.
    pub notes: Vec<String>,
}

/// The cells of one column.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Numbers; booleans are 1 and 0, a missing cell is NaN.
    Number(Vec<f64>),
    /// Text; a missing cell is empty.
    Text(Vec<String>),
    /// Text whose cells are numbers, as `7M` is: a number where one is needed, else the text.
    Written { numbers: Vec<f64>, cells: Vec<String> },
}

/// What a column stands for in an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reads {
    Number,
    Text,
    /// A number, or a text where it is compared with one.
    Either,
}

impl Table {
    /// The column of a name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|(of, _)| of == name).map(|(_, column)| column)
    }

    /// The names of the columns in the file's order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    /// The names in backticks, for a message.
    pub(super) fn listed(&self) -> String {
        self.names().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

/// A cell as it is compared with others of its column: the bits of a number, or a text.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Key<'a> {
    Number(u64),
    Text(&'a str),
}

impl Column {
    /// The cell of a row.
    pub(super) fn key(&self, row: usize) -> Key<'_> {
        match self {
            Self::Number(values) => Key::Number(values[row].to_bits()),
            Self::Text(cells) | Self::Written { cells, .. } => Key::Text(&cells[row]),
        }
    }

    /// The first cell of a text column that is no number, with its 1-based row.
    pub(super) fn first_text(&self) -> Option<(usize, &str)> {
        let Self::Text(cells) = self else { return None };
        let is_text = |cell: &str| !cell.is_empty() && cell.trim().parse::<f64>().is_err();
        let row = cells.iter().position(|cell| is_text(cell))?;
        Some((row + 1, &cells[row]))
    }

    /// How it stands in an expression.
    pub(super) fn reads(&self) -> Reads {
        match self {
            Self::Number(_) => Reads::Number,
            Self::Text(_) => Reads::Text,
            Self::Written { .. } => Reads::Either,
        }
    }
}
