//! Trains runs, trunks and evaluators in a worker.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::assignment::{Assignment, Outcome, open_or_remake, train_past_damage};
use super::assignment::{LOG, MODEL, TEST_CLIPS, weights_notes};
use super::folder::ResultsFolder;
use super::job::{JobId, JobKind};
use super::program::{self, FinishedRun, TrainerResult};
use super::tokenizer::{embed_captions, make_codes};
use crate::codes::TokenStore;
use crate::data::MotionSource;
use crate::evaluator::{self, Course, Evaluator, EvaluatorReport, TrainedEvaluator, Verdict};
use crate::files::atomic::{write_json, write_json_lines};
use crate::generator::{self, GeneratorError, Inputs, ScaleInputs, Trained, Training};
use crate::learn::{Branch, Checkpoints, weights};
use crate::machine::peak_bytes;
use crate::plan::{EvaluatorJob, Trunk};
use crate::progress::beats;
use crate::spec::{EvaluatorSpec, RunSpec};
use crate::text::TextStore;
use crate::tokenizer::Tokenizer;

/// Trains a run from its last checkpoint, or starts the user's trainer; the record is written last, atomically.
pub fn train_run(assignment: &Assignment) -> Result<Outcome> {
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
    write_results(assignment, &spec, &opened, trained)?;
    assignment.done()
}

fn write_results(
    assignment: &Assignment,
    spec: &RunSpec,
    opened: &Opened,
    trained: Trained,
) -> Result<()> {
    let place = assignment.place();
    weights::save(&place.join(MODEL), &trained.weights, weights_notes(&assignment.job.id))?;
    if !trained.log.is_empty() {
        write_json_lines(&place.join(LOG), &trained.log)?;
    }
    write_json_lines(&place.join(TEST_CLIPS), &trained.test.clips)?;
    let result = TrainerResult {
        device: Some(assignment.device_name.to_string()),
        loss_nats: trained.test.loss_nats,
        loss_normalised: Some(trained.test.loss_normalised),
        normalised_by_scale: trained.test.normalised_by_scale,
        likeliest_exponential_entropy: trained.test.likeliest_exponential_entropy,
        clips: trained.test.clips,
        nats_per_frame: Some(trained.test.nats_per_frame),
        flops_exact: Some(trained.flops_exact),
        peak_bytes: Some(peak_bytes() as f64),
        ..TrainerResult::default()
    };
    let run = FinishedRun {
        folder: assignment.folder,
        id: &assignment.job.id,
        spec,
        tokens: Some(opened.inputs().tokens),
        max_text_tokens: 0,
        ran_s: trained.wall_s,
    };
    Ok(write_json(&assignment.product(), &run.record(&result))?)
}

/// Trains a trunk, from the one that it goes on from, up to where runs branch off.
pub fn train_trunk(assignment: &Assignment) -> Result<Outcome> {
    let Trunk { spec, from, .. } = assignment.spec()?;
    let state_of = |id: &String| {
        trunk_state(assignment.folder, id)
            .with_context(|| format!("the spec of trunk {id} is missing"))
    };
    let opened = Opened::new(assignment, &spec, from.as_ref().map(state_of).transpose()?)?;
    let state = assignment.product();
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = opened.train(|training| generator::train_trunk(training, &state, &mut beats))?;
    if trained.is_none() {
        return Ok(Outcome::Stopped);
    }
    assignment.done()
}

/// Trains an evaluator, from the checkpoint if that is whole, or loads it, and measures its gates; they are written
/// last.
pub fn train_evaluator(assignment: &Assignment) -> Result<Outcome> {
    let source = assignment.source()?;
    let EvaluatorJob { spec, data_digest, .. } = assignment.spec()?;
    if spec.loaded.is_some() {
        let loaded = loaded_evaluator(assignment, &spec, &*source)?;
        return judged(assignment, loaded, data_digest, &*source);
    }
    let (path, every) = (assignment.checkpoint(), assignment.checkpoint_every()?);
    let checkpoints = Checkpoints { path: &path, every, branch: None };
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = train_past_damage(&[&path], || {
        evaluator::train(&spec, &*source, assignment.device, Some(&checkpoints), &mut beats)
    })?;
    match trained {
        Some(trained) => judged(assignment, trained, data_digest, &*source),
        None => Ok(Outcome::Stopped),
    }
}

/// The evaluator in the folder that the sweep names.
fn loaded_evaluator(
    assignment: &Assignment,
    spec: &EvaluatorSpec,
    source: &dyn MotionSource,
) -> Result<TrainedEvaluator> {
    let folder = assignment.sweep()?.evaluator.and_then(|section| section.weights);
    let folder = folder.context("the sweep names no folder of an evaluator any more")?;
    let evaluator = Evaluator::converted(&folder, source, assignment.device)?;
    if evaluator.spec() != spec {
        bail!("{} holds another evaluator than when the sweep was planned", folder.display());
    }
    Ok(TrainedEvaluator { evaluator, course: Course::default() })
}

