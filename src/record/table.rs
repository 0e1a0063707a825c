//! `runs.parquet` and `runs.csv`: a row a finished run. Beside the table of scores, the one
//! place that knows polars.
//!
//! The columns are those of [`COLUMNS`], then metrics that nobody declared, by name. A column that is
//! not there reads as null.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::Path;

use polars::prelude::*;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::cell::{CellKind, FactColumn};
use super::facts::{COLUMNS, LOSSES, Planned};
use super::json::flat;
use super::run_record::RunRecord;
use crate::files::atomic::write_whole;

/// Why a table could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct TableError {
    pub path: String,
    pub reason: String,
}

impl TableError {
    pub fn new(path: &Path, reason: impl ToString) -> Self {
        Self { path: path.display().to_string(), reason: reason.to_string() }
    }
}

/// Sorts records as the table has them: by budget, model, vocabulary and seed.
pub fn sort(records: &mut [RunRecord]) {
    let budget = |r: &RunRecord| r.planned.budget_flops;
    records.sort_by(|a, b| budget(a).total_cmp(&budget(b)).then_with(|| key(a).cmp(&key(b))));
}

fn key(r: &RunRecord) -> (usize, Option<usize>, usize, Option<u64>, &str) {
    let planned = &r.planned;
    let Planned { params_nonvocab, d_model, n_vocab, seed, .. } = *planned;
    (params_nonvocab, d_model, n_vocab, seed, &planned.run_id)
}

/// Writes both forms of the table, each whole, by rename.
pub fn write(folder: &Path, records: &[RunRecord]) -> Result<(), TableError> {
    let frame = frame(records).map_err(|error| TableError::new(folder, error))?;
    write_frame(folder, "runs", frame)
}

/// Writes a table as `<name>.parquet` and `<name>.csv`, each whole, by rename.
///
/// # Errors
/// A file cannot be written.
pub fn write_frame(folder: &Path, name: &str, mut frame: DataFrame) -> Result<(), TableError> {
    let [parquet, csv] = ["parquet", "csv"].map(|ending| folder.join(format!("{name}.{ending}")));
    write_whole(&parquet, |file| {
        ParquetWriter::new(file).finish(&mut frame).map_err(std::io::Error::other).map(|_| ())
    })
    .map_err(|error| TableError::new(&parquet, error))?;
    write_whole(&csv, |file| CsvWriter::new(file).finish(&mut frame).map_err(std::io::Error::other))
        .map_err(|error| TableError::new(&csv, error))
}

/// Reads `runs.parquet` of a sweep's folder, or `runs.csv` where that alone was kept.
///
/// # Errors
/// The file is missing or damaged; a column has another type; a row lacks what it is nothing without.
pub fn read(folder: &Path) -> Result<Vec<RunRecord>, TableError> {
    let [parquet, csv] = ["runs.parquet", "runs.csv"].map(|name| folder.join(name));
    let is_csv = !parquet.exists() && csv.exists();
    let path = if is_csv { csv } else { parquet };
    let failed = |error: &dyn std::fmt::Display| TableError::new(&path, error);
    let file = File::open(&path).map_err(|error| failed(&error))?;
    let frame = if is_csv { csv_frame(file) } else { ParquetReader::new(file).finish() };
    frame.and_then(|frame| rows(&frame)).map_err(|error| failed(&error))
}

/// A table of text, with each column turned into what it is declared as; the others into numbers.
fn csv_frame(file: File) -> PolarsResult<DataFrame> {
    let options = CsvReadOptions::default().with_infer_schema_length(Some(0));
    let text = options.into_reader_with_file_handle(file).finish()?;
    let typed = text.columns().iter().map(|column| column.cast(&declared_type(column.name())));
    DataFrame::new(text.height(), typed.collect::<PolarsResult<_>>()?)
}

fn declared_type(name: &str) -> DataType {
    let column = COLUMNS.iter().find(|column| column.name == name);
    match column.map_or(CellKind::Number, |column| column.kind) {
        CellKind::Count => DataType::UInt64,
        CellKind::Number => DataType::Float64,
        CellKind::Text => DataType::String,
    }
}

