//! The motions of a run, scored.

mod made;
mod run_scores;
mod samples;
mod scoring;

use std::collections::HashMap;
use std::path::PathBuf;

use anyhow::{Context, Result};

pub use run_scores::{RunScores, ScoredPhysics};
use samples::write_samples;
pub use scoring::Scoring;

use super::assignment::{Assignment, Outcome};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::spec_file::write_once;
use super::trained::TrainedRun;
use super::trusted_evaluator::TrustedEvaluator;
use super::{evaluator, folder};
use crate::evaluator::OneScore;
use crate::files::atomic::write_json;
use crate::files::{FileError, read_if_there};
use crate::plan::{Plan, PlannedRun, ScoreJob, evaluator_peak_bytes};
use crate::progress::{Step, beats};
use crate::sweep::Stage;

/// Makes motions of a run and scores them; the scores are written last.
pub struct Score;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Score);

/// FLOPs that a motion counts for, as a multiple of the model's parameters: a forward pass a code.
const FLOPS_PER_PARAMETER: f64 = 2.0 * 49.0;

impl Kind for Score {
    fn word(&self) -> &'static str {
        "score"
    }

    fn plural(&self) -> &'static str {
        "scores"
    }

    fn role(&self) -> &'static str {
        "its score"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("scores").join(id)
    }

    fn product(&self) -> &'static str {
        "scores.json"
    }

    fn spec(&self, id: &str) -> PathBuf {
        self.folder(id).join("job.json")
    }

    fn stage(&self) -> Stage {
        Stage::Train
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        if plan.scores.is_empty() {
            return Vec::new();
        }
        let runs: HashMap<&str, &PlannedRun> =
            plan.runs.iter().map(|run| (run.run_id.as_str(), run)).collect();
        let of = |score: &ScoreJob| Some(job(score, runs.get(score.run_id.as_str())?, plan));
        plan.scores.iter().filter_map(of).collect()
    }

    fn prepare(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        warn: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        let write = |job: &ScoreJob| write_once(&folder.file(self.spec(&job.id())), job, warn);
        plan.scores.iter().try_for_each(write)
    }

    fn inspect(&self, folder: &ResultsFolder, id: &str) -> Result<(), FileError> {
        folder.scores(id).map(|_| ())
    }

    fn is_result(&self) -> bool {
        true
    }

    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        let job = JobId::new(KIND, id);
        let spec = read_if_there::<ScoreJob>(&folder.spec(&job)).ok().flatten();
        let done = read_if_there::<Vec<OneScore>>(&repeats_file(folder, &job)).ok().flatten();
        let share =
            |(done, job): (Vec<OneScore>, ScoreJob)| done.len() as f64 / job.spec.repeats as f64;
        done.zip(spec).map_or(0.0, share)
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let job: ScoreJob = assignment.spec()?;
        let trusted =
            TrustedEvaluator::of(assignment.folder, &job.evaluator_id, assignment.device)?;
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
        assignment.remove_checkpoint()?;
        Ok(Outcome::Done)
    }
}

fn job(score: &ScoreJob, run: &PlannedRun, plan: &Plan) -> Job {
    let [.., test] = plan.data.clips;
    let ScoreJob { run_id, evaluator_id, spec, .. } = score;
    let motions = spec.repeats * test + spec.multimodal_captions * spec.multimodal_motions;
    let evaluator = plan.evaluator.as_ref();
    let evaluating = evaluator.map_or(0, |job| evaluator_peak_bytes(&job.spec, &plan.data));
    Job {
        id: JobId::new(KIND, score.id()),
        label: format!("score of {}", run.spec.label()),
        cost: motions as f64 * run.params.total() as f64 * FLOPS_PER_PARAMETER,
        // A batch of motions in the making takes less than a step of training, and true motions are
        // held as for the evaluator's gates.
        peak_bytes: run.peak_bytes + evaluating,
        needs: vec![JobId::run(run_id), JobId::new(evaluator::KIND, evaluator_id)],
    }
}

/// The repeats that are done of a job that is not.
fn repeats_file(folder: &ResultsFolder, job: &JobId) -> PathBuf {
    folder.job(job).join(folder::CHECKPOINT).join("repeats.json")
}
