//! Reads a file into a [`Table`].

use std::path::Path;

use super::{ReadProblem, Table, csv, written};

/// Why a file gives no table.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct ReadError {
    pub path: String,
    pub problem: ReadProblem,
}

/// Reads a table; the extension (`.csv`, `.txt`, `.tsv`, `.parquet`) sets the format.
///
/// # Errors
/// The path, and the problem with its line. A table without rows is an error.
pub fn read(path: &Path) -> Result<Table, ReadError> {
    contents(path)
        .and_then(checked)
        .map(written::read)
        .map_err(|problem| ReadError { path: path.display().to_string(), problem })
}

fn contents(path: &Path) -> Result<Table, ReadProblem> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    // A device or a pipe may have no end.
    let is_endless = std::fs::metadata(path).is_ok_and(|about| !about.is_file() && !about.is_dir());
    if is_endless {
        let problem = "it is a device or a pipe, and no regular file".to_string();
        return Err(ReadProblem::Unreadable(problem));
    }
    let bytes = || std::fs::read(path).map_err(|e| ReadProblem::Unreadable(e.to_string()));
    match extension.to_str() {
        Some("csv" | "txt") => {
            let bytes = bytes()?;
            let text = utf8(&bytes)?;
            let separator = csv::separator(text);
            let mut table = csv::table(text, separator)?;
            table.notes.extend(csv::note(separator));
            Ok(table)
        }
        Some("tsv") => csv::table(utf8(&bytes()?)?, b'\t'),
        #[cfg(feature = "parquet")]
        Some("parquet") => super::parquet::table(bytes()?),
        #[cfg(not(feature = "parquet"))]
        Some("parquet") => Err(ReadProblem::Unreadable(NO_PARQUET.to_string())),
        _ => Err(ReadProblem::Extension),
    }
}

#[cfg(not(feature = "parquet"))]
const NO_PARQUET: &str = "this build has no feature `parquet`; save the table as CSV";

fn utf8(bytes: &[u8]) -> Result<&str, ReadProblem> {
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        ReadProblem::NotUtf8 { line: 1 + before.iter().filter(|b| **b == b'\n').count() }
    })
}

fn checked(table: Table) -> Result<Table, ReadProblem> {
    let mut places = std::collections::HashMap::new();
    for (i, name) in table.names().enumerate() {
        if let Some(first) = places.insert(name, i + 1) {
            return Err(ReadProblem::RepeatedName { name: name.into(), first, second: i + 1 });
        }
    }
    if table.n_rows == 0 {
        return Err(ReadProblem::NoRows { names: table.listed() });
    }
    Ok(table)
}

#[cfg(feature = "parquet")]
#[cfg(test)]
mod tests {
    use super::*;
    use polars::prelude::*;
    use proptest::prelude::*;
    use std::io::{Cursor, Write};

    use crate::table::Column;

    fn read_bytes(extension: &str, bytes: &[u8]) -> Result<Table, ReadError> {
        let mut file =
            tempfile::Builder::new().suffix(extension).tempfile().expect("a private file");
        file.write_all(bytes).expect("room on the disk");
        read(file.path())
    }

    fn refused(extension: &str, bytes: &[u8]) -> String {
        let error = read_bytes(extension, bytes).unwrap_err();
        assert!(error.path.ends_with(extension));
        error.problem.to_string()
    }

    /// A Parquet file of numbers, booleans and text with missing cells.
    fn parquet_bytes(rows: usize, compression: ParquetCompression) -> Vec<u8> {
        let even = |i: usize| i.is_multiple_of(2);
        let series = [
            Series::new(
                "loss".into(),
                (0..rows).map(|i| even(i).then_some(i as f64)).collect::<Vec<_>>(),
            ),
            Series::new("n".into(), (0..rows).map(|i| i as i64).collect::<Vec<_>>()),
            Series::new("ok".into(), (0..rows).map(even).collect::<Vec<_>>()),
            Series::new(
                "name".into(),
                (0..rows).map(|i| even(i).then(|| format!("r{}", i % 7))).collect::<Vec<_>>(),
            ),
        ];
        let columns = series.into_iter().map(Into::into).collect();
        let mut frame = DataFrame::new(rows, columns).unwrap();
        let mut bytes = Vec::new();
        ParquetWriter::new(&mut bytes).with_compression(compression).finish(&mut frame).unwrap();
        bytes
    }

