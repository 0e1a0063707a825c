//! Parses a CSV text into a table: one pass for numbers, a second only for text.

use std::borrow::Cow;

use super::{Column, ReadProblem, Table};

/// Cells that mean a missing number, in any case.
const MISSING: [&str; 8] = ["", "-", "na", "n/a", "#n/a", "nan", "null", "none"];

type Cells<'a> = Vec<Cow<'a, str>>;

/// The separator of a text: of comma, semicolon and tab the most frequent outside quotes in its first
/// line, the comma if it has none.
pub(super) fn separator(text: &str) -> u8 {
    let head = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let outside: String = head.split('"').step_by(2).collect();
    let count = |separator: &u8| outside.bytes().filter(|byte| byte == separator).count();
    // Of equal counts the last one counts.
    [b'\t', b';', b','].into_iter().max_by_key(count).unwrap_or(b',')
}

/// A note for a separator that is not the comma.
pub(super) fn note(separator: u8) -> Option<String> {
    let name = match separator {
        b';' => "semicolons",
        b'\t' => "tabs",
        _ => return None,
    };
    Some(format!("cells are taken to be separated by {name}"))
}

/// The table in a text whose first record is the header.
///
/// A column's type is decided by all of its rows: numbers, or `true` and `false`, else text.
pub(super) fn table(text: &str, separator: u8) -> Result<Table, ReadProblem> {
    let mut records = Records::new(text.strip_prefix('\u{feff}').unwrap_or(text), separator);
    let mut cells = Cells::new();
    records.next_into(&mut cells)?.ok_or(ReadProblem::Empty)?;
    let names: Vec<String> = cells.iter().enumerate().map(|(i, c)| name(i, c)).collect();
    let numbers = numbers(records, names.len())?;
    let n_rows = numbers.iter().map(|column| column.n_rows).max().unwrap_or(0);
    let texts = if numbers.iter().any(|column| column.kind == Kind::Text) {
        texts(records, &numbers)?
    } else {
        vec![Vec::new(); names.len()]
    };
    let columns = numbers.into_iter().zip(texts).map(|(number, text)| match number.kind {
        Kind::Text => Column::Text(text),
        _ => Column::Number(number.values),
    });
    Ok(Table { columns: names.into_iter().zip(columns).collect(), n_rows, notes: Vec::new() })
}

/// A header without the spaces around it; a nameless column, as of an index, is called by its place.
fn name(index: usize, header: &str) -> String {
    match header.trim() {
        "" => format!("column_{}", index + 1),
        name => name.to_string(),
    }
}

