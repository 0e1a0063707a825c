//! [`Tokenizer`]: a trained module with the statistics its features are normalised by.

use std::io;
use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::error::TokenizerError;
use super::module::TokenizerModule;
use super::normalise::Normaliser;
use crate::data::FeatureStats;
use crate::files::atomic::write_json;
use crate::files::{FileError, read_if_there};
use crate::learn::weights;
use crate::learn::weights::{HostTensor, Source, Weights, WeightsError};
use crate::spec::TokenizerSpec;

/// Raw features to codes and back; a token stands for `spec().frames_per_token()` frames.
#[derive(Debug)]
pub struct Tokenizer {
    module: TokenizerModule,
    spec: TokenizerSpec,
    stats: FeatureStats,
    normaliser: Normaliser,
    device: Device,
}

impl Tokenizer {
    /// Takes a module as it is after training, without autodiff, on `device`.
    pub(super) fn new(
        module: TokenizerModule,
        spec: TokenizerSpec,
        stats: FeatureStats,
        device: Device,
    ) -> Self {
        let normaliser = Normaliser::new(&spec.architecture, &stats);
        Self { module, spec, stats, normaliser, device }
    }

    /// What it was trained by.
    pub fn spec(&self) -> &TokenizerSpec {
        &self.spec
    }

    /// What its features are normalised by.
    pub fn stats(&self) -> &FeatureStats {
        &self.stats
    }

    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.spec.n_vocab()
    }

    /// Parameters of encoder, quantizer and decoder; for VQ the codebook too.
    pub fn n_parameters(&self) -> usize {
        self.module.num_params()
    }

    /// Codes of one clip's raw features, row-major `[n_frames, n_features]`.
    ///
    /// Frames after the last whole token are left out.
    pub fn encode(&self, features: &[f32]) -> Vec<u32> {
        let token = self.spec.grid().fewest_frames() * self.stats.mean.len();
        let n_tokens = features.len() / token;
        if n_tokens == 0 {
            return Vec::new();
        }
        self.encode_stack(features[..n_tokens * token].to_vec(), 1)
    }

    /// Raw features of one clip's codes, row-major `[n_frames, n_features]`.
    ///
    /// # Errors
    /// If an id is not below `n_vocab`.
    pub fn decode(&self, ids: &[u32]) -> Result<Vec<f32>, TokenizerError> {
        let n_vocab = self.n_vocab();
        if let Some(&id) = ids.iter().find(|&&id| id as usize >= n_vocab) {
            return Err(TokenizerError::UnknownCode { id, n_vocab });
        }
        if ids.is_empty() {
            return Ok(Vec::new());
        }
        Ok(self.decode_stack(ids, 1))
    }

    /// Codes, clip after clip, of the raw features of `n_clips` clips of one length in whole tokens.
    pub(super) fn encode_stack(&self, mut features: Vec<f32>, n_clips: usize) -> Vec<u32> {
        self.normaliser.apply(&mut features);
        let n_features = self.stats.mean.len();
        let n_frames = features.len() / n_clips / n_features;
        let data = TensorData::new(features, [n_clips, n_frames, n_features]);
        self.module.ids(Tensor::from_data(data, &self.device))
    }

    /// Raw features, clip after clip, of the codes of `n_clips` clips of one length.
    pub(super) fn decode_stack(&self, ids: &[u32], n_clips: usize) -> Vec<f32> {
        let features = self.module.decode(ids, n_clips).into_data();
        let mut features = features.try_into_vec().expect("features are f32");
        self.normaliser.undo(&mut features);
        features
    }

    /// Writes `weights.safetensors`, then `tokenizer.json`, each whole, by rename.
    pub fn save(&self, folder: &Path) -> Result<(), TokenizerError> {
        let mut tensors = weights::of_module(&self.module);
        for (name, values) in [(MEAN, &self.stats.mean), (STD, &self.stats.std)] {
            let tensor = HostTensor { shape: vec![values.len()], values: values.clone() };
            tensors.insert(name.to_string(), Source::Host(tensor));
        }
        weights::save(&folder.join(WEIGHTS), &tensors, Default::default())?;
        let path = folder.join(SPEC);
        Ok(write_json(&path, &self.spec)?)
    }

    /// Reads what [`Tokenizer::save`] wrote, for use on `device`.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, TokenizerError> {
        let spec = read_spec(&folder.join(SPEC))?;
        let (tensors, _) = weights::load(&folder.join(WEIGHTS))?;
        let stats = FeatureStats { mean: vector(&tensors, MEAN)?, std: vector(&tensors, STD)? };
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let module = TokenizerModule::new(&spec, stats.mean.len(), &mut unused, device);
        let module = weights::into_module(module, tensors)?;
        Ok(Self::new(module, spec, stats, device.clone()))
    }
}

