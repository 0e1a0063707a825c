//! Jobs of a worker: embedding captions, training a tokenizer, and tokenising a data set; and [`TrainedTokenizer`],
//! opened.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;

use super::assignment::{
    Assignment, Outcome, open_or_remake, put_away, spec_of, train_past_damage,
};
use super::folder::{CHECKPOINT, ResultsFolder};
use super::job::{JobId, JobKind, captions};
use super::program;
use super::trained::{find_run, folder_and_id};
use crate::codes::TokenStore;
use crate::codes::TokenizerMetrics;
use crate::data::{self, Split};
use crate::files::atomic::{write_json, write_json_lines};
use crate::learn::Checkpoints;
use crate::motion::N_FEATURES;
use crate::plan::TextJob;
use crate::progress::beats;
use crate::spec::{RunSpec, TokenizerJob, TokenizerSpec};
use crate::text::{self, TextEncoder, TextError, TextStore, as_in_data};
use crate::tokenizer::{self, Corpus, Parts, Reconstruction, Tokenizer, Validated};

/// Embeds every caption of the data once.
pub fn embed_captions(assignment: &Assignment) -> Result<Outcome> {
    let (spec, source) = (assignment.sweep()?.text, assignment.source()?);
    let encoder = text::encoder(&spec)?;
    let found = TextJob::new(&spec, source.digest(), encoder.digest());
    if let Some(file) = spec.path.filter(|_| found.id() != assignment.job.id) {
        return Err(TextError::Changed { file }.into());
    }
    text::embed(&*encoder, &*source, &assignment.product())?;
    Ok(Outcome::Done)
}

/// Trains a tokenizer and measures it; metrics are written last.
pub fn train(assignment: &Assignment) -> Result<Outcome> {
    let started = Instant::now();
    let place = assignment.place();
    let (source, text) = (assignment.source()?, open_text(assignment)?);
    let corpus = Corpus { source: &*source, text: text.as_ref() };
    let (tokenizer, log) = match trained(assignment, &corpus)? {
        ControlFlow::Continue(trained) => trained,
        ControlFlow::Break(ended) => return Ok(ended),
    };
    text.as_ref().map_or(Ok(()), TextStore::unchanged)?;
    tokenizer.save(&place)?;
    if !log.is_empty() {
        write_json_lines(&place.join("log.jsonl"), &log)?;
    }
    let wall_s = started.elapsed().as_secs_f64();
    let metrics = tokenizer::evaluate(&tokenizer, &corpus, &assignment.job.id, wall_s)?;
    let k_means = tokenizer::k_means_baseline(tokenizer.spec(), &*source, assignment.device)?;
    let train_steps = tokenizer::best(&log).map_or(metrics.train_steps, |line| line.step);
    let metrics = TokenizerMetrics { k_means, train_steps, ..metrics };
    write_json(&assignment.product(), &metrics)?;
    assignment.done()
}

/// The captions for the tokenizer of an assignment; damaged ones are remade first.
///
/// # Errors
/// They can neither be opened nor made.
fn open_text(assignment: &Assignment) -> Result<Option<TextStore>> {
    let needed = captions(&assignment.spec::<TokenizerJob>()?);
    needed
        .map(|text| open_or_remake(assignment, &text, TextStore::open, embed_captions))
        .transpose()
}

/// A tokenizer with its validation results; or the end of the job without one.
type MadeHere = ControlFlow<Outcome, (Tokenizer, Vec<Validated>)>;

/// Trains by the trainer of the spec.
fn trained(assignment: &Assignment, corpus: &Corpus) -> Result<MadeHere> {
    let job = assignment.spec::<TokenizerJob>()?;
    if job.spec.trainer.is_built_in() {
        return trained_here(&job.spec, assignment, corpus);
    }
    let text = captions(&job).map(|text| assignment.folder.product(&text));
    let made = program::train_tokenizer(assignment, &job, corpus, text)?;
    Ok(made.map_continue(|tokenizer| (tokenizer, Vec::new())))
}

