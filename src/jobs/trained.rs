//! Opens trained runs that make motions, and evaluators that score them: [`TrainedRun`] and [`TrustedEvaluator`].

use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use rayon::prelude::*;

use super::assignment::{MODEL, OF_RUN};
use super::folder::{JobState, Product, ResultsFolder};
use super::job::{JobId, JobKind};
use crate::data;
use crate::draws::stream;
use crate::evaluator::{self, Evaluator, EvaluatorReport, Truth};
use crate::files::FileError;
use crate::generator::{self, Edit, GeneratorError, Prompt, Sampled, Sampler, Sampling};
use crate::learn::weights;
use crate::spec::{EvaluatorSection, RunSpec};
use crate::text::{self, LengthEstimator, TextEncoder, as_in_data};
use crate::tokenizer::Tokenizer;

/// First ChaCha stream of lengths, far above those of motions.
const LENGTHS_STREAM: u64 = 1 << 40;

/// A motion that a run has made.
pub struct MadeMotion {
    pub sampled: Sampled,
    /// `[T, 263]` row-major.
    pub features: Vec<f32>,
}

/// A finished run with all that turns a caption into motion.
pub struct TrainedRun {
    /// The sweep's folder.
    pub folder: ResultsFolder,
    pub run_id: String,
    pub spec: RunSpec,
    pub tokenizer: Tokenizer,
    encoder: Box<dyn TextEncoder>,
    sampler: Box<dyn Sampler>,
}

impl TrainedRun {
    /// Opens the run of a folder `…/runs/<id>`, or of a sweep's folder the run with the lowest L_u.
    ///
    /// # Errors
    /// There is no such run, it has not ended, its trainer left no weights, or a file that
    /// it needs is missing or damaged.
    pub fn open(path: &Path, device: &Device) -> Result<Self> {
        let (folder, run_id) = find_run(path)?;
        let place = folder.run(&run_id);
        let spec: Option<RunSpec> = folder.read_spec(&JobId::run(&run_id))?;
        let spec = spec.with_context(|| format!("{} has no spec.json", place.display()))?;
        if let Some(trainer) = spec.trainer.as_ref().filter(|_| !place.join(MODEL).exists()) {
            bail!(
                "{} was trained by `{}`, which left no weights; generate with that",
                place.display(),
                trainer.command
            );
        }
        let (loaded, notes) = weights::load(&place.join(MODEL))?;
        if let Some(other) = notes.get(OF_RUN).filter(|id| **id != run_id) {
            let reason = format!("its weights are those of run {other}");
            return Err(FileError::damaged(&place.join(MODEL), reason).into());
        }
        let sampler = generator::of(&spec).sampler(&spec, loaded, device)?;
        let tokenizer = Tokenizer::load(&folder.tokenizer(&spec.tokenizer_id), device)
            .context("opening its tokenizer")?;
        let encoder =
            text::encoder(&folder.sweep()?.text).context("opening the vectors of captions")?;
        Ok(Self { folder, run_id, spec, tokenizer, encoder, sampler })
    }

    /// The vectors of a caption, which is read as the captions of data are: lower-case, with single
    /// spaces.
    ///
    /// # Errors
    /// The encoder has none for it.
    pub fn embed(&self, caption: &str) -> Result<Vec<f32>> {
        Ok(self.encoder.encode(&as_in_data(caption))?)
    }

    /// Words that stand in no caption of the training split; none where the captions' file is gone, or of an older
    /// version.
    pub fn unseen_words(&self, captions: &[String]) -> Vec<String> {
        let file = self.folder.text(&self.spec.text_id);
        text::unseen_words(&file, captions).ok().flatten().unwrap_or_default()
    }

    /// Makes a motion of each prompt, all at once, of whole strides of the tokenizer.
    ///
    /// # Errors
    /// [`GeneratorError::NoCode`] for a length below one stride of the tokenizer; as
    /// [`Sampler::sample`].
    pub fn sample(
        &self,
        prompts: &[Prompt],
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        let least = self.tokenizer.spec().stride();
        let too_short = |prompt: &Prompt| prompt.n_frames.filter(|n_frames| *n_frames < least);
        if let Some(n_frames) = prompts.iter().find_map(too_short) {
            return Err(GeneratorError::NoCode { n_frames, least });
        }
        let whole = |prompt: &Prompt| prompt.n_frames.map(|n_frames| n_frames / least * least);
        let prompts: Vec<Prompt> =
            prompts.iter().map(|own| Prompt { n_frames: whole(own), ..*own }).collect();
        self.sampler.sample(&prompts, &self.tokenizer, sampling)
    }

