//! [`FactColumn`]: a column of the table, and how a record's cell of it is read and filled.

use super::run_record::RunRecord;

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// A whole number from 0.
    Count,
    Number,
    Text,
}

/// One value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellValue<'a> {
    /// The record does not have the value.
    Null,
    Count(u64),
    Number(f64),
    Text(&'a str),
}

impl<'a> CellValue<'a> {
    /// The whole number, if it is one.
    pub fn count(self) -> Option<u64> {
        if let Self::Count(value) = self { Some(value) } else { None }
    }

    /// The number, if it is one; a count is none.
    pub fn number(self) -> Option<f64> {
        if let Self::Number(value) = self { Some(value) } else { None }
    }

    /// The text, if it is one.
    pub fn text(self) -> Option<&'a str> {
        if let Self::Text(value) = self { Some(value) } else { None }
    }
}

/// A column of the table.
#[derive(Clone, Copy, Debug)]
pub struct FactColumn {
    /// The name in the table and in `record.json`.
    pub name: &'static str,
    pub kind: CellKind,
    /// Whether a row without a value is damaged.
    pub is_required: bool,
    pub(super) read: fn(&RunRecord) -> CellValue<'_>,
    pub(super) fill: fn(&mut RunRecord, CellValue<'_>) -> bool,
}

impl FactColumn {
    /// The cell of a record.
    pub fn of<'a>(&self, record: &'a RunRecord) -> CellValue<'a> {
        (self.read)(record)
    }

    /// Gives a record its cell; `false` where a required value is null or of another kind.
    pub(super) fn fill(&self, record: &mut RunRecord, cell: CellValue<'_>) -> bool {
        (self.fill)(record, cell)
    }
}

/// A type that a fact may have. One that is no [`Option`] is required.
pub(super) trait Fact: Sized {
    const KIND: CellKind;
    const IS_REQUIRED: bool = true;

    fn cell(&self) -> CellValue<'_>;

    /// `None`: the cell is no such value.
    fn of(cell: CellValue<'_>) -> Option<Self>;
}

impl Fact for u64 {
    const KIND: CellKind = CellKind::Count;

    fn cell(&self) -> CellValue<'_> {
        CellValue::Count(*self)
    }

    fn of(cell: CellValue<'_>) -> Option<Self> {
        cell.count()
    }
}

impl Fact for usize {
    const KIND: CellKind = CellKind::Count;

    fn cell(&self) -> CellValue<'_> {
        CellValue::Count(*self as u64)
    }

    fn of(cell: CellValue<'_>) -> Option<Self> {
        cell.count().and_then(|count| count.try_into().ok())
    }
}

impl Fact for f64 {
    const KIND: CellKind = CellKind::Number;

    fn cell(&self) -> CellValue<'_> {
        CellValue::Number(*self)
    }

    fn of(cell: CellValue<'_>) -> Option<Self> {
        cell.number()
    }
}

impl Fact for String {
    const KIND: CellKind = CellKind::Text;

    fn cell(&self) -> CellValue<'_> {
        CellValue::Text(self)
    }

    fn of(cell: CellValue<'_>) -> Option<Self> {
        cell.text().map(str::to_string)
    }
}

impl<T: Fact> Fact for Option<T> {
    const KIND: CellKind = T::KIND;
    const IS_REQUIRED: bool = false;

    fn cell(&self) -> CellValue<'_> {
        self.as_ref().map_or(CellValue::Null, T::cell)
    }

    fn of(cell: CellValue<'_>) -> Option<Self> {
        if cell == CellValue::Null { Some(None) } else { T::of(cell).map(Some) }
    }
}

/// Replaces a fact by a cell; `false` where the cell is no value for it.
pub(super) fn fill<T: Fact>(fact: &mut T, cell: CellValue<'_>) -> bool {
    T::of(cell).map(|value| *fact = value).is_some()
}