const WEIGHTS: &str = "weights.safetensors";
const SPEC: &str = "tokenizer.json";
const MEAN: &str = "stats.mean";
const STD: &str = "stats.std";

fn read_spec(path: &Path) -> Result<TokenizerSpec, TokenizerError> {
    let spec: Option<TokenizerSpec> = read_if_there(path)?;
    let missing = || FileError::read(path)(io::ErrorKind::NotFound.into());
    let spec = spec.ok_or_else(missing)?;
    spec.check()?;
    Ok(spec)
}

fn vector(tensors: &Weights, name: &str) -> Result<Vec<f32>, WeightsError> {
    let missing = || WeightsError::Mismatch {
        name: name.to_string(),
        expected: vec![crate::motion::N_FEATURES],
        found: "missing".to_string(),
    };
    tensors.get(name).map(|tensor| tensor.values.clone()).ok_or_else(missing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::QuantizerSpec;
    use crate::tokenizer::testing::{Waves, small_spec};

    fn untrained(kind: QuantizerSpec) -> Tokenizer {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
        let spec = TokenizerSpec { quantizer: kind, ..small_spec() };
        let stats = Waves::new(&[8], 5).stats;
        let module = TokenizerModule::new(&spec, 5, &mut rng, &device);
        Tokenizer::new(module, spec, stats, device)
    }

    #[test]
    fn a_saved_tokenizer_loads_with_the_same_codes_and_features() {
        let kinds = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 6 }];
        for kind in kinds {
            let folder = tempfile::tempdir().unwrap();
            let tokenizer = untrained(kind);
            tokenizer.save(folder.path()).unwrap();
            let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
            let features = Waves::new(&[40], 5).clip(0, 0);
            let ids = tokenizer.encode(&features);
            assert_eq!((loaded.spec(), loaded.stats()), (tokenizer.spec(), tokenizer.stats()));
            assert_eq!((ids.len(), loaded.encode(&features)), (10, ids.clone()));
            assert_eq!(loaded.decode(&ids).unwrap(), tokenizer.decode(&ids).unwrap());
        }
    }

    #[test]
    fn frames_after_the_last_whole_token_are_left_out() {
        let tokenizer = untrained(QuantizerSpec::Fsq { levels: vec![5, 3] });
        let features = Waves::new(&[24], 5).clip(0, 0);
        assert_eq!(tokenizer.encode(&features[..23 * 5]), tokenizer.encode(&features[..20 * 5]));
        assert!(tokenizer.encode(&features[..3 * 5]).is_empty());
    }

    #[test]
    fn an_id_that_is_no_code_is_an_error() {
        let tokenizer = untrained(QuantizerSpec::Fsq { levels: vec![5, 3] });
        assert_eq!(tokenizer.decode(&[14, 0]).unwrap().len(), 8 * 5);
        let error = tokenizer.decode(&[3, 15]).unwrap_err().to_string();
        assert!(error.contains("15"), "{error}");
    }
}
