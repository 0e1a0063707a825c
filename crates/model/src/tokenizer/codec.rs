//! [`Tokenizer`]: a trained module with the statistics its features are normalised by.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::TokenizerError;
use super::corpus::Normaliser;
use super::halves::{Captions, host};
use super::module::TokenizerModule;
use super::quantizer::{Extent, Quantizer};
use crate::data::{self, FeatureStats, MotionSource};
use crate::files::FileError;
use crate::generator::ScaleInputs;
use crate::learn::{described, weights};
use crate::spec::TokenizerSpec;

/// Raw features to codes and back.
#[derive(Debug)]
pub struct Tokenizer {
    module: TokenizerModule,
    spec: TokenizerSpec,
    stats: FeatureStats,
    fps: f64,
    normaliser: Normaliser,
    device: Device,
}

impl Tokenizer {
    /// Takes a module as it is after training, without autodiff, on `device`.
    pub(super) fn new(
        module: TokenizerModule,
        spec: TokenizerSpec,
        stats: FeatureStats,
        fps: f64,
        device: Device,
    ) -> Self {
        let normaliser = Normaliser::new(&spec, &stats);
        Self { module, spec, stats, fps, normaliser, device }
    }

    /// As [`Tokenizer::new`], after training on clips.
    pub(super) fn of_clips(
        module: TokenizerModule,
        spec: &TokenizerSpec,
        clips: &dyn MotionSource,
        device: &Device,
    ) -> Self {
        let (stats, fps) = (clips.stats().clone(), clips.fps().into());
        Self::new(module, spec.clone(), stats, fps, device.clone())
    }

    /// Its specification.
    pub fn spec(&self) -> &TokenizerSpec {
        &self.spec
    }

    /// Frames per second of the motion that it was trained on.
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// The normalisation of its features.
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
    /// A tokenizer with language sees the clip's caption, row-major `[words, dim]`; others look at none.
    /// Frames after the last whole stride are left out; fewer frames than one stride have no codes.
    ///
    /// # Errors
    /// If a tokenizer with language is given no caption, or one of another width.
    pub fn encode(
        &self,
        features: &[f32],
        caption: Option<&[f32]>,
    ) -> Result<Vec<u32>, TokenizerError> {
        let captions = self.captions(caption)?;
        Ok(self.encode_with(features, captions.as_ref()))
    }

    /// The same with captions at hand.
    pub(super) fn encode_with(&self, features: &[f32], captions: Option<&Captions>) -> Vec<u32> {
        let stride = self.spec.stride() * self.stats.mean.len();
        let whole = features.len() / stride * stride;
        if whole == 0 {
            return Vec::new();
        }
        self.encode_stack(features[..whole].to_vec(), 1, captions)
    }

    /// Raw features of the codes of one clip of `n_frames` frames, row-major `[n_frames, n_features]`,
    /// without the frames after the last whole stride.
    ///
    /// A tokenizer with language reads the clip's caption, like [`Tokenizer::encode`]; `guidance` g gives (1 + g) m_c −
    /// g m_u, with m_u decoded without the caption. LG-Tok uses 2 for HumanML3D and 1 for Motion-X; 0 reconstructs.
    ///
    /// # Errors
    /// If a clip of so many frames has another number of codes, or an id is not below its scale's
    /// `n_vocab`; as [`Tokenizer::encode`].
    pub fn decode(
        &self,
        ids: &[u32],
        n_frames: usize,
        caption: Option<&[f32]>,
        guidance: f64,
    ) -> Result<Vec<f32>, TokenizerError> {
        self.decode_with(ids, n_frames, self.captions(caption)?.as_ref(), guidance)
    }

    /// The same with captions at hand.
    pub(super) fn decode_with(
        &self,
        ids: &[u32],
        n_frames: usize,
        captions: Option<&Captions>,
        guidance: f64,
    ) -> Result<Vec<f32>, TokenizerError> {
        let whole = n_frames / self.spec.stride() * self.spec.stride();
        // A clip without a whole stride has no codes.
        let wanted = if whole == 0 { 0 } else { self.spec.grid().n_codes(n_frames) };
        let found = ids.len();
        if found != wanted {
            return Err(TokenizerError::CodeCount { found, wanted, n_frames });
        }
        if whole == 0 {
            return Ok(Vec::new());
        }
        let grid = self.spec.grid();
        let sizes = grid.scales.iter().zip(grid.lengths(n_frames));
        let sizes = sizes.flat_map(|(scale, length)| std::iter::repeat_n(scale.n_vocab, length));
        if let Some((&id, n_vocab)) = ids.iter().zip(sizes).find(|(id, n)| **id as usize >= *n) {
            return Err(TokenizerError::UnknownCode { id, n_vocab });
        }
        Ok(self.decode_stack(ids, [1, whole], captions, guidance))
    }

    /// The quantizer, for a generator that makes codes scale after scale.
    pub fn quantizer(&self) -> &dyn Quantizer {
        &*self.module.quantizer
    }

