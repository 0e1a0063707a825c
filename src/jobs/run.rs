//! A finished run and its record.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use rayon::prelude::*;

use super::assignment::{Assignment, Outcome};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::record::{ExactFlops, Report};
use super::spec_file::write_once;
use super::training::{Opened, share_done, trunk_state};
use super::{program, text, tokens, trunk};
use crate::codes::TokenStore;
use crate::data::Split;
use crate::files::atomic::{write_json, write_json_lines};
use crate::files::{FileError, read_if_there};
use crate::generator::{self, Inputs, Sums, Trained, losses_by_block};
use crate::learn::weights;
use crate::machine::peak::peak_bytes;
use crate::plan::{Plan, PlannedRun, RunSpec};
use crate::progress::{beats, progress};
use crate::sweep::Stage;

/// Trains a run from where it stands, or has a program of somebody's own do so; its record is
/// written whole, after everything else.
pub struct Run;

/// The weights of a finished run, in its folder.
pub const MODEL: &str = "model.safetensors";

/// The validation curve of a finished run, a line a measurement, in its folder.
pub const LOG: &str = "log.jsonl";

/// What a finished run has on each clip of the test split, a line a clip, in its folder.
pub const TEST_CLIPS: &str = "test.jsonl";

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Run);

impl Kind for Run {
    fn word(&self) -> &'static str {
        "run"
    }

    fn plural(&self) -> &'static str {
        "runs"
    }

    fn role(&self) -> &'static str {
        "the run"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("runs").join(id)
    }

    fn product(&self) -> &'static str {
        "record.json"
    }

    fn spec(&self, id: &str) -> PathBuf {
        self.folder(id).join("spec.json")
    }

    fn stage(&self) -> Stage {
        Stage::Train
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        let inputs = inputs(plan);
        let canary = canary(plan);
        let needs = |run: &PlannedRun| {
            let first = canary.filter(|canary| canary.run_id != run.run_id);
            let first = first.map(|canary| JobId::run(&canary.run_id));
            inputs.iter().cloned().chain(first).collect::<Vec<_>>()
        };
        plan.runs.par_iter().map(|run| job(run, needs(run), plan)).collect()
    }

    fn prepare(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        warn: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        for run in &plan.runs {
            let path = folder.file(self.spec(&run.run_id));
            let is_done = folder.product(&JobId::run(&run.run_id)).exists();
            if !is_done || !path.exists() {
                write_once(&path, &run.spec, warn)?;
            }
        }
        Ok(())
    }

    fn inspect(&self, folder: &ResultsFolder, id: &str) -> Result<(), FileError> {
        folder.record(id).map(|_| ())
    }

    /// A program of somebody's own keeps its checkpoint to itself: what it last said of its steps
    /// stands for it.
    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        let job = JobId::run(id);
        let Some(spec) = read_if_there::<RunSpec>(&folder.spec(&job)).ok().flatten() else {
            return 0.0;
        };
        let trunk = spec.trunk().map(|trunk| trunk.id());
        let told = || {
            let beat = progress(&folder.job(&job)).filter(|_| spec.trainer.is_some())?;
            Some((beat.step as f64 / beat.steps.max(1) as f64).clamp(0.0, 1.0))
        };
        share_done(folder, &job, &spec, trunk.as_deref()).or_else(told).unwrap_or(0.0)
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let spec: RunSpec = assignment.spec()?;
        if let Some(trainer) = &spec.trainer {
            if assignment.folder.tokens(&spec.tokenizer_id).exists() {
                Opened::new(assignment, &spec, None)?;
            }
            return program::run_program(assignment, &spec, trainer);
        }
        let trunk = spec.trunk().and_then(|trunk| trunk_state(assignment.folder, &trunk.id()));
        let opened = Opened::new(assignment, &spec, trunk)?;
        let place = assignment.place();
        let mut beats = beats(&place, assignment.stop);
        let trained = opened.train(|training| generator::train(training, &mut beats))?;
        let Some(trained) = trained else { return Ok(Outcome::Stopped) };
        write_results(assignment, &spec, &opened, &trained)?;
        Ok(Outcome::Done)
    }

    fn grace(&self, place: &Path) -> Duration {
        program::grace(place)
    }
}

/// What every run of a plan needs, but for its own codes and trunk, and the canary.
fn inputs(plan: &Plan) -> Vec<JobId> {
    plan.text.iter().map(|text| JobId::new(text::KIND, text.id())).collect()
}

/// The run that tries a program of somebody's own before the others: the cheapest.
fn canary(plan: &Plan) -> Option<&PlannedRun> {
    let cheapest = plan.runs.iter().min_by(|a, b| a.own_flops().total_cmp(&b.own_flops()));
    cheapest.filter(|_| plan.canary)
}

fn job(run: &PlannedRun, inputs: Vec<JobId>, plan: &Plan) -> Job {
    let codes = (!plan.tokenizers.is_empty()).then_some((tokens::KIND, &run.spec.tokenizer_id));
    let trunk = run.trunk_id.iter().map(|id| (trunk::KIND, id));
    let own = codes.into_iter().chain(trunk).map(|(kind, id)| JobId::new(kind, id));
    Job {
        id: JobId::run(&run.run_id),
        label: run.spec.label(),
        cost: run.own_flops(),
        // What a program of somebody's own takes is not known.
        peak_bytes: run.known_peak_bytes().unwrap_or(0),
        needs: inputs.into_iter().chain(own).collect(),
    }
}

/// What the built-in trainer says of a run.
fn report(device_name: &str, spec: &RunSpec, inputs: &Inputs, trained: &Trained) -> Report {
    let tokens = inputs.tokens;
    Report {
        device: device_name.to_string(),
        loss_nats: trained.test.loss_nats,
        loss_normalised: trained.test.loss_normalised,
        normalised_by_scale: trained.test.normalised_by_scale.clone(),
        normalised_by_block: by_block(tokens, &trained.test.clips),
        nats_per_frame: Some(trained.test.nats_per_frame),
        nats_per_second: None,
        tokens: None,
        unique_tokens: tokens.training_targets(spec.share),
        steps: None,
        batch_tokens: None,
        lr: None,
        flops_exact: ExactFlops::Counted(trained.flops_exact),
        zero_count_targets: tokens.zero_count_targets(),
        wall_s: trained.wall_s,
        tokens_per_s: None,
        peak_bytes: Some(peak_bytes()),
        params_nonvocab: None,
        params_vocab: None,
        params_text: None,
    }
}

/// L_u of each block of the test split; empty where the codes do not say which clips go together.
pub fn by_block(tokens: &TokenStore, clips: &[Sums]) -> Vec<f64> {
    let Some(groups) = tokens.groups(Split::Test) else { return Vec::new() };
    let frames = (0..groups.len()).map(|clip| tokens.clip_frames(Split::Test, clip));
    losses_by_block(clips, groups, &frames.collect::<Vec<_>>())
}

fn write_results(
    assignment: &Assignment,
    spec: &RunSpec,
    opened: &Opened,
    trained: &Trained,
) -> Result<()> {
    let place = assignment.place();
    weights::save(&place.join(MODEL), &trained.weights, Default::default())?;
    write_json_lines(&place.join(LOG), &trained.log)?;
    write_json_lines(&place.join(TEST_CLIPS), &trained.test.clips)?;
    let report = report(assignment.device_name, spec, &opened.inputs(), trained);
    let record = report.record(assignment.folder, &assignment.job.id, spec);
    write_json(&assignment.product(), &record)?;
    assignment.remove_checkpoint()?;
    Ok(())
}