    /// The same decoded; `detokenizer_guidance` sets how closely a tokenizer with language follows the captions, which of
    /// an edited motion only the part reads.
    ///
    /// # Errors
    /// As [`TrainedRun::sample`] and [`Tokenizer::decode`].
    pub fn motions(
        &self,
        prompts: &[Prompt],
        sampling: &Sampling,
        detokenizer_guidance: f64,
    ) -> Result<Vec<MadeMotion>> {
        if prompts.is_empty() {
            return Ok(Vec::new());
        }
        let tokenizer = &self.tokenizer;
        let decoded = |(prompt, sampled): (&Prompt, Sampled)| {
            let (codes, n_frames) = (&sampled.codes, sampled.n_frames);
            let (text, guidance) = (prompt.text, detokenizer_guidance);
            let features = match prompt.edit {
                None => tokenizer.decode(codes, n_frames, Some(text), guidance)?,
                Some(Edit { anew, .. }) => {
                    tokenizer.decode_edited((codes, anew), n_frames, text, guidance)?
                }
            };
            Ok(MadeMotion { sampled, features })
        };
        let sampled = self.sample(prompts, sampling)?;
        prompts.par_iter().zip(sampled).map(decoded).collect()
    }

    /// The run's length estimator.
    ///
    /// # Errors
    /// The file of the captions is missing, damaged, or of an older version.
    pub fn length_estimator(&self) -> Result<LengthEstimator, FileError> {
        LengthEstimator::open(&self.folder.text(&self.spec.text_id))
    }

    /// A length in frames, of whole strides, that an estimator draws for a caption's vectors, by a seed and an index.
    pub fn draw_length(
        &self,
        estimator: &LengthEstimator,
        text: &[f32],
        seed: u64,
        index: u64,
    ) -> usize {
        let stride = self.tokenizer.spec().stride();
        let drawn = estimator.draw(text, &mut stream(seed, LENGTHS_STREAM + index));
        (drawn / stride).max(1) * stride
    }

    /// Whether motions can be moved away from those without text.
    pub fn takes_guidance(&self) -> bool {
        self.sampler.takes_guidance()
    }

    /// Whether a prompt has to say how long the motion is.
    pub fn wants_length(&self) -> bool {
        self.sampler.wants_length()
    }
}

/// The sweep's folder and the run that a path names.
pub fn find_run(path: &Path) -> Result<(ResultsFolder, String)> {
    if !path.is_dir() {
        bail!("{} does not exist; give a run's folder, or a sweep's", path.display());
    }
    if path.join("runs").is_dir() {
        let folder = ResultsFolder::new(path);
        let run = best_run(&folder)?;
        return Ok((folder, run));
    }
    let Some((root, id)) = run_of(path) else {
        bail!("{} is neither a run's folder nor a sweep's", path.display());
    };
    let folder = ResultsFolder::new(root);
    match folder.state(&JobId::run(&id)) {
        JobState::Done => Ok((folder, id)),
        _ => bail!("the run in {} has not ended: it has no record.json", path.display()),
    }
}

/// The root and the id of `…/runs/<id>`.
fn run_of(path: &Path) -> Option<(PathBuf, String)> {
    let full = path.canonicalize().ok()?;
    let runs = full.parent().filter(|parent| parent.ends_with("runs"))?;
    let id = full.file_name()?.to_str()?.to_string();
    // The path as given reads better than the full one, if it is complete.
    let given = path.parent().and_then(Path::parent).filter(|root| root.join("runs").is_dir());
    Some((given.or(runs.parent())?.to_path_buf(), id))
}

/// The finished run with the lowest L_u.
fn best_run(folder: &ResultsFolder) -> Result<String> {
    let mut best: Option<(f64, String)> = None;
    for entry in std::fs::read_dir(folder.file("runs"))? {
        let id = entry?.file_name().to_string_lossy().into_owned();
        let Some(record) = folder.record(&id)? else { continue };
        let Ok(loss) = record.loss_normalised() else { continue };
        if folder.run(&id).join(MODEL).exists()
            && best.as_ref().is_none_or(|(least, _)| loss < *least)
        {
            best = Some((loss, id));
        }
    }
    let none = || format!("{} has no finished run with weights", folder.root().display());
    Ok(best.with_context(none)?.1)
}

/// An evaluator that passes its gates, and the sweep that it was trained for.
pub struct TrustedEvaluator {
    pub id: String,
    /// The sweep's folder.
    pub folder: ResultsFolder,
    pub evaluator: Evaluator,
}

impl TrustedEvaluator {
    /// Opens `…/evaluators/<id>`, or the evaluator of a sweep's folder that has one.
    ///
    /// # Errors
    /// There is none, there are several, it does not pass its gates, or a file is missing or damaged.
    pub fn open(path: &Path, device: &Device) -> Result<Self> {
        let (folder, id) = folder_and_id(&evaluator_of(path)?)?;
        Self::of(&folder, &id, device)
    }

