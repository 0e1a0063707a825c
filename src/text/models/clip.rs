//! CLIP's text tower: states of the words, or the vector of the sentence.

use candle_core::{D, IndexOp, Tensor};
use candle_transformers::models::clip::text_model::{
    Activation, ClipTextConfig, ClipTextTransformer,
};
use serde::Deserialize;

use super::folder::ModelFolder;
use super::network::Network;
use crate::spec::TextStates;
use crate::text::error::TextError;

/// What is read of `config.json`: of a text tower alone, or of the tower in a whole model.
#[derive(Deserialize)]
struct Config {
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

/// The network and the width of its vectors.
pub fn load(
    folder: &ModelFolder,
    states: TextStates,
) -> Result<(Box<dyn Network>, usize), TextError> {
    let config: Config = folder.config()?;
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
    let load = |weights: candle_nn::VarBuilder<'_>| {
        ClipTextTransformer::new(weights.pp("text_model"), &shape)
    };
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
