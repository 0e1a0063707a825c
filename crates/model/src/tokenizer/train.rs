//! Training a tokenizer: the same spec and data give the same bits each time, straight or resumed, here or by a
//! trainer in another process.

use std::path::{Path, PathBuf};

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::json;

use super::TokenizerError;
use super::codec::Tokenizer;
use super::corpus::{Corpus, Normaliser, ReadCaptions};
use super::halves::{Pass, host};
use super::kept_weights::{Average, Validated, Watch};
use super::loss::{JointLoss, of_gradient, reconstruction_loss};
use super::module::TokenizerModule;
use super::pool::WindowPool;
use super::windows::{Mixing, Windows};
use crate::draws::{below, stream};
use crate::learn::adamw::AdamWConfig;
use crate::learn::weights::{self, Source, Sources, Weights};
use crate::learn::{Checkpoints, Course, LearnError, Learner, LearnerState, Learning, LoadedState};
use crate::progress::Progress;
use crate::spec::{TokenizerLoss, TokenizerSpec, TokenizerTraining};

/// The stream of a seed from which windows are drawn.
const WINDOWS_STREAM: u64 = 1;

/// The streams of a seed for captions and dropout: one per step.
const CAPTIONS_STREAMS: u64 = 1 << 40;
const NOISE_STREAMS: u64 = 2 << 40;

/// Trains a tokenizer on the training split of `corpus`, from its checkpoint if there is one.
///
/// # Errors
/// The spec is unusable, required captions are missing, no clip is as long as a window, a clip cannot be read, the loss
/// is not a number, a checkpoint is damaged or cannot be written, or `progress` asks for an end.
pub fn train(
    spec: &TokenizerSpec,
    corpus: &Corpus,
    device: &Device,
    checkpoints: Option<&Checkpoints>,
    progress: &mut Progress,
) -> Result<Tokenizer, TokenizerError> {
    Ok(train_watched(spec, corpus, device, checkpoints, progress)?.0)
}

/// [`train`], with the results on the validation split; empty if the spec has no plateau.
///
/// # Errors
/// As there.
pub fn train_watched(
    spec: &TokenizerSpec,
    corpus: &Corpus,
    device: &Device,
    checkpoints: Option<&Checkpoints>,
    progress: &mut Progress,
) -> Result<(Tokenizer, Vec<Validated>), TokenizerError> {
    spec.check()?;
    let learner = Reconstructing::new(spec, corpus, &device.clone().autodiff())?;
    let learning = Learning::run(learner, &course(spec), checkpoints, progress)?;
    let learner = learning.into_learner();
    let last = learner.kept();
    let (module, log) = learner.watch.map_or(Ok((last, Vec::new())), Watch::end)?;
    Ok((Tokenizer::of_clips(module, spec, corpus.source, device), log))
}

/// A tokenizer that learns to reconstruct windows of clips.
struct Reconstructing<'a> {
    spec: &'a TokenizerSpec,
    pool: WindowPool,
    /// `None` for a tokenizer without language.
    captions: Option<ReadCaptions<'a>>,
    module: TokenizerModule,
    average: Option<Average>,
    /// `None` if all steps are taken and the last weights kept.
    watch: Option<Watch<'a>>,
    /// `None` for the loss in features.
    joints: Option<JointLoss>,
    normaliser: Normaliser,
    /// Draws the windows of a batch.
    draws: ChaCha8Rng,
    device: Device,
}

impl<'a> Reconstructing<'a> {
    fn new(
        spec: &'a TokenizerSpec,
        corpus: &Corpus<'a>,
        device: &Device,
    ) -> Result<Self, TokenizerError> {
        let Corpus { source, .. } = *corpus;
        let TokenizerTraining { seed, average, loss, .. } = spec.training;
        let normaliser = Normaliser::new(spec, source.stats());
        let mut draws = stream(seed, WINDOWS_STREAM);
        let pool = WindowPool::load(source, spec, &mut draws)?;
        let module = TokenizerModule::begun(spec, &pool, normaliser.n_features(), device);
        let watch =
            |plateau| Watch::new(plateau, (spec, *corpus), &module.valid(), device.clone().inner());
        Ok(Self {
            watch: spec.plateau.map(watch).transpose()?,
            spec,
            pool,
            captions: corpus.read_by(spec)?,
            average: (average > 0.0).then(|| Average::new(&module, average)),
            module,
            joints: (loss == TokenizerLoss::Joints)
                .then(|| JointLoss::new(normaliser.clone(), &spec.training)),
            normaliser,
            draws,
            device: device.clone(),
        })
    }

    fn windows(&mut self) -> Windows {
        let TokenizerTraining { batch, mix_body, mix_arm, .. } = self.spec.training;
        let n_frames = self.window_frames();
        let mut windows = self.pool.windows(batch, n_frames, &mut self.draws);
        let mixing = Mixing { body: mix_body, arm: mix_arm };
        mixing.apply(&mut windows, &self.normaliser.std, &mut self.draws);
        windows
    }

