//! `runs.parquet` and `runs.csv`: one row per finished run. Only this file and the table of scores use
//! polars.
//!
//! The columns are those of [`COLUMNS`], then undeclared metrics by name. A missing column reads as null.

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

use polars::io::parquet::write::KeyValueMetadata;
use polars::prelude::*;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::facts::{COLUMNS, CellKind, FactColumn, LOSSES, Planned};
use super::run_record::{RunRecord, flat};
use crate::files::atomic::{write_bytes, write_whole};
use crate::files::{ANY, LARGE, digest, read_regular};
use crate::table::parquet_frame;

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
    write_frame(folder, "runs", frame(records))
}

/// Writes a table as `<name>.parquet` and `<name>.csv`, each whole, by rename.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_frame(
    folder: &Path,
    name: &str,
    frame: PolarsResult<DataFrame>,
) -> Result<(), TableError> {
    let mut frame = frame.map_err(|error| TableError::new(folder, error))?;
    let [parquet, csv] = ["parquet", "csv"].map(|ending| folder.join(format!("{name}.{ending}")));
    let bytes = parquet_bytes(&mut frame).map_err(|error| TableError::new(&parquet, error))?;
    write_bytes(&parquet, &bytes).map_err(|error| TableError::new(&parquet, error))?;
    write_whole(&csv, |file| CsvWriter::new(file).finish(&mut frame).map_err(std::io::Error::other))
        .map_err(|error| TableError::new(&csv, error))
}

/// A table as Parquet, with its digest as a note.
fn parquet_bytes(frame: &mut DataFrame) -> PolarsResult<Vec<u8>> {
    let note = KeyValueMetadata::from_static(vec![("isoflop".into(), digest::field())]);
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).with_key_value_metadata(Some(note)).finish(frame)?;
    Ok(digest::fill(bytes))
}

/// The bytes of a Parquet table.
///
/// # Errors
/// It cannot be read, or has the digest of other bytes.
pub fn checked(path: &Path) -> Result<Vec<u8>, TableError> {
    let bytes = read_regular(path, ANY).map_err(|error| TableError::new(path, error))?;
    match digest::is_wrong(&bytes) {
        true => Err(TableError::new(path, CHANGED)),
        false => Ok(bytes),
    }
}

/// Why a table is refused.
const CHANGED: &str = "its bytes are not those that were written; the CSV beside it has the same rows, and \
                       `isoflop run` writes both again from the records";

/// Reads `runs.parquet` of a sweep's folder, or `runs.csv` if only that was kept.
///
/// # Errors
/// The file is missing or damaged; a column has another type; a row lacks a required value.
pub fn read(folder: &Path) -> Result<Vec<RunRecord>, TableError> {
    let [parquet, csv] = ["runs.parquet", "runs.csv"].map(|name| folder.join(name));
    let is_csv = !parquet.exists() && csv.exists();
    let path = if is_csv { csv } else { parquet };
    let frame = if is_csv {
        csv_frame(read_regular(&path, LARGE).map_err(|error| TableError::new(&path, error))?)
    } else {
        let read = parquet_frame(checked(&path)?).map_err(|error| TableError::new(&path, error))?;
        Ok(read.0)
    };
    frame.and_then(|frame| rows(&frame)).map_err(|error| TableError::new(&path, error))
}

