//! Weights before the first step.

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::module::TokenizerModule;
use super::pool::WindowPool;
use crate::spec::{BegunFrom, TokenizerSpec};

/// The stream of a seed from which weights are drawn.
const WEIGHTS_STREAM: u64 = 0;

/// Patches whose latents are made at a time.
const PATCHES_AT_ONCE: usize = 1 << 14;

/// Fresh weights; where the architecture begins from data, from patches of the pool.
pub fn begun(
    spec: &TokenizerSpec,
    pool: &WindowPool,
    n_features: usize,
    device: &Device,
) -> TokenizerModule {
    let mut rng = stream(spec.training.seed, WEIGHTS_STREAM);
    let mut module = TokenizerModule::new(spec, n_features, &mut rng, device);
    if let Some(BegunFrom { weights, codes }) = spec.begun_from() {
        let plain = device.clone().inner();
        let frames = spec.architecture.frames_per_latent();
        let of_weights = Vec::from_iter(pool.patches(frames, weights));
        module.begin_weights(&rows(&of_weights, &plain), n_features);
        let of_codes = Vec::from_iter(pool.patches(frames, codes));
        let latents = of_codes
            .chunks(PATCHES_AT_ONCE)
            .map(|patches| module.latents(rows(patches, &plain), n_features));
        module.begin_codes(&Tensor::cat(latents.collect(), 0));
    }
    module
}

/// `[n, p]` of n patches of p values.
fn rows(patches: &[&[f32]], device: &Device) -> Tensor<2> {
    let shape = [patches.len(), patches[0].len()];
    Tensor::from_data(TensorData::new(patches.concat(), shape), device)
}

/// A stream of a seed, so that more of one draw does not move another.
pub fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}
