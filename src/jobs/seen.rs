//! Progress of jobs, read from their folders.

use serde::Serialize;

use super::folder::{CHECKPOINT, JobState, ResultsFolder};
use super::job::{JobId, JobKind};
use super::presence::is_locked;
use super::score::repeats_file;
use super::training::trunk_state;
use crate::evaluator::OneScore;
use crate::files::read_if_there;
use crate::learn::step_of;
use crate::plan::{EvaluatorJob, ScoreJob, Trunk};
use crate::progress::{Beat, progress};
use crate::spec::{RunSpec, TokenizerJob};
use crate::tokenizer::share_kept;

/// Jobs by how far they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub done: usize,
    pub failed: usize,
    /// A worker is at it now.
    pub running: usize,
    /// Interrupted, with a checkpoint to go on from.
    pub started: usize,
    pub missing: usize,
    /// Among the missing: jobs that need something that failed, which are not started.
    pub blocked: usize,
}

impl Counts {
    /// All of them.
    pub fn total(&self) -> usize {
        self.done + self.failed + self.running + self.started + self.missing
    }

    /// Counts a job.
    pub(super) fn add(&mut self, seen: Seen, is_lost: bool) {
        self.blocked += usize::from(is_lost && seen.is_open());
        *match seen {
            Seen::At(JobState::Done) => &mut self.done,
            Seen::At(JobState::Failed) => &mut self.failed,
            Seen::At(JobState::Started) | Seen::Started(_) => &mut self.started,
            Seen::At(JobState::Missing) => &mut self.missing,
            Seen::Running(..) => &mut self.running,
        } += 1;
    }
}

/// The state of a job's folder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen {
    At(JobState),
    /// The share that its checkpoint holds.
    Started(f64),
    /// Its last progress line, and the progress in its checkpoint.
    Running(Option<Beat>, f64),
}

impl Seen {
    /// Looks at a job.
    pub fn at(folder: &ResultsFolder, job: &JobId) -> Self {
        let state = folder.state(job);
        let unfinished = matches!(state, JobState::Missing | JobState::Started);
        let place = folder.job(job);
        let share_done = || share_done(folder, job).unwrap_or(0.0);
        match state {
            _ if unfinished && is_locked(&place) => match progress(&place) {
                Some(beat) => Seen::Running(Some(beat), 0.0),
                None => Seen::Running(None, share_done()),
            },
            JobState::Started => Seen::Started(share_done()),
            state => Seen::At(state),
        }
    }

    /// Whether there is something to do.
    pub fn is_open(self) -> bool {
        !matches!(self, Self::At(JobState::Done | JobState::Failed))
    }

    /// The share of the job that is done.
    pub fn done(self) -> f64 {
        match self {
            Self::At(JobState::Done) => 1.0,
            Self::Running(Some(beat), _) => beat_share(&beat).min(1.0),
            Self::Running(None, share) | Self::Started(share) => share,
            Self::At(_) => 0.0,
        }
    }

    /// The share of the job that the next hours hold: nothing of one that failed.
    pub fn left(self) -> f64 {
        if self == Self::At(JobState::Failed) { 0.0 } else { 1.0 - self.done() }
    }
}

/// The share of its steps that a job has done, as it says.
fn beat_share(beat: &Beat) -> f64 {
    beat.step as f64 / beat.steps.max(1) as f64
}

/// The fraction of a job's steps in its checkpoint; `None` if unknown.
fn share_done(folder: &ResultsFolder, job: &JobId) -> Option<f64> {
    let of = |steps: usize| Some(step_of(&folder.checkpoint(job))? as f64 / steps as f64);
    match job.kind {
        JobKind::Text => None,
        JobKind::Tokenizer => of(folder.known_spec::<TokenizerJob>(job)?.spec.training.steps),
        JobKind::Tokens => Some(share_kept(&folder.job(job).join(CHECKPOINT))),
        JobKind::Trunk => {
            let trunk: Trunk = folder.known_spec(job)?;
            own_share(folder, job, &trunk.spec, trunk.from.as_deref())
        }
        JobKind::Run => {
            let spec: RunSpec = folder.known_spec(job)?;
            let trunk = spec.trunk().map(|trunk| trunk.id());
            // The checkpoint of a user's trainer is opaque: its last progress line is used.
            let told = || {
                let beat = progress(&folder.job(job)).filter(|_| spec.trainer.is_some())?;
                Some(beat_share(&beat).clamp(0.0, 1.0))
            };
            own_share(folder, job, &spec, trunk.as_deref()).or_else(told)
        }
        JobKind::Evaluator => of(folder.known_spec::<EvaluatorJob>(job)?.spec.steps),
        JobKind::Score => {
            let done: Vec<OneScore> = read_if_there(&repeats_file(folder, job)).ok().flatten()?;
            let repeats = folder.known_spec::<ScoreJob>(job)?.spec.repeats;
            Some(done.len() as f64 / repeats as f64)
        }
    }
}

/// The fraction of its own steps in a run's or a trunk's checkpoint, if it starts from the trunk of an id.
fn own_share(
    folder: &ResultsFolder,
    job: &JobId,
    spec: &RunSpec,
    from: Option<&str>,
) -> Option<f64> {
    let step = step_of(&folder.checkpoint(job))?;
    let trunk = from.and_then(|id| trunk_state(folder, id));
    let before = trunk.filter(|(state, _)| state.exists()).map_or(0, |(_, steps)| steps);
    let [done, all] = [step, spec.steps].map(|end| end.saturating_sub(before) as f64);
    Some((done / all.max(1.0)).clamp(0.0, 1.0))
}
