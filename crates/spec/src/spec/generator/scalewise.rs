//! Cost of the scale-by-scale transformer.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::flops::{
    ClipShape, Context, FlopsPerToken, ModelShape, ParamCounts, Pricing, openai_per_token,
};
use crate::spec::Grid;

/// LG-Tok's generator (after MoSa and VAR), resolved: the codes of a scale all at once, given the text
/// and the scales before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScalewiseSpec {
    pub shape: ModelShape,
    /// Channels of the tokenizer's latents, which inputs are made of.
    pub d_latent: usize,
    /// The tokenizer's stride: lengths of clips are counted in so many frames (LG-Tok: 4).
    pub frames_per_latent: usize,
    /// Strides of the longest clip: lengths that have an embedding.
    pub most_latents: usize,
    /// Share of the codes that training shows as random ones.
    pub corruption: f64,
    /// Share of the captions that training leaves out.
    pub text_drop: f64,
}

impl ScalewiseSpec {
    /// The generator of a shape for the codes of a grid.
    pub fn new(shape: ModelShape, codes: &Grid, context: &Context) -> Self {
        Self {
            d_latent: context.d_latent,
            frames_per_latent: context.frames_per_latent,
            most_latents: context.most_latents(&shape),
            corruption: context.corruption,
            text_drop: context.text_drop,
            shape: context.with_room(shape, codes),
        }
    }

    /// The codes of each scale of the longest clip.
    pub fn longest(&self, codes: &Grid) -> Vec<usize> {
        codes.lengths(self.most_latents * self.frames_per_latent).collect()
    }

    /// Mean number of codes to choose from, over the codes of the longest clip: each scale has its own head.
    fn mean_vocab(&self, codes: &Grid) -> f64 {
        let lengths = self.longest(codes);
        let choices = codes.scales.iter().zip(&lengths).map(|(scale, n)| scale.n_vocab * n);
        choices.sum::<usize>() as f64 / lengths.iter().sum::<usize>() as f64
    }
}

impl Pricing for ScalewiseSpec {
    fn name(&self) -> &'static str {
        "scalewise"
    }

    fn shape(&self) -> &ModelShape {
        &self.shape
    }

    /// N_v is V·d as for any generator; there is no embedding of codes, since inputs are made of the
    /// tokenizer's latents, and a head a scale.
    fn params(&self, codes: &Grid) -> ParamCounts {
        let (shape, n_vocab) = (&self.shape, codes.n_vocab());
        let first = self.longest(codes).first().copied().unwrap_or(0);
        let tables = first + codes.scales.len() + self.most_latents + self.d_latent + 1;
        ParamCounts {
            embedding: tables * shape.d_model,
            head: n_vocab * shape.d_model,
            ..shape.params_of(n_vocab)
        }
    }

    /// By the OpenAI rule as for any generator, except that a code is chosen from its own scale's codes. The exact
    /// count is for the longest clip after a text of `prefix` tokens.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken {
        let (shape, lengths) = (&self.shape, self.longest(codes));
        let head = 2.0 * shape.d_model as f64 * self.mean_vocab(codes);
        FlopsPerToken {
            openai: openai_per_token(shape, 0) + head.round() as u64,
            six_nd: self.params(codes).six_nd_per_token(),
            exact: exact_of_clip(self, codes, prefix, &lengths, &lengths)
                / lengths.iter().sum::<usize>() as f64,
        }
    }

    /// The whole clip goes through the network; the head of each scale is applied to its supervised codes.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64 {
        let lengths: Vec<usize> = codes.lengths(clip.n_frames).collect();
        let mut start = 0;
        let own = lengths.iter().map(|length| {
            let scale = start..start + length;
            start = scale.end;
            supervised.end.min(scale.end).saturating_sub(supervised.start.max(scale.start))
        });
        let own: Vec<usize> = own.collect();
        let of = |prefix| exact_of_clip(self, codes, prefix, &lengths, &own);
        clip.mean_over_texts(self.text_drop, of)
    }
}

/// Forward FLOPs of one clip by the model as built: two per multiply-add of its products.
///
/// `prefix` text positions attend to each other; the codes of a scale (`lengths`) attend to everything before them and
/// to each other; `supervised` codes of each scale go through its head. The frozen tokenizer and text encoder are
/// not counted.
pub fn exact_of_clip(
    spec: &ScalewiseSpec,
    codes: &Grid,
    prefix: usize,
    lengths: &[usize],
    supervised: &[usize],
) -> f64 {
    let shape = &spec.shape;
    let d = shape.d_model;
    let block = 4 * d * d + shape.ffn_params();
    let (mut positions, mut pairs, mut heads) = (prefix, prefix * prefix, 0);
    for ((length, chosen), scale) in lengths.iter().zip(supervised).zip(&codes.scales) {
        positions += length;
        pairs += length * positions;
        heads += chosen * d * scale.n_vocab;
    }
    let later: usize = lengths.iter().skip(1).sum();
    let blocks = shape.n_layer * (positions * block + 2 * d * pairs);
    2.0 * (blocks + prefix * shape.d_text * d + later * spec.d_latent * d + heads) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::generator::flops::TINY;
    use crate::spec::{Length, Scale};

    /// Two scales of 1 and 3 codes out of 4 and 6, one text position, 7 channels: counted by hand.
    #[test]
    fn counts_of_a_tiny_model() {
        let scale = |n_vocab, codes| Scale { n_vocab, length: Length::Codes(codes) };
        let codes = Grid { scales: vec![scale(4, 1), scale(6, 3)], end_token: false };
        let context = Context {
            max_text: 1,
            d_latent: 7,
            frames_per_latent: 4,
            corruption: 0.5,
            text_drop: 0.1,
        };
        let spec = ScalewiseSpec::new(TINY, &codes, &context);
        assert_eq!((spec.shape.n_ctx, spec.most_latents), (5, 4));
        // Blocks 5 positions of 4·4 + 3·6 = 34; pairs 1 + 1·2 + 3·5 of 2·2; text 10; inputs 3·7·2;
        // heads 2·4 + 3·2·6.
        let multiply_adds = 5 * 34 + 18 * 4 + 10 + 42 + 44;
        let exact = spec.flops_per_token(&codes, 1).exact;
        assert_eq!(exact, 2.0 * f64::from(multiply_adds) / 4.0);
        let params = spec.params(&codes);
        // Tables: a start, two levels, four lengths, seven channels and a bias.
        assert_eq!((params.embedding, params.head, params.vocab), (15 * 2, 10 * 2, 10 * 2));
    }
}
