//! Reads a Parquet file. The only file of this module that uses polars.

use polars::prelude::*;
use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, PanicHookInfo, UnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::pages::{check_footer, check_pages};
use super::{Column, ReadProblem, Table};

/// A Parquet file can claim any number of rows in a few bytes; a table of runs has fewer.
const MAX_ROWS: usize = 100_000_000;

/// A Parquet file's columns.
pub(super) fn table(bytes: Vec<u8>) -> Result<Table, ReadProblem> {
    let (frame, notes) = parquet_frame(bytes)?;
    let columns = frame.columns().iter().map(|c| Ok((c.name().to_string(), column(c)?)));
    let columns = columns.collect::<PolarsResult<_>>();
    let columns = columns.map_err(|error| ReadProblem::Parquet(error.to_string()))?;
    Ok(Table { columns, n_rows: frame.height(), notes })
}

/// A Parquet file as polars has it, and a sentence for each column that is left out; a panic of the reader is
/// turned into an error.
///
/// # Errors
/// [`ReadProblem`]: it is no such file, or a damaged one.
///
/// Polars trusts a file's metadata and panics where a damaged one breaks that trust.
pub fn parquet_frame(bytes: Vec<u8>) -> Result<(DataFrame, Vec<String>), ReadProblem> {
    const MAGIC: &[u8] = b"PAR1";
    if bytes.is_empty() {
        return Err(ReadProblem::Empty);
    }
    if !bytes.starts_with(MAGIC) || !bytes.ends_with(MAGIC) {
        let reason = "it does not begin and end with `PAR1`".to_string();
        return Err(ReadProblem::Parquet(reason));
    }
    match quietly(AssertUnwindSafe(|| frame(bytes))) {
        Some(frame) => frame.map_err(|error| ReadProblem::Parquet(error.to_string())),
        None => Err(ReadProblem::Parquet("its contents contradict each other".to_string())),
    }
}

fn frame(bytes: Vec<u8>) -> PolarsResult<(DataFrame, Vec<String>)> {
    check_footer(&bytes).map_err(|reason| polars_err!(ComputeError: "{reason}"))?;
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
    if let Some(cut) = frame.columns().iter().find(|column| column.len() != frame.height()) {
        let (name, found, rows) = (cut.name(), cut.len(), frame.height());
        polars_bail!(ComputeError: "column {name} has {found} cells, and the table {rows} rows");
    }
    Ok((frame, notes))
}

/// Refuses counts in the metadata that no file of this size can hold; see [`check_pages`].
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
        check_pages(pages, num_values).map_err(damaged)?;
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

// Catches a panic of the reader silently, and turns it into an error.

thread_local! {
    /// Whether this thread reads.
    static READS: Cell<bool> = const { Cell::new(false) };
}

/// Threads that read.
static READERS: AtomicUsize = AtomicUsize::new(0);

/// The result of `read`; `None` if it panics, without a message.
///
/// The panic hook is global. It silences panics of reading threads, and, while one reads, panics from polars, which has
/// its own threads; it passes on all others.
fn quietly<T>(read: impl FnOnce() -> T + UnwindSafe) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |info| {
            if !is_readers(info) {
                others(info);
            }
        }));
    });
    READS.set(true);
    READERS.fetch_add(1, Ordering::SeqCst);
    let read = catch_unwind(read);
    READERS.fetch_sub(1, Ordering::SeqCst);
    READS.set(false);
    read.ok()
}

fn is_readers(info: &PanicHookInfo) -> bool {
    let in_polars = info.location().is_some_and(|place| place.file().contains("polars"));
    READS.get() || in_polars && READERS.load(Ordering::SeqCst) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none_and_a_value_itself() {
        assert_eq!(quietly(|| 7), Some(7));
        let nothing: Option<u8> = quietly(|| panic!("this is not printed"));
        assert_eq!(nothing, None);
        assert!(!READS.get());
    }
}