/// Calls `row` with the cells of each record, which must be `width` many.
fn each_row<'a>(
    mut records: Records<'a>,
    width: usize,
    mut row: impl FnMut(&mut Cells<'a>),
) -> Result<(), ReadProblem> {
    let mut cells = Cells::new();
    while let Some(start) = records.next_into(&mut cells)? {
        if cells.len() != width {
            let line = records.line_of(start);
            return Err(ReadProblem::Ragged { line, found: cells.len(), expected: width });
        }
        row(&mut cells);
    }
    Ok(())
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Kind {
    /// Nothing but missing cells so far.
    #[default]
    Unknown,
    Number,
    Boolean,
    Text,
}

/// A column while it may still be numeric.
#[derive(Default)]
struct Numbers {
    kind: Kind,
    values: Vec<f64>,
    n_rows: usize,
}

impl Numbers {
    fn push(&mut self, cell: &str) {
        self.n_rows += 1;
        if self.kind == Kind::Text {
            return;
        }
        let (kind, value) = value(cell).unwrap_or((self.kind, f64::NAN));
        self.kind = if self.kind == Kind::Unknown || self.kind == kind { kind } else { Kind::Text };
        self.values.push(value);
    }
}

/// Whether a cell says that its value is missing.
pub(super) fn is_missing(cell: &str) -> bool {
    let cell = cell.trim();
    cell.len() <= 4 && MISSING.iter().any(|name| cell.eq_ignore_ascii_case(name))
}

/// The type of a cell and its number; `None` if it is missing.
fn value(cell: &str) -> Option<(Kind, f64)> {
    let cell = cell.trim();
    if is_missing(cell) {
        return None;
    }
    Some(match cell.parse() {
        Ok(number) => (Kind::Number, number),
        Err(_) if cell.eq_ignore_ascii_case("true") => (Kind::Boolean, 1.0),
        Err(_) if cell.eq_ignore_ascii_case("false") => (Kind::Boolean, 0.0),
        Err(_) => (Kind::Text, f64::NAN),
    })
}

fn numbers(records: Records<'_>, width: usize) -> Result<Vec<Numbers>, ReadProblem> {
    let mut columns: Vec<Numbers> = (0..width).map(|_| Numbers::default()).collect();
    each_row(records, width, |cells| {
        columns.iter_mut().zip(cells.iter()).for_each(|(column, cell)| column.push(cell));
    })?;
    Ok(columns)
}

/// The cells of the text columns; the others stay empty.
fn texts(records: Records<'_>, columns: &[Numbers]) -> Result<Vec<Vec<String>>, ReadProblem> {
    let mut texts = vec![Vec::new(); columns.len()];
    each_row(records, columns.len(), |cells| {
        for ((text, column), cell) in texts.iter_mut().zip(columns).zip(cells) {
            if column.kind == Kind::Text {
                text.push(std::mem::take(cell).into_owned());
            }
        }
    })?;
    Ok(texts)
}

// The records of a text, cell by cell (RFC 4180).
//
// Polars reads CSV too, but it ends a record at the wrong place if a quote is not closed, and its errors name no line.
// This reader is strict: a quote opens a cell only at the cell's start, and every mismatch is an error with its line.
// Lines end in LF, CR LF or CR.

/// A cursor over a text; a copy continues from its position.
#[derive(Clone, Copy)]
struct Records<'a> {
    text: &'a str,
    separator: u8,
    at: usize,
}

impl<'a> Records<'a> {
    fn new(text: &'a str, separator: u8) -> Self {
        Self { text, separator, at: 0 }
    }

    /// The 1-based line of the byte reached, or of `byte`.
    fn line_of(&self, byte: usize) -> usize {
        let before = &self.text.as_bytes()[..byte];
        let feeds = before.iter().filter(|b| **b == b'\n').count();
        let returns = || before.iter().filter(|b| **b == b'\r').count();
        1 + if self.text.contains('\n') { feeds } else { returns() }
    }

    /// Puts the next record into `cells` and returns its first byte; none at the end. Blank lines
    /// are no records.
    fn next_into(&mut self, cells: &mut Vec<Cow<'a, str>>) -> Result<Option<usize>, ReadProblem> {
        cells.clear();
        while matches!(self.peek(), Some(b'\n' | b'\r')) {
            self.at += 1;
        }
        let start = self.at;
        if self.peek().is_none() {
            return Ok(None);
        }
        loop {
            cells.push(self.cell()?);
            let more = self.peek() == Some(self.separator);
            self.at += usize::from(self.peek().is_some());
            if !more {
                return Ok(Some(start));
            }
        }
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    /// Reads the cell that starts here, and stops before its delimiter.
    fn cell(&mut self) -> Result<Cow<'a, str>, ReadProblem> {
        if self.peek() == Some(b'"') { self.quoted() } else { Ok(Cow::Borrowed(self.plain())) }
    }

