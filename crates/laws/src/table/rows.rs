//! Turns a table's rows into points for the laws.

use serde::Serialize;
use std::cmp::Reverse;
use std::collections::HashMap;

use super::{
    Column, DropStage, Expression, Group, Key, OutlierStage, Quantity, Split, Table, TableError,
    cell, distinct, hint,
};
use crate::laws::{IsoFlopPoint, Parameters};
use crate::table::columns::{Named, named};
use crate::table::derive::{Derived, derive, source};

/// The request for a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableRequest {
    /// `name=expression,…`; without it the columns named as quantities are taken.
    pub columns: Option<String>,
    /// The one group whose rows count; all rows if none is named.
    pub group: Option<Group>,
    /// Conditions that a row must meet, all of them.
    pub filters: Vec<String>,
    /// Number of rows with the highest loss to drop, after the filters.
    pub drop_highest: usize,
    /// Rows that cannot be trusted, stage by stage.
    pub outliers: Vec<OutlierStage>,
}

/// The points of a table, and the dropped rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// In the table's order.
    pub points: Vec<IsoFlopPoint>,
    pub parameters: Parameters,
    /// Whether budgets were declared; else each row's budget is what it spent, and no two need agree.
    pub budget_declared: bool,
    /// Rows dropped one by one, in the order of the stages; `--where` is only counted, in a note.
    pub dropped: Vec<Dropped>,
    /// Notes: implicit choices, and likely errors.
    pub notes: Vec<String>,
    /// Sentences on rows that are likely wrong; they are notes too.
    pub doubts: Vec<String>,
}

/// A row that is not among the points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dropped {
    pub run_id: String,
    pub stage: DropStage,
    /// The problem of the row.
    pub reason: String,
}

/// Makes points of the rows of `table`: filters, derives, and drops copies, incomplete rows, the highest losses and
/// outliers, in this order.
///
/// # Errors
/// The part of the request that does not fit the table; a row with values that no law can use; the step that left no
/// row.
pub fn load(table: &Table, request: &TableRequest) -> Result<Loaded, TableError> {
    let named = named(request.columns.as_deref(), table)?;
    let mut notes = [&table.notes[..], &named.notes].concat();
    let rows = filtered(table, request, &mut notes)?;
    let named = select(&named, &rows);
    let derived = derive(&named, table)?;
    notes.extend(derived.notes.iter().chain(&derived.doubts).cloned());
    let budgets = derived.budget_declared.then(|| derived.of(Quantity::BudgetFlops));
    notes.extend(mixed(table, &rows, budgets).filter(|_| request.group.is_none()));
    let mut dropped = Vec::new();
    let first = first_alike(table, &rows);
    let rows = (0..rows.len()).collect();
    let reason = |row: usize| {
        let first = &named.run_ids[first[row]?];
        Some(format!("it is {first} again, cell by cell: a copy is no second run"))
    };
    let rows = kept(DropStage::Copy, rows, &named, &mut dropped, reason)?;
    let reason = |row| missing(&named, &derived, row);
    let rows = kept(DropStage::Missing, rows, &named, &mut dropped, reason)?;
    let loss = derived.of(Quantity::Loss);
    let highest = highest(loss, &rows, request.drop_highest);
    let reason = |row| is_highest(loss, &highest, row);
    let rows = kept(DropStage::DropHighest, rows, &named, &mut dropped, reason)?;
    let points = rows.iter().map(|row| derived.checked(*row, &named));
    let mut points = points.collect::<Result<Vec<_>, _>>()?;
    let Derived { parameters, budget_declared, mut doubts, .. } = derived;
    for stage in &request.outliers {
        let split = without_outliers(*stage, points, &mut dropped)?;
        points = split.kept;
        notes.extend(split.doubts.iter().cloned());
        doubts.extend(split.doubts);
    }
    Ok(Loaded { points, parameters, budget_declared, dropped, notes, doubts })
}

