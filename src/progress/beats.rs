//! [`Beat`]: how far a worker is, on its standard output and in its folder.

use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::files::read_if_there;
use crate::progress::{Step, Stop, pieces};

/// What a worker prints, a line each: how far it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beat {
    pub step: usize,
    pub steps: usize,
    pub loss: f64,
    /// Seconds that this process has spent in steps.
    #[serde(default)]
    pub train_s: f64,
    /// As a user's trainer tells it.
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
    /// Prints it; whether anybody still listens is no concern of the work.
    pub fn say(&self) {
        let line = serde_json::to_string(self).expect("plain values");
        let _ = writeln!(std::io::stdout(), "{line}");
    }
}

/// How often a worker tells of work that has no steps, at most.
const TELL: Duration = Duration::from_millis(200);

/// Tells of pieces of work that are done, as they are: where none is, nothing is said.
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

/// Where a worker notes how far it is, for those who do not read its pipe.
const PROGRESS: &str = ".progress.json";

/// How often it does.
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

/// What [`note_progress`] wrote last.
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
