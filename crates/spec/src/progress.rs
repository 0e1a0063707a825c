//! Progress of running work, and requests to stop.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::progress::Stop;
//!
//! let stop = Stop::default();
//! let asked_elsewhere = stop.clone();
//! asked_elsewhere.raise();
//! assert!(stop.is_raised());
//! ```

use crate::failure::Failure;
use crate::files::read_if_there;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

// Progress of running work, by which a scheduler distinguishes slow work from hanging work.
//
// Training reports its steps ([`Progress`]). Work without steps (reading, tokenising, embedding, measuring) counts
// finished pieces, so [their number](pieces) stops changing when the work hangs.

/// A training step just done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Counted from 1.
    pub step: usize,
    /// The total number of steps.
    pub steps: usize,
    /// Before the update.
    pub loss: f64,
    /// Time of the step, without evaluation and checkpoint.
    pub seconds: f64,
}

/// Called after each step; may ask for a stop.
pub type Progress<'a> = dyn FnMut(Step) -> ControlFlow<()> + 'a;

static MOVED: AtomicU64 = AtomicU64::new(0);

/// A piece of work is done: a clip read, a batch measured.
pub fn moved() {
    MOVED.fetch_add(1, Ordering::Relaxed);
}

/// Pieces done so far.
pub fn pieces() -> u64 {
    MOVED.load(Ordering::Relaxed)
}

// [`Beat`]: how far a worker is, on its standard output and in its folder.

/// A progress line of a worker.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beat {
    pub step: usize,
    pub steps: usize,
    pub loss: f64,
    /// Seconds that this process has spent in steps.
    #[serde(default)]
    pub train_s: f64,
    /// As reported by a user's trainer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens_per_s: Option<f64>,
}

/// A line that a worker prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Said {
    Beat(Beat),
    /// Why it ends without a result.
    Failure(Failure),
    /// Pieces of work done that are no steps.
    Moved {
        moved: u64,
    },
}

impl Said {
    /// Prints it; a closed pipe is ignored.
    pub fn say(&self) {
        let line = serde_json::to_string(self).expect("plain values");
        let _ = writeln!(std::io::stdout(), "{line}");
    }
}

/// Least time between reports of work without steps.
const TELL: Duration = Duration::from_millis(200);

/// Reports finished pieces of work, if there are new ones.
pub fn tell_of_pieces() {
    std::thread::spawn(|| {
        let mut told = 0;
        loop {
            std::thread::sleep(TELL);
            let moved = pieces();
            if moved != told {
                told = moved;
                Said::Moved { moved }.say();
            }
        }
    });
}

/// The file in which a worker notes its progress, for readers without its pipe.
const PROGRESS: &str = ".progress.json";

/// Time between notes.
const NOTE: Duration = Duration::from_millis(500);

/// Notes how far a worker is in its folder: whole, by rename, but not flushed to disk, since the
/// note means nothing once its writer is gone. That it cannot be written stops no work.
pub fn note_progress(place: &Path, beat: &Beat) {
    let partial = place.join(".partial-progress");
    let text = serde_json::to_string(beat).expect("plain values");
    let noted = fs::write(&partial, text).and_then(|()| fs::rename(&partial, place.join(PROGRESS)));
    if noted.is_err() {
        let _ = fs::remove_file(partial);
    }
}

/// The last note of [`note_progress`].
pub fn progress(place: &Path) -> Option<Beat> {
    read_if_there(&place.join(PROGRESS)).ok().flatten()
}

/// Takes the note away.
pub fn forget_progress(place: &Path) {
    let _ = fs::remove_file(place.join(PROGRESS));
}

/// Prints a beat a tenth of a second at most, and the last one for sure; notes one in the folder
/// less often; asks for an end once `stop` is raised.
pub fn beats(place: &Path, stop: &Stop) -> impl FnMut(Step) -> ControlFlow<()> + use<> {
    let (place, stop) = (place.to_path_buf(), stop.clone());
    let (mut printed, mut noted) = (None::<Instant>, None::<Instant>);
    let mut train_s = 0.0;
    let due = |last: &mut Option<Instant>, every: Duration| {
        let due = last.is_none_or(|last| last.elapsed() > every);
        if due {
            *last = Some(Instant::now());
        }
        due
    };
    move |Step { step, steps, loss, seconds }| {
        train_s += seconds;
        let beat = Beat { step, steps, loss, train_s, tokens_per_s: None };
        let stopped = stop.is_raised();
        if due(&mut printed, Duration::from_millis(100)) || stopped || step == steps {
            Said::Beat(beat).say();
        }
        if due(&mut noted, NOTE) {
            note_progress(&place, &beat);
        }
        if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

// [`Stop`]: one flag that Ctrl-C, a closed pipe or a caller can raise.

/// A request to end in good order; clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks for an end.
    pub fn raise(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether a stop was requested.
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

/// A line of `log.jsonl`: a run measured on the validation split.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLine {
    pub step: usize,
    /// Supervised tokens so far.
    pub tokens: usize,
    pub lr: f64,
    /// Mean cross-entropy of the steps since the last line, in nats.
    pub train_loss_nats: f64,
    /// L_u on the validation split.
    pub val_loss_normalised: f64,
}
