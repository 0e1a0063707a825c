//! [`FactColumn`]: a column of the table.

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// A whole number from 0.
    Count,
    Number,
    Text,
}

/// A column of the table.
#[derive(Clone, Copy, Debug)]
pub struct FactColumn {
    /// The name in the table and in `record.json`.
    pub name: &'static str,
    pub kind: CellKind,
    /// Whether a row without a value is damaged.
    pub is_required: bool,
}
