//! [`TransformerSpec`]: the language-guided transformer tokenizer of LG-Tok; [`LanguageSpec`]: which of its halves see
//! a caption.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::{Ffn, SpecError, TextSpec, require};
use crate::units::number::plain;
use crate::units::{is_default, section};

plain!(LanguagePlace, LanguageSection, TokenizerNorm, Positions, Detokenizer);

/// Weights of a feed-forward layer of either kind, as a multiple of the width's square.
const FFN_WEIGHTS: usize = 12;

/// Features of a frame, and the part that the encoder reads: the root and the joint positions.
const N_FEATURES: f64 = 263.0;
const N_SEEN: f64 = 67.0;

/// Words per caption, to estimate the cost of captions.
const WORDS: f64 = 12.0;

/// The sizes of the transformer tokenizer, with equally many layers in each half.
///
/// Those of LG-Tok's paper: `width: 256, layers: 9, heads: 4` (SwiGLU of 1024), `latent: 512`,
/// `latents: 49`, `window: 196`, `dropout: 0.1`, trained at a rate of 2e-4 for 200 epochs. The defaults train in
/// minutes on two cores.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TransformerSpec {
    /// Channels of every row (d).
    pub width: usize,
    /// Layers of each half: as many before the middle one as after it.
    pub layers: usize,
    pub heads: usize,
    /// Frames of a latent; with `latents`, frames that clips are cut to multiples of.
    pub frames: usize,
    /// Latents of a piece of any length; `None` for one for `frames` frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latents: Option<usize>,
    /// Channels of a latent.
    pub latent: usize,
    /// Frames in one window, as in training. A longer clip is processed in pieces.
    pub span: usize,
    pub norm: TokenizerNorm,
    #[serde(skip_serializing_if = "is_default")]
    pub ffn: Ffn,
    /// Whether outputs of the layers before the middle one reach those after it.
    #[serde(skip_serializing_if = "bool::clone")]
    pub skips: bool,
    pub positions: Positions,
    pub detokenizer: Detokenizer,
    /// Dropout on the output of each part of a layer.
    pub dropout: f64,
    /// The halves that read a caption; `None` if neither does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub language: Option<LanguageSpec>,
}

/// The norm of a layer, and its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenizerNorm {
    /// RMSNorm after each sum, as LG-Tok's code has it.
    #[default]
    Post,
    /// RMSNorm before each part of a layer, as in LLaMA.
    Pre,
    /// LayerNorm after each sum, the other one of LG-Tok's Table 4a.
    Layer,
}

/// The encoding of positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Positions {
    /// One rotary index over text, latents and motion; frames and latents of the detokenizer also have
    /// learned vectors. LG-Tok's, except that its latents have none.
    #[default]
    Learned,
    /// Only rotary: a latent has the position of the middle of its frames, in both halves and in the
    /// attention from frames to latents.
    Rotary,
}

/// How the frames of the detokenizer see latents and text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Detokenizer {
    /// By cross-attention in each layer, as LG-Tok's code has it.
    #[default]
    Cross,
    /// In the same sequence: every row attends to every other.
    Context,
}

impl Default for TransformerSpec {
    fn default() -> Self {
        Self {
            width: 64,
            layers: 3,
            heads: 4,
            frames: 4,
            latents: None,
            latent: 32,
            span: 64,
            norm: TokenizerNorm::default(),
            ffn: Ffn::default(),
            skips: true,
            positions: Positions::default(),
            detokenizer: Detokenizer::default(),
            dropout: 0.0,
            language: None,
        }
    }
}

impl TransformerSpec {
    /// The first field that no training can use.
    pub(super) fn check(&self) -> Result<(), SpecError> {
        let Self { width, layers, heads, frames, span, .. } = self;
        let odd = "must be odd: as many before the middle one as after it";
        require(layers % 2 == 1, "layers", odd)?;
        let divides = width.is_multiple_of(*heads);
        require(divides, "heads", &format!("{heads} heads do not divide a width of {width}"))?;
        let even = (width / heads).is_multiple_of(2);
        require(even, "heads", "RoPE turns pairs of channels, so width / heads must be even")?;
        require(*span > 0 && span.is_multiple_of(*frames), "window", "must be whole codes")?;
        let few = self.latents.is_none_or(|latents| latents <= *span);
        let many = format!("a window has {span} frames: set it to {span} or less");
        require(few, "latents", &many)?;
        self.language.as_ref().map_or(Ok(()), LanguageSpec::check)
    }

    /// Hidden features of a feed-forward layer.
    pub fn hidden(&self) -> usize {
        FFN_WEIGHTS / self.ffn.matrices() * self.width
    }

    /// Latents of the longest piece.
    pub fn most_latents(&self) -> usize {
        self.latents.unwrap_or(self.span / self.frames)
    }

    /// Latents of a frame of the longest piece.
    pub(super) fn latents_per_frame(&self) -> f64 {
        self.latents.map_or(1.0 / self.frames as f64, |n| n as f64 / self.span as f64)
    }

    /// Rows of both halves, as multiples of the frames of a window.
    fn rows_per_frame(&self) -> [f64; 2] {
        let words = |sees: bool| if sees { WORDS / self.span as f64 } else { 0.0 };
        let [encoder, decoder] = self.language.as_ref().map_or([false; 2], LanguageSpec::places);
        let latents = self.latents_per_frame();
        let beside = match self.detokenizer {
            Detokenizer::Cross => 0.0,
            Detokenizer::Context => latents + words(decoder),
        };
        [1.0 + latents + words(encoder), 1.0 + beside]
    }

