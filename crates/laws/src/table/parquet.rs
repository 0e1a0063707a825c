//! Reads a Parquet file. The only file of this module that uses polars.

use polars::prelude::*;
use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, PanicHookInfo, UnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Refuses counts in the metadata that no file of this size can hold; see the checks below.
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

// The footer of a file and the headers of its columns' pages, checked before polars decodes them.
//
// Polars sizes its buffers by the counts that they give. A damaged count asks for exabytes, and an
// allocation that fails ends the process: no panic that could be caught. So the lists of the footer
// are walked here to their ends, and the counts of the headers are checked against it. Both are structs
// in Thrift's compact protocol; all of their fields are read, but only whole numbers are kept.

/// Structs, lists and maps within each other that a footer may hold.
const MAX_DEPTH: usize = 16;
/// The length of the footer and the mark, at the end of a file.
const TAIL: usize = 8;

/// Checks that the footer of a whole file has the length that it says, so that no list in it holds more
/// than its bytes.
fn check_footer(file: &[u8]) -> Result<(), &'static str> {
    let footer = footer(file).ok_or("the footer goes beyond the file")?;
    let mut reader = Compact { bytes: footer, at: 0 };
    let walked = reader.read_struct(0, &mut |_, _| ());
    match walked.filter(|()| reader.at == footer.len()) {
        Some(()) => Ok(()),
        None => Err("the footer is not readable"),
    }
}

fn footer(file: &[u8]) -> Option<&[u8]> {
    let end = file.len().checked_sub(TAIL)?;
    let length = u32::from_le_bytes(*file[end..].first_chunk()?);
    file.get(end.checked_sub(usize::try_from(length).ok()?)?..end)
}

/// The counts of a page header, by the ids of `parquet.thrift`.
#[derive(Debug, Default, PartialEq)]
struct Header {
    /// `type`: 0 and 3 for data, 2 for a dictionary.
    kind: i64,
    uncompressed_page_size: i64,
    compressed_page_size: i64,
    num_values: i64,
}

/// Checks the pages that begin with `bytes` and hold `num_values` values in all.
fn check_pages(mut bytes: &[u8], num_values: i64) -> Result<(), &'static str> {
    let mut seen = 0;
    while seen < num_values {
        let (header, length) = header(bytes).ok_or("a page header is not readable")?;
        let sizes = [header.uncompressed_page_size, header.compressed_page_size];
        if sizes.iter().any(|size| !(0..=i64::from(i32::MAX)).contains(size)) {
            return Err("a page has an impossible size");
        }
        if !(0..=num_values).contains(&header.num_values) {
            return Err("a page holds more values than its column");
        }
        seen += if matches!(header.kind, 0 | 3) { header.num_values } else { 0 };
        let end = length + header.compressed_page_size as usize;
        bytes = bytes.get(end..).ok_or("a page goes beyond the end of the file")?;
    }
    if seen == num_values { Ok(()) } else { Err("the pages hold more values than their column") }
}

fn header(bytes: &[u8]) -> Option<(Header, usize)> {
    let mut reader = Compact { bytes, at: 0 };
    let mut header = Header::default();
    reader.read_struct(0, &mut |path, value| match path {
        [1] => header.kind = value,
        [2] => header.uncompressed_page_size = value,
        [3] => header.compressed_page_size = value,
        // Of a data page, a dictionary page and a data page of version 2.
        [5 | 7 | 8, 1] => header.num_values = value,
        _ => (),
    })?;
    Some((header, reader.at))
}