    /// Opens the evaluator of an id.
    ///
    /// # Errors
    /// It is not trained, does not pass its gates, or a file is missing or damaged.
    pub fn of(folder: &ResultsFolder, id: &str, device: &Device) -> Result<Self> {
        let report = folder.gates(id)?.with_context(|| format!("evaluator {id} is not trained"))?;
        if !report.passes {
            let failed: Vec<&str> = report.failed().map(|verdict| verdict.gate.as_str()).collect();
            bail!("evaluator {id} scores nothing: it fails {}", failed.join(", "));
        }
        let evaluator = Evaluator::load(&folder.evaluator(id), device)
            .with_context(|| format!("opening evaluator {id}"))?;
        Ok(Self { id: id.to_string(), folder: folder.clone(), evaluator })
    }

    /// True clips of the data that it was trained on.
    ///
    /// # Errors
    /// The data cannot be opened, or holds too few clips.
    pub fn truth(&self) -> Result<Truth> {
        let data = self.folder.sweep()?.data;
        let source = data::open(&data, None).context("opening the data of the evaluator")?;
        Ok(Truth::load(&self.evaluator, &*source)?)
    }
}

/// The folder of an evaluator that a path names: of several in a sweep's folder, that which the sweep
/// describes.
fn evaluator_of(path: &Path) -> Result<PathBuf> {
    if path.join("gates.json").is_file() {
        return Ok(path.to_path_buf());
    }
    let folder = ResultsFolder::new(path);
    let place = |report: &EvaluatorReport| folder.evaluator(&report.evaluator_id);
    let trained = folder.all_gates(|_| ()).unwrap_or_default();
    match trained.as_slice() {
        [one] => Ok(place(one)),
        [] => bail!(
            "{} has no trained evaluator; `isoflop evaluator train` trains that of a sweep",
            path.display()
        ),
        [first, ..] => match described(&folder)?.as_slice() {
            [one] => Ok(place(one)),
            _ => bail!(
                "{} has {} evaluators; name one, as {}",
                path.display(),
                trained.len(),
                place(first).display()
            ),
        },
    }
}

/// The evaluators that the frozen sweep of a folder describes.
fn described(folder: &ResultsFolder) -> Result<Vec<EvaluatorReport>> {
    let sweep = folder.sweep()?;
    let section = sweep.evaluator.as_ref();
    Ok(section.map_or(Ok(Vec::new()), |section| folder.gates_of(section, |_| ()))?)
}

/// The sweep's folder and the id of a job's folder, `…/evaluators/<id>`.
///
/// # Errors
/// The folder is not there.
pub fn folder_and_id(place: &Path) -> Result<(ResultsFolder, String)> {
    let full = place.canonicalize().with_context(|| format!("finding {}", place.display()))?;
    let id = full.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let root = full.parent().and_then(Path::parent).map(Path::to_path_buf);
    Ok((ResultsFolder::new(root.unwrap_or_default()), id))
}

// The evaluators of a folder, and quick checks of products.

impl Product for EvaluatorReport {
    fn is_of(&self, job: &JobId, _: &ResultsFolder) -> bool {
        self.evaluator_id == job.id
    }
}

impl ResultsFolder {
    /// Checks that the product of a finished job can be read, if this is quick.
    ///
    /// # Errors
    /// [`FileError::Damaged`].
    pub fn inspect(&self, JobId { kind, id }: &JobId) -> Result<(), FileError> {
        match kind {
            JobKind::Text | JobKind::Tokens | JobKind::Trunk => Ok(()),
            JobKind::Tokenizer => self.metrics(id).map(drop),
            JobKind::Run => self.record(id).map(drop),
            JobKind::Evaluator => self.gates(id).map(drop),
            JobKind::Score => self.scores(id).map(drop),
        }
    }

    /// The gates of a finished evaluator.
    pub fn gates(&self, evaluator_id: &str) -> Result<Option<EvaluatorReport>, FileError> {
        self.own_product(&JobId::new(JobKind::Evaluator, evaluator_id))
    }

    /// The gates of every finished evaluator in the folder, like [`ResultsFolder::all_metrics`].
    ///
    /// # Errors
    /// The folder cannot be listed.
    pub fn all_gates(&self, warn: impl FnMut(String)) -> io::Result<Vec<EvaluatorReport>> {
        self.products(JobKind::Evaluator, |r: &EvaluatorReport| r.evaluator_id.clone(), warn)
    }

    /// The entries of [`ResultsFolder::all_gates`] that a section describes: all that were loaded, if it names a folder
    /// that is not here any more.
    ///
    /// # Errors
    /// The folder cannot be listed.
    pub fn gates_of(
        &self,
        section: &EvaluatorSection,
        warn: impl FnMut(String),
    ) -> io::Result<Vec<EvaluatorReport>> {
        let spec = match &section.weights {
            None => Some(section.spec()),
            Some(folder) => evaluator::spec_of(folder).ok(),
        };
        let is_own = |report: &EvaluatorReport| match &spec {
            Some(spec) => report.spec == *spec,
            None => report.spec.loaded.is_some(),
        };
        Ok(self.all_gates(warn)?.into_iter().filter(is_own).collect())
    }
}
