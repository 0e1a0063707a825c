//! Processes of the program that work in one folder, found in `/proc`.

use std::fs;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Workers whose command line names the folder.
pub fn workers(results: &Path) -> Vec<Pid> {
    let folder = results.to_str().expect("temporary paths are UTF-8");
    let entries = fs::read_dir("/proc").expect("a Linux system");
    let pids = entries.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<i32>().ok());
    let works_there = |pid: &i32| {
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let mut words = line.split(|byte| *byte == 0);
        words.any(|word| word == b"worker") && words.any(|word| word == folder.as_bytes())
    };
    pids.filter(works_there).map(Pid::from_raw).collect()
}

/// Kills a process, which may have ended by itself.
pub fn kill_9(pid: Pid) {
    let _ = kill(pid, Signal::SIGKILL);
}

/// Sends a signal to a child that has not been waited for.
pub fn signal(child: &Child, signal: Signal) {
    kill(Pid::from_raw(child.id() as i32), signal).expect("a child that was not waited for");
}

/// Looks again and again until there is something to see; `None` when the time is up.
pub fn wait_for<T>(limit: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let started = Instant::now();
    loop {
        let seen = look();
        if seen.is_some() || started.elapsed() > limit {
            return seen;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The end of a child; it is killed, and the test fails, when the time is up.
pub fn end_within(limit: Duration, child: &mut Child) -> ExitStatus {
    let ended = wait_for(limit, || child.try_wait().expect("a child of this process"));
    ended.unwrap_or_else(|| {
        let _ = child.kill();
        panic!("the program did not end within {limit:?}")
    })
}

/// Stops a process, as Ctrl-Z would; it lives on and does nothing.
pub fn stop(pid: Pid) {
    kill(pid, Signal::SIGSTOP).expect("a living process");
}