    /// Codes, clip after clip, of the raw features of `n_clips` clips of one length in whole strides.
    pub(super) fn encode_stack(
        &self,
        features: Vec<f32>,
        n_clips: usize,
        captions: Option<&Captions>,
    ) -> Vec<u32> {
        let values = self.normaliser.apply(features);
        let n_features = self.normaliser.n_features();
        let n_frames = values.len() / n_clips / n_features;
        let data = TensorData::new(values, [n_clips, n_frames, n_features]);
        self.module.ids(Tensor::from_data(data, &self.device), captions)
    }

    /// Raw features, clip after clip, of the codes of `n_clips` clips of `n_frames` frames in whole strides.
    pub(super) fn decode_stack(
        &self,
        ids: &[u32],
        [n_clips, n_frames]: [usize; 2],
        captions: Option<&Captions>,
        guidance: f64,
    ) -> Vec<f32> {
        let latents_blc = self.quantizer().embed(ids, self.extent(n_clips, n_frames));
        let values = host(self.module.decode(latents_blc, n_frames, captions, guidance));
        self.normaliser.undo(values, n_frames, self.fps)
    }

    /// The latents of clips of so many frames.
    fn extent(&self, n_clips: usize, n_frames: usize) -> Extent {
        Extent { n_clips, n_latents: self.spec.architecture.n_latents(n_frames) }
    }

    /// Writes `weights.safetensors`, then `tokenizer.json`, each whole, by rename.
    pub fn save(&self, folder: &Path) -> Result<(), TokenizerError> {
        let mut tensors = weights::of_module(&self.module);
        weights::insert_stats(&mut tensors, &self.stats);
        weights::insert_number(&mut tensors, FPS, self.fps);
        Ok(described::save(folder, SPEC, &self.spec, &tensors)?)
    }

    /// Reads files of [`Tokenizer::save`], for use on `device`.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, TokenizerError> {
        let (spec, mut tensors): (TokenizerSpec, _) = described::load(folder, SPEC)?;
        spec.check()?;
        let fps = weights::take_number(&mut tensors, FPS).unwrap_or(data::FPS);
        let beyond = described::beyond(&(&spec.architecture, &spec.quantizer), &tensors);
        if let Some(problem) = beyond.or_else(|| described::no_rate(fps)) {
            return Err(FileError::damaged(&folder.join(SPEC), problem).into());
        }
        let stats = weights::take_stats(&mut tensors)?;
        let module = TokenizerModule::of_weights(&spec, &stats, tensors, device)?;
        Ok(Self::new(module, spec, stats, fps, device.clone()))
    }
}

const SPEC: &str = "tokenizer.json";
/// The rate of the motion, among the tensors.
const FPS: &str = "fps";

impl ScaleInputs for Tokenizer {
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>> {
        let extent = self.extent(n_clips, n_frames);
        let inputs = self.quantizer().inputs(codes, extent).into_iter();
        inputs.map(host).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use crate::motion::N_FEATURES;
    use crate::spec::{
        ArchitectureSpec, CodebookKind, QuantizerKind, QuantizerSection, QuantizerSpec,
        Representation, ScaleSpec,
    };
    use crate::tokenizer::testing::{Waves, patch_spec, small_spec, transformer_spec};
    use crate::tokenizer::{Corpus, train};

    fn untrained(kind: QuantizerSpec) -> Tokenizer {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
        let spec = TokenizerSpec { quantizer: kind, ..small_spec() };
        let stats = Waves::new(&[8], 5).metadata.stats;
        let module = TokenizerModule::new(&spec, 5, &mut rng, &device);
        Tokenizer::new(module, spec, stats, 29.97, device)
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
            assert_eq!(loaded.fps(), tokenizer.fps());
            let features = Waves::new(&[40], 5).clip(0, 0);
            let ids = tokenizer.encode(&features, None).unwrap();
            assert_eq!((loaded.spec(), loaded.stats()), (tokenizer.spec(), tokenizer.stats()));
            let wanted = tokenizer.spec().grid().n_codes(40);
            assert_eq!((ids.len(), loaded.encode(&features, None).unwrap()), (wanted, ids.clone()));
            let decoded = |tokenizer: &Tokenizer| tokenizer.decode(&ids, 40, None, 0.0).unwrap();
            assert_eq!(decoded(&loaded), decoded(&tokenizer));
        }
    }

    #[test]
    fn frames_after_the_last_whole_latent_are_left_out() {
        for kind in kinds() {
            let tokenizer = untrained(kind);
            let features = Waves::new(&[24], 5).clip(0, 0);
            let codes = |frames: usize| tokenizer.encode(&features[..frames * 5], None).unwrap();
            let decode = |ids: &[u32], frames| tokenizer.decode(ids, frames, None, 0.0).unwrap();
            let ids = codes(23);
            assert_eq!(ids, codes(20));
            assert_eq!(decode(&ids, 23).len(), 20 * 5);
            assert!(codes(3).is_empty() && decode(&[], 3).is_empty());
        }
    }

