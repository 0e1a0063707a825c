//! [`Tokenizer`]: a trained module with the statistics its features are normalised by.

use std::io;
use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::captions::Captions;
use super::error::TokenizerError;
use super::module::TokenizerModule;
use super::normalise::Normaliser;
use super::quantizer::{Extent, Quantizer};
use crate::data::{self, FeatureStats, MotionSource};
use crate::files::atomic::write_json;
use crate::files::{FileError, read_if_there};
use crate::generator::ScaleInputs;
use crate::learn::weights;
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

    /// What it was trained by.
    pub fn spec(&self) -> &TokenizerSpec {
        &self.spec
    }

    /// Frames a second of the motion that it was trained on.
    pub fn fps(&self) -> f64 {
        self.fps
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
    /// A tokenizer with language sees the clip's caption, row-major `[words, dim]`; others look at none.
    /// Frames after the last whole latent are left out; fewer frames than one latent's have no codes.
    ///
    /// # Errors
    /// If a tokenizer with language is given no caption, or one of another width.
    pub fn encode(
        &self,
        features: &[f32],
        caption: Option<&[f32]>,
    ) -> Result<Vec<u32>, TokenizerError> {
        let captions = self.captions(caption)?;
        let latent = self.spec.frames_per_latent() * self.stats.mean.len();
        let n_latents = features.len() / latent;
        if n_latents == 0 {
            return Ok(Vec::new());
        }
        Ok(self.encode_stack(features[..n_latents * latent].to_vec(), 1, captions.as_ref()))
    }

    /// The caption of one clip, where the tokenizer has language.
    fn captions(&self, caption: Option<&[f32]>) -> Result<Option<Captions>, TokenizerError> {
        let Some(language) = self.spec.architecture.language() else { return Ok(None) };
        let (caption, wanted) = (caption.ok_or(TokenizerError::NoText)?, language.dim);
        if caption.is_empty() || !caption.len().is_multiple_of(wanted) {
            return Err(TokenizerError::TextWidth { found: caption.len(), wanted });
        }
        Ok(Some(Captions::of([caption], wanted)))
    }

    /// Raw features of the codes of one clip of `n_frames` frames, row-major `[n_frames, n_features]`,
    /// without the frames after the last whole latent.
    ///
    /// A tokenizer with language sees the clip's caption, as [`Tokenizer::encode`] does, and follows it
    /// the more the larger `guidance` is: (1 + g) m_c − g m_u, with what it makes without the caption.
    /// LG-Tok has 2 for HumanML3D and 1 for Motion-X; 0 reconstructs.
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
        let captions = self.captions(caption)?;
        let n_latents = n_frames / self.spec.frames_per_latent();
        let (found, wanted) = (ids.len(), self.n_codes(n_frames));
        if found != wanted {
            return Err(TokenizerError::CodeCount { found, wanted, n_frames });
        }
        self.check_ids(ids, n_frames)?;
        if n_latents == 0 {
            return Ok(Vec::new());
        }
        let extent = Extent { n_clips: 1, n_latents };
        Ok(self.decode_stack(ids, extent, captions.as_ref(), guidance))
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

    /// Raw features, clip after clip, of the codes of clips of one length.
    pub(super) fn decode_stack(
        &self,
        ids: &[u32],
        extent: Extent,
        captions: Option<&Captions>,
        guidance: f64,
    ) -> Vec<f32> {
        let features = self.module.decode(ids, extent, captions, guidance).into_data();
        let values = features.try_into_vec().expect("features are f32");
        self.normaliser.undo(values, extent.n_latents * self.spec.frames_per_latent())
    }

    /// Writes `weights.safetensors`, then `tokenizer.json`, each whole, by rename.
    pub fn save(&self, folder: &Path) -> Result<(), TokenizerError> {
        let mut tensors = weights::of_module(&self.module);
        weights::insert_stats(&mut tensors, &self.stats);
        weights::insert_number(&mut tensors, FPS, self.fps);
        weights::save(&folder.join(WEIGHTS), &tensors, Default::default())?;
        let path = folder.join(SPEC);
        Ok(write_json(&path, &self.spec)?)
    }

    /// Reads what [`Tokenizer::save`] wrote, for use on `device`.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, TokenizerError> {
        let spec = read_spec(&folder.join(SPEC))?;
        let (mut tensors, _) = weights::load(&folder.join(WEIGHTS))?;
        let fps = weights::take_number(&mut tensors, FPS).unwrap_or(data::FPS);
        let stats = weights::take_stats(&mut tensors)?;
        let module = TokenizerModule::of_weights(&spec, &stats, tensors, device)?;
        Ok(Self::new(module, spec, stats, fps, device.clone()))
    }
}

const WEIGHTS: &str = "weights.safetensors";
const SPEC: &str = "tokenizer.json";
/// The rate of the motion, among the tensors.
const FPS: &str = "fps";

fn read_spec(path: &Path) -> Result<TokenizerSpec, TokenizerError> {
    let spec: Option<TokenizerSpec> = read_if_there(path)?;
    let missing = || FileError::read(path)(io::ErrorKind::NotFound.into());
    let spec = spec.ok_or_else(missing)?;
    spec.check()?;
    Ok(spec)
}

#[cfg(test)]
mod tests;

impl ScaleInputs for Tokenizer {
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>> {
        let extent = Extent { n_clips, n_latents: self.n_latents(n_frames) };
        let inputs = self.quantizer().inputs(codes, extent).into_iter();
        inputs.map(|x| x.into_data().try_into_vec().expect("latents are f32")).collect()
    }

    fn n_latents(&self, n_frames: usize) -> usize {
        n_frames / self.spec().architecture.frames_per_latent()
    }
}
