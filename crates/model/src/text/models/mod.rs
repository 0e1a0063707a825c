//! Text encoders from local weights: T5, CLIP's text tower, the BERT family, LLaMA, computed by candle.
//!
//! A model's folder has `config.json`, `tokenizer.json` and `model.safetensors` as downloaded from the hub. States are
//! from the last layer, after its norm, in single precision. Captions with the same number of tokens form a batch, so none
//! is padded.

mod networks;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use candle_core::{DType, Device, Tensor};
use tokenizers::Tokenizer;

use super::store::{TextEncoder, TextError};
use crate::progress::moved;
use crate::spec::{TextEncoderKind, TextSpec, TextStates};
use networks::{ModelFolder, Network, first_line};

/// Captions that go through a model together.
const BATCH: usize = 32;

/// A text encoder of a folder.
pub struct LocalModel {
    folder: PathBuf,
    network: Box<dyn Network>,
    tokenizer: Tokenizer,
    dim: usize,
    max_tokens: usize,
    states: TextStates,
    digest: String,
}

impl LocalModel {
    /// Opens a model; captions are cut to `max_tokens` tokens, those included that the tokenizer adds.
    ///
    /// # Errors
    /// A file is missing, is not of such a model, or its states have another width than `spec.dim`.
    pub fn open(path: &Path, spec: &TextSpec) -> Result<Self, TextError> {
        let folder = ModelFolder::open(path)?;
        let (network, found) = match spec.encoder {
            TextEncoderKind::T5 => networks::load_t5(&folder)?,
            TextEncoderKind::Clip => networks::load_clip(&folder, spec.states)?,
            TextEncoderKind::Llama => networks::load_llama(&folder)?,
            _ => networks::load_bert(&folder)?,
        };
        if found != spec.dim {
            return Err(TextError::Width { found, wanted: spec.dim, file: path.to_path_buf() });
        }
        Ok(Self {
            network,
            tokenizer: folder.tokenizer(spec.max_tokens)?,
            dim: found,
            max_tokens: spec.max_tokens,
            states: spec.states,
            digest: folder.digest(),
            folder: path.to_path_buf(),
        })
    }

    fn failed(&self, error: impl std::fmt::Display) -> TextError {
        TextError::Model { folder: self.folder.clone(), reason: error.to_string() }
    }

    /// The ids of a caption's tokens, at least one.
    fn ids(&self, caption: &str) -> Result<Vec<u32>, TextError> {
        let encoding = self.tokenizer.encode(caption, true).map_err(|error| self.failed(error))?;
        let ids = encoding.get_ids();
        if ids.is_empty() {
            return Err(self.failed(format!("its tokenizer makes no token of `{caption}`")));
        }
        Ok(ids[..ids.len().min(self.max_tokens)].to_vec())
    }

    /// Vectors of captions of one number of tokens.
    fn together(&self, ids: &[Vec<u32>]) -> candle_core::Result<Vec<Vec<f32>>> {
        let shape = (ids.len(), ids[0].len());
        let ids = Tensor::from_vec(ids.concat(), shape, &Device::Cpu)?;
        let states = self.network.states(&ids)?.to_dtype(DType::F32)?;
        let vectors = match self.states {
            TextStates::Words => states,
            TextStates::Sentence => self.network.sentence(&ids, &states)?.unsqueeze(1)?,
        };
        vectors.flatten_from(1)?.to_vec2()
    }

    fn all(&self, captions: &[String]) -> Result<Vec<Vec<f32>>, TextError> {
        let mut by_length: BTreeMap<usize, Vec<(usize, Vec<u32>)>> = BTreeMap::new();
        for (place, caption) in captions.iter().enumerate() {
            let ids = self.ids(caption)?;
            by_length.entry(ids.len()).or_default().push((place, ids));
        }
        let mut all = vec![Vec::new(); captions.len()];
        for batch in by_length.values().flat_map(|alike| alike.chunks(BATCH)) {
            let ids: Vec<Vec<u32>> = batch.iter().map(|(_, ids)| ids.clone()).collect();
            let vectors = self.together(&ids).map_err(|error| self.failed(first_line(&error)))?;
            for ((place, _), vector) in batch.iter().zip(vectors) {
                all[*place] = vector;
            }
            moved();
        }
        Ok(all)
    }
}

impl TextEncoder for LocalModel {
    fn dim(&self) -> usize {
        self.dim
    }

    fn encode(&self, caption: &str) -> Result<Vec<f32>, TextError> {
        Ok(self.all(&[caption.to_string()])?.swap_remove(0))
    }

    fn encode_all(&self, captions: &[String]) -> Vec<Result<Vec<f32>, TextError>> {
        match self.all(captions) {
            Ok(vectors) => vectors.into_iter().map(Ok).collect(),
            // One of them is to blame; each by itself says which.
            Err(_) => captions.iter().map(|caption| self.encode(caption)).collect(),
        }
    }

    fn n_tokens(&self, caption: &str) -> Result<usize, TextError> {
        let n = self.ids(caption)?.len();
        Ok(if self.states == TextStates::Words { n } else { 1 })
    }

    fn digest(&self) -> Option<String> {
        Some(self.digest.clone())
    }
}
