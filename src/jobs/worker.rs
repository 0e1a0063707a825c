//! The other side of a job: what a worker process does.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

use anyhow::{Error, Result};

use super::assignment::{Assignment, Outcome};
use super::folder::JobState;
use super::kind::JobKind;
use super::{evaluator, run, score, text, tokenizer, tokens, trunk};
use crate::data::DataError;
use crate::evaluator::EvaluatorError;
use crate::failure::{Consequence, Failure, FailureKind};
use crate::files::atomic::write_json;
use crate::files::{self, FileError};
use crate::generator::GeneratorError;
use crate::progress::{Said, Stop};
use crate::text::TextError;
use crate::tokenizer::TokenizerError;

pub use super::exit::{FAILED, GRACE, REFUSED_MEMORY, STOPPED, killed_by};
pub use super::presence::claim;

/// Raises `stop` when standard input ends: the scheduler holds it open for as long as it lives.
///
/// Work that never looks at the flag, or takes too long to, is cut short: files are whole or not
/// there, so at most the steps since the last checkpoint are lost.
pub fn stop_with_parent(stop: &Stop, grace: Duration) {
    let stop = stop.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        stop.raise();
        std::thread::sleep(grace);
        std::process::exit(STOPPED);
    });
}

/// Lines of a log that a failure keeps.
const LAST_LINES: usize = 10;

/// The last lines of a job's log.
pub fn last_lines(job: &Path) -> Vec<String> {
    let log = fs::read(job.join("log.txt")).unwrap_or_default();
    let log = String::from_utf8_lossy(&log);
    let lines: Vec<&str> = log.lines().collect();
    lines[lines.len().saturating_sub(LAST_LINES)..].iter().map(|line| as_shown(line)).collect()
}

/// Letters of a line that a failure keeps.
const LONGEST_LINE: usize = 500;

/// What a terminal ends up showing of a line: its last state, where `\r` goes back to its beginning, without colours
/// and other controls, and no more than [`LONGEST_LINE`] of it.
fn as_shown(line: &str) -> String {
    let states = line.split('\r').rfind(|state| !state.trim().is_empty());
    let mut letters = states.unwrap_or_default().chars();
    let mut shown = String::new();
    while let Some(letter) = letters.next() {
        match letter {
            '\u{1b}' => skip_escape(&mut letters),
            '\t' => shown.push(' '),
            letter if letter.is_control() => {}
            letter => shown.push(letter),
        }
    }
    match shown.char_indices().nth(LONGEST_LINE) {
        None => shown,
        Some((end, _)) => shown[..end].to_string() + "…",
    }
}

/// What follows an escape: `[` and numbers to a letter, `]` and a text to a bell, or one letter.
fn skip_escape(letters: &mut std::str::Chars) {
    match letters.next() {
        Some('[') => drop(letters.find(|letter| ('@'..='~').contains(letter))),
        Some(']') => drop(letters.find(|letter| *letter == '\u{7}')),
        _ => {}
    }
}

/// Notes a failure in the job's folder: the job is not tried again unasked.
///
/// # Errors
/// The folder cannot be written to.
pub fn write_failure(job: &Path, failure: &Failure) -> Result<(), FileError> {
    write_json(&job.join("failure.json"), failure)
}

/// Tells the scheduler why the job in `place` has no result, and notes it there if it is final.
pub fn report_failure(place: &Path, failure: Failure) {
    let mut failure = Failure { last_lines: last_lines(place), ..failure };
    if failure.kind.consequence() == Consequence::Final
        && let Err(error) = write_failure(place, &failure)
    {
        // A full disk has many symptoms; this is the cause.
        let kind = error.failure_kind();
        failure =
            Failure { last_lines: failure.last_lines, ..Failure::new(kind, error.to_string()) };
    }
    Said::Failure(failure).say();
}

/// The failure that ends a job with this error.
pub fn failure_of(error: &Error) -> Failure {
    let of_file = files::failure_kind(error.as_ref()).filter(|kind| *kind != FailureKind::Other);
    let kind = of_file.or_else(|| error.chain().find_map(kind_of));
    Failure::new(kind.unwrap_or_default(), format!("{error:#}"))
}

/// The kind of failure that an error knows itself to be.
fn kind_of(cause: &(dyn std::error::Error + 'static)) -> Option<FailureKind> {
    let generator = || cause.downcast_ref::<GeneratorError>()?.failure_kind();
    let tokenizer = || cause.downcast_ref::<TokenizerError>()?.failure_kind();
    let data = || Some(cause.downcast_ref::<DataError>()?.failure_kind());
    let evaluator = || cause.downcast_ref::<EvaluatorError>()?.failure_kind();
    let text = || Some(cause.downcast_ref::<TextError>()?.failure_kind());
    generator().or_else(tokenizer).or_else(evaluator).or_else(data).or_else(text)
}

/// Does a job, unless it is done already.
///
/// # Errors
/// Why it has no result.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    if assignment.folder.state(assignment.job) == JobState::Done {
        return Ok(Outcome::Done);
    }
    match assignment.job.kind {
        JobKind::Text => text::work(assignment),
        JobKind::Tokenizer => tokenizer::work(assignment),
        JobKind::Tokens => tokens::work(assignment),
        JobKind::Trunk => trunk::work(assignment),
        JobKind::Run => run::work(assignment),
        JobKind::Evaluator => evaluator::work(assignment),
        JobKind::Score => score::work(assignment),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;
    use crate::learn::LearnError;

    #[test]
    fn a_line_is_what_a_terminal_ends_up_showing() {
        for (line, shown) in [
            ("step 1\rstep 2\rstep 30", "step 30"),
            ("step 3\r", "step 3"),
            ("\u{1b}[31mred\u{1b}[0m and \u{1b}]0;title\u{7}plain\u{7}", "red and plain"),
            ("a\tb\u{8}", "a b"),
            ("é", "é"),
            ("\u{1b}", ""),
        ] {
            assert_eq!(as_shown(line), shown, "{line:?}");
        }
        let long = as_shown(&"é".repeat(2_000_000));
        assert_eq!((long.chars().count(), long.chars().last()), (LONGEST_LINE + 1, Some('…')));
    }

    #[test]
    fn an_error_is_known_through_what_wraps_it() {
        let (step, steps, loss, advice) = (3, 9, f64::NAN, "lower train.lr");
        let diverged = LearnError::NonFinite { step, steps, loss, advice };
        let error = Error::new(GeneratorError::from(diverged)).context("training");
        assert_eq!(failure_of(&error).kind, FailureKind::Diverged);
        let full = FileError::write(Path::new("codes"))(io::Error::from_raw_os_error(28));
        let error = Error::new(TokenizerError::from(full)).context("tokenising");
        let failure = failure_of(&error);
        assert_eq!(failure.kind, FailureKind::DiskFull);
        assert!(failure.reason.contains("tokenising: cannot write codes: No space"), "{failure:?}");
        assert_eq!(failure_of(&Error::msg("what is this")).kind, FailureKind::Other);
    }
}