/// Saves an evaluator and its gates.
fn judged(
    assignment: &Assignment,
    TrainedEvaluator { evaluator, course }: TrainedEvaluator,
    data_digest: String,
    source: &dyn MotionSource,
) -> Result<Outcome> {
    evaluator.save(&assignment.place())?;
    let gates = evaluator::measure(&evaluator, source)?;
    let spec = evaluator.spec().clone();
    let verdicts = gates.verdicts_of(&spec);
    let report = EvaluatorReport {
        evaluator_id: assignment.job.id.clone(),
        n_parameters: evaluator.n_parameters(),
        passes: verdicts.iter().all(Verdict::is_enough),
        verdicts,
        spec,
        data_digest,
        course,
        gates,
    };
    write_json(&assignment.product(), &report)?;
    assignment.done()
}

// Shared by runs and trunks: inputs, and resuming.

/// The opened inputs of a run, and the path of its state.
pub struct Opened<'a> {
    assignment: &'a Assignment<'a>,
    spec: &'a RunSpec,
    tokens: TokenStore,
    text: TextStore,
    /// The tokenizer, if the generator makes codes scale by scale.
    tokenizer: Option<Tokenizer>,
    checkpoint: PathBuf,
    every: Duration,
    /// The state of the trunk that it goes on from, and the steps done there.
    trunk: Option<(PathBuf, usize)>,
}

impl<'a> Opened<'a> {
    /// Opens the inputs of a run; damaged ones are remade first.
    ///
    /// # Errors
    /// It can neither be opened nor made.
    pub fn new(
        assignment: &'a Assignment<'a>,
        spec: &'a RunSpec,
        trunk: Option<(PathBuf, usize)>,
    ) -> Result<Self> {
        let tokens = JobId::new(JobKind::Tokens, &spec.tokenizer_id);
        let text = JobId::new(JobKind::Text, &spec.text_id);
        let wants_scales = generator::of(spec).wants_scales();
        let tokenizer = assignment.folder.tokenizer(&spec.tokenizer_id);
        let load = || Tokenizer::load(&tokenizer, assignment.device);
        Ok(Self {
            tokens: open_or_remake(assignment, &tokens, TokenStore::open, make_codes)?,
            text: open_or_remake(assignment, &text, TextStore::open, embed_captions)?,
            tokenizer: wants_scales.then(load).transpose().context("opening its tokenizer")?,
            checkpoint: assignment.checkpoint(),
            every: assignment.checkpoint_every()?,
            assignment,
            spec,
            trunk,
        })
    }

    /// The inputs of the run.
    pub fn inputs(&self) -> Inputs<'_> {
        let scales = self.tokenizer.as_ref().map(|tokenizer| tokenizer as &dyn ScaleInputs);
        Inputs { tokens: &self.tokens, text: &self.text, scales }
    }

    /// Trunks shorten the way and change no result, so one that is gone is done without.
    fn checkpoints(&self) -> Checkpoints<'_> {
        let trunk = self.trunk.as_ref().filter(|(state, _)| state.exists());
        let branch = trunk.map(|(state, steps)| Branch { state, steps: *steps });
        Checkpoints { path: &self.checkpoint, every: self.every, branch }
    }

    /// Trains; if the checkpoint or the trunk is damaged, trains again without it. `None` if stopped.
    ///
    /// # Errors
    /// Training failed, or what it read changed meanwhile.
    pub fn train<T>(
        &self,
        mut train: impl FnMut(&Training) -> Result<T, GeneratorError>,
    ) -> Result<Option<T>> {
        let trunk = self.trunk.iter().map(|(state, _)| state.as_path());
        let states: Vec<&Path> = trunk.chain([self.checkpoint.as_path()]).collect();
        let trained = train_past_damage(&states, || {
            let (inputs, checkpoints) = (self.inputs(), self.checkpoints());
            let (spec, device) = (self.spec, self.assignment.device);
            train(&Training { spec, inputs: &inputs, device, checkpoints: &checkpoints })
        })?;
        self.tokens.unchanged()?;
        self.text.unchanged()?;
        Ok(trained)
    }
}

/// The state of a trunk and its steps, as its spec says.
pub fn trunk_state(folder: &ResultsFolder, trunk_id: &str) -> Option<(PathBuf, usize)> {
    let job = JobId::new(JobKind::Trunk, trunk_id);
    let trunk: Trunk = folder.known_spec(&job)?;
    Some((folder.product(&job), trunk.spec.steps))
}
