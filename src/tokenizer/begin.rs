//! Weights before the first step.

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::module::TokenizerModule;
use super::pool::WindowPool;
use crate::spec::TokenizerSpec;

/// The stream of a seed from which weights are drawn.
const WEIGHTS_STREAM: u64 = 0;

/// Fresh weights; where the architecture begins from data, from patches of the pool.
pub fn begun(
    spec: &TokenizerSpec,
    pool: &WindowPool,
    n_features: usize,
    device: &Device,
) -> TokenizerModule {
    let mut rng = stream(spec.training.seed, WEIGHTS_STREAM);
    let mut module = TokenizerModule::new(spec, n_features, &mut rng, device);
    if let Some(most) = spec.patches_begun_from() {
        let frames = spec.architecture.frames_per_latent();
        let patches = pool.patches(frames, most);
        let shape = [patches.len() / (frames * n_features), frames * n_features];
        let plain = device.clone().inner();
        module.begin(&Tensor::from_data(TensorData::new(patches, shape), &plain), n_features);
    }
    module
}

/// A stream of a seed, so that more of one draw does not move another.
pub fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}
