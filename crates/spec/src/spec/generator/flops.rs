//! Counting FLOPs: three conventions, each a pure function of the shape.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::ModelShape;

/// Which count of FLOPs a budget is spent in and the laws are written in.
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

    /// The rule of a name; `None` where there is none.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name)
    }

    /// The name in files: `openai`, `6nd`, `exact`.
    pub fn name(self) -> &'static str {
        match self {
            FlopsRule::OpenAi => "openai",
            FlopsRule::SixNd => "6nd",
            FlopsRule::Exact => "exact",
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

/// Forward FLOPs a token by 2N, N = N_nv + N_v; training is 6ND (ScaMo Eq. 7).
pub fn six_nd_per_token(shape: &ModelShape, n_vocab: usize) -> f64 {
    let params = shape.params_of(n_vocab);
    2.0 * (params.nonvocab + params.vocab) as f64
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

#[cfg(test)]
mod tests {
    use super::*;

    /// One layer, d = 2, d_ff = 3, V = 4, one text position, two targets: counted by hand.
    #[test]
    fn exact_count_of_a_tiny_model() {
        let shape = ModelShape {
            n_layer: 1,
            n_head: 1,
            d_model: 2,
            d_ff: 3,
            n_ctx: 4,
            d_text: 5,
            ffn: crate::spec::Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 1e4,
        };
        // Blocks 2 positions of 4·4 + 3·6 = 34; pairs (0,0) (1,0) (1,1) of 2·2; text 10; head 2·10.
        let multiply_adds = 2.0 * 34.0 + 3.0 * 4.0 + 10.0 + 20.0;
        assert_eq!(exact_of_sequence(&shape, 4, 1.0, 2.0), 2.0 * multiply_adds);
    }
}