/// Trains from the checkpoint, or from the beginning if that is damaged.
fn trained_here(
    spec: &TokenizerSpec,
    assignment: &Assignment,
    corpus: &Corpus,
) -> Result<MadeHere> {
    let (path, every) = (assignment.checkpoint(), assignment.checkpoint_every()?);
    let checkpoints = Checkpoints { path: &path, every, branch: None };
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = train_past_damage(&[&path], || {
        tokenizer::train_watched(spec, corpus, assignment.device, Some(&checkpoints), &mut beats)
    })?;
    Ok(trained.map_or(ControlFlow::Break(Outcome::Stopped), ControlFlow::Continue))
}

/// Turns every clip of the data into codes.
pub fn make_codes(assignment: &Assignment) -> Result<Outcome> {
    let tokenizer = match load_or_retrain(assignment)? {
        ControlFlow::Continue(tokenizer) => tokenizer,
        ControlFlow::Break(ended) => return Ok(ended),
    };
    let (source, text) = (assignment.source()?, open_text(assignment)?);
    let corpus = Corpus { source: &*source, text: text.as_ref() };
    let kept = assignment.place().join(CHECKPOINT);
    let parts = Parts { folder: &kept, stop: assignment.stop };
    let Some(()) = tokenizer::tokenize(&tokenizer, &corpus, &assignment.product(), parts)? else {
        return Ok(Outcome::Stopped);
    };
    assignment.done()
}

/// The trained tokenizer; if its files are damaged it is trained again here. `Break` if that gives none,
/// and how it ended.
fn load_or_retrain(assignment: &Assignment) -> Result<ControlFlow<Outcome, Tokenizer>> {
    let job = JobId::new(JobKind::Tokenizer, &assignment.job.id);
    let place = assignment.folder.job(&job);
    let error = match Tokenizer::load(&place, assignment.device) {
        Ok(tokenizer) => return Ok(ControlFlow::Continue(tokenizer)),
        Err(error) => error,
    };
    let Some(file) = error.damaged_file() else { return Err(error.into()) };
    put_away(&place.join("weights.safetensors"), file, "the tokenizer is trained again")?;
    Ok(match train(&assignment.of(&job))? {
        Outcome::Done => ControlFlow::Continue(Tokenizer::load(&place, assignment.device)?),
        ended => ControlFlow::Break(ended),
    })
}

/// A trained tokenizer, with the text encoder of its captions.
pub struct TrainedTokenizer {
    /// The name of its folder.
    pub id: String,
    /// The folder of its sweep.
    pub folder: ResultsFolder,
    pub tokenizer: Tokenizer,
    /// For a tokenizer with language.
    encoder: Option<Box<dyn TextEncoder>>,
}

impl TrainedTokenizer {
    /// Opens the tokenizer of a run's folder, or, for a sweep's folder, of the run with the lowest L_u.
    ///
    /// # Errors
    /// There is no such run, it has not ended, or a file that is needed is missing or damaged.
    pub fn of_run(path: &Path, device: &Device) -> Result<Self> {
        let (folder, run_id) = find_run(path)?;
        let spec: RunSpec = spec_of(&folder, &JobId::run(&run_id))?;
        Self::open(&folder.tokenizer(&spec.tokenizer_id), device)
    }

    /// Opens a tokenizer's folder, `…/tokenizers/<id>`.
    ///
    /// # Errors
    /// It holds no tokenizer, or a file that is needed is missing or damaged.
    pub fn open(place: &Path, device: &Device) -> Result<Self> {
        if !place.join("tokenizer.json").is_file() {
            bail!(
                "{} holds no trained tokenizer; give `tokenizers/<id>` of a sweep's folder",
                place.display()
            );
        }
        let tokenizer = Tokenizer::load(place, device)
            .with_context(|| format!("opening the tokenizer in {}", place.display()))?;
        let (folder, id) = folder_and_id(place)?;
        let language = tokenizer.spec().architecture.language().is_some();
        let encoder = if language { Some(encoder_of(&folder)?) } else { None };
        Ok(Self { id, folder, tokenizer, encoder })
    }

