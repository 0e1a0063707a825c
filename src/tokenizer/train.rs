//! Training a tokenizer: the same spec and data give the same bits each time, straight or resumed.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;

use super::codec::Tokenizer;
use super::error::TokenizerError;
use super::loss::reconstruction_loss;
use super::module::TokenizerModule;
use super::pool::WindowPool;
use crate::data::MotionSource;
use crate::learn::adamw::AdamWConfig;
use crate::learn::{Checkpoints, Course, Learner, LearnerState, Learning, LoadedState};
use crate::progress::Progress;
use crate::spec::TokenizerSpec;

/// Streams of one seed, so that more of one draw does not move another.
const WEIGHTS_STREAM: u64 = 0;
const WINDOWS_STREAM: u64 = 1;

/// Trains a tokenizer on the training split of `source`, from its checkpoint where there is one.
///
/// # Errors
/// If the spec is unusable, no clip holds a window, a clip cannot be read, the loss stops being a
/// number, a checkpoint is damaged or cannot be written, or `progress` asks for an end.
pub fn train(
    spec: &TokenizerSpec,
    source: &dyn MotionSource,
    device: &Device,
    checkpoints: Option<&Checkpoints>,
    progress: &mut Progress,
) -> Result<Tokenizer, TokenizerError> {
    spec.check()?;
    let learner = Windows::new(spec, source, &device.clone().autodiff())?;
    let learning = Learning::run(learner, &course(spec), checkpoints, progress)?;
    let module = learning.into_learner().module.valid();
    Ok(Tokenizer::new(module, spec.clone(), source.stats().clone(), device.clone()))
}

/// A tokenizer that learns to reconstruct windows of clips.
struct Windows<'a> {
    spec: &'a TokenizerSpec,
    pool: WindowPool,
    module: TokenizerModule,
    /// Draws the windows of a batch.
    draws: ChaCha8Rng,
    n_features: usize,
    device: Device,
}

impl<'a> Windows<'a> {
    fn new(
        spec: &'a TokenizerSpec,
        source: &dyn MotionSource,
        device: &Device,
    ) -> Result<Self, TokenizerError> {
        let n_features = source.stats().mean.len();
        let mut draws = stream(spec.training.seed, WINDOWS_STREAM);
        let pool = WindowPool::load(source, spec, &mut draws)?;
        let mut weights = stream(spec.training.seed, WEIGHTS_STREAM);
        let module = TokenizerModule::new(spec, n_features, &mut weights, device);
        Ok(Self { spec, pool, module, draws, n_features, device: device.clone() })
    }

    fn batch(&mut self) -> Tensor<3> {
        let values = self.pool.windows(self.spec.training.batch, &mut self.draws);
        let shape = [self.spec.training.batch, self.spec.training.window, self.n_features];
        Tensor::from_data(TensorData::new(values, shape), &self.device)
    }
}

