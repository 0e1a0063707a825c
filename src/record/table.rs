//! `runs.parquet` and `runs.csv`: a row a finished run. The one place that knows polars.

use std::fs::File;
use std::path::Path;

use polars::prelude::*;

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
    fn new(path: &Path, reason: impl ToString) -> Self {
        Self { path: path.display().to_string(), reason: reason.to_string() }
    }
}

/// Sorts records as the table has them: by budget, model, vocabulary and seed.
pub fn sort(records: &mut [RunRecord]) {
    records.sort_by(|a, b| {
        a.budget_flops.total_cmp(&b.budget_flops).then_with(|| key(a).cmp(&key(b)))
    });
}

fn key(r: &RunRecord) -> (usize, usize, usize, u64, &str) {
    (r.params_nonvocab, r.d_model, r.n_vocab, r.seed, &r.run_id)
}

/// Writes both forms of the table, each whole, by rename.
pub fn write(folder: &Path, records: &[RunRecord]) -> Result<(), TableError> {
    let (parquet, csv) = (folder.join("runs.parquet"), folder.join("runs.csv"));
    let mut frame = frame(records).map_err(|error| TableError::new(&parquet, error))?;
    write_whole(&parquet, |file| {
        ParquetWriter::new(file).finish(&mut frame).map_err(std::io::Error::other).map(|_| ())
    })
    .map_err(|error| TableError::new(&parquet, error))?;
    write_whole(&csv, |file| CsvWriter::new(file).finish(&mut frame).map_err(std::io::Error::other))
        .map_err(|error| TableError::new(&csv, error))
}

/// Reads `runs.parquet` of a sweep's folder.
pub fn read(folder: &Path) -> Result<Vec<RunRecord>, TableError> {
    let path = folder.join("runs.parquet");
    let failed = |error: &dyn std::fmt::Display| TableError::new(&path, error);
    let file = File::open(&path).map_err(|error| failed(&error))?;
    let frame = ParquetReader::new(file).finish().map_err(|error| failed(&error))?;
    rows(&frame).map_err(|error| failed(&error))
}

/// Declares each column once, for both directions.
macro_rules! columns {
    ($($name:ident: $kind:ident),* $(,)?) => {
        fn frame(records: &[RunRecord]) -> PolarsResult<DataFrame> {
            DataFrame::new(records.len(), vec![$(
                Column::new(
                    stringify!($name).into(),
                    records.iter().map(|r| to_column!($kind, r.$name)).collect::<Vec<_>>(),
                ),
            )*])
        }

        fn rows(frame: &DataFrame) -> PolarsResult<Vec<RunRecord>> {
            $(let $name = frame.column(stringify!($name))?.as_materialized_series();)*
            $(let $name = series!($kind, $name)?;)*
            (0..frame.height())
                .map(|i| Ok(RunRecord { $($name: from_column!($kind, $name, i)?),* }))
                .collect()
        }
    };
}

macro_rules! to_column {
    (count, $value:expr) => {
        $value as u64
    };
    (number, $value:expr) => {
        $value
    };
    (text, $value:expr) => {
        $value.as_str()
    };
}

macro_rules! series {
    (count, $series:expr) => {
        $series.u64()
    };
    (number, $series:expr) => {
        $series.f64()
    };
    (text, $series:expr) => {
        $series.str()
    };
}

macro_rules! from_column {
    (count, $column:expr, $i:expr) => {
        present($column.get($i), stringify!($column)).map(|x| x as _)
    };
    (number, $column:expr, $i:expr) => {
        present($column.get($i), stringify!($column))
    };
    (text, $column:expr, $i:expr) => {
        present($column.get($i), stringify!($column)).map(str::to_string)
    };
}

fn present<T>(value: Option<T>, column: &str) -> PolarsResult<T> {
    value.ok_or_else(|| polars_err!(ComputeError: "column {column} has an empty cell"))
}

columns! {
    run_id: text,
    seed: count,
    n_layer: count,
    n_head: count,
    d_model: count,
    d_ff: count,
    n_ctx: count,
    n_vocab: count,
    budget_flops: number,
    flops_openai: number,
    flops_6nd: number,
    flops_exact: number,
    params_nonvocab: count,
    params_vocab: count,
    params_text: count,
    params_embedding: count,
    params_head: count,
    tokens: count,
    unique_tokens: count,
    epochs: number,
    steps: count,
    batch_tokens: count,
    lr: number,
    loss_nats: number,
    loss_normalised: number,
    nats_per_frame: number,
    nats_per_second: number,
    zero_count_targets: count,
    wall_s: number,
    tokens_per_s: number,
    peak_bytes: count,
    tokenizer_id: text,
    device: text,
    git_revision: text,
}
