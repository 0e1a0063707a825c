//! What Slurm tells a task by signals: its time is nearly up (USR2), or it is to end (TERM).

use std::sync::atomic::{AtomicBool, Ordering};

static TIME_IS_UP: AtomicBool = AtomicBool::new(false);
static TO_END: AtomicBool = AtomicBool::new(false);

/// Whether the warning before the time limit has come.
pub fn time_is_up() -> bool {
    TIME_IS_UP.load(Ordering::SeqCst)
}

/// Whether the task was asked to end: cancelled, preempted, or beyond its time.
pub fn to_end() -> bool {
    TO_END.load(Ordering::SeqCst)
}

/// Notes signals from here on. However often they come, the task ends in good order.
///
/// # Errors
/// The system takes no handlers.
pub fn listen() -> std::io::Result<()> {
    use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

    extern "C" fn note(signal: i32) {
        let flag = if signal == Signal::SIGUSR2 as i32 { &TIME_IS_UP } else { &TO_END };
        flag.store(true, Ordering::SeqCst);
    }
    let action = SigAction::new(SigHandler::Handler(note), SaFlags::SA_RESTART, SigSet::empty());
    for signal in [Signal::SIGUSR2, Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
        // SAFETY: the handler does nothing but store to an atomic, which a handler may.
        unsafe { sigaction(signal, &action) }.map_err(std::io::Error::from)?;
    }
    Ok(())
}
