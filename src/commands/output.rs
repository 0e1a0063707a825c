//! Where a command's words go: results to standard output, everything else to standard error.

use std::cell::RefCell;
use std::io::{ErrorKind, Write};

use anyhow::Result;
use isoflop::engine::Tell;
use isoflop::words::fit_to_terminal;
use serde_json::Value;
use tracing_subscriber::EnvFilter;

use super::exit::{Common, Exit, is_coloured, say};

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
