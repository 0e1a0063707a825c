//! Computes states with a model's folder: BERT, T5, LLaMA, CLIP.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use candle_core::{D, DType, Device, IndexOp, Tensor};
use candle_nn::VarBuilder;
use candle_transformers::models::bert::{self, BertModel};
use candle_transformers::models::clip::text_model::{
    Activation, ClipTextConfig, ClipTextTransformer,
};
use candle_transformers::models::llama::{Cache, Config, Llama, LlamaConfig};
use candle_transformers::models::t5::{self, T5EncoderModel};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use tokenizers::{Tokenizer, TruncationParams};

use crate::files::{ANY, FileError, read_regular};
use crate::spec::TextStates;
use crate::text::store::TextError;

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
            read_regular(&file, ANY).map_err(|error| TextError::File(FileError::read(&file)(error)))
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

    /// The settings in `config.json`.
    fn config<T: DeserializeOwned>(&self) -> Result<T, TextError> {
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
    fn weights(&self) -> Result<HashMap<String, Tensor>, TextError> {
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
    fn network<T>(
        &self,
        weights: HashMap<String, Tensor>,
        load: impl FnOnce(VarBuilder<'static>) -> candle_core::Result<T>,
    ) -> Result<T, TextError> {
        let built = load(VarBuilder::from_tensors(weights, DType::F32, &Device::Cpu));
        built.map_err(|error| self.failed(format!("{WEIGHTS}: {}", first_line(&error))))
    }

    /// Why the model cannot be used.
    fn failed(&self, reason: impl Into<String>) -> TextError {
        TextError::Model { folder: self.path.clone(), reason: reason.into() }
    }
}

/// The message of an error, without the stack that candle adds if `RUST_BACKTRACE` is set.
pub fn first_line(error: &candle_core::Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}

/// The states of captions by a model.
pub trait Network: Send + Sync {
    /// States of the tokens of captions of one length, `[n, tokens]` to `[n, tokens, dim]`.
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor>;

    /// One vector a caption, `[n, dim]`, of its tokens and their states; by default the mean of these.
    fn sentence(&self, _ids: &Tensor, states: &Tensor) -> candle_core::Result<Tensor> {
        states.mean(1)
    }
}

/// A network, and the width of its vectors.
type Loaded = Result<(Box<dyn Network>, usize), TextError>;

// The BERT family: MiniLM, BERT, and others with its layers.

pub fn load_bert(folder: &ModelFolder) -> Loaded {
    let config: bert::Config = folder.config()?;
    let model = folder.network(folder.weights()?, |weights| BertModel::load(weights, &config))?;
    Ok((Box::new(model), config.hidden_size))
}

impl Network for BertModel {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        self.forward(ids, &ids.zeros_like()?, None)
    }
}

// The encoder of T5.

pub fn load_t5(folder: &ModelFolder) -> Loaded {
    let config: t5::Config = folder.config()?;
    let model =
        folder.network(folder.weights()?, |weights| T5EncoderModel::load(weights, &config))?;
    Ok((Box::new(Mutex::new(model)), config.d_model))
}

/// Its forward pass needs mutable access, although an encoder keeps no state.
impl Network for Mutex<T5EncoderModel> {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        self.lock().unwrap_or_else(PoisonError::into_inner).forward(ids)
    }
}

// LLaMA: the states of its last layer, which LG-Tok reads.

/// candle's LLaMA gives logits of the last position alone. Its head is replaced by the identity, so that
/// logits are states, and tokens go through one after another, each seeing those before it.
struct States {
    model: Llama,
    config: Config,
}

const HEAD: &str = "lm_head.weight";
const BODY: &str = "model.";

pub fn load_llama(folder: &ModelFolder) -> Loaded {
    let config: LlamaConfig = folder.config()?;
    let config = Config { tie_word_embeddings: false, ..config.into_config(false) };
    let width = config.hidden_size;
    let mut weights = prefixed(folder.weights()?);
    let head =
        identity(config.vocab_size, width).map_err(|error| folder.failed(first_line(&error)))?;
    weights.insert(HEAD.to_string(), head);
    let model = folder.network(weights, |weights| Llama::load(weights, &config))?;
    Ok((Box::new(States { model, config }), width))
}

/// Weights by the names of a whole model, also for a body without its head.
fn prefixed(weights: HashMap<String, Tensor>) -> HashMap<String, Tensor> {
    if weights.keys().any(|name| name.starts_with(BODY)) {
        return weights;
    }
    weights.into_iter().map(|(name, tensor)| (format!("{BODY}{name}"), tensor)).collect()
}

