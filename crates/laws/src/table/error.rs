//! Errors of files, tables and expressions; reasons for dropped rows.

use serde::Serialize;
use std::fmt;
use std::ops::Range;

use super::{OutlierStage, Quantity, UnknownName};

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

/// The problem of a file.
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

/// Why a row was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DropStage {
    /// A cell that is needed is empty.
    Missing,
    /// It is a copy of an earlier row.
    Copy,
    /// `--drop-highest`.
    DropHighest,
    #[serde(untagged)]
    Outliers(OutlierStage),
}

impl fmt::Display for DropStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

// Errors of expressions.

/// An expression that could not be understood; shown with a caret under the place.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpressionError {
    /// The whole expression.
    pub text: String,
    /// The bytes of `text` at fault.
    pub span: Range<usize>,
    pub problem: ExpressionProblem,
}

/// The problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExpressionProblem {
    #[error("no column is named `{name}`; {hint}columns: {columns}")]
    UnknownColumn { name: String, hint: String, columns: String },

    #[error("no function is named `{name}`; {hint}functions: {functions}")]
    UnknownFunction { name: String, hint: String, functions: String },

    #[error("`{0}` has no meaning here; a name with such a character stands in backticks")]
    UnknownCharacter(char),

    #[error("`{0}` is not a number")]
    BadNumber(String),

    #[error("the quote is never closed")]
    Unclosed,

    #[error("a number, a column or a function is missing here")]
    MissingOperand,

    #[error("an operator is missing before this, such as * in `6*N`")]
    MissingOperator,

    #[error("the parenthesis is never closed")]
    OpenParenthesis,

    #[error("nothing opens what this closes or parts")]
    Stray,

    #[error("comparisons do not chain; write `a < x and x < b`")]
    Chain,

    #[error("`not` binds less than the operator before it; put it in parentheses")]
    LooseNot,

    #[error("{function} takes {expected}, not {found}")]
    Arguments { function: &'static str, expected: &'static str, found: usize },

    #[error("more than {0} levels of parentheses or operators; write it in parts")]
    TooDeep(usize),

    #[error("column `{name}` is text{cell}; a text can only be compared, with == or !=")]
    TextColumn { name: String, cell: String },

    #[error("a text can only be compared, with == or !=, to another text")]
    Text,

    #[error("a text is compared with a number")]
    MixedComparison,

    #[error("the table has no column `{0}` of the type that the expression was read for")]
    OtherTable(String),
}

impl ExpressionError {
    pub fn new(text: &str, span: Range<usize>, problem: ExpressionProblem) -> Self {
        Self { text: text.to_string(), span, problem }
    }
}

impl std::error::Error for ExpressionError {}

impl fmt::Display for ExpressionError {
    /// The problem, the expression on one line, and carets under the place.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let blank = |c: char| if c.is_control() { ' ' } else { c };
        let shown: String = self.text.chars().map(blank).collect();
        let before = self.text[..self.span.start].chars().count();
        let carets = self.text[self.span.clone()].chars().count().max(1);
        writeln!(f, "{}", self.problem)?;
        writeln!(f, "  {shown}")?;
        write!(f, "  {}{}", " ".repeat(before), "^".repeat(carets))
    }
}
