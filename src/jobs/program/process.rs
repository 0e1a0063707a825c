//! Starts a user's trainer, follows it to its end and never leaves it behind; and its guard.
//!
//! The guard is a small process that outlives its worker until the worker's program has ended. A worker can be killed,
//! and a program may start others in separate sessions, as torchrun does. The guard leads the program's process group
//! and recognises all descendants by a mark in the environment. It holds a lock, so that the next worker's program
//! starts only after every process of the last one has ended.

use std::fs::{self, File, TryLockError};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::{Pid, getpgrp, getpid};

use crate::failure::{Failure, FailureKind};
use crate::jobs::worker::{bound_log, killed_by};
use crate::machine::Kills;
use crate::progress::{Beat, Said, Stop, stop_on_signals};

/// Time between polls of the program and the stop flag.
const POLL: Duration = Duration::from_millis(10);
/// Between two forwarded beats.
const BEAT: Duration = Duration::from_millis(100);
/// Bytes of its output that are copied at once.
const AT_ONCE: usize = 1 << 16;
/// Time for the last lines to arrive after the program's end.
const LAST_OUTPUT: Duration = Duration::from_secs(2);

/// Runs a program to its end; returns the failure, or `None` if it succeeded.
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
    let (sender, beats) = mpsc::channel();
    let lines = forward(child.stdout.take().expect("stdout is piped"), sender);
    let ended = follow(&mut child, &mut guard, place, stop, &beats);
    guard.finish()?;
    let waited = Instant::now();
    while !lines.is_finished() && waited.elapsed() < LAST_OUTPUT {
        sleep(POLL);
    }
    say_last(&beats);
    bound_log(place);
    let status = ended?;
    let sentence = || format!("the trainer `{}` ended with {status}", words[0]);
    Ok((!status.success()).then(|| Failure::new(kind(status, &kills), sentence())))
}

/// Whether a program failed by itself or was killed; a shell reports a signal of its last command as 128 plus the
/// signal.
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

/// Waits for the program's end, tells of its progress and keeps its log in bounds; a stop makes the guard end it.
fn follow(
    child: &mut Child,
    guard: &mut Guard,
    place: &Path,
    stop: &Stop,
    beats: &Receiver<Beat>,
) -> Result<ExitStatus> {
    let mut said = Instant::now();
    loop {
        if said.elapsed() > BEAT {
            said = Instant::now();
            say_last(beats);
        }
        bound_log(place);
        if let Some(status) = child.try_wait().context("waiting for the trainer")? {
            return Ok(status);
        }
        if stop.is_raised() {
            guard.leash = None;
        }
        if guard.child.try_wait()?.is_some() {
            // Without a guard the program would survive this process.
            child.kill()?;
        }
        sleep(POLL);
    }
}

/// Prints the last of the beats that have come.
fn say_last(beats: &Receiver<Beat>) {
    beats.try_iter().last().map(Said::Beat).iter().for_each(Said::say);
}

/// Copies lines to the log, and sends those that are beats.
fn forward(output: impl Read + Send + 'static, beats: Sender<Beat>) -> JoinHandle<()> {
    spawn(move || {
        in_lines(BufReader::new(output), |line| {
            let _ = io::stderr().write_all(line);
            if let Ok(beat) = serde_json::from_slice(line) {
                let _ = beats.send(beat);
            }
        });
    })
}

/// Hands over line after line with its end, `\n` or the `\r` after which a line is written over; one of more than
/// [`AT_ONCE`] bytes in parts.
fn in_lines(mut output: impl BufRead, mut take: impl FnMut(&[u8])) {
    let mut line = Vec::new();
    while let Ok(bytes) = output.fill_buf()
        && !bytes.is_empty()
    {
        let room = &bytes[..bytes.len().min(AT_ONCE - line.len())];
        let end = room.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let used = end.map_or(room.len(), |end| end + 1);
        line.extend_from_slice(&room[..used]);
        output.consume(used);
        if end.is_some() || line.len() == AT_ONCE {
            take(&line);
            line.clear();
        }
    }
    if !line.is_empty() {
        take(&line);
    }
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
        ensure!(line.trim_end() == READY, "it ended before it was ready");
        Ok(Self { child, leash, mark })
    }

    /// Lets it end the program's leftover processes, and waits for that.
    fn finish(mut self) -> Result<()> {
        if let Some(mut leash) = self.leash.take() {
            let _ = leash.write_all(DONE.as_bytes());
        }
        self.child.wait().context("waiting for the trainer's guard")?;
        Ok(())
    }
}

// The process of the guard.

/// The environment variable by which a program and its children are known.
const MARK: &str = "ISOFLOP_RUN";
/// Held by the guard in the run's folder, with the number of its process group in it.
const LOCK: &str = ".program.lock";
/// The guard's message once it holds the lock.
const READY: &str = "ready";
/// The worker's message when the program has ended by itself.
const DONE: &str = "done";

