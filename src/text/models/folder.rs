//! [`ModelFolder`]: the files of a model, read and checked.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use candle_core::{DType, Device, Tensor};
use candle_nn::VarBuilder;
use serde::de::DeserializeOwned;
use tokenizers::{Tokenizer, TruncationParams};

use crate::files::FileError;
use crate::text::error::TextError;

const CONFIG: &str = "config.json";
const TOKENIZER: &str = "tokenizer.json";
const WEIGHTS: &str = "model.safetensors";

/// The files of a model.
pub struct ModelFolder {
    path: PathBuf,
    config: Vec<u8>,
    tokenizer: Vec<u8>,
    weights: Vec<u8>,
}

impl ModelFolder {
    /// Reads all three files.
    ///
    /// # Errors
    /// One of them cannot be read.
    pub fn open(path: &Path) -> Result<Self, TextError> {
        let read = |name: &str| {
            let file = path.join(name);
            fs::read(&file).map_err(|error| TextError::File(FileError::read(&file)(error)))
        };
        Ok(Self {
            config: read(CONFIG)?,
            tokenizer: read(TOKENIZER)?,
            weights: read(WEIGHTS)?,
            path: path.to_path_buf(),
        })
    }

    /// Hex digest of all three.
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for file in [&self.config, &self.tokenizer, &self.weights] {
            hasher.update(blake3::hash(file).as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }

    /// What `config.json` says.
    ///
    /// # Errors
    /// It is not of such a model.
    pub fn config<T: DeserializeOwned>(&self) -> Result<T, TextError> {
        serde_json::from_slice(&self.config)
            .map_err(|error| self.failed(format!("{CONFIG}: {error}")))
    }

    /// The tokenizer, which cuts texts to `max_tokens` and pads none.
    ///
    /// # Errors
    /// `tokenizer.json` cannot be understood.
    pub fn tokenizer(&self, max_tokens: usize) -> Result<Tokenizer, TextError> {
        let failed = |error: tokenizers::Error| self.failed(format!("{TOKENIZER}: {error}"));
        let mut tokenizer = Tokenizer::from_bytes(&self.tokenizer).map_err(failed)?;
        let cut = TruncationParams { max_length: max_tokens, ..TruncationParams::default() };
        tokenizer.with_truncation(Some(cut)).map_err(failed)?;
        tokenizer.with_padding(None);
        Ok(tokenizer)
    }

    /// The weights in single precision.
    ///
    /// # Errors
    /// `model.safetensors` is damaged.
    pub fn weights(&self) -> Result<HashMap<String, Tensor>, TextError> {
        let failed =
            |error: candle_core::Error| self.failed(format!("{WEIGHTS}: {}", first_line(&error)));
        let loaded = candle_core::safetensors::load_buffer(&self.weights, &Device::Cpu);
        let single = loaded.map_err(failed)?.into_iter().map(|(name, tensor)| {
            // Counters and the like, as position ids, are no weights.
            let is_float = tensor.dtype().is_float();
            let tensor = if is_float { tensor.to_dtype(DType::F32)? } else { tensor };
            Ok((name, tensor))
        });
        single.collect::<candle_core::Result<_>>().map_err(failed)
    }

    /// A network of weights.
    ///
    /// # Errors
    /// A weight is missing or of another shape.
    pub fn network<T>(
        &self,
        weights: HashMap<String, Tensor>,
        load: impl FnOnce(VarBuilder<'static>) -> candle_core::Result<T>,
    ) -> Result<T, TextError> {
        let built = load(VarBuilder::from_tensors(weights, DType::F32, &Device::Cpu));
        built.map_err(|error| self.failed(format!("{WEIGHTS}: {}", first_line(&error))))
    }

    /// Why the model cannot be used.
    pub fn failed(&self, reason: impl Into<String>) -> TextError {
        TextError::Model { folder: self.path.clone(), reason: reason.into() }
    }
}

/// What an error says, without the stack that candle adds where `RUST_BACKTRACE` is set.
pub fn first_line(error: &candle_core::Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}