/// Converts a table of text: declared columns to their type, the others to numbers.
fn csv_frame(text: Vec<u8>) -> PolarsResult<DataFrame> {
    let options = CsvReadOptions::default().with_infer_schema_length(Some(0));
    let text = options.into_reader_with_file_handle(Cursor::new(text)).finish()?;
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

/// The facts of a record in the order of the columns; null for missing ones.
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
    let names: BTreeSet<&str> = names.collect();
    names.into_iter().filter(|name| !is_declared(name)).collect()
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
        Some(row) => polars_bail!(
            ComputeError: "row {} has none of the losses {}", row + 1, LOSSES.join(", ")
        ),
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

/// Collects the metrics: every loss, and every undeclared column of numbers.
fn read_metrics(frame: &DataFrame, to: &mut [RunRecord]) -> PolarsResult<()> {
    for column in frame.columns() {
        let name = column.name().as_str();
        let is_other = !is_declared(name) && column.dtype() == &DataType::Float64;
        if is_other || LOSSES.contains(&name) {
            for (row, (record, value)) in to.iter_mut().zip(column.f64()?.iter()).enumerate() {
                let Some(x) = value else { continue };
                polars_ensure!(x.is_finite(), ComputeError: "row {} has {x} for {name}", row + 1);
                record.metrics.set(name.to_string(), x);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};

    use super::*;
    use crate::record::tests::{of_format_1, whole};

    #[test]
    fn a_table_without_an_end_is_refused() {
        for name in ["runs.parquet", "runs.csv"] {
            let place = tempfile::tempdir().unwrap();
            std::os::unix::fs::symlink("/dev/zero", place.path().join(name)).unwrap();
            let told = read(place.path()).unwrap_err().to_string();
            assert!(told.contains(name) && told.contains("no regular file"), "{told}");
        }
    }

    /// A table as another build may have written it.
    fn rewritten(
        records: &[RunRecord],
        change: impl FnOnce(&mut DataFrame),
    ) -> Result<Vec<RunRecord>, String> {
        let place = tempfile::tempdir().unwrap();
        let mut frame = frame(records).unwrap();
        change(&mut frame);
        let file = File::create(place.path().join("runs.parquet")).unwrap();
        ParquetWriter::new(file).finish(&mut frame).unwrap();
        read(place.path()).map_err(|error| error.to_string())
    }

    fn drop_columns(frame: &mut DataFrame, names: &[&str]) {
        *frame = frame.drop_many(names.iter().copied());
    }

    #[test]
    fn a_table_reads_back_equal_with_its_nulls_and_metrics_that_nobody_declared() {
        let mut sparse = of_format_1();
        sparse.measured.wall_s = None;
        sparse.metrics = [("nats_per_second", 1.5)].into_iter().collect();
        let records = [whole(), of_format_1(), sparse];
        let place = tempfile::tempdir().unwrap();
        write(place.path(), &records).unwrap();
        assert_eq!(read(place.path()).unwrap(), records);
        // The CSV stands in for it where it alone was kept.
        fs::remove_file(place.path().join("runs.parquet")).unwrap();
        assert_eq!(read(place.path()).unwrap(), records);
    }

    #[test]
    fn a_table_without_rows_reads_as_none() {
        let place = tempfile::tempdir().unwrap();
        write(place.path(), &[]).unwrap();
        assert_eq!(read(place.path()).unwrap(), []);
    }

    #[test]
    fn a_loss_that_is_not_finite_is_refused_with_its_row() {
        let mut record = whole();
        record.metrics.set("loss_nats", f64::INFINITY);
        let error = rewritten(&[whole(), record], |_| ()).unwrap_err();
        assert!(error.contains("row 2 has inf for loss_nats"), "{error}");
    }

    #[test]
    fn the_columns_are_those_of_format_1_then_the_new_ones_then_other_metrics() {
        let place = tempfile::tempdir().unwrap();
        write(place.path(), &[whole(), of_format_1()]).unwrap();
        let csv = fs::read_to_string(place.path().join("runs.csv")).unwrap();
        let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
        let file = include_str!("../../tests/fixtures/record-format-1.json");
        let mut expected: Vec<&str> =
            file.lines().filter_map(|line| line.split('"').nth(1)).collect();
        assert_eq!((expected[0], expected.len()), ("run_id", 34));
        expected.extend(["generator", "tokenizer_kind", "quantizer", "varied", "share", "fid"]);
        assert_eq!(rows[0], expected);
        assert_eq!(
            rows[1][34..],
            ["autoregressive", "convolutional", "vq", "train.lr=0.001", "0.5", "0.25"]
        );
        assert_eq!(rows[2][34..], [""; 6], "what the older record lacks is empty");
        assert!(rows[2][..34].iter().all(|cell| !cell.is_empty()));
    }

    #[test]
    fn a_missing_column_reads_as_null() {
        let names = ["lr", "device", "peak_bytes", "loss_nats"];
        let read = rewritten(&[whole(), whole()], |frame| drop_columns(frame, &names)).unwrap();
        let mut expected = whole();
        (expected.planned.lr, expected.measured.device, expected.measured.peak_bytes) =
            (None, None, None);
        let others = whole();
        let others = others.metrics.iter().filter(|(name, _)| *name != "loss_nats");
        expected.metrics = others.map(|(name, value)| (name.to_string(), value)).collect();
        assert_eq!(read, [expected.clone(), expected]);
    }

    #[test]
    fn an_unknown_column_of_numbers_is_a_metric_and_any_other_is_passed_over() {
        let add = |frame: &mut DataFrame| {
            frame.with_column(Column::new("diversity".into(), [Some(2.5), None])).unwrap();
            frame.with_column(Column::new("host".into(), ["a", "b"])).unwrap();
            frame.with_column(Column::new("gpus".into(), [1u64, 2])).unwrap();
        };
        let read = rewritten(&[whole(), whole()], add).unwrap();
        let mut measured = whole();
        measured.metrics.set("diversity", 2.5);
        assert_eq!(read, [measured, whole()]);
    }

    #[test]
    fn a_table_without_what_a_row_is_nothing_without_is_refused() {
        let refused =
            |change: fn(&mut DataFrame)| rewritten(&[whole(), whole()], change).unwrap_err();
        let error = refused(|frame| drop_columns(frame, &["tokens"]));
        assert!(error.contains("runs.parquet: ") && error.contains("tokens"), "{error}");
        let error = refused(|frame| {
            frame.with_column(Column::new("n_vocab".into(), [Some(64u64), None])).unwrap();
        });
        assert!(error.contains("column n_vocab has an empty cell"), "{error}");
        let error = refused(|frame| drop_columns(frame, LOSSES));
        assert!(error.contains("row 1 has none of the losses loss_nats, "), "{error}");
    }
}
