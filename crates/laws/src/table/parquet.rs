//! Reads a Parquet file. The one file of this module that knows polars.

use std::io::Cursor;
use std::panic::AssertUnwindSafe;

use polars::prelude::*;

use super::error::ReadProblem;
use super::quiet::quietly;
use super::{Column, Table, pages};

/// A Parquet file can claim any number of rows in a few bytes; a table of runs has fewer.
const MAX_ROWS: usize = 100_000_000;

/// A Parquet file's columns, with a panic of the reader turned into an error.
///
/// Polars trusts a file's metadata and panics where a damaged one breaks that trust; see [`quietly`].
pub(super) fn table(bytes: Vec<u8>) -> Result<Table, ReadProblem> {
    const MAGIC: &[u8] = b"PAR1";
    if bytes.is_empty() {
        return Err(ReadProblem::Empty);
    }
    if !bytes.starts_with(MAGIC) || !bytes.ends_with(MAGIC) {
        let reason = "it does not begin and end with `PAR1`".to_string();
        return Err(ReadProblem::Parquet(reason));
    }
    match quietly(AssertUnwindSafe(|| frame(bytes))) {
        Some(table) => table.map_err(|error| ReadProblem::Parquet(error.to_string())),
        None => Err(ReadProblem::Parquet("its contents contradict each other".to_string())),
    }
}

fn frame(bytes: Vec<u8>) -> PolarsResult<Table> {
    pages::check_footer(&bytes).map_err(|reason| polars_err!(ComputeError: "{reason}"))?;
    let mut reader = ParquetReader::new(Cursor::new(&bytes));
    check_counts(&mut reader, &bytes)?;
    let (mut read, mut notes) = (Vec::new(), Vec::new());
    for (i, field) in reader.schema()?.iter_values().enumerate() {
        if is_readable(field.dtype()) {
            read.push(i);
        } else {
            notes.push(format!(
                "column `{}` is left out: cells of type {:?} are neither numbers nor text",
                field.name,
                field.dtype()
            ));
        }
    }
    let frame = reader.with_projection(Some(read)).finish()?;
    let columns = frame.columns().iter().map(|c| Ok((c.name().to_string(), column(c)?)));
    Ok(Table { columns: columns.collect::<PolarsResult<_>>()?, n_rows: frame.height(), notes })
}

/// Refuses counts in the metadata that no file of this size can hold; see [`pages`].
fn check_counts(reader: &mut ParquetReader<Cursor<&Vec<u8>>>, bytes: &[u8]) -> PolarsResult<()> {
    let damaged = |reason: &'static str| polars_err!(ComputeError: "{reason}");
    let metadata = reader.get_metadata()?;
    let rows = metadata.row_groups.iter().map(|group| group.num_rows());
    let total = rows.fold(0usize, usize::saturating_add);
    if total != metadata.num_rows || total > MAX_ROWS {
        return Err(damaged("the count of rows is wrong, or over a hundred million"));
    }
    for column in metadata.row_groups.iter().flat_map(|group| group.parquet_columns()) {
        let start = usize::try_from(column.byte_range().start).unwrap_or(usize::MAX);
        let pages = bytes.get(start..).ok_or_else(|| damaged("a column starts beyond the end"))?;
        let num_values = column.num_values();
        if !(0..=MAX_ROWS as i64).contains(&num_values) {
            return Err(damaged("the count of a column's values is wrong"));
        }
        pages::check(pages, num_values).map_err(damaged)?;
    }
    Ok(())
}

/// The types that polars reads with the features it is built with.
fn is_readable(dtype: &ArrowDataType) -> bool {
    use ArrowDataType as T;
    let is_text = |t: &T| matches!(t, T::Utf8 | T::LargeUtf8 | T::Utf8View);
    match dtype {
        T::Null | T::Boolean | T::Int32 | T::Int64 | T::UInt32 | T::UInt64 => true,
        T::Float32 | T::Float64 => true,
        T::Dictionary(_, values, _) => is_text(values),
        other => is_text(other),
    }
}

fn column(column: &polars::prelude::Column) -> PolarsResult<Column> {
    if matches!(column.dtype(), DataType::String | DataType::Categorical(..) | DataType::Enum(..)) {
        let cells = column.cast(&DataType::String)?;
        let cells = cells.str()?.iter().map(|cell| cell.unwrap_or_default().to_string());
        return Ok(Column::Text(cells.collect()));
    }
    let cells = column.cast(&DataType::Float64)?;
    let cells = cells.f64()?.iter().map(|cell| cell.unwrap_or(f64::NAN));
    Ok(Column::Number(cells.collect()))
}