    #[test]
    fn a_parquet_file_gives_numbers_and_text_with_what_is_missing() {
        let table = read_bytes(".parquet", &parquet_bytes(3, ParquetCompression::Snappy)).unwrap();
        let columns: Vec<_> =
            table.columns.iter().map(|(_, column)| format!("{column:?}")).collect();
        let expected = [
            "Number([0.0, NaN, 2.0])",
            "Number([0.0, 1.0, 2.0])",
            "Number([1.0, 0.0, 1.0])",
            "Text([\"r0\", \"\", \"r2\"])",
        ];
        assert_eq!(columns, expected);
        assert_eq!(table.names().collect::<Vec<_>>(), ["loss", "n", "ok", "name"]);
    }

    #[test]
    fn a_column_that_is_neither_number_nor_text_is_left_out_and_named() {
        let lists = Series::new("list".into(), [Series::new("".into(), [1i64, 2])]);
        let number = Series::new("x".into(), [1.5f64]);
        let mut frame = DataFrame::new(1, vec![lists.into(), number.into()]).unwrap();
        let mut bytes = Vec::new();
        ParquetWriter::new(&mut bytes).finish(&mut frame).unwrap();
        let table = read_bytes(".parquet", &bytes).unwrap();
        assert_eq!(table.names().collect::<Vec<_>>(), ["x"]);
        assert!(table.notes[0].contains("`list` is left out"), "{:?}", table.notes);
    }

    #[test]
    fn a_file_that_is_no_table_is_refused_with_its_path() {
        assert!(refused(".xlsx", b"x").contains(".csv, .txt, .tsv or .parquet"));
        for extension in [".csv", ".tsv", ".parquet"] {
            assert!(refused(extension, b"").contains("empty"));
        }
        assert!(refused(".csv", b"a,b\n").contains("no rows, only the column names `a`, `b`"));
        assert!(refused(".csv", b"a,b,a\n1,2,3\n").contains("columns 1 and 3 are both named `a`"));
        assert!(refused(".csv", b"a\nx\n\xff\n").contains("line 3 is not UTF-8"));
        assert!(refused(".csv", b"a,b\n1,2\n3\n").contains("line 3 has 1 cell(s)"));
        assert!(refused(".csv", b"a,b\n\"1,2\n").contains("line 2 is never closed"));
        assert!(refused(".parquet", b"PAR1 nothing PAR1").contains("damaged"));
        let error = read(Path::new("/nowhere/runs.csv")).unwrap_err().to_string();
        assert!(error.starts_with("/nowhere/runs.csv: cannot be read"), "{error}");
    }

    #[test]
    fn a_truncated_parquet_file_is_refused() {
        let bytes = parquet_bytes(100, ParquetCompression::Uncompressed);
        assert!(refused(".parquet", &bytes[..bytes.len() / 2]).contains("damaged"));
    }

    /// A cell as a person or a program may write it, and what it holds.
    fn cell() -> impl Strategy<Value = (String, String)> {
        let plain = "[a-z .#;'-]{1,6}".prop_map(|text| (text.clone(), text));
        let quoted = "[a-z,\n\r\" ]{0,8}"
            .prop_map(|text| (format!("\"{}\"", text.replace('"', "\"\"")), text));
        prop_oneof![plain, quoted]
    }

    fn grid() -> impl Strategy<Value = Vec<Vec<(String, String)>>> {
        (1..5usize, 1..6usize)
            .prop_flat_map(|(n, m)| prop::collection::vec(prop::collection::vec(cell(), n), m))
    }