/// A reader of Thrift's compact protocol; none at the first byte that does not fit.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Called with the ids of the fields down to a whole number, and the number.
type Seen<'s> = &'s mut dyn FnMut(&[i64], i64);

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        self.at += 1;
        self.bytes.get(self.at - 1).copied()
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(count).ok()?)?;
        (self.at <= self.bytes.len()).then_some(())
    }

    /// Seven bits a byte, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// A signed number: 0, −1, 1, −2, … are 0, 1, 2, 3, …
    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn read_struct(&mut self, depth: usize, seen: Seen) -> Option<()> {
        let mut id = 0i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            let step = i64::from(head >> 4);
            id = if step == 0 { self.zigzag()? } else { id.checked_add(step)? };
            self.value(head & 0x0f, depth, &mut |path, value| {
                seen(&[&[id], path].concat(), value);
            })?;
        }
    }

    fn value(&mut self, kind: u8, depth: usize, seen: Seen) -> Option<()> {
        match kind {
            1 | 2 => Some(()),
            3 => self.skip(1),
            4..=6 => {
                let value = self.zigzag()?;
                seen(&[], value);
                Some(())
            }
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 if depth < MAX_DEPTH => self.list(depth + 1),
            12 if depth < MAX_DEPTH => self.read_struct(depth + 1, seen),
            _ => None,
        }
    }

    /// The elements of a list or set; a boolean takes a byte there.
    fn list(&mut self, depth: usize) -> Option<()> {
        let head = self.byte()?;
        let long = head >> 4 == 15;
        let count = if long { self.varint()? } else { u64::from(head >> 4) };
        for _ in 0..count {
            match head & 0x0f {
                1 | 2 => self.skip(1)?,
                kind => self.value(kind, depth, &mut |_, _| ())?,
            }
        }
        Some(())
    }
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

    /// A data page of 5 values in 3 bytes: type 0, sizes 3 and 3, five.num_values 5.
    const PAGE: [u8; 14] = [0x15, 0, 0x15, 6, 0x15, 6, 0x2c, 0x15, 10, 0, 0, 7, 7, 7];

    #[test]
    fn a_footer_is_as_long_as_its_lists() {
        // Field 2, a list of structs: so many as the first byte of the list says, each of no field.
        let file = |list: &[u8]| {
            let footer = [&[0x29], list, &[0]].concat();
            let length = (footer.len() as u32).to_le_bytes();
            [b"PAR1", &footer[..], &length, b"PAR1"].concat()
        };
        assert_eq!(check_footer(&file(&[0x2c, 0, 0])), Ok(()));
        assert!(check_footer(&file(&[0x3c, 0, 0])).is_err(), "a list of three");
        let billions = [0xfc, 0xff, 0xff, 0xff, 0xff, 0x0f, 0, 0];
        assert_eq!(check_footer(&file(&billions)), Err("the footer is not readable"));
        assert_eq!(check_footer(&file(&[0x2c, 0, 0])[5..]), Err("the footer goes beyond the file"));
        assert!(check_footer(b"PAR1PAR1").is_err());
    }

    #[test]
    fn a_header_is_read_by_its_field_ids() {
        let expected =
            Header { kind: 0, uncompressed_page_size: 3, compressed_page_size: 3, num_values: 5 };
        assert_eq!(header(&PAGE), Some((expected, 11)));
        assert_eq!(header(&PAGE[..10]), None);
    }

    #[test]
    fn pages_hold_what_their_column_says() {
        assert_eq!(check_pages(&PAGE, 5), Ok(()));
        assert_eq!(check_pages(&[PAGE, PAGE].concat(), 10), Ok(()));
        assert!(check_pages(&PAGE, 4).unwrap_err().contains("more values"));
        assert!(check_pages(&PAGE, 6).unwrap_err().contains("not readable"));
        assert!(check_pages(&PAGE[..13], 5).unwrap_err().contains("beyond the end"));
    }

    #[test]
    fn a_negative_count_or_size_is_refused() {
        let with = |at: usize, byte: u8| {
            let mut page = PAGE;
            page[at] = byte;
            check_pages(&page, 5)
        };
        assert!(with(8, 1).unwrap_err().contains("more values"));
        assert!(with(5, 1).unwrap_err().contains("impossible size"));
    }
}