/// The rows of the group that pass every filter.
fn filtered(
    table: &Table,
    request: &TableRequest,
    notes: &mut Vec<String>,
) -> Result<Vec<usize>, TableError> {
    let is_in = |row: &usize| request.group.as_ref().is_none_or(|group| group.has(table, *row));
    let mut rows: Vec<usize> = (0..table.n_rows).filter(is_in).collect();
    for filter in &request.filters {
        let expression = Expression::parse(filter, table).map_err(TableError::Filter)?;
        let passes = expression.mask(table).map_err(TableError::Filter)?;
        let before = rows.len();
        rows.retain(|row| passes[*row]);
        notes.push(format!("--where {filter}: {} of {before} rows pass", rows.len()));
        if rows.is_empty() {
            return Err(TableError::NothingPasses(filter.clone()));
        }
    }
    Ok(rows)
}

fn select(named: &Named, rows: &[usize]) -> Named {
    let of = |values: &Vec<f64>| rows.iter().map(|row| values[*row]).collect();
    Named {
        numbers: named.numbers.iter().map(|(quantity, values)| (*quantity, of(values))).collect(),
        run_ids: rows.iter().map(|row| named.run_ids[*row].clone()).collect(),
        sources: named.sources.clone(),
        notes: Vec::new(),
    }
}

/// The rows for which `reason` finds none to drop them.
fn kept(
    stage: DropStage,
    rows: Vec<usize>,
    named: &Named,
    dropped: &mut Vec<Dropped>,
    reason: impl Fn(usize) -> Option<String>,
) -> Result<Vec<usize>, TableError> {
    let before = dropped.len();
    let mut kept = Vec::with_capacity(rows.len());
    for row in rows {
        match reason(row) {
            Some(reason) => {
                dropped.push(Dropped { run_id: named.run_ids[row].clone(), stage, reason });
            }
            None => kept.push(row),
        }
    }
    something_left(stage, kept.is_empty(), &dropped[before..])?;
    Ok(kept)
}

fn something_left(stage: DropStage, nothing: bool, dropped: &[Dropped]) -> Result<(), TableError> {
    if !nothing {
        return Ok(());
    }
    let first = dropped.first().map(|row| format!("{}: {}", row.run_id, row.reason));
    let (count, first) = (dropped.len(), first.unwrap_or_default());
    Err(TableError::NothingLeft { stage, count, first })
}

/// For each row, the first other row with the same cell in every column, if any.
fn first_alike(table: &Table, rows: &[usize]) -> Vec<Option<usize>> {
    let mut seen: HashMap<Vec<Key>, usize> = HashMap::new();
    let cells = |row: usize| table.columns.iter().map(move |(_, column)| column.key(row)).collect();
    let first = |(place, row): (usize, &usize)| {
        let first = *seen.entry(cells(*row)).or_insert(place);
        (first != place).then_some(first)
    };
    rows.iter().enumerate().map(first).collect()
}

fn missing(named: &Named, derived: &Derived, row: usize) -> Option<String> {
    // A row may leave out its share of the data and its distinct tokens.
    let needed = |quantity| !matches!(quantity, Quantity::Share | Quantity::UniqueTokens);
    let (quantity, _) = derived.values(row).find(|(q, value)| needed(*q) && value.is_nan())?;
    let given = named.numbers.iter().find(|(_, values)| values[row].is_nan());
    Some(match given {
        Some((quantity, _)) => format!("{} is missing", source(named, *quantity)),
        None => format!("{} is not a number", source(named, quantity)),
    })
}

/// The `count` rows of the highest loss, ascending; of equal losses the first in the table.
fn highest(loss: &[f64], rows: &[usize], count: usize) -> Vec<usize> {
    let mut by_loss = rows.to_vec();
    by_loss.sort_by(|a, b| loss[*b].total_cmp(&loss[*a]));
    by_loss.truncate(count);
    by_loss.sort_unstable();
    by_loss
}

fn is_highest(loss: &[f64], highest: &[usize], row: usize) -> Option<String> {
    highest.binary_search(&row).ok()?;
    Some(format!("its loss of {} is among the {} highest", loss[row], highest.len()))
}

fn without_outliers(
    stage: OutlierStage,
    points: Vec<IsoFlopPoint>,
    dropped: &mut Vec<Dropped>,
) -> Result<Split, TableError> {
    let mut split = stage.split(points);
    let before = dropped.len();
    dropped.extend(split.dropped.drain(..).map(|(point, reason)| Dropped {
        run_id: point.run_id,
        stage: DropStage::Outliers(stage),
        reason,
    }));
    something_left(DropStage::Outliers(stage), split.kept.is_empty(), &dropped[before..])?;
    Ok(split)
}

