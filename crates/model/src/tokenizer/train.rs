//! Training a tokenizer: the same spec and data give the same bits each time, straight or resumed.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::average::Average;
use super::begin::{begun, stream};
use super::codec::Tokenizer;
use super::corpus::{Corpus, ReadCaptions};
use super::error::TokenizerError;
use super::loss::{JointLoss, of_gradient, reconstruction_loss};
use super::mix::Mixing;
use super::module::TokenizerModule;
use super::normalise::Normaliser;
use super::pass::Pass;
use super::pool::WindowPool;
use super::watch::{Validated, Watch};
use super::windows::Windows;
use crate::learn::adamw::AdamWConfig;
use crate::learn::params::below;
use crate::learn::weights::{Source, Sources, Weights};
use crate::learn::{Checkpoints, Course, LearnError, Learner, LearnerState, Learning, LoadedState};
use crate::progress::Progress;
use crate::spec::{TokenizerLoss, TokenizerSpec, TokenizerTraining};

/// The stream of a seed from which windows are drawn.
pub const WINDOWS_STREAM: u64 = 1;

/// The streams of a seed from which captions, and what is dropped, are drawn: one a step.
const CAPTIONS_STREAMS: u64 = 1 << 40;
const NOISE_STREAMS: u64 = 2 << 40;

/// Trains a tokenizer on the training split of `corpus`, from its checkpoint where there is one.
///
/// # Errors
/// If the spec is unusable, the captions that it wants are missing, no clip holds a window, a clip cannot be read, the loss stops being a
/// number, a checkpoint is damaged or cannot be written, or `progress` asks for an end.
pub fn train(
    spec: &TokenizerSpec,
    corpus: &Corpus,
    device: &Device,
    checkpoints: Option<&Checkpoints>,
    progress: &mut Progress,
) -> Result<Tokenizer, TokenizerError> {
    Ok(train_watched(spec, corpus, device, checkpoints, progress)?.0)
}

/// [`train`], with what was measured on the validation split; nothing where the spec has no plateau.
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
    let (module, log) = learning.into_learner().end()?;
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
    /// `None` where all steps are taken and the last weights kept.
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
        let module = begun(spec, &pool, normaliser.n_features(), device);
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

    /// Frames of the windows of a step: drawn, where an architecture wants to know all lengths.
    fn window_frames(&mut self) -> usize {
        let (window, stride) =
            (self.spec.training.window, self.spec.architecture.frames_per_latent());
        let share = self.spec.architecture.shortest_window();
        if share == 1.0 {
            return window;
        }
        let most = window / stride;
        let longest_scale = self.spec.quantizer.longest_scale();
        let least = ((share * most as f64) as usize).max(longest_scale).max(1);
        (least + below(&mut self.draws, most - least + 1)) * stride
    }

    /// The weights as they would be kept now.
    fn kept(&self) -> TokenizerModule {
        let average = self.average.as_ref().map(|average| average.module().clone());
        average.unwrap_or_else(|| self.module.valid())
    }

    /// The weights that are kept, and what the validation split said of them.
    fn end(self) -> Result<(TokenizerModule, Vec<Validated>), TokenizerError> {
        let last = self.kept();
        self.watch.map_or(Ok((last, Vec::new())), Watch::end)
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
        let seed = self.spec.training.seed;
        let of_step = |first: u64| stream(seed, first + step as u64);
        let captions = self.captions.as_ref();
        let captions =
            captions.map(|read| read.drawn(&windows.clips, &mut of_step(CAPTIONS_STREAMS)));
        let noise = Some(of_step(NOISE_STREAMS));
        let mut pass = Pass { captions: captions.as_ref(), noise };
        let shape = [windows.len(), windows.n_frames, self.normaliser.n_features()];
        let data = TensorData::new(windows.values.clone(), shape);
        let target_btf = Tensor::<3>::from_data(data, &self.device);
        let (features_btf, auxiliary_loss) = self.module.reconstruct(target_btf.clone(), &mut pass);
        let loss = match &self.joints {
            None => {
                let position_weight = self.spec.training.position_weight;
                reconstruction_loss(features_btf, target_btf, position_weight)
            }
            Some(joints) => {
                let made = features_btf.clone().into_data().try_into_vec();
                let (value, gradient) = joints.of(&made.expect("features are f32"), &windows);
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

    /// Numbers drawn for windows, as text, since they have 68 bits; what the quantizer keeps; the averaged
    /// weights, and the best ones.
    fn keep(&self) -> LearnerState {
        let LearnerState { note, mut tensors } = self.module.quantizer().keep();
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
        self.module.quantizer_mut().resume(LoadedState { note, tensors })
    }
}

/// Tensors under names of their own.
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

#[cfg(test)]
mod tests;
