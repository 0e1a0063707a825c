//! [`Output`], where a command's words go: results to standard output, everything else to standard error; and
//! tables, lists and counts as a person reads them.

use std::array::from_fn;
use std::cell::RefCell;
use std::io::{ErrorKind, Write};

use anyhow::Result;
#[cfg(feature = "train")]
use isoflop::engine::Tell;
use isoflop::words::fit_to_terminal;
use serde_json::Value;
use tracing_subscriber::EnvFilter;

use super::args::Common;
use super::exit::{Exit, is_coloured, say};

/// The three ways to speak: for people, `--json`, quiet.
pub struct Output {
    pub json: bool,
    pub quiet: bool,
    /// Say everything, in place of one screen.
    pub full: bool,
    warned: RefCell<Vec<String>>,
}

impl Output {
    /// From the command line; also sets up logging to standard error.
    pub fn new(common: &Common) -> Self {
        let level = match common.verbose {
            0 => "warn",
            1 => "isoflop=info",
            _ => "isoflop=debug",
        };
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
        let _ = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_ansi(is_coloured())
            .with_writer(std::io::stderr)
            .without_time()
            .log_internal_errors(false)
            .try_init();
        if let Some((columns, _)) = terminal_size::terminal_size_of(std::io::stdout()) {
            fit_to_terminal(columns.0.into());
        }
        Self {
            json: common.json,
            quiet: common.quiet,
            full: common.full,
            warned: RefCell::default(),
        }
    }

    /// A result: the JSON document or the text for people, on standard output. A command that ends with it is done.
    pub fn result(&self, json: &Value, text: &str) -> Result<Exit> {
        let mut out = std::io::stdout().lock();
        let written = if self.json {
            serde_json::to_writer_pretty(&mut out, json).map_err(Into::into)
        } else {
            out.write_all(text.trim_end().as_bytes())
        };
        match written.and_then(|()| out.write_all(b"\n")) {
            // `isoflop … | head` is no error.
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
            _ => Ok(Exit::Done),
        }
    }

    /// A result of which only the form asked for is made: a document may be large.
    pub fn result_of(
        &self,
        json: impl FnOnce() -> Value,
        text: impl FnOnce() -> String,
    ) -> Result<Exit> {
        if self.json { self.result(&json(), "") } else { self.result(&Value::Null, &text()) }
    }

    /// Something worth knowing that is no result.
    pub fn note(&self, line: &str) {
        if !self.quiet {
            say(line);
        }
    }

    /// Something that may be wrong.
    pub fn warn(&self, line: &str) {
        say(&format!("warning: {line}"));
        self.warned.borrow_mut().push(line.to_string());
    }

    /// Every warning so far.
    pub fn warned(&self) -> Vec<String> {
        self.warned.borrow().clone()
    }
}

#[cfg(feature = "train")]
impl Tell for Output {
    fn note(&self, line: &str) {
        self.note(line);
    }

    fn warn(&self, line: &str) {
        self.warn(line);
    }

    fn is_quiet(&self) -> bool {
        self.quiet
    }
}

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
