//! Turns any table of runs into [`IsoFlopPoint`](crate::laws::IsoFlopPoint)s.
//!
//! `file → Table → quantities → derived quantities → rows kept and rows dropped`
//!
//! | step | function |
//! | --- | --- |
//! | a CSV, TSV or Parquet file into columns | [`read()`] |
//! | `7M`, `1,5e7` and other written numbers | `written` |
//! | `Model Size*1e6`, `loss < 4 and not outlier` | [`Expression::parse`] |
//! | `--columns` into quantities | `columns` |
//! | derived quantities | `derive` |
//! | the groups of a column | [`groups()`] |
//! | doubtful rows | [`OutlierStage::split`] |
//! | all of it | [`load`] |
//!
//! # Example
//!
//! ```
//! use isoflop_laws::table::{self, TableRequest};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("theirs.csv");
//! std::fs::write(&path, "size_m,C,ce\n10,1e17,3.9\n20,1e17,3.7\n40,1e17,3.8\n")?;
//! let columns = Some("params=size_m*1e6,budget_flops=C,loss=ce".to_string());
//! let request = TableRequest { columns, ..TableRequest::default() };
//! let loaded = table::load(&table::read(&path)?, &request)?;
//! // D follows from C = 6ND.
//! assert_eq!(loaded.points[0].tokens, 1e17 / (6.0 * 1e7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod columns;
mod csv;
mod derive;
mod error;
mod expression;
mod outliers;
#[cfg(feature = "parquet")]
mod pages;
#[cfg(feature = "parquet")]
mod parquet;
mod read;
mod rows;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod units;
mod written;

pub use error::{DropStage, ExpressionError, ExpressionProblem, ReadProblem, TableError};
pub use expression::Expression;
pub use outliers::{OutlierStage, Split};
#[cfg(feature = "parquet")]
pub use parquet::parquet_frame;
pub use read::{ReadError, read};
pub use rows::{Dropped, Loaded, TableRequest, groups, load};
pub use written::number;

use std::fmt;
use std::str::FromStr;

// A table as columns of numbers and text.

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

/// The value of a column in an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reads {
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
    fn listed(&self) -> String {
        self.names().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

/// A cell as it is compared with others of its column: the bits of a number, or a text.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Key<'a> {
    Number(u64),
    Text(&'a str),
}

impl Column {
    /// The cell of a row.
    fn key(&self, row: usize) -> Key<'_> {
        match self {
            Self::Number(values) => Key::Number(values[row].to_bits()),
            Self::Text(cells) | Self::Written { cells, .. } => Key::Text(&cells[row]),
        }
    }

    /// The first cell of a text column that is no number, with its 1-based row.
    fn first_text(&self) -> Option<(usize, &str)> {
        let Self::Text(cells) = self else { return None };
        let is_text = |cell: &str| !cell.is_empty() && cell.trim().parse::<f64>().is_err();
        let row = cells.iter().position(|cell| is_text(cell))?;
        Some((row + 1, &cells[row]))
    }

    /// How it stands in an expression.
    fn reads(&self) -> Reads {
        match self {
            Self::Number(_) => Reads::Number,
            Self::Text(_) => Reads::Text,
            Self::Written { .. } => Reads::Either,
        }
    }
}

/// The rows that have one value in a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    pub column: String,
    /// The cell as text.
    pub value: String,
}

impl Group {
    /// Whether a row is in it.
    fn has(&self, table: &Table, row: usize) -> bool {
        table.column(&self.column).is_some_and(|cells| cell(cells, row) == self.value)
    }
}

/// A cell as text; empty if it is missing.
fn cell(column: &Column, row: usize) -> String {
    match column {
        Column::Text(cells) | Column::Written { cells, .. } => cells[row].trim().to_string(),
        Column::Number(cells) if cells[row].is_nan() => String::new(),
        Column::Number(cells) => cells[row].to_string(),
    }
}

/// The values of some rows, each once, without the empty one.
fn distinct(column: &Column, rows: &[usize]) -> Vec<String> {
    let mut seen = std::collections::HashSet::new();
    let cells = rows.iter().map(|row| cell(column, *row));
    cells.filter(|cell| !cell.is_empty() && seen.insert(cell.clone())).collect()
}

// The quantities that a column can stand for.

/// The quantities of columns, by the names of `--columns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// N, where the vocabulary is not told apart.
    Params,
    /// N_nv.
    ParamsNonvocab,
    /// N_v = V·d.
    ParamsVocab,
    /// V.
    NVocab,
    /// d, the model's width.
    DModel,
    /// D, the tokens trained on.
    Tokens,
    /// C as declared: rows are grouped by it.
    BudgetFlops,
    /// The FLOPs of the run, if different from the declared budget.
    Flops,
    /// The loss to fit.
    Loss,
    /// Tells repeats of one configuration apart.
    Seed,
    /// The weight of the row.
    Weight,
    /// Distinct tokens of what the run was trained on.
    UniqueTokens,
    /// The fraction of the data used, 1 for all.
    Share,
    /// The name of the row in messages.
    RunId,
}

impl Quantity {
    /// Every quantity with its name.
    pub const ALL: [(&'static str, Self); 14] = [
        ("params", Self::Params),
        ("params_nonvocab", Self::ParamsNonvocab),
        ("params_vocab", Self::ParamsVocab),
        ("n_vocab", Self::NVocab),
        ("d_model", Self::DModel),
        ("tokens", Self::Tokens),
        ("budget_flops", Self::BudgetFlops),
        ("flops", Self::Flops),
        ("loss", Self::Loss),
        ("seed", Self::Seed),
        ("weight", Self::Weight),
        ("unique_tokens", Self::UniqueTokens),
        ("share", Self::Share),
        ("run_id", Self::RunId),
    ];

    /// The name of `--columns`.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, of)| *of == self).map_or("", |(name, _)| name)
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Quantity {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("quantity", name, &Self::ALL)
    }
}

// The valid name that a wrong one was meant to be.

/// Names less alike than this are no help.
const ALIKE: f64 = 0.7;

/// The most similar of `names`, by Jaro and Winkler and without regard to case.
fn nearest<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let wrong = wrong.to_lowercase();
    names
        .map(|name| (strsim::jaro_winkler(&wrong, &name.to_lowercase()), name))
        .filter(|(alike, _)| *alike > ALIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// "did you mean `loss`? ", or nothing.
fn hint<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> String {
    nearest(wrong, names).map(|name| format!("did you mean `{name}`? ")).unwrap_or_default()
}

/// A name that none has of those that are valid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{name}` is no {kind}; {hint}valid: {valid}")]
pub struct UnknownName {
    kind: &'static str,
    name: String,
    hint: String,
    valid: String,
}

/// The item of a kind with a name.
fn named<T: Copy>(
    kind: &'static str,
    name: &str,
    all: &[(&'static str, T)],
) -> Result<T, UnknownName> {
    let names = || all.iter().map(|(name, _)| *name);
    let found = all.iter().find(|(of, _)| *of == name).map(|(_, value)| *value);
    found.ok_or_else(|| UnknownName {
        kind,
        name: name.to_string(),
        hint: hint(name, names()),
        valid: names().collect::<Vec<_>>().join(", "),
    })
}
