//! Why a file gives no table, and a table no points.

use super::drop_stage::DropStage;
use super::nearest::UnknownName;
use super::{ExpressionError, Quantity};

/// Why a table gives no points; every message says what is wrong, where, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    #[error("--columns: `{0}` is not of the form name=expression")]
    NotAnAssignment(String),

    #[error("--columns: {0}")]
    UnknownQuantity(#[from] UnknownName),

    #[error("--columns gives {0} twice; keep one")]
    Repeated(Quantity),

    #[error("--columns, at {quantity}: {error}")]
    Column { quantity: Quantity, error: ExpressionError },

    #[error(
        "the column named {quantity} is taken for it, but: {error}\n\
         name another with --columns {quantity}=…, or mend the cell"
    )]
    Implicit { quantity: Quantity, error: ExpressionError },

    #[error("--where: {0}")]
    Filter(ExpressionError),

    #[error("--by: no column is named `{name}`; {hint}columns: {columns}")]
    NoColumn { name: String, hint: String, columns: String },

    #[error("--by: column `{0}` is empty in every row, so that there is no group to fit")]
    NoGroups(String),

    #[error("the table has no {what}: name {remedy} with --columns; its columns are {columns}")]
    Missing { what: &'static str, remedy: &'static str, columns: String },

    #[error(
        "run {run_id}: {source_of} is {value}, but it must be {expected}; mend or drop that row"
    )]
    BadValue { run_id: String, source_of: String, value: f64, expected: &'static str },

    #[error("no rows are left: --where {0} passes none of them")]
    NothingPasses(String),

    #[error("no rows are left after {stage}, which dropped the last {count}; {first}")]
    NothingLeft { stage: DropStage, count: usize, first: String },
}

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReadProblem {
    #[error("cannot be read: {0}")]
    Unreadable(String),

    #[error("not a table that can be read: the name must end in .csv, .txt, .tsv or .parquet")]
    Extension,

    #[error("the file is empty; it needs a line of column names and a line for each run")]
    Empty,

    #[error("the table has no rows, only the column names {names}")]
    NoRows { names: String },

    #[error("line {line} is not UTF-8 text; save the table as UTF-8")]
    NotUtf8 { line: usize },

    #[error("line {line} has {found} cell(s), but the header has {expected}; mend that line")]
    Ragged { line: usize, found: usize, expected: usize },

    #[error("the quote that opens on line {line} is never closed")]
    Unclosed { line: usize },

    #[error("line {line} goes on after a closing quote; write a quote within a cell twice")]
    AfterQuote { line: usize },

    #[error("columns {first} and {second} are both named `{name}`; rename one of them")]
    RepeatedName { name: String, first: usize, second: usize },

    #[error("not a Parquet file, or a damaged one: {0}")]
    Parquet(String),
}