fn frame(records: &[RunRecord]) -> PolarsResult<DataFrame> {
    let rows: Vec<Vec<Value>> = records.par_iter().map(cells).collect();
    let metric = |name: &str| {
        let values: Vec<_> = records.iter().map(|record| record.metrics.get(name)).collect();
        Column::new(name.into(), values)
    };
    let declared = COLUMNS.par_iter().enumerate().map(|(at, column)| match column.name {
        loss if LOSSES.contains(&loss) => metric(loss),
        _ => written(column, rows.iter().map(|row| &row[at])),
    });
    let mut columns: Vec<Column> = declared.collect();
    columns.extend(undeclared(records).into_iter().map(metric));
    DataFrame::new(records.len(), columns)
}

/// The facts of a record in the order of the columns; null for what it lacks.
fn cells(record: &RunRecord) -> Vec<Value> {
    let (planned, measured) = (json!(record.planned), json!(record.measured));
    let fact = |column: &FactColumn| planned.get(column.name).or(measured.get(column.name));
    COLUMNS.iter().map(|column| fact(column).cloned().unwrap_or_default()).collect()
}

fn written<'a>(column: &FactColumn, cells: impl Iterator<Item = &'a Value>) -> Column {
    let name = column.name.into();
    match column.kind {
        CellKind::Count => Column::new(name, cells.map(Value::as_u64).collect::<Vec<_>>()),
        CellKind::Number => Column::new(name, cells.map(Value::as_f64).collect::<Vec<_>>()),
        CellKind::Text => Column::new(name, cells.map(Value::as_str).collect::<Vec<_>>()),
    }
}

/// Metrics that are no declared columns.
fn undeclared(records: &[RunRecord]) -> BTreeSet<&str> {
    let names = records.iter().flat_map(|record| record.metrics.iter()).map(|(name, _)| name);
    let others: BTreeSet<&str> = names.filter(|name| !LOSSES.contains(name)).collect();
    others.into_iter().filter(|name| !is_declared(name)).collect()
}

fn is_declared(name: &str) -> bool {
    COLUMNS.iter().any(|column| column.name == name)
}

fn rows(frame: &DataFrame) -> PolarsResult<Vec<RunRecord>> {
    let facts = COLUMNS.iter().filter(|column| !LOSSES.contains(&column.name));
    let columns = facts.filter_map(|column| read_column(column, frame).transpose());
    let mut columns = columns.collect::<PolarsResult<Vec<(&str, Vec<Value>)>>>()?;
    let row = |at: usize| {
        let cells = columns.iter_mut().map(|(name, cells)| (name.to_string(), cells[at].take()));
        let facts: Map<String, Value> = cells.collect();
        flat(&facts).map_err(|error| polars_err!(ComputeError: "row {}: {error}", at + 1))
    };
    let mut records = (0..frame.height()).map(row).collect::<PolarsResult<Vec<_>>>()?;
    read_metrics(frame, &mut records)?;
    match records.iter().position(|record| !record.metrics.have_a_loss()) {
        None => Ok(records),
        Some(row) => {
            let losses = LOSSES.join(", ");
            polars_bail!(ComputeError: "row {} has none of the losses {losses}", row + 1)
        }
    }
}

/// The name and the cells of a column; `None` if the table has none and may lack it.
fn read_column<'a>(
    column: &'a FactColumn,
    frame: &DataFrame,
) -> PolarsResult<Option<(&'a str, Vec<Value>)>> {
    let FactColumn { name, kind, is_required } = *column;
    let cells = match frame.column(name) {
        Ok(cells) => cells,
        Err(_) if is_required => polars_bail!(ColumnNotFound: "column {name} is missing"),
        Err(_) => return Ok(None),
    };
    if is_required && cells.null_count() > 0 {
        polars_bail!(ComputeError: "column {name} has an empty cell")
    }
    let cells = match kind {
        CellKind::Count => cells.u64()?.iter().map(Value::from).collect(),
        CellKind::Number => cells.f64()?.iter().map(Value::from).collect(),
        CellKind::Text => cells.str()?.iter().map(Value::from).collect(),
    };
    Ok(Some((name, cells)))
}

/// Takes every loss for a metric, and every column of numbers that nobody declared.
fn read_metrics(frame: &DataFrame, to: &mut [RunRecord]) -> PolarsResult<()> {
    for column in frame.columns() {
        let name = column.name().as_str();
        let is_other = !is_declared(name) && column.dtype() == &DataType::Float64;
        if is_other || LOSSES.contains(&name) {
            for (record, value) in to.iter_mut().zip(column.f64()?.iter()) {
                value.into_iter().for_each(|x| record.metrics.set(name.to_string(), x));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
