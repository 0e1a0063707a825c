//! The note where rows of several experiments are fitted as one law.

use std::cmp::Reverse;

use super::group::{cell, distinct};
use super::{Column, Table};

/// Words in the name of a column that tells where runs come from, the most telling first.
const TELLING: [&str; 8] =
    ["experiment", "dataset", "data_set", "corpus", "source", "group", "study", "family"];
/// Rows of a value, at least, on average: a column of names has one.
const ROWS_EACH: usize = 3;

/// A note where rows of several experiments are fitted as one law: by the column of most values whose
/// name tells where runs come from. `budgets` are those of the rows, if they were declared; rows that
/// share no budget are not told of.
pub(super) fn mixed(table: &Table, rows: &[usize], budgets: Option<&[f64]>) -> Option<String> {
    let rank = |name: &str| TELLING.iter().position(|word| name.to_lowercase().contains(word));
    let texts = table.columns.iter().filter(|(name, _)| rank(name).is_some());
    let texts = texts.filter(|(_, column)| !matches!(column, Column::Number(_)));
    let counted = texts.map(|(name, column)| (distinct(column, rows).len(), name, column));
    let enough = counted.filter(|(n, ..)| *n > 1 && n * ROWS_EACH <= rows.len());
    let mixes = |column: &Column| budgets.is_none_or(|c| share_a_budget(column, rows, c));
    let mixed: Vec<_> = enough.filter(|(.., column)| mixes(column)).collect();
    let (n, name, _) = mixed.iter().max_by_key(|(n, name, _)| (*n, Reverse(rank(name))))?;
    let is_word = name.chars().all(|c| c.is_alphanumeric() || c == '_');
    let option = if is_word { (*name).clone() } else { format!("'{name}'") };
    Some(format!(
        "column `{name}` has {n} values; their rows are fitted as one law: --by {option} fits each"
    ))
}

/// Whether two rows of one budget differ in the column.
fn share_a_budget(column: &Column, rows: &[usize], budgets: &[f64]) -> bool {
    let mut pairs: Vec<(f64, String)> =
        rows.iter().zip(budgets).map(|(row, budget)| (*budget, cell(column, *row))).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    pairs.windows(2).any(|two| two[0].0 == two[1].0 && two[0].1 != two[1].1)
}
