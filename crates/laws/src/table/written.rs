//! Numbers as users write them: `7M`, `0.02B`, `1,5e7`, `1,234,567`.
//!
//! A comma before three digits may separate thousands or decimals. Other cells of the column, or other columns of the
//! file, decide; an undecided column stays text.

use super::{Column, Table};
use crate::table::csv::is_missing;

/// Letters after a number, and their factors.
const SUFFIXES: [(char, f64); 5] = [('k', 1e3), ('m', 1e6), ('b', 1e9), ('g', 1e9), ('t', 1e12)];

/// The meaning of a comma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comma {
    Decimal,
    Thousands,
    /// Either, as in `1,234`.
    Unclear,
}

/// A cell that may be a number.
struct Written<'a> {
    digits: &'a str,
    factor: f64,
    comma: Option<Comma>,
}

/// Columns of text whose cells are all numbers in some form, read as such; each with a note.
pub(super) fn read(mut table: Table) -> Table {
    let commas = |column: &Column| match column {
        Column::Text(cells) => comma(cells).ok().flatten(),
        _ => None,
    };
    let all: Vec<Comma> = table.columns.iter().filter_map(|(_, column)| commas(column)).collect();
    let decimal = all.contains(&Comma::Decimal) && !all.contains(&Comma::Thousands);
    for (name, column) in &mut table.columns {
        let Column::Text(cells) = column else { continue };
        let Some((numbers, example)) = numbers(cells, decimal) else { continue };
        let (cell, number) = example;
        let plain = (1e-3..1e5).contains(&number.abs());
        let number = if plain { number.to_string() } else { format!("{number:e}") };
        table.notes.push(format!("column `{name}`: {cell} is read as {number}"));
        *column = Column::Written { numbers, cells: std::mem::take(cells) };
    }
    table
}

/// Why a text column whose cells look like numbers is not read as numbers; `None` if they do not.
pub(super) fn unclear(cells: &[String]) -> Option<String> {
    let cell = |wanted: Comma| {
        let is = |cell: &&String| written(cell).is_some_and(|found| found.comma == Some(wanted));
        cells.iter().find(is)
    };
    match comma(cells) {
        Ok(Some(Comma::Unclear)) => {
            let cell = cell(Comma::Unclear)?;
            let [whole, decimal] = [cell.replace(',', ""), cell.replace(',', ".")];
            Some(format!("`{cell}` may be {whole} or {decimal}: write the one that is meant"))
        }
        Err(()) => {
            let (a, b) = (cell(Comma::Decimal)?, cell(Comma::Thousands)?);
            Some(format!("its commas are decimal in `{a}` and part thousands in `{b}`"))
        }
        _ => None,
    }
}

/// The meaning of the commas in a column of numbers; `None` without commas, or if it is no such column.
///
/// # Errors
/// They have both meanings.
fn comma(cells: &[String]) -> Result<Option<Comma>, ()> {
    let mut meant = None;
    for cell in cells.iter().filter(|cell| !is_missing(cell)) {
        let Some(found) = written(cell) else { return Ok(None) };
        meant = match (meant, found.comma) {
            (meant, None) => meant,
            (None | Some(Comma::Unclear), found) => found,
            (meant, Some(Comma::Unclear)) => meant,
            (Some(a), Some(b)) if a == b => Some(a),
            _ => return Err(()),
        };
    }
    Ok(meant)
}

/// The numbers of a column, and the first cell that Rust would not read with its number; `None` if
/// a cell is no number, or may be two.
fn numbers(cells: &[String], decimal: bool) -> Option<(Vec<f64>, (String, f64))> {
    let meant = match comma(cells).ok()? {
        Some(Comma::Unclear) if decimal => Comma::Decimal,
        Some(Comma::Unclear) => return None,
        other => other.unwrap_or(Comma::Thousands),
    };
    let number = |cell: &String| match is_missing(cell) {
        true => Some(f64::NAN),
        false => written(cell)?.number(meant),
    };
    let numbers: Vec<f64> = cells.iter().map(number).collect::<Option<_>>()?;
    let is_example =
        |(cell, number): &(&String, &f64)| !number.is_nan() && cell.trim().parse::<f64>().is_err();
    let (cell, number) = cells.iter().zip(&numbers).find(is_example)?;
    let example = (cell.trim().to_string(), *number);
    Some((numbers, example))
}

/// A number as a cell may have it; `None` if it is none, or may be two.
pub fn number(text: &str) -> Option<f64> {
    let found = written(text)?;
    let meant = found.comma.unwrap_or(Comma::Thousands);
    if meant == Comma::Unclear { None } else { found.number(meant) }
}

