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
use super::quantizer::{Extent, Quantizer};
use crate::data::FeatureStats;
use crate::files::atomic::write_json;
use crate::files::{FileError, read_if_there};
use crate::learn::weights;
use crate::learn::weights::{HostTensor, Source, Weights, WeightsError};
use crate::spec::TokenizerSpec;

/// Raw features to codes and back.
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

    /// Codes of all codebooks together (V).
    pub fn n_vocab(&self) -> usize {
        self.spec.n_vocab()
    }

    /// Parameters of encoder, quantizer and decoder; for VQ the codebook too.
    pub fn n_parameters(&self) -> usize {
        self.module.num_params()
    }

    /// Codes of one clip's raw features, row-major `[n_frames, n_features]`.
    ///
    /// Frames after the last whole latent are left out; fewer frames than one latent's have no codes.
    pub fn encode(&self, features: &[f32]) -> Vec<u32> {
        let latent = self.spec.frames_per_latent() * self.stats.mean.len();
        let n_latents = features.len() / latent;
        if n_latents == 0 {
            return Vec::new();
        }
        self.encode_stack(features[..n_latents * latent].to_vec(), 1)
    }

    /// Raw features of the codes of one clip of `n_frames` frames, row-major `[n_frames, n_features]`,
    /// without the frames after the last whole latent.
    ///
    /// # Errors
    /// If a clip of so many frames has another number of codes, or an id is not below its scale's
    /// `n_vocab`.
    pub fn decode(&self, ids: &[u32], n_frames: usize) -> Result<Vec<f32>, TokenizerError> {
        let n_latents = n_frames / self.spec.frames_per_latent();
        let (found, wanted) = (ids.len(), self.n_codes(n_frames));
        if found != wanted {
            return Err(TokenizerError::CodeCount { found, wanted, n_frames });
        }
        self.check_ids(ids, n_frames)?;
        if n_latents == 0 {
            return Ok(Vec::new());
        }
        Ok(self.decode_stack(ids, Extent { n_clips: 1, n_latents }))
    }

    /// Codes of a clip of so many frames: none where it has no whole latent.
    fn n_codes(&self, n_frames: usize) -> usize {
        let is_encoded = n_frames >= self.spec.frames_per_latent();
        if is_encoded { self.spec.grid().n_codes(n_frames) } else { 0 }
    }

    fn check_ids(&self, ids: &[u32], n_frames: usize) -> Result<(), TokenizerError> {
        let grid = self.spec.grid();
        let lengths = grid.lengths(n_frames);
        let sizes = grid.scales.iter().zip(lengths);
        let sizes = sizes.flat_map(|(scale, length)| std::iter::repeat_n(scale.n_vocab, length));
        match ids.iter().zip(sizes).find(|(id, n_vocab)| **id as usize >= *n_vocab) {
            Some((&id, n_vocab)) => Err(TokenizerError::UnknownCode { id, n_vocab }),
            None => Ok(()),
        }
    }

    /// The quantizer, for a generator that makes codes scale after scale.
    pub fn quantizer(&self) -> &dyn Quantizer {
        self.module.quantizer()
    }

    /// Codes, clip after clip, of the raw features of `n_clips` clips of one length in whole latents.
    pub(super) fn encode_stack(&self, mut features: Vec<f32>, n_clips: usize) -> Vec<u32> {
        self.normaliser.apply(&mut features);
        let n_features = self.stats.mean.len();
        let n_frames = features.len() / n_clips / n_features;
        let data = TensorData::new(features, [n_clips, n_frames, n_features]);
        self.module.ids(Tensor::from_data(data, &self.device))
    }

    /// Raw features, clip after clip, of the codes of clips of one length.
    pub(super) fn decode_stack(&self, ids: &[u32], extent: Extent) -> Vec<f32> {
        let features = self.module.decode(ids, extent).into_data();
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
    use crate::spec::{CodebookKind, QuantizerKind, QuantizerSection, QuantizerSpec, ScaleSpec};
    use crate::tokenizer::testing::{Waves, small_spec};

    fn untrained(kind: QuantizerSpec) -> Tokenizer {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
        let spec = TokenizerSpec { quantizer: kind, ..small_spec() };
        let stats = Waves::new(&[8], 5).stats;
        let module = TokenizerModule::new(&spec, 5, &mut rng, &device);
        Tokenizer::new(module, spec, stats, device)
    }

    /// A quantizer of each kind, with scales of three codes in all.
    fn kinds() -> Vec<QuantizerSpec> {
        let (fsq, vq) = (CodebookKind::Fsq, CodebookKind::Vq);
        let section = |kind: QuantizerKind, inner| {
            let mut section = QuantizerSection { inner: Some(inner), ..kind.section() };
            match kind {
                QuantizerKind::Residual => section.layers = Some(2),
                _ => section.scales = Some(ScaleSpec::List(vec![1, 2])),
            }
            section.of_size(16).unwrap()
        };
        let kinds = [QuantizerKind::Residual, QuantizerKind::Multiscale];
        let several =
            kinds.into_iter().flat_map(|kind| [fsq, vq].map(|inner| section(kind, inner)));
        let single = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 6 }];
        single.into_iter().chain(several).collect()
    }

    #[test]
    fn a_saved_tokenizer_loads_with_the_same_codes_and_features() {
        for kind in kinds() {
            let folder = tempfile::tempdir().unwrap();
            let tokenizer = untrained(kind);
            tokenizer.save(folder.path()).unwrap();
            let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
            let features = Waves::new(&[40], 5).clip(0, 0);
            let ids = tokenizer.encode(&features);
            assert_eq!((loaded.spec(), loaded.stats()), (tokenizer.spec(), tokenizer.stats()));
            let wanted = tokenizer.spec().grid().n_codes(40);
            assert_eq!((ids.len(), loaded.encode(&features)), (wanted, ids.clone()));
            assert_eq!(loaded.decode(&ids, 40).unwrap(), tokenizer.decode(&ids, 40).unwrap());
        }
    }

    #[test]
    fn frames_after_the_last_whole_latent_are_left_out() {
        for kind in kinds() {
            let tokenizer = untrained(kind);
            let features = Waves::new(&[24], 5).clip(0, 0);
            let ids = tokenizer.encode(&features[..23 * 5]);
            assert_eq!(ids, tokenizer.encode(&features[..20 * 5]));
            assert_eq!(tokenizer.decode(&ids, 23).unwrap().len(), 20 * 5);
            assert!(tokenizer.encode(&features[..3 * 5]).is_empty());
            assert!(tokenizer.decode(&[], 3).unwrap().is_empty());
        }
    }

    #[test]
    fn an_id_that_is_no_code_is_an_error() {
        let tokenizer = untrained(QuantizerSpec::Fsq { levels: vec![5, 3] });
        assert_eq!(tokenizer.decode(&[14, 0], 8).unwrap().len(), 8 * 5);
        let error = tokenizer.decode(&[3, 15], 8).unwrap_err().to_string();
        assert!(error.contains("15"), "{error}");
        let error = tokenizer.decode(&[3, 1], 12).unwrap_err().to_string();
        assert!(error.contains("2 codes") && error.contains("12 frames have 3"), "{error}");
    }

    #[test]
    fn an_id_is_held_against_the_codebook_of_its_own_scale() {
        let mut section = QuantizerKind::Multiscale.section();
        section.scales = Some(ScaleSpec::List(vec![1, 2]));
        let tokenizer = untrained(section.of_size(16).unwrap());
        assert!(tokenizer.decode(&[7, 23, 23], 20).is_ok());
        let error = tokenizer.decode(&[8, 23, 23], 20).unwrap_err().to_string();
        assert!(error.contains("8 is no code") && error.contains("8 codes"), "{error}");
    }
}