    /// Frames of the windows of a step: random, if the architecture needs all lengths.
    fn window_frames(&mut self) -> usize {
        let (window, stride) = (self.spec.training.window, self.spec.stride());
        let share = self.spec.architecture.shortest_window();
        if share == 1.0 {
            return window;
        }
        let most = window / stride;
        // A scale needs as many latents as it has codes, which a fixed number of them are.
        let fixed = self.spec.architecture.fixed_latents().is_some();
        let longest_scale = if fixed { 0 } else { self.spec.quantizer.longest_scale() };
        let least = ((share * most as f64) as usize).max(longest_scale).max(1);
        (least + below(&mut self.draws, most - least + 1)) * stride
    }

    /// The weights as they would be kept now.
    fn kept(&self) -> TokenizerModule {
        let average = self.average.as_ref().map(|average| average.module.clone());
        average.unwrap_or_else(|| self.module.valid())
    }
}

impl Learner for Reconstructing<'_> {
    type Weights = TokenizerModule;

    fn weights(&self) -> &TokenizerModule {
        &self.module
    }

    fn set_weights(&mut self, weights: TokenizerModule) {
        self.module = weights;
    }

    fn loss(&mut self, step: usize) -> Tensor<1> {
        let windows = self.windows();
        // Streams of a step's own: a checkpoint need not hold how far they have come.
        let training = &self.spec.training;
        let of_step = |first: u64| stream(training.seed, first + step as u64);
        let drawn =
            |read: &ReadCaptions| read.drawn(&windows.clips, &mut of_step(CAPTIONS_STREAMS));
        let captions = self.captions.as_ref().map(drawn);
        let noise = Some(of_step(NOISE_STREAMS));
        let mut pass = Pass { captions: captions.as_ref(), noise };
        let shape = [windows.len(), windows.n_frames, self.normaliser.n_features()];
        let data = TensorData::new(windows.values.clone(), shape);
        let target_btf = Tensor::<3>::from_data(data, &self.device);
        let (features_btf, auxiliary_loss) = self.module.reconstruct(target_btf.clone(), &mut pass);
        let loss = match &self.joints {
            None => reconstruction_loss(features_btf, target_btf, training.position_weight),
            Some(joints) => {
                let (value, gradient) = joints.of(&host(features_btf.clone()), &windows);
                of_gradient(features_btf, value, gradient)
            }
        };
        match auxiliary_loss {
            Some(auxiliary) => loss + auxiliary,
            None => loss,
        }
    }

    fn learning_rate(&self, step: usize) -> f64 {
        self.spec.learning_rate(step)
    }

    fn advice(&self) -> &'static str {
        "lower tokenizer.lr, and look for features that are not finite"
    }

    fn after(&mut self, step: usize, _: f64) -> Result<(), LearnError> {
        if let Some(average) = &mut self.average {
            average.follow(&self.module, step);
        }
        if let Some(mut watch) = self.watch.take() {
            watch.see(&self.kept(), step);
            self.watch = Some(watch);
        }
        Ok(())
    }

    fn is_over(&self) -> bool {
        self.watch.as_ref().is_some_and(Watch::is_over)
    }

    /// The position in the random numbers of windows, as text, since it has 68 bits; the state of the quantizer; the
    /// averaged weights, and the best ones.
    fn keep(&self) -> LearnerState {
        let LearnerState { note, mut tensors } = self.module.quantizer.keep();
        let mut note = json!({ DRAWN: self.draws.get_word_pos().to_string(), QUANTIZER: note });
        tensors.extend(self.average.iter().flat_map(|average| named(AVERAGE, average.keep())));
        if let Some(watch) = &self.watch {
            let (log, best) = watch.keep();
            note[LOG] = log;
            tensors.extend(named(BEST, best));
        }
        LearnerState { note, tensors }
    }

    fn resume(&mut self, mut saved: LoadedState) -> Option<()> {
        self.draws.set_word_pos(saved.note[DRAWN].as_str()?.parse().ok()?);
        if let Some(average) = &mut self.average {
            average.resume(taken(AVERAGE, &mut saved.tensors))?;
        }
        if let Some(watch) = &mut self.watch {
            watch.resume(saved.note[LOG].take(), taken(BEST, &mut saved.tensors))?;
        }
        let (note, tensors) = (saved.note[QUANTIZER].take(), saved.tensors);
        self.module.quantizer.resume(LoadedState { note, tensors })
    }
}

/// Tensors under separate names.
fn named(prefix: &str, tensors: Sources) -> impl Iterator<Item = (String, Source)> {
    tensors.into_iter().map(move |(name, tensor)| (format!("{prefix}{name}"), tensor))
}

