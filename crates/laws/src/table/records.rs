//! The records of a CSV text, cell by cell (RFC 4180).
//!
//! Polars reads CSV too, but it ends a record at the wrong place where a quote is not closed, and
//! its errors name no line. This reader takes nothing on trust: a quote opens a cell only at the
//! cell's start, and what does not fit is an error with its line. Lines end in LF, CR LF or CR.

use std::borrow::Cow;

use super::error::ReadProblem;

/// Walks through a text; a copy starts again from where it was taken.
#[derive(Clone, Copy)]
pub(super) struct Records<'a> {
    text: &'a str,
    separator: u8,
    at: usize,
}

impl<'a> Records<'a> {
    pub fn new(text: &'a str, separator: u8) -> Self {
        Self { text, separator, at: 0 }
    }

    /// The 1-based line of the byte reached, or of `byte`.
    pub fn line_of(&self, byte: usize) -> usize {
        let before = &self.text.as_bytes()[..byte];
        let feeds = before.iter().filter(|b| **b == b'\n').count();
        let returns = || before.iter().filter(|b| **b == b'\r').count();
        1 + if self.text.contains('\n') { feeds } else { returns() }
    }

    /// Puts the next record into `cells` and returns its first byte; none at the end. Blank lines
    /// are no records.
    pub fn next_into(
        &mut self,
        cells: &mut Vec<Cow<'a, str>>,
    ) -> Result<Option<usize>, ReadProblem> {
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

    /// The cell that starts here; stops before what ends it.
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