/// Time for a program to write a checkpoint and end, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(10);

const GUARD_POLL: Duration = Duration::from_millis(25);
/// Time for killed processes to be gone.
const LAST_KILLS: Duration = Duration::from_secs(2);

/// Waits for the end of standard input, then ends leftover processes of the program.
///
/// After `done`, leftovers are killed. Without it the worker was stopped or died: the group is sent TERM, and killed
/// after [`GRACE`].
pub fn guard(lock: &Path, mark: &str) -> Result<()> {
    ensure!(getpgrp() == getpid(), "a guard leads a process group of its own");
    // The TERM to its group reaches the guard too.
    let _ignored = stop_on_signals()?;
    let file = File::create(lock).with_context(|| format!("making {}", lock.display()))?;
    file.lock().context("waiting for the program of an earlier worker")?;
    // For `wake_guard`.
    let _ = file.set_len(0).and_then(|()| (&file).write_all(getpid().to_string().as_bytes()));
    let _ = writeln!(io::stdout(), "{READY}");
    let mut said = String::new();
    let _ = io::stdin().read_to_string(&mut said);
    if said != DONE {
        let _ = kill(Pid::from_raw(0), Signal::SIGTERM);
        wait_until_gone(mark, GRACE);
    }
    kill_all(mark);
    drop(file);
    Ok(())
}

/// Continues a stopped guard and its program: without its worker, the guard then ends leftover processes.
pub fn wake_guard(place: &Path) {
    let path = place.join(LOCK);
    let is_held = File::open(&path)
        .is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)));
    let noted = fs::read_to_string(&path).ok().and_then(|text| text.parse().ok());
    if let Some(group) = noted.filter(|_| is_held) {
        let _ = killpg(Pid::from_raw(group), Signal::SIGCONT);
    }
}

fn wait_until_gone(mark: &str, limit: Duration) {
    let started = Instant::now();
    while started.elapsed() < limit && !members(mark).is_empty() {
        sleep(GUARD_POLL);
    }
}

#[cfg(target_os = "linux")]
fn kill_all(mark: &str) {
    let started = Instant::now();
    loop {
        let left = members(mark);
        if left.is_empty() || started.elapsed() > LAST_KILLS {
            return;
        }
        for pid in left {
            let _ = kill(pid, Signal::SIGKILL);
        }
        sleep(GUARD_POLL);
    }
}

/// Without `/proc` only the group is known, and the guard goes with it.
#[cfg(not(target_os = "linux"))]
fn kill_all(_: &str) {
    let _ = LAST_KILLS;
    let _ = kill(Pid::from_raw(0), Signal::SIGKILL);
}

/// Living processes of this group or with the mark, but for this one.
#[cfg(target_os = "linux")]
fn members(mark: &str) -> Vec<Pid> {
    let wanted = format!("{MARK}={mark}");
    let (me, group) = (getpid(), getpgrp());
    let entries = fs::read_dir("/proc").into_iter().flatten();
    let pids = entries.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    let belongs = |pid: &Pid| {
        let marked = || {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment.split(|byte| *byte == 0).any(|one| one == wanted.as_bytes())
        };
        *pid != me && alive_in(*pid).is_some_and(|found| found == group || marked())
    };
    pids.map(Pid::from_raw).filter(belongs).collect()
}

/// The process group of a process; `None` for one that is dead.
#[cfg(target_os = "linux")]
fn alive_in(pid: Pid) -> Option<Pid> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name is in brackets and may contain anything; then: state, parent, group.
    let mut fields = stat.rsplit_once(") ")?.1.split(' ');
    let dead = matches!(fields.next()?, "Z" | "X");
    let group = fields.nth(1)?.parse().ok()?;
    (!dead).then(|| Pid::from_raw(group))
}

/// Unknown without `/proc`: taken for alive until the grace is over.
#[cfg(not(target_os = "linux"))]
fn members(_: &str) -> Vec<Pid> {
    vec![getpid()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_of_a_line_are_told_apart_and_an_endless_line_comes_in_parts() {
        let text = [b"{1}\r{2}\r\n{3}\n".to_vec(), vec![b'x'; 2 * AT_ONCE + 5]].concat();
        let mut parts = Vec::new();
        // A pipe gives what it has at the time.
        in_lines(BufReader::with_capacity(7, &text[..]), |line| parts.push(line.to_vec()));
        assert_eq!(parts.concat(), text);
        assert_eq!(parts[..4], [&b"{1}\r"[..], b"{2}\r", b"\n", b"{3}\n"]);
        let lengths: Vec<usize> = parts[4..].iter().map(Vec::len).collect();
        assert_eq!(lengths, [AT_ONCE, AT_ONCE, 5]);
    }
}
