//! The motions of a run, scored.

mod made;
mod run_scores;
mod samples;
mod scoring;

use std::path::PathBuf;

use anyhow::{Context, Result};

pub use run_scores::{RunScores, ScoredPhysics};
use samples::write_samples;
pub use scoring::Scoring;

use super::assignment::{Assignment, Outcome};
use super::folder::{CHECKPOINT, ResultsFolder};
use super::id::JobId;
use super::trained::TrainedRun;
use super::trusted_evaluator::TrustedEvaluator;
use crate::evaluator::OneScore;
use crate::files::atomic::write_json;
use crate::files::read_if_there;
use crate::plan::ScoreJob;
use crate::progress::{Step, beats};

/// Makes motions of a run and scores them; the scores are written last.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let job: ScoreJob = assignment.spec()?;
    let trusted = TrustedEvaluator::of(assignment.folder, &job.evaluator_id, assignment.device)?;
    let (evaluator, truth) = (&trusted.evaluator, trusted.truth()?);
    let run = TrainedRun::open(&assignment.folder.run(&job.run_id), assignment.device)
        .context("opening the run")?;
    let scoring = Scoring::new(&run, evaluator, &truth, &job.spec)?;
    let path = repeats_file(assignment.folder, assignment.job);
    let mut done: Vec<OneScore> = read_if_there(&path).ok().flatten().unwrap_or_default();
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    while done.len() < job.spec.repeats {
        let began = std::time::Instant::now();
        done.push(scoring.repeat(done.len())?);
        write_json(&path, &done)?;
        let (step, steps) = (done.len(), job.spec.repeats);
        let (loss, seconds) = (done[step - 1].fid, began.elapsed().as_secs_f64());
        if beats(Step { step, steps, loss, seconds }).is_break() && step < steps {
            return Ok(Outcome::Stopped);
        }
    }
    write_samples(&scoring)?;
    write_json(&assignment.product(), &scoring.finish(&done, &job.evaluator_id)?)?;
    assignment.done()
}

/// The repeats that are done of a job that is not.
pub fn repeats_file(folder: &ResultsFolder, job: &JobId) -> PathBuf {
    folder.job(job).join(CHECKPOINT).join("repeats.json")
}
