//! What the two stages of a masked generator take together, on codes of several layers.
//!
//! A place of a clip is two tokens of a step: its code of the first layer, which goes through the first
//! stage, and its code of the layer that is asked for, which goes through the second. So a token goes
//! through one of two transformers of one shape, and C = 6ND holds with N_nv that of one.

use super::flops::{FlopsPerToken, exact_whole, openai_per_token};
use super::shape::{ModelShape, ParamCounts};
use crate::spec::grid::Grid;

/// Parameters by group. N_v is V·d with the codes of all layers.
///
/// The second stage embeds the layers but the last, and each layer that it is asked for; it has a head
/// for each layer but the first. Where embeddings are tied, the last layer's alone is a matrix of its own.
pub fn params(shape: &ModelShape, codes: &Grid) -> ParamCounts {
    let d = shape.d_model;
    let first = shape.params_of(codes.scales[0].n_vocab);
    let (all, last) = (codes.n_vocab(), codes.scales[codes.scales.len() - 1].n_vocab);
    let asked = codes.scales.len() - 1;
    let heads = if shape.tie_embeddings { last } else { all - codes.scales[0].n_vocab };
    ParamCounts {
        vocab: all * d,
        other_stages: first.nonvocab,
        text: 2 * first.text,
        embedding: first.embedding + (all - last + asked) * d,
        head: first.head + heads * d,
        ..first
    }
}

/// Forward FLOPs a token: the mean of both stages. By the OpenAI rule a code is chosen from its own
/// layer's alone; the exact count is that of the longest clip, with a head for every code.
pub fn flops_per_token(shape: &ModelShape, codes: &Grid, prefix: usize) -> FlopsPerToken {
    let d = shape.d_model as f64;
    let n_places = shape.n_ctx - prefix;
    let first = codes.scales[0].n_vocab as f64;
    let later = mean_later_vocab(codes);
    let params = params(shape, codes);
    let body = exact_whole(shape, 0, prefix, n_places, 0) / n_places as f64;
    FlopsPerToken {
        openai: openai_per_token(shape, 0) + (d * (first + later)).round() as u64,
        six_nd: 2.0 * (params.nonvocab + params.vocab) as f64,
        // Half of the tokens have the head of the first stage, which has a column for the end token.
        exact: body + d * (first + 1.0 + later),
    }
}

/// V of a layer after the first; those of a residual quantizer are all alike.
pub fn mean_later_vocab(codes: &Grid) -> f64 {
    let later = &codes.scales[1..];
    later.iter().map(|scale| scale.n_vocab).sum::<usize>() as f64 / later.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{Context, Ffn, GeneratorKind, Length, Scale};

    fn shape() -> ModelShape {
        ModelShape {
            n_layer: 1,
            n_head: 1,
            d_model: 2,
            d_ff: 3,
            n_ctx: 1 + 4,
            d_text: 5,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 1e4,
        }
    }

    /// Three layers of 6 codes.
    fn codes() -> Grid {
        let scale = Scale { n_vocab: 6, length: Length::FramesPerCode(4) };
        Grid { scales: vec![scale; 3], end_token: false }
    }

    /// Four places after one text position: counted by hand.
    #[test]
    fn counts_of_a_tiny_model() {
        let context = Context {
            max_text: 1,
            d_latent: 7,
            frames_per_latent: 4,
            corruption: 0.0,
            text_drop: 0.1,
        };
        let spec = GeneratorKind::Masked.of(shape(), &codes(), &context);
        assert_eq!(spec.shape().n_ctx, 5, "a place is one position, not one a layer");
        assert_eq!(spec.positions(&codes(), 17), 4);
        // Blocks 5 positions of 4·4 + 3·6 = 34; pairs 5·5 of 2·2; text 10. Heads of 7 and 6 columns.
        let body = 5 * 34 + 25 * 4 + 10;
        let multiply_adds = 2 * body + 4 * 2 * (7 + 6);
        let counted = spec.flops_per_token(&codes(), 1);
        assert_eq!(counted.exact, 2.0 * f64::from(multiply_adds) / 8.0);
        assert_eq!(counted.openai, openai_per_token(&shape(), 6));
        let params = spec.params(&codes());
        // A block of 34 and two norms, and the last norm.
        let trunk = 34 + 4 + 2;
        assert_eq!((params.nonvocab, params.other_stages, params.vocab), (trunk, trunk, 18 * 2));
        // Codes, end and pad; two layers of codes and two that are asked for.
        assert_eq!((params.embedding, params.head), ((8 + 12 + 2) * 2, (7 + 12) * 2));
        assert_eq!(counted.six_nd, 2.0 * (trunk + 36) as f64);
    }
}
