//! [`ModelShape`] and [`Pricing`]: the sizes of a model, its parameters, and its FLOPs by three conventions.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::Grid;
use crate::units::number::plain;

plain!(Ffn, FlopsRule);

// Sizes.

/// The feed-forward layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ffn {
    /// silu(x W₁) ⊙ (x W₂) W₃ with d_ff ≈ 8d/3, in tokenizers 4d.
    #[default]
    SwiGlu,
    /// gelu(x W₁) W₂ with d_ff = 4d, in tokenizers 6d.
    Gelu,
}

impl Ffn {
    /// Its matrices of weights.
    pub const fn matrices(self) -> usize {
        match self {
            Self::SwiGlu => 3,
            Self::Gelu => 2,
        }
    }
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
    /// The head as built: V + 1 outputs, since pad is never predicted; 0 if tied.
    pub head: usize,
}

impl ParamCounts {
    /// Every parameter of the model as built.
    pub fn total(self) -> usize {
        self.nonvocab + self.other_stages + self.text + self.embedding + self.head
    }

    /// Forward FLOPs a token by 2N, N = N_nv + N_v; training is 6ND (ScaMo Eq. 7).
    pub(super) fn six_nd_per_token(self) -> f64 {
        2.0 * (self.nonvocab + self.vocab) as f64
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

    /// Weights of one feed-forward layer.
    pub fn ffn_params(&self) -> usize {
        self.ffn.matrices() * self.d_model * self.d_ff
    }
}

/// A layer of two channels, for a text position and four of codes.
#[cfg(test)]
pub(super) const TINY: ModelShape = ModelShape {
    n_layer: 1,
    n_head: 1,
    d_model: 2,
    d_ff: 3,
    n_ctx: 1 + 4,
    d_text: 5,
    ffn: Ffn::SwiGlu,
    tie_embeddings: false,
    rope_base: 1e4,
};

// FLOPs, by three conventions.

/// The FLOP rule of budgets and laws.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    JsonSchema,
)]
pub enum FlopsRule {
    /// ScaMo Code 1, after Kaplan et al. 2020.
    #[default]
    #[serde(rename = "openai")]
    OpenAi,
    /// 6 (N_nv + N_v) D, ScaMo Eq. 7.
    #[serde(rename = "6nd")]
    SixNd,
    /// The multiply-adds of the model as built, each clip at its own length after its own caption, and in
    /// each step that it stands in.
    #[serde(rename = "exact")]
    Exact,
}

impl FlopsRule {
    /// Every rule.
    pub const ALL: [Self; 3] = [Self::OpenAi, Self::SixNd, Self::Exact];

    /// The rule of a name; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }

    /// The name in files: `openai`, `6nd`, `exact`.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenAi => "openai",
            Self::SixNd => "6nd",
            Self::Exact => "exact",
        }
    }
}

/// Forward FLOPs a supervised token, by every convention.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlopsPerToken {
    pub openai: u64,
    #[serde(rename = "6nd")]
    pub six_nd: f64,
    /// The multiply-adds of the model as built, times two.
    pub exact: f64,
}

impl FlopsPerToken {
    /// The count of one convention.
    pub fn by(&self, rule: FlopsRule) -> f64 {
        match rule {
            FlopsRule::OpenAi => self.openai as f64,
            FlopsRule::SixNd => self.six_nd,
            FlopsRule::Exact => self.exact,
        }
    }
}

/// d_ff = `FF_RATIO`·d in ScaMo's Code 1, whatever width was built.
///
/// With SwiGLU's three matrices of 8d/3 the count is the same, but for rounding.
const FF_RATIO: u64 = 4;

/// A training step costs a forward pass and a backward pass of twice its price.
pub const TRAINING_PER_FORWARD: f64 = 3.0;

/// Forward FLOPs a token by the OpenAI rule (ScaMo Code 1, after Kaplan et al. 2020, Table 1).
///
/// 4d + 6Ld² + 2L·n_ctx·d + 2Ld² + 4L·d·d_ff + 2dV: embedding, QKV, attention, projection,
/// feed-forward, logits. ScaMo's Table 3 drops a d from the feed-forward row; Code 1 is right.
pub fn openai_per_token(shape: &ModelShape, n_vocab: usize) -> u64 {
    let [d, l, n_ctx, v] = [shape.d_model, shape.n_layer, shape.n_ctx, n_vocab].map(|x| x as u64);
    let embedding = 4 * d;
    let attention = 6 * l * d * d + 2 * l * n_ctx * d + 2 * l * d * d;
    let feed_forward = 4 * l * d * (FF_RATIO * d);
    embedding + attention + feed_forward + 2 * d * v
}

