//! [`ModelShape`]: the sizes of one model and the parameters that follow from them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The feed-forward layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ffn {
    /// silu(x W₁) ⊙ (x W₂) W₃ with d_ff ≈ 8d/3.
    #[default]
    SwiGlu,
    /// gelu(x W₁) W₂ with d_ff = 4d.
    Gelu,
}

/// Everything that the architecture of one model depends on, but for its vocabulary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelShape {
    pub n_layer: usize,
    pub n_head: usize,
    pub d_model: usize,
    /// Width of the feed-forward layer as built.
    pub d_ff: usize,
    /// Longest text prefix and motion slots: positions of the FLOP rule.
    pub n_ctx: usize,
    /// Width of the frozen text embeddings.
    pub d_text: usize,
    pub ffn: Ffn,
    pub tie_embeddings: bool,
    pub rope_base: f64,
}

/// Parameters by group, so that the convention is chosen when fitting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamCounts {
    /// N_nv: blocks and norms that a code goes through.
    pub nonvocab: usize,
    /// Blocks and norms of the other stages, of a model in which a code goes through one of several.
    pub other_stages: usize,
    /// N_v = V·d (ScaMo §4.3).
    pub vocab: usize,
    /// The projection of text embeddings, with its bias.
    pub text: usize,
    /// The embedding as built: V + 2 rows, for the end and pad tokens.
    pub embedding: usize,
    /// The head as built: V + 1 outputs, since pad is never predicted; 0 where tied.
    pub head: usize,
}

impl ParamCounts {
    /// Every parameter of the model as built.
    pub fn total(self) -> usize {
        self.nonvocab + self.other_stages + self.text + self.embedding + self.head
    }
}

impl ModelShape {
    /// Parameters with a vocabulary of `n_vocab` codes.
    pub fn params_of(&self, n_vocab: usize) -> ParamCounts {
        let d = self.d_model;
        let block = 4 * d * d + self.ffn_params() + 2 * d;
        ParamCounts {
            nonvocab: self.n_layer * block + d,
            other_stages: 0,
            vocab: n_vocab * d,
            text: self.d_text * d + d,
            embedding: (n_vocab + 2) * d,
            head: if self.tie_embeddings { 0 } else { (n_vocab + 1) * d },
        }
    }

    /// Weights of one feed-forward layer: three matrices for SwiGLU, two for GELU.
    pub fn ffn_params(&self) -> usize {
        let matrices = match self.ffn {
            Ffn::SwiGlu => 3,
            Ffn::Gelu => 2,
        };
        matrices * self.d_model * self.d_ff
    }
}
