//! [`TrainedRun`]: a finished run, opened to make motions.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

use super::assignment::frozen_sweep;
use super::folder::{JobState, MODEL, ResultsFolder};
use super::id::JobId;
use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::{self, GeneratorError, Prompt, Sampled, Sampler, Sampling};
use crate::learn::params::below;
use crate::learn::weights;
use crate::spec::RunSpec;
use crate::text::{self, TextEncoder, as_in_data};
use crate::tokenizer::Tokenizer;

/// Lengths take their ChaCha stream from here on, far above those of motions.
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
        let (folder, run_id) = find(path)?;
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
        let (loaded, _) = weights::load(&place.join(MODEL))?;
        let sampler = generator::of(&spec).sampler(&spec, loaded, device)?;
        let tokenizer = Tokenizer::load(&folder.tokenizer(&spec.tokenizer_id), device)
            .context("opening its tokenizer")?;
        let encoder = text::encoder(&frozen_sweep(&folder)?.text)
            .context("opening the vectors of captions")?;
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

    /// Makes a motion of each prompt, all at once.
    ///
    /// # Errors
    /// [`GeneratorError::NoCode`] for a length below one latent of the tokenizer; as
    /// [`Sampler::sample`].
    pub fn sample(
        &self,
        prompts: &[Prompt],
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        let least = self.tokenizer.spec().frames_per_latent();
        let too_short = |prompt: &Prompt| prompt.n_frames.filter(|n_frames| *n_frames < least);
        if let Some(n_frames) = prompts.iter().find_map(too_short) {
            return Err(GeneratorError::NoCode { n_frames, least });
        }
        self.sampler.sample(prompts, &self.tokenizer, sampling)
    }

    /// The same decoded; a tokenizer with language follows the captions the more the larger
    /// `detokenizer_guidance` is.
    ///
    /// # Errors
    /// As [`TrainedRun::sample`] and [`Tokenizer::decode`].
    pub fn motions(
        &self,
        prompts: &[Prompt],
        sampling: &Sampling,
        detokenizer_guidance: f64,
    ) -> Result<Vec<MadeMotion>> {
        let tokenizer = &self.tokenizer;
        let decoded = |(prompt, sampled): (&Prompt, Sampled)| {
            let (codes, n_frames) = (&sampled.codes, sampled.n_frames);
            let text = Some(prompt.text);
            let features = tokenizer.decode(codes, n_frames, text, detokenizer_guidance)?;
            Ok(MadeMotion { sampled, features })
        };
        let sampled = self.sample(prompts, sampling)?;
        prompts.par_iter().zip(sampled).map(decoded).collect()
    }

    /// The length of a clip of the training split, in frames, drawn by a seed and an index.
    ///
    /// # Errors
    /// The codes of its data are missing or damaged.
    pub fn some_length(&self, seed: u64, index: u64) -> Result<usize> {
        let tokens = TokenStore::open(&self.folder.tokens(&self.spec.tokenizer_id))?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(LENGTHS_STREAM + index);
        let clip = below(&mut rng, tokens.n_clips(Split::Train));
        Ok(tokens.clip_frames(Split::Train, clip))
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
pub(super) fn find(path: &Path) -> Result<(ResultsFolder, String)> {
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
    // The path as it was given, where it names all of it, reads better than the full one.
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