/// Forward FLOPs of one sequence of the model as built: two for each multiply-add of its products.
///
/// `prefix` text positions see each other, `targets` motion tokens are predicted (the end token
/// among them, which is never an input). Norms, RoPE, softmax and activations are not counted.
pub fn exact_of_sequence(shape: &ModelShape, n_vocab: usize, prefix: f64, targets: f64) -> f64 {
    let [d, l] = [shape.d_model as f64, shape.n_layer as f64];
    let inputs = targets - 1.0;
    let positions = prefix + inputs;
    let block = 4.0 * d * d + shape.ffn_params() as f64;
    let seen_pairs = prefix * prefix + inputs * (prefix + (inputs + 1.0) / 2.0);
    let multiply_adds = positions * l * block
        + l * 2.0 * d * seen_pairs
        + prefix * shape.d_text as f64 * d
        + targets * d * (n_vocab + 1) as f64;
    2.0 * multiply_adds
}

/// The same where `prefix` text positions and `n_codes` codes all see one another, and `n_targets` of
/// the codes go through the head.
pub fn exact_whole(
    shape: &ModelShape,
    n_vocab: usize,
    prefix: usize,
    n_codes: usize,
    n_targets: usize,
) -> f64 {
    let d = shape.d_model;
    let positions = prefix + n_codes;
    let block = 4 * d * d + shape.ffn_params();
    let blocks = shape.n_layer * (positions * block + 2 * d * positions * positions);
    2.0 * (blocks + prefix * shape.d_text * d + n_targets * d * (n_vocab + 1)) as f64
}

// [`Pricing`]: what a generator takes, and [`Context`]: what surrounds it.

/// The context of a generator; a kind uses the parts that it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Tokens of the longest text.
    pub max_text: usize,
    /// Channels of the tokenizer's latents.
    pub d_latent: usize,
    /// The tokenizer's stride, in frames.
    pub frames_per_latent: usize,
    /// Share of the codes that training shows as random ones.
    pub corruption: f64,
    /// Share of the captions that training leaves out.
    pub text_drop: f64,
}

impl Context {
    /// Strides of the longest clip: the motion slots of a shape.
    pub fn most_latents(&self, shape: &ModelShape) -> usize {
        shape.n_ctx - self.max_text
    }

    /// A shape with room for the longest text and every code of the longest clip, in place of one for
    /// its latents.
    pub fn with_room(&self, shape: ModelShape, codes: &Grid) -> ModelShape {
        let longest_clip = self.most_latents(&shape) * self.frames_per_latent;
        ModelShape { n_ctx: self.max_text + codes.n_codes(longest_clip), ..shape }
    }
}

/// A training clip as a price sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ClipShape {
    pub n_frames: usize,
    /// Tokens of its text.
    pub n_text: usize,
}

impl ClipShape {
    /// A mean over runs that leave out a share of the captions, as one token.
    pub fn mean_over_texts(self, text_drop: f64, of: impl Fn(usize) -> f64) -> f64 {
        (1.0 - text_drop) * of(self.n_text) + text_drop * of(1)
    }
}

/// The unit of a step's count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Places {
    pub count: usize,
    /// Supervised tokens that each of them is.
    pub tokens_each: usize,
}

/// The cost of a generator, before it is built.
pub trait Pricing {
    /// The word in files: `autoregressive`.
    fn name(&self) -> &'static str;

    /// Its layers and widths.
    fn shape(&self) -> &ModelShape;

    /// Its parameters by group, for the codes of a grid.
    fn params(&self, codes: &Grid) -> ParamCounts;

    /// Forward FLOPs a supervised token by every convention, after a text of `prefix` tokens.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken;

    /// The count of a clip by its frames: its targets.
    fn places(&self, codes: &Grid, n_frames: usize) -> Places {
        Places { count: codes.n_targets(n_frames), tokens_each: 1 }
    }

    /// Forward FLOPs by the exact count of a clip in a step that supervises some of its places: every
    /// position that goes through the network, and the heads of what is supervised. On the mean over
    /// what training draws.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64;

    /// Positions that the codes of a clip of so many frames take in a sequence, after its text.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.n_codes(n_frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One layer, d = 2, d_ff = 3, V = 4, one text position, two targets: counted by hand.
    #[test]
    fn exact_count_of_a_tiny_model() {
        // Blocks 2 positions of 4·4 + 3·6 = 34; pairs (0,0) (1,0) (1,1) of 2·2; text 10; head 2·10.
        let multiply_adds = 2.0 * 34.0 + 3.0 * 4.0 + 10.0 + 20.0;
        assert_eq!(exact_of_sequence(&TINY, 4, 1.0, 2.0), 2.0 * multiply_adds);
    }
}