/// A cell in its parts; `None` if it is no number in any form.
fn written(cell: &str) -> Option<Written<'_>> {
    let cell = cell.trim();
    let last = cell.chars().next_back()?.to_ascii_lowercase();
    let suffix = SUFFIXES.iter().find(|(letter, _)| *letter == last);
    let (digits, factor) = match suffix {
        Some((letter, factor)) => (cell[..cell.len() - letter.len_utf8()].trim_end(), *factor),
        None => (cell, 1.0),
    };
    let is_numeric = |c: char| c.is_ascii_digit() || "+-.,eE".contains(c);
    let sound = digits.chars().all(is_numeric) && digits.contains(|c: char| c.is_ascii_digit());
    if !sound {
        return None;
    }
    let comma = if digits.contains(',') { Some(meaning(digits)?) } else { None };
    let found = Written { digits, factor, comma };
    let as_any = if comma == Some(Comma::Unclear) {
        Comma::Decimal
    } else {
        comma.unwrap_or(Comma::Thousands)
    };
    found.number(as_any)?;
    Some(found)
}

/// The meaning of the commas in a number; `None` if they are at invalid places.
fn meaning(digits: &str) -> Option<Comma> {
    let unsigned = digits.trim_start_matches(['+', '-']);
    let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (unsigned, None),
    };
    let (whole, point) = match mantissa.split_once('.') {
        Some((whole, decimals)) if !decimals.contains(',') => (whole, true),
        Some(_) => return None,
        None => (mantissa, false),
    };
    let groups: Vec<&str> = whole.split(',').collect();
    let first = groups[0];
    let parts = groups[1..].iter().all(|group| group.len() == 3)
        && (1..=3).contains(&first.len())
        && !first.starts_with('0');
    match (groups.len(), parts) {
        (2, true) if !point && exponent.is_none() => Some(Comma::Unclear),
        (_, true) => Some(Comma::Thousands),
        (2, false) if !point => Some(Comma::Decimal),
        _ => None,
    }
}

impl Written<'_> {
    fn number(&self, meant: Comma) -> Option<f64> {
        let digits = match meant {
            Comma::Decimal => self.digits.replace(',', "."),
            Comma::Thousands | Comma::Unclear => self.digits.replace(',', ""),
        };
        digits.parse::<f64>().ok().map(|number| number * self.factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(cells: &[&str]) -> Column {
        Column::Text(cells.iter().map(ToString::to_string).collect())
    }

    fn table(columns: &[&[&str]]) -> Table {
        let named = |(i, cells): (usize, &&[&str])| (format!("c{i}"), texts(cells));
        let n_rows = columns[0].len();
        read(Table {
            columns: columns.iter().enumerate().map(named).collect(),
            n_rows,
            notes: vec![],
        })
    }

    fn found(cells: &[&str]) -> Option<Vec<f64>> {
        match table(&[cells]).columns.remove(0).1 {
            Column::Written { numbers, .. } => Some(numbers),
            _ => None,
        }
    }

    #[test]
    fn suffixes_and_decimal_commas_and_thousands_are_numbers() {
        let close = |cells: &[&str], wanted: &[f64]| {
            let numbers = found(cells).unwrap_or_else(|| panic!("{cells:?}"));
            let near = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < 1e-12;
            assert!(numbers.iter().zip(wanted).all(near), "{cells:?}: {numbers:?}");
        };
        close(&["7M", "0.02B", "1.5k", "3e2"], &[7e6, 2e7, 1500.0, 300.0]);
        close(&["1,97531e+07", "2"], &[1.97531e7, 2.0]);
        close(&["0,5", "-1,25"], &[0.5, -1.25]);
        close(&["1,234,567", "12,500"], &[1_234_567.0, 12_500.0]);
        close(&["1,234", "1,5"], &[1.234, 1.5]);
        close(&["1,234.5"], &[1234.5]);
        let numbers = found(&["-", "7M", "NA", ""]).unwrap();
        assert!(numbers[0].is_nan() && numbers[1] == 7e6 && numbers[3].is_nan());
    }

    #[test]
    fn a_comma_that_may_mean_two_things_is_not_guessed() {
        assert_eq!(found(&["1,234", "2,500"]), None);
        let cells = |cells: &[&str]| cells.iter().map(ToString::to_string).collect::<Vec<_>>();
        let said = unclear(&cells(&["1,234"])).unwrap();
        assert!(said.contains("1234 or 1.234"), "{said}");
        let said = unclear(&cells(&["1,5", "1,234,567"])).unwrap();
        assert!(said.contains("`1,5`") && said.contains("`1,234,567`"), "{said}");
        assert_eq!(unclear(&cells(&["llama", "1,234"])), None);
        // Another column shows what commas mean in this file.
        let table = table(&[&["1,234", "2,500"], &["0,75", "1,5"]]);
        let Column::Written { numbers, .. } = &table.columns[0].1 else { panic!("{table:?}") };
        assert_eq!(numbers, &[1.234, 2.5]);
        assert_eq!(table.notes[0], "column `c0`: 1,234 is read as 1.234");
    }

    #[test]
    fn one_number_is_read_alone() {
        let read = ["7B", "1.5k", "2e9", "7e9M", "1,234", "7X"].map(number);
        assert_eq!(read, [Some(7e9), Some(1500.0), Some(2e9), Some(7e15), None, None]);
    }

    #[test]
    fn names_and_dates_stay_text() {
        for cells in [&["llama-7B"][..], &["2024-01-02x"], &["#faebdd"], &["e"], &["M"], &["1,2,3"]]
        {
            assert_eq!(found(cells), None, "{cells:?}");
        }
    }
}