/// The tensors that [`named`] named, by their first names.
fn taken(prefix: &str, tensors: &mut Weights) -> Weights {
    let (own, others): (Weights, Weights) =
        std::mem::take(tensors).into_iter().partition(|(name, _)| name.starts_with(prefix));
    *tensors = others;
    own.into_iter().map(|(name, tensor)| (name[prefix.len()..].to_string(), tensor)).collect()
}

const AVERAGE: &str = "average.";
const BEST: &str = "best.";
const LOG: &str = "validated";
const DRAWN: &str = "windows_drawn";
const QUANTIZER: &str = "quantizer";

fn course(spec: &TokenizerSpec) -> Course {
    let optimiser = AdamWConfig {
        beta_1: spec.training.beta_1,
        beta_2: spec.training.beta_2,
        epsilon: 1e-8,
        weight_decay: spec.training.weight_decay,
        clip_norm: (spec.training.clip_norm > 0.0).then_some(spec.training.clip_norm),
    };
    Course { steps: spec.training.steps, optimiser }
}

// Training in another process.

/// Raised when a key changes its meaning or goes.
const VERSION: u32 = 1;

/// Numbers of 32 bits that a generator counts in one of 64.
const WORDS_PER_NUMBER: u128 = 2;

/// One tokenizer as its trainer reads it: complete, with absolute paths.
///
/// The trainer begins with the same weights as the built-in one and draws the same numbers, so it
/// takes the same steps. A batch is a pure function of the spec: from the stream `WINDOWS_STREAM` of
/// the seed, of which the first `drawn` numbers chose the clips, each step takes one number for the
/// length of its windows (transformers alone), then for each window one for its clip and one for its
/// first frame.
#[derive(Clone, Debug, Serialize)]
pub struct Handover {
    pub version: u32,
    pub spec: TokenizerSpec,
    /// Normalised clips, mirrored ones too: `values` (f32, frame after frame), `offsets` (u64, the
    /// first frame of each clip, and the end), `origins` (u64, the clip of the training split that
    /// each is made of), and `mean` and `std` (f32) that undo the normalisation.
    pub pool: PathBuf,
    /// The first weights by their names in the tokenizer.
    pub init: PathBuf,
    /// Numbers of the windows' stream that are used up.
    pub drawn: u64,
    /// Keys of the generators that the codebooks of VQ draw from, a codebook each.
    pub codebook_keys: Vec<[u32; 8]>,
    #[serde(flatten)]
    pub files: HandoverFiles,
}

/// The paths of a trainer's files other than the spec.
#[derive(Clone, Debug, Serialize)]
pub struct HandoverFiles {
    /// The embedded captions; `null` if the tokenizer has no language.
    pub text: Option<PathBuf>,
    /// Seconds between two checkpoints.
    pub checkpoint_s: f64,
    /// Its result.
    pub out: PathBuf,
    /// A folder that outlives a kill; the clips and the first weights are put there.
    pub checkpoint: PathBuf,
}

impl Handover {
    /// Writes the clips and the first weights of a tokenizer; the checkpoint's folder is there.
    ///
    /// # Errors
    /// As [`train`] before its first step.
    pub fn write(
        spec: &TokenizerSpec,
        corpus: &Corpus,
        device: &Device,
        files: HandoverFiles,
    ) -> Result<Self, TokenizerError> {
        spec.check()?;
        corpus.read_by(spec)?;
        let normaliser = Normaliser::new(spec, corpus.source.stats());
        let mut draws = stream(spec.training.seed, WINDOWS_STREAM);
        let pool = WindowPool::load(corpus.source, spec, &mut draws)?;
        let module = TokenizerModule::begun(spec, &pool, normaliser.n_features(), device);
        let [clips, init] =
            ["pool.safetensors", "init.safetensors"].map(|name| files.checkpoint.join(name));
        pool.write(&clips, &normaliser)?;
        weights::save(&init, &weights::of_module(&module), Default::default())?;
        Ok(Self {
            version: VERSION,
            spec: spec.clone(),
            pool: clips,
            init,
            drawn: (draws.get_word_pos() / WORDS_PER_NUMBER) as u64,
            codebook_keys: module.quantizer.keys().into_iter().map(words).collect(),
            files,
        })
    }
}

/// A key as the numbers of 32 bits that it is made of.
fn words(key: [u8; 32]) -> [u32; 8] {
    let (words, _) = key.as_chunks();
    std::array::from_fn(|i| u32::from_le_bytes(words[i]))
}

/// The tokenizer of weights that a trainer in another process has left.
///
/// # Errors
/// The file cannot be read, or does not hold the weights of such a tokenizer.
pub fn taken_back(
    spec: &TokenizerSpec,
    corpus: &Corpus,
    device: &Device,
    path: &Path,
) -> Result<Tokenizer, TokenizerError> {
    let (found, _) = weights::load(path)?;
    let module = TokenizerModule::of_weights(spec, corpus.source.stats(), found, device)?;
    Ok(Tokenizer::of_clips(module, spec, corpus.source, device))
}

#[cfg(test)]
mod tests;
