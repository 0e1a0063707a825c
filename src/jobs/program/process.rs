//! The program itself: started, followed to its end, and never left behind.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::failure::{Failure, FailureKind};
use crate::jobs::exit::killed_by;
use crate::jobs::program::guard::{DONE, LOCK, MARK, READY};
use crate::jobs::program::log::bound;
use crate::machine::Kills;
use crate::progress::{Beat, Said, Stop};

/// How often the program and the stop flag are looked at.
const POLL: Duration = Duration::from_millis(10);
/// Between two forwarded beats.
const BEAT: Duration = Duration::from_millis(100);
/// Bytes of its output that are copied at once.
const AT_ONCE: u64 = 1 << 16;
/// Time for the last lines to arrive after the program's end.
const LAST_LINES: Duration = Duration::from_secs(2);

/// Runs a program to its end; what went wrong, or `None` where it ended well.
///
/// Its output goes to this process's standard error, which is the run's log.
pub fn attend(words: &[String], place: &Path, id: &str, stop: &Stop) -> Result<Option<Failure>> {
    let mut guard = Guard::start(place, id).context("starting the trainer's guard")?;
    let kills = Kills::so_far();
    let mut child = match start(words, &guard) {
        Ok(child) => child,
        Err(error) => {
            guard.finish()?;
            let sentence = format!("the trainer `{}` cannot be started: {error}", words[0]);
            return Ok(Some(Failure::new(FailureKind::Trainer, sentence)));
        }
    };
    let lines = forward(child.stdout.take().expect("stdout is piped"));
    let ended = follow(&mut child, &mut guard, place, stop);
    guard.finish()?;
    let waited = Instant::now();
    while !lines.is_finished() && waited.elapsed() < LAST_LINES {
        sleep(POLL);
    }
    bound(place);
    let status = ended?;
    let sentence = || format!("the trainer `{}` ended with {status}", words[0]);
    Ok((!status.success()).then(|| Failure::new(kind(status, &kills), sentence())))
}

/// Whether a program failed by itself or was ended by others; a shell tells of its last command's
/// end by 128 and the signal.
fn kind(status: ExitStatus, kills: &Kills) -> FailureKind {
    let signal = status.signal().or_else(|| status.code()?.checked_sub(128));
    killed_by(signal, kills).unwrap_or(FailureKind::Trainer)
}

/// In the guard's group, with its mark; standard error is the log already.
fn start(words: &[String], guard: &Guard) -> io::Result<Child> {
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).env(MARK, &guard.mark);
    // Meant for the built-in trainer.
    command.env_remove("RAYON_NUM_THREADS");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::inherit());
    command.process_group(guard.child.id() as i32).spawn()
}

/// Waits for the program's end and keeps its log in bounds; a stop makes the guard end it.
fn follow(child: &mut Child, guard: &mut Guard, place: &Path, stop: &Stop) -> Result<ExitStatus> {
    loop {
        bound(place);
        if let Some(status) = child.try_wait().context("waiting for the trainer")? {
            return Ok(status);
        }
        if stop.is_raised() {
            guard.leash = None;
        }
        if guard.child.try_wait()?.is_some() {
            // Without a guard nobody would end it if this process died.
            child.kill()?;
        }
        sleep(POLL);
    }
}

/// Copies lines to the log, and prints those that are beats. A line without an end is copied in parts.
fn forward(output: impl Read + Send + 'static) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let (mut reader, mut line, mut last) =
            (BufReader::new(output), Vec::new(), None::<Instant>);
        while (&mut reader).take(AT_ONCE).read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
            let _ = io::stderr().write_all(&line);
            let due = last.is_none_or(|last| last.elapsed() > BEAT);
            if let (true, Ok(beat)) = (due, serde_json::from_slice::<Beat>(&line)) {
                last = Some(Instant::now());
                Said::Beat(beat).say();
            }
            line.clear();
        }
    })
}

/// This side of a guard process.
struct Guard {
    child: Child,
    /// Its standard input: when it closes without [`DONE`], the guard ends the program.
    leash: Option<ChildStdin>,
    mark: String,
}

impl Guard {
    /// Starts one, and waits until no program of an earlier worker is left.
    fn start(place: &Path, id: &str) -> Result<Self> {
        let mark = format!("{id}-{}", std::process::id());
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("guard").arg(place.join(LOCK)).arg(&mark);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.process_group(0).spawn()?;
        let leash = child.stdin.take();
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("stdout is piped")).read_line(&mut line)?;
        anyhow::ensure!(line.trim_end() == READY, "it ended before it was ready");
        Ok(Self { child, leash, mark })
    }

    /// Has it end what the program left running, and waits for that.
    fn finish(mut self) -> Result<()> {
        if let Some(mut leash) = self.leash.take() {
            let _ = leash.write_all(DONE.as_bytes());
        }
        self.child.wait().context("waiting for the trainer's guard")?;
        Ok(())
    }
}