    /// The grid under a header, with a column `key` that no type can be found for but text.
    fn written(grid: &[Vec<(String, String)>], end: &str) -> String {
        let header = (0..grid[0].len()).map(|i| format!("c{i},")).collect::<String>() + "key";
        let row = |row: &Vec<(String, String)>| {
            row.iter().map(|(cell, _)| format!("{cell},")).collect::<String>()
        };
        let rows = grid.iter().map(|of| row(of) + "key");
        std::iter::once(header).chain(rows).map(|line: String| line + end).collect()
    }

    fn as_text(column: &Column) -> Vec<String> {
        match column {
            Column::Text(cells) | Column::Written { cells, .. } => cells.clone(),
            Column::Number(cells) => cells.iter().map(|_| String::new()).collect(),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn any_bytes_are_a_table_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            for extension in [".csv", ".tsv", ".parquet"] {
                let _ = read_bytes(extension, &bytes).map_err(|error| error.to_string());
            }
        }

        #[test]
        fn any_bytes_between_the_marks_of_parquet_are_an_error(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            footer in 0..300u32,
        ) {
            let footer = footer.to_le_bytes();
            let bytes = [b"PAR1", &bytes[..], &footer, b"PAR1"].concat();
            prop_assert!(read_bytes(".parquet", &bytes).is_err());
        }

        #[test]
        fn text_like_a_table_is_a_table_or_an_error(text in "[ab1.,;\"'\r\n\t \u{feff}é]{0,60}") {
            for extension in [".csv", ".tsv"] {
                if let Ok(table) = read_bytes(extension, text.as_bytes()) {
                    let lengths = table.columns.iter().map(|(_, column)| match column {
                        Column::Number(cells) => cells.len(),
                        Column::Text(cells) | Column::Written { cells, .. } => cells.len(),
                    });
                    prop_assert!(lengths.into_iter().all(|length| length == table.n_rows));
                }
            }
        }

        #[test]
        fn a_grid_with_odd_quoting_comes_back_cell_by_cell(
            grid in grid(),
            end in prop::sample::select(vec!["\n", "\r\n"]),
        ) {
            let table = read_bytes(".csv", written(&grid, end).as_bytes()).unwrap();
            prop_assert_eq!(table.n_rows, grid.len());
            for (i, (_, column)) in table.columns.iter().take(grid[0].len()).enumerate() {
                if let Column::Text(cells) = column {
                    let expected: Vec<_> = grid.iter().map(|row| row[i].1.clone()).collect();
                    prop_assert_eq!(cells, &expected);
                }
            }
        }

        #[test]
        fn polars_reads_the_same_cells_from_a_well_formed_file(grid in grid()) {
            let text = written(&grid, "\n");
            let table = read_bytes(".csv", text.as_bytes()).unwrap();
            let options = CsvReadOptions::default().with_infer_schema_length(Some(0));
            let frame = options.into_reader_with_file_handle(Cursor::new(text)).finish().unwrap();
            for ((_, ours), theirs) in table.columns.iter().zip(frame.columns()) {
                let is_text = matches!(ours, Column::Text(_));
                let theirs = theirs.str().unwrap().iter().map(|cell| cell.unwrap_or_default());
                let theirs: Vec<String> = theirs.map(ToString::to_string).collect();
                prop_assert!(!is_text || as_text(ours) == theirs);
            }
        }
    }

    proptest! {
        // Polars prints each panic that is caught: fewer cases keep the output readable.
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_damaged_parquet_file_is_a_table_or_an_error(
            compressed in any::<bool>(),
            damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        ) {
            use ParquetCompression::{Snappy, Uncompressed};
            let compression = if compressed { Snappy } else { Uncompressed };
            let mut bytes = parquet_bytes(50, compression);
            for (at, byte) in damage {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            let _ = read_bytes(".parquet", &bytes).map_err(|error| error.to_string());
        }
    }
}