/// `[rows, width]`: a row a channel, then rows of zeros.
fn identity(rows: usize, width: usize) -> candle_core::Result<Tensor> {
    let own = Tensor::eye(width, DType::F32, &Device::Cpu)?;
    if rows <= width {
        return own.narrow(0, 0, rows);
    }
    let rest = Tensor::zeros((rows - width, width), DType::F32, &Device::Cpu)?;
    Tensor::cat(&[own, rest], 0)
}

impl Network for States {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        let (_, n_tokens) = ids.dims2()?;
        let mut cache = Cache::new(true, DType::F32, &self.config, &Device::Cpu)?;
        let state = |place: usize| {
            let token = ids.i((.., place..place + 1))?;
            let logits = self.model.forward(&token, place, &mut cache)?;
            logits.narrow(1, 0, self.config.hidden_size)
        };
        let states = (0..n_tokens).map(state).collect::<candle_core::Result<Vec<_>>>()?;
        Tensor::stack(&states, 1)
    }
}

// CLIP's text tower: states of the words, or the vector of the sentence.

/// The part of `config.json` that is read: of a text tower alone, or of the tower in a whole model.
#[derive(Deserialize)]
struct ClipConfig {
    text_config: Option<TextConfig>,
    #[serde(flatten)]
    own: Option<TextConfig>,
}

#[derive(Clone, Deserialize)]
struct TextConfig {
    vocab_size: usize,
    hidden_size: usize,
    intermediate_size: usize,
    max_position_embeddings: usize,
    num_hidden_layers: usize,
    num_attention_heads: usize,
    #[serde(default = "quick_gelu")]
    hidden_act: String,
}

fn quick_gelu() -> String {
    "quick_gelu".to_string()
}

struct Clip {
    tower: ClipTextTransformer,
    /// `[projected, dim]`, of the sentence.
    projection: Option<Tensor>,
}

pub fn load_clip(folder: &ModelFolder, states: TextStates) -> Loaded {
    let config: ClipConfig = folder.config()?;
    let own = config.text_config.or(config.own);
    let own = own.ok_or_else(|| folder.failed("config.json: it describes no text tower"))?;
    if own.hidden_act != quick_gelu() {
        return Err(folder.failed(format!(
            "config.json: its activation is {}, and only quick_gelu, that of OpenAI's CLIP, is built",
            own.hidden_act
        )));
    }
    let weights = folder.weights()?;
    let projection = weights.get("text_projection.weight").cloned();
    let width = match (states, &projection) {
        (TextStates::Words, _) => own.hidden_size,
        (TextStates::Sentence, Some(projection)) => projection.dims()[0],
        (TextStates::Sentence, None) => {
            return Err(folder.failed("it has no text_projection, which makes a sentence's vector"));
        }
    };
    let shape = shape(&own);
    let load = |weights: VarBuilder<'_>| ClipTextTransformer::new(weights.pp("text_model"), &shape);
    let tower = folder.network(weights, load)?;
    Ok((Box::new(Clip { tower, projection }), width))
}

fn shape(config: &TextConfig) -> ClipTextConfig {
    ClipTextConfig {
        vocab_size: config.vocab_size,
        embed_dim: config.hidden_size,
        activation: Activation::QuickGelu,
        intermediate_size: config.intermediate_size,
        max_position_embeddings: config.max_position_embeddings,
        pad_with: None,
        num_hidden_layers: config.num_hidden_layers,
        num_attention_heads: config.num_attention_heads,
        projection_dim: config.hidden_size,
    }
}

impl Network for Clip {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        self.tower.forward_with_mask(ids, usize::MAX)
    }

    /// The state of the end token, which has the largest id, projected.
    fn sentence(&self, ids: &Tensor, states: &Tensor) -> candle_core::Result<Tensor> {
        let ends: Vec<u32> = ids.argmax(D::Minus1)?.to_vec1()?;
        let of = |(caption, end): (usize, &u32)| states.i((caption, *end as usize));
        let ends = ends.iter().enumerate().map(of).collect::<candle_core::Result<Vec<_>>>()?;
        let ends = Tensor::stack(&ends, 0)?;
        match &self.projection {
            Some(projection) => ends.matmul(&projection.t()?),
            None => Ok(ends),
        }
    }
}
