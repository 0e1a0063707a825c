//! The process of a worker: its end, its log, and its failure.

use std::fs::{self, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::time::Duration;

use anyhow::{Error, Result};
use nix::sys::signal::Signal;

use crate::data::DataError;
use crate::evaluator::EvaluatorError;
use crate::failure::{Consequence, Failure, FailureKind};
use crate::files::{self, FileError, atomic::write_json};
use crate::generator::GeneratorError;
use crate::learn::TrainingError;
use crate::machine::Kills;
use crate::progress::{Said, Stop};
use crate::text::TextError;
use crate::tokenizer::TokenizerError;

/// Exit code of a worker whose job failed. The reason was reported, and written to `failure.json` if a retry would fail
/// again.
pub const FAILED: i32 = 1;
/// Exit code of a worker that was asked to stop.
pub const STOPPED: i32 = 130;
/// Exit code of a worker that was refused memory.
pub const REFUSED_MEMORY: i32 = 12;

/// Time to reach the end of a step and write a checkpoint, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(2);

/// Whether a process that a signal ended was ended by others; `None` if it was its own fault. `kills` are those before.
pub fn killed_by(signal: Option<i32>, kills: &Kills) -> Option<FailureKind> {
    const OTHERS: [Signal; 4] = [Signal::SIGKILL, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGINT];
    match OTHERS.into_iter().find(|other| Some(*other as i32) == signal)? {
        Signal::SIGKILL if kills.have_risen() => Some(FailureKind::OutOfMemory),
        _ => Some(FailureKind::Killed),
    }
}

/// Raises `stop` when standard input ends: the scheduler holds it open for as long as it lives.
///
/// Work that never looks at the flag, or takes too long to, is cut short: files are whole or not
/// there, so at most the steps since the last checkpoint are lost.
pub fn stop_with_parent(stop: &Stop, grace: Duration) {
    let stop = stop.clone();
    std::thread::spawn(move || {
        let _ = io::stdin().read_to_end(&mut Vec::new());
        stop.raise();
        std::thread::sleep(grace);
        std::process::exit(STOPPED);
    });
}

// The log of its job.

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

/// The final state of a line on a terminal: after the last `\r`, without colours and other control sequences, at most
/// [`LONGEST_LINE`] long.
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

/// The rest of an escape sequence: `[` and numbers to a letter, `]` and a text to a bell, or one letter.
fn skip_escape(letters: &mut std::str::Chars) {
    match letters.next() {
        Some('[') => drop(letters.find(|letter| ('@'..='~').contains(letter))),
        Some(']') => drop(letters.find(|letter| *letter == '\u{7}')),
        _ => {}
    }
}

/// Bytes of a log at most; then its middle is cut out.
const LONGEST_LOG: usize = 16 << 20;
/// Bytes that a cut leaves of its beginning, and of its end.
const KEPT: usize = 4 << 20;
/// The text that replaces the middle, before the number of bytes.
const LEFT_OUT: &[u8] = b"\n[isoflop left out ";
const BYTES: &str = " bytes here]\n";

/// Cuts the middle out of a job's log, if it is too long. A program appends to the log directly, so its output survives
/// its worker.
pub fn bound_log(place: &Path) {
    let path = place.join("log.txt");
    if fs::metadata(&path).is_ok_and(|file| file.len() as usize > LONGEST_LOG) {
        // Looked at again soon: a log that cannot be cut stops no work.
        let _ = cut(&path, KEPT);
    }
}

/// Cuts the middle out of a file that is appended to; its new length.
fn cut(path: &Path, kept: usize) -> io::Result<usize> {
    let bytes = fs::read(path)?;
    if bytes.len() <= 3 * kept {
        return Ok(bytes.len());
    }
    let (head, left_out, tail) = parts(&bytes, kept);
    let mut file = OpenOptions::new().read(true).append(true).open(path)?;
    // The text appended since the read.
    let mut since = Vec::new();
    file.seek(SeekFrom::Start(bytes.len() as u64))?;
    io::copy(&mut file, &mut since)?;
    // Text appended during the copy is left out with the middle; text appended after this line is lost uncounted.
    let length = file.metadata()?.len() as usize;
    let left_out = left_out + length.saturating_sub(bytes.len() + since.len());
    file.set_len(head.len() as u64)?;
    let mark = format!("{}{left_out}{BYTES}", String::from_utf8_lossy(LEFT_OUT));
    let rest = [mark.as_bytes(), tail, &since].concat();
    (&file).write_all(&rest)?;
    Ok(head.len() + rest.len())
}

/// The head and the tail after a cut, with the number of bytes left out, including earlier cuts.
fn parts(bytes: &[u8], kept: usize) -> (&[u8], usize, &[u8]) {
    let (_, tail) = bytes.split_at(bytes.len() - kept);
    let end_of_line = |bytes: &[u8]| bytes.iter().position(|byte| *byte == b'\n');
    let tail = &tail[end_of_line(tail).map_or(0, |end| end + 1)..];
    let (head, said, before) = earlier(&bytes[..bytes.len() - kept]).unwrap_or((kept, 0, 0));
    (&bytes[..head], before + bytes.len() - tail.len() - head - said, tail)
}

/// The position of an earlier cut, the length of its sentence, and the bytes that it left out.
fn earlier(bytes: &[u8]) -> Option<(usize, usize, usize)> {
    let at = bytes.windows(LEFT_OUT.len()).position(|window| window == LEFT_OUT)?;
    let rest = &bytes[at + LEFT_OUT.len()..];
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let n = std::str::from_utf8(&rest[..digits]).ok()?.parse().ok()?;
    Some((at, LEFT_OUT.len() + digits + BYTES.len(), n))
}

// Failures.

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

/// The failure kind of an error's type.
fn kind_of(cause: &(dyn std::error::Error + 'static)) -> Option<FailureKind> {
    let generator = || cause.downcast_ref::<GeneratorError>()?.failure_kind();
    let tokenizer = || cause.downcast_ref::<TokenizerError>()?.failure_kind();
    let data = || Some(cause.downcast_ref::<DataError>()?.failure_kind());
    let evaluator = || cause.downcast_ref::<EvaluatorError>()?.failure_kind();
    let text = || Some(cause.downcast_ref::<TextError>()?.failure_kind());
    generator().or_else(tokenizer).or_else(evaluator).or_else(data).or_else(text)
}

#[cfg(test)]
mod tests {
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

    #[test]
    fn a_cut_keeps_the_head_and_the_tail_and_counts_what_all_cuts_left_out() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("log.txt");
        let line = |i: usize| format!("line {i:05}\n");
        let mut said = 0;
        let mut say = |lines: usize| {
            let more: String = (said..said + lines).map(line).collect();
            said += lines;
            let mut file = OpenOptions::new().create(true).append(true).open(&path).unwrap();
            file.write_all(more.as_bytes()).unwrap();
        };
        for (lines, left_out) in [(100, 0), (400, 5500 - 770 - 770), (200, 7700 - 770 - 770)] {
            say(lines);
            let length = cut(&path, if lines == 100 { 1100 } else { 775 }).unwrap();
            let text = fs::read_to_string(&path).unwrap();
            assert_eq!(length, text.len());
            assert!(text.starts_with(&line(0)), "{text}");
            assert_eq!(text.contains("left out"), left_out > 0);
            assert_eq!(text.matches("left out").count(), usize::from(left_out > 0));
            if let Some(n) = earlier(text.as_bytes()).map(|(.., n)| n) {
                assert!(n.abs_diff(left_out) <= 11, "{n} and not {left_out}");
            }
        }
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.ends_with(&line(699)) && text.len() < 1700, "{text}");
    }
}