impl Learner for Windows<'_> {
    type Weights = TokenizerModule;

    fn weights(&self) -> &TokenizerModule {
        &self.module
    }

    fn set_weights(&mut self, weights: TokenizerModule) {
        self.module = weights;
    }

    fn device(&self) -> &Device {
        &self.device
    }

    fn loss(&mut self, _: usize) -> Tensor<1> {
        let target_btf = self.batch();
        let made = self.module.reconstruct(target_btf.clone());
        let loss =
            reconstruction_loss(made.features_btf, target_btf, self.spec.training.position_weight);
        match made.auxiliary_loss {
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

    /// Numbers drawn for windows, as text, since they have 68 bits; and what the quantizer keeps.
    fn keep(&self) -> LearnerState {
        let LearnerState { note, tensors } = self.module.quantizer().keep();
        let note = json!({ DRAWN: self.draws.get_word_pos().to_string(), QUANTIZER: note });
        LearnerState { note, tensors }
    }

    fn resume(&mut self, mut saved: LoadedState) -> Option<()> {
        self.draws.set_word_pos(saved.note[DRAWN].as_str()?.parse().ok()?);
        let note = saved.note[QUANTIZER].take();
        self.module.quantizer_mut().resume(LoadedState { note, tensors: saved.tensors })
    }
}

const DRAWN: &str = "windows_drawn";
const QUANTIZER: &str = "quantizer";

fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

fn course(spec: &TokenizerSpec) -> Course {
    let optimiser = AdamWConfig {
        beta_1: spec.training.beta_1,
        beta_2: spec.training.beta_2,
        epsilon: 1e-8,
        weight_decay: spec.training.weight_decay,
        clip_norm: None,
    };
    Course { steps: spec.training.steps, optimiser }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::data::Split;
    use crate::learn::LearnError;
    use crate::progress::Step;
    use crate::spec::QuantizerSpec;
    use crate::tokenizer::testing::{Waves, small_spec, spec_of};

    fn losses(spec: &TokenizerSpec) -> (Tokenizer, Vec<f64>) {
        let mut losses = Vec::new();
        let source = Waves::new(&[40, 24, 32, 16], 9);
        let mut progress = |done: Step| {
            losses.push(done.loss);
            ControlFlow::Continue(())
        };
        let tokenizer = train(spec, &source, &Device::flex(), None, &mut progress).unwrap();
        (tokenizer, losses)
    }

    #[test]
    fn training_lowers_the_loss_with_either_quantizer() {
        let kinds = [QuantizerSpec::Fsq { levels: vec![5, 5] }, QuantizerSpec::Vq { n_vocab: 16 }];
        for kind in kinds {
            let (_, losses) = losses(&spec_of(kind, 80));
            let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
            let (first, last) = (mean(&losses[..10]), mean(&losses[70..]));
            assert!(last < 0.7 * first, "{first} to {last}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
        let kinds = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 64 }];
        for kind in kinds {
            let spec = spec_of(kind, 6);
            let bits = |spec: &TokenizerSpec| {
                let folder = tempfile::tempdir().unwrap();
                losses(spec).0.save(folder.path()).unwrap();
                std::fs::read(folder.path().join("weights.safetensors")).unwrap()
            };
            let mut other = spec.clone();
            other.training.seed = 1;
            assert_eq!(bits(&spec), bits(&spec));
            assert_ne!(bits(&spec), bits(&other));
        }
    }

    #[test]
    fn training_stops_when_it_is_told_to() {
        let source = Waves::new(&[40], 3);
        let mut progress = |done: Step| match done.step {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        };
        let result = train(&small_spec(), &source, &Device::flex(), None, &mut progress);
        assert!(matches!(result, Err(TokenizerError::Learn(LearnError::Stopped { step: 2, .. }))));
    }

    #[test]
    fn a_resumed_training_ends_on_the_same_bits() {
        let kinds = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 64 }];
        for kind in kinds {
            let spec = spec_of(kind, 9);
            let folder = tempfile::tempdir().unwrap();
            let bits = |tokenizer: Tokenizer| {
                tokenizer.save(folder.path()).unwrap();
                std::fs::read(folder.path().join("weights.safetensors")).unwrap()
            };
            let straight = bits(losses(&spec).0);
            let source = Waves::new(&[40, 24, 32, 16], 9);
            let path = folder.path().join("checkpoint.safetensors");
            let every = std::time::Duration::from_secs(3600);
            let checkpoints = Some(&Checkpoints { path: &path, every, branch: None });
            let mut seen = Vec::new();
            for stop_at in [3, 4, 7] {
                let mut progress = |Step { step, .. }| {
                    seen.push(step);
                    if step == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                };
                let ended = train(&spec, &source, &Device::flex(), checkpoints, &mut progress);
                assert!(matches!(ended, Err(TokenizerError::Learn(LearnError::Stopped { .. }))));
            }
            let mut progress = |_| ControlFlow::Continue(());
            let resumed = train(&spec, &source, &Device::flex(), checkpoints, &mut progress);
            assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7], "no step is done twice");
            assert!(bits(resumed.unwrap()) == straight, "{:?}", spec.quantizer);
        }
    }

    #[test]
    fn a_damaged_checkpoint_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        std::fs::write(&path, b"not a checkpoint").unwrap();
        let every = std::time::Duration::ZERO;
        let checkpoints = Some(&Checkpoints { path: &path, every, branch: None });
        let mut progress = |_| ControlFlow::Continue(());
        let source = Waves::new(&[40], 3);
        let ended = train(&small_spec(), &source, &Device::flex(), checkpoints, &mut progress);
        let message = ended.err().unwrap().to_string();
        assert!(message.contains("checkpoint.safetensors") && message.contains("remove it"));
    }

    #[test]
    fn features_that_are_not_finite_are_an_error() {
        let mut source = Waves::new(&[40], 3);
        source.spoiled = Some((Split::Train, 0));
        let result =
            train(
                &small_spec(),
                &source,
                &Device::flex(),
                None,
                &mut |_| ControlFlow::Continue(()),
            );
        assert!(matches!(
            result,
            Err(TokenizerError::Learn(LearnError::NonFinite { step: 1, .. }))
        ));
    }
}