// The groups of a column, whose rows are fitted apart.

/// The groups of `column` among the rows that pass the filters, in the table's order. Rows whose
/// cell is empty are in none.
///
/// # Errors
/// [`TableError::NoColumn`] with the nearest name; a filter that does not fit the table.
pub fn groups(
    table: &Table,
    request: &TableRequest,
    column: &str,
) -> Result<Vec<Group>, TableError> {
    let cells = table.column(column).ok_or_else(|| TableError::NoColumn {
        name: column.to_string(),
        hint: hint(column, table.names()),
        columns: table.listed(),
    })?;
    let rows = filtered(table, &TableRequest { group: None, ..request.clone() }, &mut Vec::new())?;
    let values = distinct(cells, &rows);
    if values.is_empty() {
        return Err(TableError::NoGroups(column.to_string()));
    }
    Ok(values.into_iter().map(|value| Group { column: column.to_string(), value }).collect())
}

/// Words in the name of a column of the runs' origin, the most likely first.
const TELLING: [&str; 8] =
    ["experiment", "dataset", "data_set", "corpus", "source", "group", "study", "family"];
/// Rows of a value, at least, on average: a column of names has one.
const ROWS_EACH: usize = 3;

/// A note if rows of several experiments are fitted as one law: by the origin column with the most values. `budgets`
/// are those of the rows, if declared; rows without a common budget give no note.
fn mixed(table: &Table, rows: &[usize], budgets: Option<&[f64]>) -> Option<String> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two experiments of four rows at one budget.
    fn table() -> Table {
        let number = |name: &str, of: fn(usize) -> f64| {
            (name.to_string(), Column::Number((0..8).map(of).collect()))
        };
        let text = |name: &str, of: fn(usize) -> String| {
            (name.to_string(), Column::Text((0..8).map(of).collect()))
        };
        Table {
            columns: vec![
                number("params", |i| 1e6 * 2f64.powi(i as i32 % 4)),
                number("budget_flops", |_| 1e15),
                number("loss", |i| 3.0 + i as f64),
                number("size", |i| (i % 2) as f64),
                text("experiment", |i| ["ours", "theirs"][i / 4].to_string()),
                text("run", |i| format!("run {i}")),
            ],
            n_rows: 8,
            notes: vec![],
        }
    }

    #[test]
    fn rows_of_a_group_alone_are_loaded_under_their_own_numbers() {
        let request = TableRequest { filters: vec!["loss > 3".into()], ..TableRequest::default() };
        let all = groups(&table(), &request, "experiment").unwrap();
        assert_eq!(all.iter().map(|group| &*group.value).collect::<Vec<_>>(), ["ours", "theirs"]);
        let request = TableRequest { group: Some(all[1].clone()), ..request };
        let loaded = load(&table(), &request).unwrap();
        assert_eq!(loaded.points.len(), 4);
        assert_eq!(loaded.points[0].run_id, "row 5");
        let sizes = groups(&table(), &TableRequest::default(), "size").unwrap();
        assert_eq!(sizes.iter().map(|group| &*group.value).collect::<Vec<_>>(), ["0", "1"]);
    }

    #[test]
    fn a_column_that_is_not_there_is_told_with_the_nearest() {
        let error = groups(&table(), &TableRequest::default(), "experimnet").unwrap_err();
        assert!(error.to_string().contains("did you mean `experiment`?"), "{error}");
    }

    #[test]
    fn experiments_that_share_a_budget_are_told_and_fitted_apart_they_are_not() {
        let notes = |request: &TableRequest| load(&table(), request).unwrap().notes.join("\n");
        let all = notes(&TableRequest::default());
        assert!(
            all.contains("`experiment` has 2 values") && all.contains("--by experiment fits each")
        );
        let one = Group { column: "experiment".into(), value: "ours".into() };
        let one = notes(&TableRequest { group: Some(one), ..TableRequest::default() });
        assert!(!one.contains("--by"), "{one}");
        let columns = Some("budget_flops=10^(15+size)".to_string());
        let mut apart = table();
        apart.columns[3].1 = Column::Number((0..8).map(|i| (i / 4) as f64).collect());
        let notes =
            load(&apart, &TableRequest { columns, ..TableRequest::default() }).unwrap().notes;
        assert!(!notes.join("\n").contains("--by"), "{notes:?}");
    }
}
