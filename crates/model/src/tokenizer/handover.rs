//! [`Handover`]: all that a trainer in another process is given of a tokenizer, and the way back.
//!
//! The trainer begins with the same weights as the built-in one and draws the same numbers, so it
//! takes the same steps. A batch is a pure function of the spec: from the stream `WINDOWS_STREAM` of
//! the seed, of which the first `drawn` numbers chose the clips, each step takes one number for the
//! length of its windows (transformers alone), then for each window one for its clip and one for its
//! first frame.

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use serde::Serialize;

use super::begin::{begun, stream};
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::error::TokenizerError;
use super::module::TokenizerModule;
use super::normalise::Normaliser;
use super::pool::WindowPool;
use super::train::WINDOWS_STREAM;
use crate::learn::weights;
use crate::spec::TokenizerSpec;

/// Raised when a key changes its meaning or goes.
const VERSION: u32 = 1;

/// Numbers of 32 bits that a generator counts in one of 64.
const WORDS_PER_NUMBER: u128 = 2;

/// One tokenizer as its trainer reads it: complete, with absolute paths.
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

/// Where a trainer leaves and finds what is not a part of the spec.
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
    /// As [`train`](super::train()) before its first step.
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
        let module = begun(spec, &pool, normaliser.n_features(), device);
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
            codebook_keys: module.quantizer().keys().into_iter().map(words).collect(),
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