    fn plain(&mut self) -> &'a str {
        let (start, separator) = (self.at, self.separator);
        let rest = &self.text.as_bytes()[start..];
        let ends = |b: &u8| *b == separator || *b == b'\n' || *b == b'\r';
        self.at += rest.iter().position(ends).unwrap_or(rest.len());
        &self.text[start..self.at]
    }

    fn quoted(&mut self) -> Result<Cow<'a, str>, ReadProblem> {
        let open = self.at;
        let mut value = Cow::Borrowed("");
        loop {
            self.at += 1;
            let length = self.text[self.at..].find('"');
            let length =
                length.ok_or_else(|| ReadProblem::Unclosed { line: self.line_of(open) })?;
            value += &self.text[self.at..self.at + length];
            self.at += length + 1;
            if self.peek() != Some(b'"') {
                break;
            }
            value += "\"";
        }
        let ended = self.peek().is_none_or(|b| b == self.separator || b == b'\n' || b == b'\r');
        if ended { Ok(value) } else { Err(ReadProblem::AfterQuote { line: self.line_of(self.at) }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(text: &str) -> Column {
        table(&format!("x,y\n{text}"), b',').unwrap().columns.remove(0).1
    }

    fn number(values: &[f64]) -> String {
        format!("{:?}", Column::Number(values.to_vec()))
    }

    #[test]
    fn the_last_row_decides_a_type_as_much_as_the_first() {
        assert_eq!(format!("{:?}", column("1,\n 2.5 ,\n1e18,")), number(&[1.0, 2.5, 1e18]));
        assert_eq!(
            column("1,\nNA,\nbig,"),
            Column::Text(["1", "NA", "big"].map(Into::into).into())
        );
    }

    #[test]
    fn booleans_are_one_and_zero_but_do_not_mix_with_numbers() {
        assert_eq!(format!("{:?}", column("True,\nfalse,\n,")), number(&[1.0, 0.0, f64::NAN]));
        assert_eq!(column("true,\n1,"), Column::Text(["true", "1"].map(Into::into).into()));
    }

    #[test]
    fn missing_cells_are_nan_in_a_column_of_numbers() {
        let found = format!("{:?}", column("NA,\n1,\nnone,\n-inf,"));
        assert_eq!(found, number(&[f64::NAN, 1.0, f64::NAN, f64::NEG_INFINITY]));
    }

    #[test]
    fn a_mark_of_byte_order_and_an_unnamed_index_are_no_obstacle() {
        let table = table("\u{feff},loss\r\n0,3.5\r\n", b',').unwrap();
        assert_eq!(table.names().collect::<Vec<_>>(), ["column_1", "loss"]);
    }

    #[test]
    fn a_ragged_row_is_named_by_its_line() {
        let ragged = |text| table(text, b'\t').unwrap_err();
        let expected = ReadProblem::Ragged { line: 4, found: 1, expected: 2 };
        assert_eq!(ragged("a\tb\n\"1\n\"\t2\n3\n"), expected);
        assert_eq!(ragged("\n\n"), ReadProblem::Empty);
    }

    fn all(text: &str) -> Result<Vec<Vec<String>>, ReadProblem> {
        let (mut records, mut cells, mut rows) = (Records::new(text, b','), Vec::new(), Vec::new());
        while records.next_into(&mut cells)?.is_some() {
            rows.push(cells.iter().map(ToString::to_string).collect());
        }
        Ok(rows)
    }

    #[test]
    fn every_kind_of_line_end_ends_a_record_and_blank_lines_are_none() {
        let rows = vec![vec!["a", "b"], vec!["1", ""], vec!["", "2"]];
        for text in
            ["a,b\n1,\n,2", "a,b\r\n1,\r\n\r\n,2\r\n", "a,b\r1,\r,2\r", "\n\na,b\n\n1,\n,2\n\n"]
        {
            assert_eq!(all(text).unwrap(), rows, "{text:?}");
        }
    }

    #[test]
    fn a_quoted_cell_keeps_separators_line_ends_and_doubled_quotes() {
        let rows = all("\"a,b\",\"say \"\"hi\"\"\"\n\"two\nlines\",5\" wide\n\"\",x\n").unwrap();
        assert_eq!(rows, [["a,b", "say \"hi\""], ["two\nlines", "5\" wide"], ["", "x"]]);
    }

    #[test]
    fn a_quote_left_open_and_text_after_a_quote_are_faults_where_they_stand() {
        assert_eq!(all("a\n\"b,c\n"), Err(ReadProblem::Unclosed { line: 2 }));
        assert_eq!(all("\"a\"b\n"), Err(ReadProblem::AfterQuote { line: 1 }));
        let records = Records::new("a\r\nb\r\nc", b',');
        assert_eq!([0, 3, 6].map(|byte| records.line_of(byte)), [1, 2, 3]);
    }
}
