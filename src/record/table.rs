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

use super::cell::{CellKind, CellValue, FactColumn};
use super::facts::{COLUMNS, LOSSES, Measured, Planned};
use super::metrics::Metrics;
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
    let declared: Vec<_> = COLUMNS.par_iter().map(|column| written(column, records)).collect();
    let others = undeclared(records);
    let others = others.iter().map(|name| {
        let values: Vec<_> = records.iter().map(|record| record.metrics.get(name)).collect();
        Column::new((*name).into(), values)
    });
    DataFrame::new(records.len(), declared.into_iter().chain(others).collect())
}

fn written(column: &FactColumn, records: &[RunRecord]) -> Column {
    let cells = records.iter().map(|record| column.of(record));
    let name = column.name.into();
    match column.kind {
        CellKind::Count => Column::new(name, cells.map(CellValue::count).collect::<Vec<_>>()),
        CellKind::Number => Column::new(name, cells.map(CellValue::number).collect::<Vec<_>>()),
        CellKind::Text => Column::new(name, cells.map(CellValue::text).collect::<Vec<_>>()),
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
    let blank = RunRecord::new(Planned::default(), Measured::default(), Metrics::default());
    let mut records = vec![blank; frame.height()];
    for column in COLUMNS {
        match frame.column(column.name) {
            Ok(cells) => read_column(column, cells, &mut records)?,
            Err(_) if column.is_required => {
                polars_bail!(ColumnNotFound: "column {} is missing", column.name)
            }
            Err(_) => {}
        }
    }
    read_metrics(frame, &mut records)?;
    match records.iter().position(|record| !record.metrics.have_a_loss()) {
        None => Ok(records),
        Some(row) => {
            let losses = LOSSES.join(", ");
            polars_bail!(ComputeError: "row {} has none of the losses {losses}", row + 1)
        }
    }
}

/// Takes every column of numbers that nobody declared for a metric.
fn read_metrics(frame: &DataFrame, to: &mut [RunRecord]) -> PolarsResult<()> {
    let others = frame.columns().iter().filter(|column| !is_declared(column.name()));
    for column in others.filter(|column| column.dtype() == &DataType::Float64) {
        for (record, value) in to.iter_mut().zip(column.f64()?.iter()) {
            value.into_iter().for_each(|x| record.metrics.set(column.name().to_string(), x));
        }
    }
    Ok(())
}

fn read_column(column: &FactColumn, cells: &Column, to: &mut [RunRecord]) -> PolarsResult<()> {
    let empty = || polars_err!(ComputeError: "column {} has an empty cell", column.name);
    let fill = |(record, cell): (&mut RunRecord, Option<CellValue>)| {
        let filled = column.fill(record, cell.unwrap_or(CellValue::Null));
        if filled { Ok(()) } else { Err(empty()) }
    };
    let records = to.iter_mut();
    match column.kind {
        CellKind::Count => {
            records.zip(cells.u64()?.iter().map(|x| x.map(CellValue::Count))).try_for_each(fill)
        }
        CellKind::Number => {
            records.zip(cells.f64()?.iter().map(|x| x.map(CellValue::Number))).try_for_each(fill)
        }
        CellKind::Text => {
            records.zip(cells.str()?.iter().map(|x| x.map(CellValue::Text))).try_for_each(fill)
        }
    }
}

#[cfg(test)]
mod tests;
