//! [`Stop`]: one flag that Ctrl-C, a closed pipe or a caller can raise.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// A flag raised by SIGINT, SIGTERM and SIGHUP; a second signal ends the process at once.
pub fn stop_on_signals() -> Result<Stop, ctrlc::Error> {
    let stop = Stop::default();
    let raised = stop.clone();
    ctrlc::set_handler(move || {
        if raised.is_raised() {
            std::process::exit(130);
        }
        raised.raise();
    })?;
    Ok(stop)
}