    #[test]
    fn clips_of_any_length_have_a_fixed_number_of_latents_and_their_own_frames() {
        let mut section = QuantizerKind::Multiscale.section();
        section.scales = Some(ScaleSpec::List(vec![1, 2, 5]));
        let mut spec = transformer_spec(&[], section.of_size(16).unwrap(), 3);
        let ArchitectureSpec::Transformer(sizes) = &mut spec.architecture else { panic!() };
        sizes.latents = Some(5);
        let source = Waves::new(&[40, 12, 16, 4], N_FEATURES);
        let keep_on = &mut |_| std::ops::ControlFlow::Continue(());
        let corpus = Corpus::wordless(&source);
        let tokenizer = train(&spec, &corpus, &Device::flex(), None, keep_on).unwrap();
        let features = source.clip(0, 0);
        // Windows have 16 frames, so that clips of 23 and 40 are encoded in two pieces and in three.
        for (n_frames, whole, latents) in
            [(4, 4, 5), (8, 8, 5), (16, 16, 5), (23, 20, 10), (40, 40, 15)]
        {
            let ids = tokenizer.encode(&features[..n_frames * N_FEATURES], None).unwrap();
            assert_eq!((ids.len(), tokenizer.extent(1, n_frames).n_latents), (8, latents));
            let made = tokenizer.decode(&ids, n_frames, None, 0.0).unwrap();
            assert_eq!(made.len(), whole * N_FEATURES);
            assert!(made.iter().all(|x| x.is_finite()));
            let inputs = tokenizer.inputs(&ids, 1, n_frames);
            let lengths: Vec<usize> = inputs.iter().map(|input| input.len() / 4).collect();
            assert_eq!(lengths, [2, 5]);
        }
        // The same codes are stretched over as many frames as are asked for.
        let ids = tokenizer.encode(&features[..16 * N_FEATURES], None).unwrap();
        let [short, long] = [8, 16].map(|n| tokenizer.decode(&ids, n, None, 0.0).unwrap());
        assert_ne!(short, long[..8 * N_FEATURES]);
        assert!(tokenizer.encode(&features[..3 * N_FEATURES], None).unwrap().is_empty());
    }

    #[test]
    fn an_id_that_is_no_code_is_an_error() {
        let tokenizer = untrained(QuantizerSpec::Fsq { levels: vec![5, 3] });
        let decode = |ids: &[u32], frames| tokenizer.decode(ids, frames, None, 0.0);
        assert_eq!(decode(&[14, 0], 8).unwrap().len(), 8 * 5);
        let error = decode(&[3, 15], 8).unwrap_err().to_string();
        assert!(error.contains("15"), "{error}");
        let error = decode(&[3, 1], 12).unwrap_err().to_string();
        assert!(error.contains("2 codes") && error.contains("12 frames have 3"), "{error}");
    }

    #[test]
    fn an_id_is_held_against_the_codebook_of_its_own_scale() {
        let mut section = QuantizerKind::Multiscale.section();
        section.scales = Some(ScaleSpec::List(vec![1, 2]));
        let tokenizer = untrained(section.of_size(16).unwrap());
        assert!(tokenizer.decode(&[7, 23, 23], 20, None, 0.0).is_ok());
        let error = tokenizer.decode(&[8, 23, 23], 20, None, 0.0).unwrap_err().to_string();
        assert!(error.contains("8 is no code") && error.contains("8 codes"), "{error}");
    }

    #[test]
    fn a_tokenizer_of_67_features_looks_at_no_other_and_makes_all() {
        let vq = || QuantizerSpec::Vq { n_vocab: 6 };
        for spec in [small_spec(), patch_spec(vq(), 3), transformer_spec(&[], vq(), 3)] {
            let mut spec = TokenizerSpec { representation: Representation::Meng67, ..spec };
            if spec.architecture.name() == "patch" {
                (spec.training.mix_body, spec.training.mix_arm) = (0.5, 0.5);
            }
            let source = Waves::new(&[40, 36, 40], N_FEATURES);
            let keep_on = &mut |_| std::ops::ControlFlow::Continue(());
            let corpus = Corpus::wordless(&source);
            let tokenizer = train(&spec, &corpus, &Device::flex(), None, keep_on).unwrap();
            let mut features = source.clip(0, 0);
            let ids = tokenizer.encode(&features, None).unwrap();
            features.chunks_mut(N_FEATURES).for_each(|frame| frame[67..].fill(1e3));
            assert_eq!(tokenizer.encode(&features, None).unwrap(), ids);
            let made = tokenizer.decode(&ids, 40, None, 0.0).unwrap();
            assert_eq!(made.len(), 40 * N_FEATURES);
            assert!(made.iter().all(|x| x.is_finite()));
            let folder = tempfile::tempdir().unwrap();
            tokenizer.save(folder.path()).unwrap();
            let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
            assert_eq!(loaded.decode(&ids, 40, None, 0.0).unwrap(), made);
        }
    }
}