    /// Whether it sees captions.
    pub fn has_language(&self) -> bool {
        self.encoder.is_some()
    }

    /// The codes that it has made of its data.
    ///
    /// # Errors
    /// There are none, or they are damaged.
    pub fn tokens(&self) -> Result<TokenStore> {
        let path = self.folder.tokens(&self.id);
        if !path.is_file() {
            bail!("{} is not there: `isoflop run` makes the codes of the data", path.display());
        }
        Ok(TokenStore::open(&path)?)
    }

    /// Measures the reconstruction of a split of its data at several strengths of language-free guidance.
    ///
    /// # Errors
    /// The data or the vectors of their captions are missing or damaged.
    pub fn reconstruct(&self, split: Split, guidances: &[f64]) -> Result<Vec<Reconstruction>> {
        let source = data::open(&self.folder.sweep()?.data, None)?;
        let id = JobId::new(JobKind::Tokenizer, &self.id);
        let job: TokenizerJob = spec_of(&self.folder, &id)?;
        let text = job.text_id.map(|id| TextStore::open(&self.folder.text(&id))).transpose();
        let text = text.context("opening the vectors of the data's captions")?;
        let corpus = Corpus { source: &*source, text: text.as_ref() };
        let of =
            |&guidance: &f64| tokenizer::reconstruct(&self.tokenizer, &corpus, split, guidance);
        Ok(guidances.iter().map(of).collect::<Result<_, _>>()?)
    }

    /// The vectors of a caption, which is read as the captions of data are; `None` for a tokenizer
    /// without language.
    ///
    /// # Errors
    /// A tokenizer with language is given no caption, or the encoder has no vectors of it.
    pub fn embed(&self, caption: Option<&str>) -> Result<Option<Vec<f32>>> {
        let Some(encoder) = &self.encoder else { return Ok(None) };
        let caption = caption.context("the tokenizer sees captions and the motion has none")?;
        Ok(Some(encoder.encode(&as_in_data(caption))?))
    }

    /// The codes of a motion, features `[T, 263]` row-major, and the frames that they cover: those after its last whole
    /// stride are left out. A tokenizer with language sees the vectors of a caption.
    ///
    /// # Errors
    /// The motion is shorter than a stride, or [`Tokenizer::encode`] fails.
    pub fn encode(&self, features: &[f32], text: Option<&[f32]>) -> Result<(Vec<u32>, usize)> {
        let stride = self.tokenizer.spec().stride();
        let n_frames = features.len() / N_FEATURES;
        if n_frames < stride {
            bail!("it has {n_frames} frames, and the tokenizer reads {stride} or more");
        }
        Ok((self.tokenizer.encode(features, text)?, n_frames / stride * stride))
    }

    /// Motion from the codes of a motion: features `[T, 263]`, row-major, without the frames after the last whole stride.
    ///
    /// # Errors
    /// As [`TrainedTokenizer::embed`] and [`TrainedTokenizer::encode`].
    pub fn reconstruction(&self, features: &[f32], caption: &str) -> Result<Vec<f32>> {
        let text = self.embed(Some(caption))?;
        let (codes, frames) = self.encode(features, text.as_deref())?;
        Ok(self.tokenizer.decode(&codes, frames, text.as_deref(), 0.0)?)
    }
}

/// The text encoder of a sweep.
fn encoder_of(folder: &ResultsFolder) -> Result<Box<dyn TextEncoder>> {
    let sweep = folder.sweep().context("reading how its sweep turns captions into vectors")?;
    text::encoder(&sweep.text).context("opening the vectors of captions")
}
