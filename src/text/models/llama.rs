//! LLaMA: the states of its last layer, which LG-Tok reads.

use std::collections::HashMap;

use candle_core::{DType, Device, IndexOp, Tensor};
use candle_transformers::models::llama::{Cache, Config, Llama, LlamaConfig};

use super::folder::{ModelFolder, first_line};
use super::network::Network;
use crate::text::error::TextError;

/// candle's LLaMA gives logits of the last position alone. Its head is replaced by the identity, so that
/// logits are states, and tokens go through one after another, each seeing those before it.
struct States {
    model: Llama,
    config: Config,
}

const HEAD: &str = "lm_head.weight";
const BODY: &str = "model.";

/// The network and the width of its states.
pub fn load(folder: &ModelFolder) -> Result<(Box<dyn Network>, usize), TextError> {
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

/// Weights by the names of a whole model, those of a body without its head too.
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
