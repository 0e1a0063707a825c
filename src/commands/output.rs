//! [`Output`]: results go to standard output, everything else to standard error. Also tables, lists and counts as
//! text, and exit codes ([`Exit`]).

use isoflop::failure::Consequence;
use isoflop::files::failure_kind;
use isoflop::laws::FitError;
use isoflop::predict::PredictError;
use isoflop::sweep::SweepErrors;
use std::array::from_fn;
use std::cell::RefCell;
use std::io::{ErrorKind, IsTerminal, Write};
use std::process::ExitCode;

use anyhow::Result;
#[cfg(feature = "train")]
use isoflop::engine::Tell;
use isoflop::words::fit_to_terminal;
use serde_json::{Value, json};
use tracing_subscriber::EnvFilter;

use super::args::Common;

/// The modes of output: text, `--json`, quiet.
pub struct Output {
    pub json: bool,
    pub quiet: bool,
    /// Print in full, in place of one screen.
    pub full: bool,
    warned: RefCell<Vec<String>>,
}

impl Output {
    /// Reads the command line, and sets up logging to standard error.
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

    /// Prints the result, JSON or text, on standard output. A command that ends with this has succeeded.
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

    /// Prints a result, building only the requested form: a document may be large.
    pub fn result_of(
        &self,
        json: impl FnOnce() -> Value,
        text: impl FnOnce() -> String,
    ) -> Result<Exit> {
        if self.json { self.result(&json(), "") } else { self.result(&Value::Null, &text()) }
    }

    /// Prints a note.
    pub fn note(&self, line: &str) {
        if !self.quiet {
            say(line);
        }
    }

    /// Prints a warning.
    pub fn warn(&self, line: &str) {
        say(&format!("warning: {}", plain(line)));
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

/// Lines of a table with columns two spaces apart: flush left if the head begins with `<`, else flush right. If all
/// heads are empty, there is no first line.
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

/// Rows that a list shows, at most.
const LISTED: usize = 12;

/// A [`table`] of the first rows, and how many more there are.
pub fn listed<const N: usize>(
    heads: [&str; N],
    rows: impl ExactSizeIterator<Item = [String; N]>,
) -> String {
    let n = rows.len();
    table(heads, rows.take(LISTED)) + &more(n, LISTED, "")
}

/// `and 3 more`, if only `most` of `n` items are shown; else empty. `how` says where to see the rest.
pub fn more(n: usize, most: usize, how: &str) -> String {
    if n > most { format!("  and {} more{how}\n", n - most) } else { String::new() }
}

/// `1 motion`, `3 motions`.
pub fn many(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// The text of a known value, or a dash.
pub fn dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_string(), shown)
}

/// A line, cut to at most `most` characters.
pub fn clip(line: &str, most: usize) -> String {
    if line.chars().count() <= most {
        return line.to_string();
    }
    line.chars().take(most - 1).chain(['…']).collect()
}

// Exit codes, lines on standard error, and the final error of the program.

/// The exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Done = 0,
    SomeRunsFailed = 1,
    Usage = 2,
    NotIdentifiable = 3,
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// Ends the program with the requested help, or with the error of the command line.
pub fn refuse(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args_os().any(|arg| arg == "--json") {
        let message = error.to_string();
        document(message.trim_start_matches("error: ").trim_end(), Exit::Usage);
    }
    error.exit()
}

/// Prints an error on standard error, and with `--json` as a document on standard output; returns the exit code.
pub fn report(error: &anyhow::Error, json: bool) -> Exit {
    let exit = told(error);
    if json {
        let message = match error.downcast_ref::<SweepErrors>() {
            Some(errors) => errors.render(false),
            None => sentence(error),
        };
        document(&message, exit);
    }
    exit
}

/// An error as a document on standard output.
fn document(message: &str, exit: Exit) {
    let document = json!({ "error": { "message": message, "exit": exit as u8 } });
    // The pipe may be closed.
    let _ = writeln!(std::io::stdout(), "{document:#}");
}

/// An error and its causes, each once: some messages contain their causes already.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut said = String::new();
    for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
        if said.is_empty() {
            said = cause;
        } else if !said.contains(&cause) {
            said = format!("{said}: {cause}");
        }
    }
    plain(&said)
}

/// Characters of an error, at most: a name in a damaged file may have no end.
const LONGEST: usize = 2000;

/// Words that may come of a file as a terminal may show them: without its control characters, and cut.
fn plain(words: &str) -> String {
    let blank = |c: char| if c.is_control() && !"\n\t".contains(c) { ' ' } else { c };
    clip(&words.chars().map(blank).collect::<String>(), LONGEST)
}

fn told(error: &anyhow::Error) -> Exit {
    if let Some(errors) = error.downcast_ref::<SweepErrors>() {
        say(&errors.render(is_coloured()));
        return Exit::Usage;
    }
    say(&format!("error: {}", sentence(error)));
    if let Some(kind) = failure_kind(error.as_ref())
        && kind.consequence() == Consequence::StopsAll
    {
        say(&format!(
            "  {}; then the same command continues",
            kind.advice().unwrap_or("mend that")
        ));
        return Exit::SomeRunsFailed;
    }
    let unidentifiable = error.downcast_ref::<FitError>().is_some_and(FitError::is_unidentifiable)
        || matches!(error.downcast_ref(), Some(PredictError::NoOptimum { .. }));
    if unidentifiable { Exit::NotIdentifiable } else { Exit::Usage }
}

/// Prints a line on standard error; a closed pipe is no error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Whether standard error is a terminal that may show colours.
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
    fn words_of_a_damaged_file_do_not_reach_the_terminal_as_they_are() {
        let error =
            anyhow::anyhow!("no key `\u{1b}[31m{}`", "x".repeat(3000)).context("a.json:\nline 2");
        let told = sentence(&error);
        assert!(told.starts_with("a.json:\nline 2: no key ` [31mxx"), "{told}");
        assert_eq!((told.chars().count(), told.chars().last()), (LONGEST, Some('…')));
    }

    #[test]
    fn what_is_not_shown_is_counted() {
        assert_eq!(more(13, 12, ": --full"), "  and 1 more: --full\n");
        assert_eq!((more(12, 12, ""), clip("walks", 4)), (String::new(), "wal…".to_string()));
        assert_eq!([many(1, "motion"), many(2, "motion")], ["1 motion", "2 motions"]);
    }
}
