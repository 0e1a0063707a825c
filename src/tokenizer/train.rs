//! Training a tokenizer: the same spec and data give the same bits each time, straight or resumed.

use std::time::Instant;

use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::checkpoint::{self, Checkpoints, Moment};
use super::codec::Tokenizer;
use super::error::TokenizerError;
use super::loss::reconstruction_loss;
use super::module::TokenizerModule;
use super::pool::WindowPool;
use super::spec::TokenizerSpec;
use crate::data::MotionSource;
use crate::moving::{Progress, Step};
use crate::train::adamw::{AdamW, AdamWConfig};

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
    checkpoints: Option<Checkpoints>,
    progress: &mut Progress,
) -> Result<Tokenizer, TokenizerError> {
    spec.check()?;
    let mut trainer = Trainer::new(spec, source, &device.clone().autodiff())?;
    if let Some(Checkpoints { path, .. }) = checkpoints.filter(|c| c.path.exists()) {
        trainer.moment = checkpoint::load(path, trainer.moment)?;
    }
    let mut saved = Instant::now();
    while trainer.moment.step < spec.steps {
        let began = Instant::now();
        let loss = trainer.step()?;
        let seconds = began.elapsed().as_secs_f64();
        let step = trainer.moment.step;
        let stopped = progress(Step { step, steps: spec.steps, loss, seconds }).is_break();
        if let Some(Checkpoints { path, every }) = checkpoints
            && (stopped || saved.elapsed() >= every)
        {
            checkpoint::save(path, &trainer.moment)?;
            saved = Instant::now();
        }
        if stopped {
            return Err(TokenizerError::Stopped { step });
        }
    }
    let stats = source.stats().clone();
    Ok(Tokenizer::new(trainer.moment.module.valid(), spec.clone(), stats, device.clone()))
}

struct Trainer<'a> {
    spec: &'a TokenizerSpec,
    pool: WindowPool,
    moment: Moment,
    n_features: usize,
    device: Device,
}

impl<'a> Trainer<'a> {
    fn new(
        spec: &'a TokenizerSpec,
        source: &dyn MotionSource,
        device: &Device,
    ) -> Result<Self, TokenizerError> {
        let n_features = source.stats().mean.len();
        let mut windows = stream(spec.seed, WINDOWS_STREAM);
        let pool = WindowPool::load(source, spec, &mut windows)?;
        let mut weights = stream(spec.seed, WEIGHTS_STREAM);
        let module = TokenizerModule::new(spec, n_features, &mut weights, device);
        let optimiser = AdamW::new(optimiser_config(spec));
        let moment = Moment { step: 0, module, optimiser, windows };
        Ok(Self { spec, pool, moment, n_features, device: device.clone() })
    }

    /// One step; its loss before the update.
    fn step(&mut self) -> Result<f64, TokenizerError> {
        let target_btf = self.batch();
        let step = self.moment.step;
        let made = self.moment.module.reconstruct(target_btf.clone());
        let weight = self.spec.position_weight;
        let mut loss = reconstruction_loss(made.features_btf, target_btf, weight);
        if let Some(auxiliary) = made.auxiliary_loss {
            loss = loss + auxiliary;
        }
        let value = finite(loss.clone(), step)?;
        let Moment { module, optimiser, .. } = &mut self.moment;
        let grads = GradientsParams::from_grads(loss.backward(), module);
        let lr = self.spec.learning_rate(step);
        (*module, _) = optimiser.step(module.clone(), grads, lr);
        self.moment.step += 1;
        Ok(value)
    }

    fn batch(&mut self) -> Tensor<3> {
        let values = self.pool.windows(self.spec.batch, &mut self.moment.windows);
        let shape = [self.spec.batch, self.spec.window, self.n_features];
        Tensor::from_data(TensorData::new(values, shape), &self.device)
    }
}

fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

fn optimiser_config(spec: &TokenizerSpec) -> AdamWConfig {
    AdamWConfig {
        beta_1: spec.beta_1,
        beta_2: spec.beta_2,
        epsilon: 1e-8,
        weight_decay: spec.weight_decay,
        clip_norm: None,
    }
}

fn finite(loss: Tensor<1>, step: usize) -> Result<f64, TokenizerError> {
    let loss = f64::from(loss.into_scalar::<f32>());
    if loss.is_finite() { Ok(loss) } else { Err(TokenizerError::NonFinite { step, loss }) }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::data::Split;
    use crate::tokenizer::quantizer::QuantizerKind;
    use crate::tokenizer::testing::{Waves, small_spec};

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
        let kinds = [QuantizerKind::Fsq { levels: vec![5, 5] }, QuantizerKind::Vq { n_vocab: 16 }];
        for kind in kinds {
            let (_, losses) = losses(&TokenizerSpec { kind, steps: 80, ..small_spec() });
            let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
            let (first, last) = (mean(&losses[..10]), mean(&losses[70..]));
            assert!(last < 0.7 * first, "{first} to {last}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
        let kinds = [QuantizerKind::Fsq { levels: vec![5, 3] }, QuantizerKind::Vq { n_vocab: 64 }];
        for kind in kinds {
            let spec = TokenizerSpec { kind, steps: 6, ..small_spec() };
            let bits = |spec: &TokenizerSpec| {
                let folder = tempfile::tempdir().unwrap();
                losses(spec).0.save(folder.path()).unwrap();
                std::fs::read(folder.path().join("weights.safetensors")).unwrap()
            };
            assert_eq!(bits(&spec), bits(&spec));
            assert_ne!(bits(&spec), bits(&TokenizerSpec { seed: 1, ..spec.clone() }));
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
        assert!(matches!(result, Err(TokenizerError::Stopped { step: 2 })));
    }

    #[test]
    fn a_resumed_training_ends_on_the_same_bits() {
        let kinds = [QuantizerKind::Fsq { levels: vec![5, 3] }, QuantizerKind::Vq { n_vocab: 64 }];
        for kind in kinds {
            let spec = TokenizerSpec { kind, steps: 9, ..small_spec() };
            let folder = tempfile::tempdir().unwrap();
            let bits = |tokenizer: Tokenizer| {
                tokenizer.save(folder.path()).unwrap();
                std::fs::read(folder.path().join("weights.safetensors")).unwrap()
            };
            let straight = bits(losses(&spec).0);
            let source = Waves::new(&[40, 24, 32, 16], 9);
            let path = folder.path().join("checkpoint.safetensors");
            let every = std::time::Duration::from_secs(3600);
            let checkpoints = Some(Checkpoints { path: &path, every });
            let mut seen = Vec::new();
            for stop_at in [3, 4, 7] {
                let mut progress = |Step { step, .. }| {
                    seen.push(step);
                    if step == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                };
                let ended = train(&spec, &source, &Device::flex(), checkpoints, &mut progress);
                assert!(matches!(ended, Err(TokenizerError::Stopped { .. })));
            }
            let mut progress = |_| ControlFlow::Continue(());
            let resumed = train(&spec, &source, &Device::flex(), checkpoints, &mut progress);
            assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7], "no step is done twice");
            assert!(bits(resumed.unwrap()) == straight, "{:?}", spec.kind);
        }
    }

    #[test]
    fn a_damaged_checkpoint_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        std::fs::write(&path, b"not a checkpoint").unwrap();
        let every = std::time::Duration::ZERO;
        let checkpoints = Some(Checkpoints { path: &path, every });
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
        assert!(matches!(result, Err(TokenizerError::NonFinite { step: 0, .. })));
    }
}
