//! A line on a terminal where a fit takes long.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use crate::commands::output::Output;
use crate::commands::screen::say;

/// How long a fit takes without a word.
const PATIENCE: Duration = Duration::from_secs(2);

/// Says `line` on standard error once a fit takes longer than two seconds, until it is dropped.
pub struct Slow {
    /// Dropped with it, which ends the thread.
    _ends: Option<Sender<()>>,
}

impl Slow {
    /// Waits beside the fit, if standard error is a terminal and notes are wanted.
    pub fn watch(output: &Output, line: String) -> Self {
        let wanted = !output.quiet && std::io::stderr().is_terminal();
        Self { _ends: wanted.then(|| said_after(PATIENCE, move || say(&line))) }
    }
}

/// Calls `then` after a time, unless what this gives is dropped before.
fn said_after(time: Duration, then: impl FnOnce() + Send + 'static) -> Sender<()> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        if receiver.recv_timeout(time) == Err(RecvTimeoutError::Timeout) {
            then();
        }
    });
    sender
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_said_after_a_while_and_not_if_all_is_done_before() {
        let (tell, told) = channel();
        let quick = tell.clone();
        drop(said_after(Duration::from_millis(200), move || quick.send("quick").unwrap()));
        let kept = said_after(Duration::from_millis(1), move || tell.send("slow").unwrap());
        assert_eq!(told.recv_timeout(Duration::from_secs(10)), Ok("slow"));
        drop(kept);
        assert_eq!(
            told.recv_timeout(Duration::from_millis(400)),
            Err(RecvTimeoutError::Disconnected)
        );
    }
}
