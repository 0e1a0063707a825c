//! Tables, lists and counts as a person reads them.

use std::array::from_fn;
use std::io::{IsTerminal, Write};

/// Lines of a table, its columns two blanks apart and as wide as what stands in them: flush left if the head begins
/// with `<`, else flush right. Without any head there is no first line.
pub fn table<const N: usize>(
    heads: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let head = heads.map(|head| head.trim_start_matches('<').to_string());
    let head = head.iter().any(|head| !head.is_empty()).then_some(head);
    let lines: Vec<[String; N]> = head.into_iter().chain(rows).collect();
    let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = from_fn(width);
    let padded = |line: &[String; N]| {
        let cells: [String; N] = from_fn(|i| match heads[i].starts_with('<') {
            true => format!("{:<1$}", line[i], widths[i]),
            false => format!("{:>1$}", line[i], widths[i]),
        });
        cells.join("  ").trim_end().to_string() + "\n"
    };
    lines.iter().map(padded).collect()
}

/// How many of a list of `n` are not shown if `most` are; nothing if all are. `how` says where they can be seen.
pub fn more(n: usize, most: usize, how: &str) -> String {
    if n > most { format!("  and {} more{how}\n", n - most) } else { String::new() }
}

/// `1 motion`, `3 motions`.
pub fn many(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// What is known, as it is shown, or a dash.
pub fn dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_string(), shown)
}

/// The beginning of a line of `most` characters at most.
pub fn clip(line: &str, most: usize) -> String {
    if line.chars().count() <= most {
        return line.to_string();
    }
    line.chars().take(most - 1).chain(['…']).collect()
}

/// A line on standard error; that nobody reads it any more is no error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Whether standard error is a terminal that colours are wanted on.
pub fn is_coloured() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_never_run_together() {
        let rows = [["a", "1", "x"], ["long name", "123456789", ""]];
        let rows = rows.map(|row| row.map(String::from));
        let lines = "name               n  word\na                  1  x\nlong name  123456789\n";
        assert_eq!(table(["<name", "n", "<word"], rows.clone()), lines);
        let bare = lines.split_once('\n').expect("a head").1;
        assert_eq!(table(["<", "", "<"], rows), bare);
    }

    #[test]
    fn what_is_not_shown_is_counted() {
        assert_eq!(more(13, 12, ": --full"), "  and 1 more: --full\n");
        assert_eq!((more(12, 12, ""), clip("walks", 4)), (String::new(), "wal…".to_string()));
        assert_eq!([many(1, "motion"), many(2, "motion")], ["1 motion", "2 motions"]);
    }
}
