//! Cost of the masked transformer, and its two stages on codes of several layers.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::flops::{
    ClipShape, Context, FlopsPerToken, ModelShape, ParamCounts, Places, Pricing, exact_whole,
    openai_per_token,
};
use crate::spec::Grid;

/// MoMask's generator, resolved: it predicts hidden codes from the text and the visible codes. It has the parameters of
/// the autoregressive transformer, but every position attends to every other; the end token's embedding row stands
/// for a hidden code.
///
/// For several layers of equal length, a second transformer of the same shape predicts all codes of a layer at once
/// from the layers before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaskedSpec {
    pub shape: ModelShape,
    /// Share of the hidden codes that training shows as random ones.
    pub corruption: f64,
    /// Share of the captions that training leaves out.
    pub text_drop: f64,
}

impl MaskedSpec {
    /// The generator of a shape.
    pub fn new(shape: ModelShape, context: &Context) -> Self {
        Self { shape, corruption: context.corruption, text_drop: context.text_drop }
    }
}

/// Points at which the share that is hidden is looked at.
const SHARES: usize = 8;

/// Mean number of hidden codes among `asked` of a clip of `n`, if the fraction cos(π u / 2) is hidden, u uniform in
/// 0 to 1, and at least one of those asked.
fn mean_hidden(n: usize, asked: usize) -> f64 {
    let at = |i: usize| {
        let share = (FRAC_PI_2 * (i as f64 + 0.5) / SHARES as f64).cos();
        let share = (share * n as f64).round().clamp(1.0, n as f64) / n as f64;
        share * asked as f64 + (1.0 - share).powi(asked as i32)
    };
    (0..SHARES).map(at).sum::<f64>() / SHARES as f64
}

/// Whether a masked generator of such codes has a second stage.
fn has_second_stage(codes: &Grid) -> bool {
    codes.scales.len() > 1
}

impl Pricing for MaskedSpec {
    fn name(&self) -> &'static str {
        "masked"
    }

    fn shape(&self) -> &ModelShape {
        &self.shape
    }

    fn params(&self, codes: &Grid) -> ParamCounts {
        match has_second_stage(codes) {
            true => params_of_two(&self.shape, codes),
            false => self.shape.params_of(codes.n_vocab()),
        }
    }

    /// A token is a code that goes through the network, hidden or not. By the OpenAI rule it costs as much as in the
    /// autoregressive transformer; the exact count is at full context, with a head for every code.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken {
        if has_second_stage(codes) {
            return flops_of_two(&self.shape, codes, prefix);
        }
        let (shape, n_vocab) = (&self.shape, codes.n_vocab());
        let n_codes = shape.n_ctx - prefix - 1;
        FlopsPerToken {
            openai: openai_per_token(shape, n_vocab),
            six_nd: shape.params_of(n_vocab).six_nd_per_token(),
            exact: exact_whole(shape, n_vocab, prefix, n_codes, n_codes) / n_codes as f64,
        }
    }

    /// Codes of the first scale; with a second stage each is two tokens.
    fn places(&self, codes: &Grid, n_frames: usize) -> Places {
        let tokens_each = if has_second_stage(codes) { 2 } else { 1 };
        Places { count: self.positions(codes, n_frames), tokens_each }
    }

    /// Every stage sees the whole clip; the first applies its head to hidden codes.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64 {
        let (shape, n) = (&self.shape, self.positions(codes, clip.n_frames));
        let blocks = |prefix| exact_whole(shape, 0, prefix, n, 0);
        let hidden = mean_hidden(n, supervised.len());
        let mut heads = hidden * (codes.scales[0].n_vocab + 1) as f64;
        let mut stages = 1.0;
        if has_second_stage(codes) {
            heads += supervised.len() as f64 * mean_later_vocab(codes);
            stages = 2.0;
        }
        stages * clip.mean_over_texts(self.text_drop, blocks) + 2.0 * shape.d_model as f64 * heads
    }

    /// Both stages see a code a place.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.lengths(n_frames).next().unwrap_or(0)
    }
}

// Cost of both stages of a masked generator, on codes of several layers.
//
// A position of a clip is two tokens of a step: its code of the first layer, through the first stage, and its code of
// the drawn layer, through the second. So a token goes through one of two transformers of equal shape, and C = 6ND
// holds with N_nv of one.

/// Parameters by group. N_v is V·d with the codes of all layers.
///
/// The second stage has an embedding for each layer but the last, a vector for each layer it predicts, and a head for
/// each layer but the first. With tied embeddings, only the last layer's head is a separate matrix.
fn params_of_two(shape: &ModelShape, codes: &Grid) -> ParamCounts {
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

/// Forward FLOPs per token: the mean of both stages. By the OpenAI rule a code is chosen from its own layer's codes;
/// the exact count is for the longest clip, with a head for every code.
fn flops_of_two(shape: &ModelShape, codes: &Grid, prefix: usize) -> FlopsPerToken {
    let d = shape.d_model as f64;
    let n_places = shape.n_ctx - prefix;
    let first = codes.scales[0].n_vocab as f64;
    let later = mean_later_vocab(codes);
    let body = exact_whole(shape, 0, prefix, n_places, 0) / n_places as f64;
    FlopsPerToken {
        openai: openai_per_token(shape, 0) + (d * (first + later)).round() as u64,
        six_nd: params_of_two(shape, codes).six_nd_per_token(),
        // Half of the tokens have the head of the first stage, which has a column for the end token.
        exact: body + d * (first + 1.0 + later),
    }
}

/// V of a layer after the first; all are equal in a residual quantizer.
fn mean_later_vocab(codes: &Grid) -> f64 {
    let later = &codes.scales[1..];
    later.iter().map(|scale| scale.n_vocab).sum::<usize>() as f64 / later.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::generator::flops::TINY;
    use crate::spec::{GeneratorKind, Length, Scale};

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
        let spec = GeneratorKind::Masked.of(TINY, &codes(), &context);
        assert_eq!(spec.shape().n_ctx, 5, "a place is one position, not one a layer");
        assert_eq!(spec.positions(&codes(), 17), 4);
        // Blocks 5 positions of 4·4 + 3·6 = 34; pairs 5·5 of 2·2; text 10. Heads of 7 and 6 columns.
        let body = 5 * 34 + 25 * 4 + 10;
        let multiply_adds = 2 * body + 4 * 2 * (7 + 6);
        let counted = spec.flops_per_token(&codes(), 1);
        assert_eq!(counted.exact, 2.0 * f64::from(multiply_adds) / 8.0);
        assert_eq!(counted.openai, openai_per_token(&TINY, 6));
        let params = spec.params(&codes());
        // A block of 34 and two norms, and the last norm.
        let trunk = 34 + 4 + 2;
        assert_eq!((params.nonvocab, params.other_stages, params.vocab), (trunk, trunk, 18 * 2));
        // Codes, end and pad; two layers of codes and two that are asked for.
        assert_eq!((params.embedding, params.head), ((8 + 12 + 2) * 2, (7 + 12) * 2));
        assert_eq!(counted.six_nd, 2.0 * (trunk + 36) as f64);
    }
}
