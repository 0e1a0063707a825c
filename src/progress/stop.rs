//! [`Stop`]: one flag that Ctrl-C, a closed pipe or a caller can raise.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// A request to end in good order; clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks for an end.
    pub fn raise(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether somebody asked.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// The process's flag, raised by SIGINT, SIGTERM and SIGHUP; a second signal ends the process at once.
pub fn stop_on_signals() -> Result<Stop, ctrlc::Error> {
    static STOP: OnceLock<Stop> = OnceLock::new();
    if let Some(stop) = STOP.get() {
        return Ok(stop.clone());
    }
    let raised = Stop::default();
    let stop = raised.clone();
    ctrlc::set_handler(move || {
        if raised.is_raised() {
            std::process::exit(130);
        }
        raised.raise();
    })?;
    Ok(STOP.get_or_init(|| stop).clone())
}
