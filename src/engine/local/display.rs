//! [`Display`]: progress bars on a terminal, one per slot and one for the whole; plain lines elsewhere.

use std::collections::HashMap;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::engine::runner::JobEnd;
use crate::jobs::Job;
use crate::progress::Beat;

/// Shows how far a sweep is.
pub struct Display {
    how: How,
    /// Estimated seconds left, from the folder.
    time_left: TimeLeft,
    estimate: Mutex<Estimate>,
    /// FLOPs of all jobs.
    total: f64,
    progress: Mutex<Progress>,
    jobs: usize,
}

type TimeLeft = Box<dyn Fn() -> Option<f64> + Send + Sync>;

/// The last estimate, when it was made, and how long that took.
#[derive(Default)]
struct Estimate {
    seconds: Option<f64>,
    made: Option<(Instant, Duration)>,
}

/// Least time between two estimates; many times the cost of one.
const EVERY: Duration = Duration::from_secs(2);
const TIMES: u32 = 50;

impl Estimate {
    fn seconds(&mut self, time_left: &TimeLeft) -> Option<f64> {
        let is_due = |(at, took): (Instant, Duration)| at.elapsed() > EVERY.max(TIMES * took);
        if self.made.is_none_or(is_due) {
            let began = Instant::now();
            self.seconds = time_left();
            self.made = Some((Instant::now(), began.elapsed()));
        }
        let age = self.made.map_or(0.0, |(at, _)| at.elapsed().as_secs_f64());
        self.seconds.map(|seconds| (seconds - age).max(0.0))
    }
}

#[derive(Default)]
struct Progress {
    /// FLOPs of ended jobs, and of running ones so far by slot.
    ended: f64,
    running: HashMap<usize, f64>,
    jobs_ended: usize,
}

enum How {
    Hidden,
    Lines,
    Bars { slots: Vec<ProgressBar>, whole: ProgressBar },
}

impl Display {
    /// Bars where standard error is a terminal, lines where not.
    pub fn new(
        jobs: &[Job],
        slots: usize,
        quiet: bool,
        time_left: impl Fn() -> Option<f64> + Send + Sync + 'static,
    ) -> Self {
        let how = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => How::Hidden,
            (false, false) => How::Lines,
            (false, true) => bars(slots),
        };
        Self {
            how,
            time_left: Box::new(time_left),
            estimate: Mutex::default(),
            total: jobs.iter().map(|job| job.cost).sum(),
            progress: Mutex::default(),
            jobs: jobs.len(),
        }
    }

    /// A slot takes up a job.
    pub fn started(&self, slot: usize, job: &Job) {
        if let How::Bars { slots, .. } = &self.how {
            slots[slot].reset();
            slots[slot].set_message(job.label.clone());
        }
    }

    /// A job reports how far it is.
    pub fn beat(&self, slot: usize, job: &Job, beat: &Beat) {
        let share = beat.step as f64 / beat.steps.max(1) as f64;
        self.lock().running.insert(slot, share * job.cost);
        if let How::Bars { slots, .. } = &self.how {
            slots[slot].set_length(beat.steps as u64);
            slots[slot].set_position(beat.step as u64);
            slots[slot].set_message(format!("{} · loss {:.3}", job.label, beat.loss));
            self.draw_whole();
        }
    }

    /// A slot is done with a job.
    pub fn ended(&self, slot: usize, job: &Job, end: &JobEnd) {
        let number = {
            let mut progress = self.lock();
            progress.running.remove(&slot);
            progress.ended += job.cost;
            progress.jobs_ended += 1;
            progress.jobs_ended
        };
        let failure = end.failure();
        let line = match failure {
            Some(failure) => format!("{} FAILED ({}): {}", job.label, end.word(), failure.reason),
            None => format!("{} {}", job.label, end.word()),
        };
        match &self.how {
            How::Lines => say(&format!("[{number}/{}] {line}{}", self.jobs, self.eta())),
            How::Bars { whole, .. } if failure.is_some() => whole.println(line),
            _ => {}
        }
        self.draw_whole();
    }

    /// A slot has nothing more to do.
    pub fn idle(&self, slot: usize) {
        if let How::Bars { slots, .. } = &self.how {
            slots[slot].finish_and_clear();
        }
    }

    /// A line that should not be missed.
    pub fn warn(&self, line: &str) {
        let line = format!("warning: {line}");
        if let How::Bars { whole, .. } = &self.how { whole.println(line) } else { say(&line) }
    }

    /// Takes the bars away.
    pub fn clear(&self) {
        if let How::Bars { whole, .. } = &self.how {
            whole.finish_and_clear();
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Progress> {
        self.progress.lock().expect("nothing panics while it holds this")
    }

    fn draw_whole(&self) {
        if let How::Bars { whole, .. } = &self.how {
            let (done, ended) = {
                let progress = self.lock();
                (progress.ended + progress.running.values().sum::<f64>(), progress.jobs_ended)
            };
            let share = if self.total > 0.0 { done / self.total } else { 1.0 };
            whole.set_position((1000.0 * share) as u64);
            whole.set_message(format!("{ended}/{} jobs{}", self.jobs, self.eta()));
        }
    }

    /// `, 3 min left`, until all has ended.
    fn eta(&self) -> String {
        if self.lock().jobs_ended == self.jobs {
            return String::new();
        }
        let mut estimate = self.estimate.lock().expect("nothing panics while it holds this");
        let seconds = estimate.seconds(&self.time_left).filter(|seconds| *seconds > 0.0);
        seconds.map(|seconds| format!(", {}", left(seconds))).unwrap_or_default()
    }
}

/// `3 min left`, of seconds.
pub fn left(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s left"),
        s if s < 5400.0 => format!("{:.0} min left", s / 60.0),
        s => format!("{:.1} h left", s / 3600.0),
    }
}

/// Prints a line on standard error; a closed pipe is ignored.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

fn bars(slots: usize) -> How {
    let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(8));
    let bar = |length, template| {
        let style = ProgressStyle::with_template(template).expect("a valid template");
        all.add(ProgressBar::new(length).with_style(style.progress_chars("━╸ ")))
    };
    let slots = (0..slots).map(|_| bar(1, "  {bar:16} {wide_msg}")).collect();
    How::Bars { slots, whole: bar(1000, "{bar:18} {percent:>3} % {wide_msg}") }
}
