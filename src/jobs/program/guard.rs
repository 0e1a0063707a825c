//! The guard: a small process that outlives its worker for as long as the worker's program.
//!
//! A worker can be killed, and a program may start others in sessions of their own, as torchrun
//! does. The guard leads the program's process group and knows all that descends from it by a mark
//! in the environment. It holds a lock, so that the next worker's program starts only when nothing
//! of the last is left.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::{Pid, getpgrp, getpid};

use crate::progress::stop_on_signals;

/// The environment variable by which a program and its children are known.
pub const MARK: &str = "ISOFLOP_RUN";
/// Held by the guard in the run's folder, with the number of its process group in it.
pub const LOCK: &str = ".program.lock";
/// What the guard prints once it holds the lock.
pub const READY: &str = "ready";
/// What the worker writes when the program has ended by itself.
pub const DONE: &str = "done";

/// Time for a program to write a checkpoint and end, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(10);

const POLL: Duration = Duration::from_millis(25);
/// Time for killed processes to be gone.
const LAST: Duration = Duration::from_secs(2);

/// Waits for the end of standard input, then ends what is left of the program.
///
/// After `done` leftovers are killed. Without it the worker was stopped or died: the group is sent
/// TERM, and what is still there after [`GRACE`] is killed.
pub fn guard(lock: &Path, mark: &str) -> Result<()> {
    ensure!(getpgrp() == getpid(), "a guard leads a process group of its own");
    // The TERM to its group reaches the guard too.
    let _ignored = stop_on_signals()?;
    let file = File::create(lock).with_context(|| format!("making {}", lock.display()))?;
    file.lock().context("waiting for the program of an earlier worker")?;
    // For `wake_guard`; whoever reads it finds it where it can be written.
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

/// Lets a guard go on, and its program, that somebody has stopped: with its worker gone, it ends
/// what is left.
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
        std::thread::sleep(POLL);
    }
}

#[cfg(target_os = "linux")]
fn kill_all(mark: &str) {
    let started = Instant::now();
    loop {
        let left = members(mark);
        if left.is_empty() || started.elapsed() > LAST {
            return;
        }
        for pid in left {
            let _ = kill(pid, Signal::SIGKILL);
        }
        std::thread::sleep(POLL);
    }
}

/// Without `/proc` only the group is known, and the guard goes with it.
#[cfg(not(target_os = "linux"))]
fn kill_all(_: &str) {
    let _ = LAST;
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
    // The name stands in brackets and may hold anything; then: state, parent, group.
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
