//! Expressions over the columns of a table: `Model Size*1e6`, `loss < 4 and not outlier`.
//!
//! | binds | operators |
//! | --- | --- |
//! | least | `or` `\|\|` |
//! | | `and` `&&` |
//! | | `not` `!` |
//! | | `==` `=` `!=` `<` `<=` `>` `>=`, which do not chain |
//! | | `+` `-` |
//! | | `*` `/` |
//! | | unary `-` |
//! | most | `^`, from the right: 2^3^2 is 2^9 and −2^2 is −4 |
//!
//! Functions are ln, log10, log2, exp, sqrt, abs, round, floor, ceil, min and max; words are `true`
//! and `false`. A column is written as it is named, spaces and dashes included: where a name may
//! stand, the longest name of the table that fits there is taken. In backticks any name may stand.
//! Texts stand in single or double quotes; a quote within is written twice.
//!
//! A comparison is 1 or 0, and every number but 0 is true. What is missing stays missing, through
//! every operator: NaN for a number, and a comparison with an empty cell is NaN.

mod error;
mod eval;
mod lex;
mod parse;
#[cfg(test)]
mod tests;
mod tree;

use super::Table;
pub use error::{ExpressionError, ExpressionProblem};
use eval::Value;
use tree::{Form, Node};

/// An expression whose names and types fit a table.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    root: Node,
}

impl Expression {
    /// Reads an expression over the columns of `table`.
    ///
    /// # Errors
    /// What was not understood, with a caret under it and the nearest valid name.
    pub fn parse(text: &str, table: &Table) -> Result<Self, ExpressionError> {
        let root = lex::tokens(text, table).and_then(|tokens| parse::tree(tokens, text.len()));
        let root = root.map_err(|(span, problem)| {
            ExpressionError::new(text, span, with_cell(problem, table))
        })?;
        Ok(Self { text: text.to_string(), root })
    }

    /// The expression that is the column of a name, whatever the name holds.
    pub(super) fn column(name: &str, table: &Table) -> Option<Self> {
        let reads = table.column(name)?.reads();
        let form = Form::Column { name: name.to_string(), reads };
        let root = Node { form, span: 0..name.len(), depth: 1 };
        Some(Self { text: name.to_string(), root })
    }

    /// What was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The value for each row; NaN where something is missing.
    ///
    /// # Errors
    /// Where the expression is a text, or `table` lacks a column of the table it was read for.
    pub fn numbers(&self, table: &Table) -> Result<Vec<f64>, ExpressionError> {
        match self.value(table)? {
            Value::Numbers(numbers) => Ok(numbers.spread(table.n_rows)),
            Value::Texts(_) => Err(self.error(not_a_number(&self.root, table))),
        }
    }

    /// Whether each row passes: neither 0 nor missing.
    ///
    /// # Errors
    /// As [`Expression::numbers`].
    pub fn mask(&self, table: &Table) -> Result<Vec<bool>, ExpressionError> {
        let passes = |value: &f64| !value.is_nan() && *value != 0.0;
        Ok(self.numbers(table)?.iter().map(passes).collect())
    }

    /// The value for each row as text; empty where it is missing.
    pub(super) fn texts(&self, table: &Table) -> Result<Vec<String>, ExpressionError> {
        if let Form::Column { name, .. } = &self.root.form
            && let Some(super::Column::Written { cells, .. }) = table.column(name)
        {
            return Ok(cells.clone());
        }
        let shown = |x: &f64| if x.is_nan() { String::new() } else { x.to_string() };
        Ok(match self.value(table)? {
            Value::Numbers(numbers) => numbers.spread(table.n_rows).iter().map(shown).collect(),
            Value::Texts(texts) => texts.spread(table.n_rows),
        })
    }

    fn value<'a>(&'a self, table: &'a Table) -> Result<Value<'a>, ExpressionError> {
        eval::value(&self.root, table).map_err(|fault| self.error(fault))
    }

    fn error(&self, (span, problem): tree::Fault) -> ExpressionError {
        ExpressionError::new(&self.text, span, problem)
    }
}

/// Why a text will not do where a number is needed; of a column, its first cell that is none.
fn not_a_number(node: &Node, table: &Table) -> tree::Fault {
    let problem = match &node.form {
        Form::Column { name, .. } => {
            ExpressionProblem::TextColumn { name: name.clone(), cell: String::new() }
        }
        _ => ExpressionProblem::Text,
    };
    (node.span.clone(), with_cell(problem, table))
}

/// The problem of a text column, with its first cell that is no number and why it is none.
fn with_cell(problem: ExpressionProblem, table: &Table) -> ExpressionProblem {
    let ExpressionProblem::TextColumn { name, .. } = problem else { return problem };
    let column = table.column(&name);
    let first = column.and_then(super::Column::first_text);
    let why = match column {
        Some(super::Column::Text(cells)) => super::written::unclear(cells),
        _ => None,
    };
    let why = why.map_or_else(String::new, |why| format!(": {why}"));
    let cell = first.map(|(row, cell)| format!(" (row {row} is `{cell}`{why})"));
    ExpressionProblem::TextColumn { cell: cell.unwrap_or_default(), name }
}