    /// FLOPs that training on a frame counts for.
    pub(super) fn flops_per_frame(&self) -> f64 {
        let (d, layers, s) = (self.width as f64, self.layers as f64, self.span as f64);
        let layer = (4 + FFN_WEIGHTS + usize::from(self.skips)) as f64 * d * d;
        let attention = |rows: f64| 2.0 * rows * s * d;
        let halves = self.rows_per_frame().map(|rows| rows * layers * (layer + attention(rows)));
        let cross = match self.detokenizer {
            Detokenizer::Cross => layers * 5.0 * d * d,
            Detokenizer::Context => 0.0,
        };
        6.0 * (halves.iter().sum::<f64>() + cross + d * (N_SEEN + N_FEATURES))
    }

    /// Bytes that the backward pass keeps of a frame of a step.
    ///
    /// Measured at widths 64 and 128, with 3 and 5 layers, 8192 frames a step, and either detokenizer:
    /// 0.8 to 1.65 GB, within 10 %.
    pub(super) fn training_bytes_per_frame(&self) -> f64 {
        let (d, layers) = (self.width as f64, self.layers as f64);
        let rows: f64 = self.rows_per_frame().iter().sum();
        4.0 * (FRAMES_KEPT * N_FEATURES + rows * layers * ROWS_KEPT * d)
    }

    /// Bytes that encoding a frame takes; with a fixed number of latents, of clips of a quarter of a window.
    pub(super) fn encoding_bytes_per_frame(&self) -> f64 {
        let more = if self.latents.is_some() { 3.0 * self.latents_per_frame() } else { 0.0 };
        let rows = self.rows_per_frame()[0] + more;
        4.0 * (N_FEATURES + rows * ROWS_AT_ONCE * self.width as f64)
    }
}

/// Frames of features that a step keeps for the loss and the way back.
const FRAMES_KEPT: f64 = 49.0;

/// Rows of the width that a layer keeps for the way back.
const ROWS_KEPT: f64 = 25.0;

/// Rows of the width that a layer holds at once on the way forward.
const ROWS_AT_ONCE: f64 = 30.0;

// Captions.

/// A half of a tokenizer that may see a caption.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum LanguagePlace {
    /// The half that turns motion into codes.
    Tokenizer,
    /// The half that turns codes into motion.
    Detokenizer,
}

section! {
    /// The `tokenizer.language` section: the clip's caption as a further input (LG-Tok).
    pub struct LanguageSection {
        /// The halves that see it: both, one, or none.
        at: Vec<LanguagePlace> = vec![LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
        /// Probability that a training step omits a clip's caption.
        drop: f64 = 0.1, 0 to 0.999;
    }
}

/// The halves that read a caption, and its width, for hashing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LanguageSpec {
    /// At least one, in the order of [`LanguagePlace`].
    pub at: Vec<LanguagePlace>,
    pub drop: f64,
    /// Width of a word's vector.
    pub dim: usize,
    /// Words of the longest caption.
    pub max_tokens: usize,
}

impl LanguageSection {
    /// The same over the vectors of a text encoder; `None` if no half reads them.
    pub(super) fn over(&self, text: &TextSpec) -> Option<LanguageSpec> {
        let mut at = self.at.clone();
        at.sort_unstable();
        let TextSpec { dim, max_tokens, .. } = *text;
        (!at.is_empty()).then_some(LanguageSpec { at, drop: self.drop, dim, max_tokens })
    }
}

impl LanguageSpec {
    /// Whether the tokenizer and the detokenizer see a caption.
    pub fn places(&self) -> [bool; 2] {
        [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer].map(|place| self.at.contains(&place))
    }

    pub(super) fn check(&self) -> Result<(), SpecError> {
        let twice = self.at.windows(2).any(|pair| pair[0] == pair[1]);
        require(!twice, "language", "a half stands in `at` twice")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::tokenizer::training::with;
    use crate::spec::{QuantizerSpec, TokenizerKind, TokenizerSection};

    #[test]
    fn captions_are_read_by_transformers_alone_and_stay_with_their_clips() {
        let language = Some(LanguageSection::default());
        let transformer = |change: fn(&mut TokenizerSection)| {
            let language = language.clone();
            with(|s| {
                (s.kind, s.language) = (TokenizerKind::Transformer, language);
                change(s);
            })
        };
        let text = TextSpec { dim: 7, max_tokens: 9, ..TextSpec::default() };
        let spec = transformer(|_| {}).spec(QuantizerSpec::default(), &text);
        let read = spec.architecture.language().unwrap();
        assert_eq!((read.dim, read.max_tokens, read.places()), (7, 9, [true; 2]));
        let none = transformer(|s| s.language = Some(LanguageSection { at: vec![], drop: 0.1 }));
        assert_eq!(none.spec(QuantizerSpec::default(), &text).architecture.language(), None);
        let bad = [
            (with(|s| s.language = language.clone()), "tokenizer.language: belongs to"),
            (transformer(|s| s.mirror = Some(true)), "tokenizer.mirror: shows mirrored clips"),
            (transformer(|s| s.mix_arm = Some(0.1)), "tokenizer.mix_arm: shows parts of other"),
            (transformer(|s| s.layers = Some(2)), "tokenizer.layers: must be odd"),
            (transformer(|s| s.heads = Some(3)), "tokenizer.heads: 3 heads do not divide"),
            (transformer(|s| s.latents = Some(9)), "tokenizer.latents: belongs to `quantizer"),
            (transformer(|s| s.depth = Some(3)), "tokenizer.depth: is not of `kind: transformer`"),
        ];
        for (section, expected) in bad {
            let error = section.check().unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
