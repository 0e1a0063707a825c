//! [`RunSpec`] and [`TokenizerJob`]: the input of workers, with ids; [`SamplingSpec`] and [`ScoresSpec`]: generation and
//! scoring of motions of runs.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    GeneratorSpec, Grid, KeyProblem, ModelShape, ParamCounts, TokenizerSpec, content_id, failed,
};
use crate::units::number::plain;
use crate::units::section;

plain!(Precision, ShownCaptions);

/// The word for isoflop's PyTorch trainer; words after it are its options.
const TORCH: &str = "torch";

/// Whether a command is isoflop's PyTorch trainer.
pub fn is_torch(command: &str) -> bool {
    command.split_whitespace().next() == Some(TORCH)
}

/// Raised when the same spec would train to other bits: records of an older revision are stale.
pub const TRAINING_REVISION: u32 = 3;

/// One run, resolved: no rule is left to apply, no path and no time is in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSpec {
    pub revision: u32,
    pub seed: u64,
    pub generator: GeneratorSpec,
    /// The codes that it learns to make.
    pub codes: Grid,
    pub budget_flops: f64,
    /// The fraction of the training split that it uses; left out if all.
    #[serde(default, skip_serializing_if = "Share::is_whole")]
    pub share: Share,
    /// Left out where it is `drawn`.
    #[serde(default, skip_serializing_if = "crate::units::is_default")]
    pub captions: ShownCaptions,
    pub batch_tokens: usize,
    pub steps: usize,
    pub lr: f64,
    pub warmup_steps: usize,
    /// The last learning rate as a share of the peak.
    pub final_share: f64,
    /// Steps of the decay at the end of a wsd schedule; `None` for a cosine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay_steps: Option<usize>,
    /// Left out where it is `f32`.
    #[serde(default, skip_serializing_if = "crate::units::is_default")]
    pub precision: Precision,
    pub weight_decay: f64,
    pub betas: [f64; 2],
    pub epsilon: f64,
    /// `None` if gradients are not clipped.
    pub clip_norm: Option<f64>,
    /// Times a run that it is measured on the validation split.
    pub evaluations: usize,
    /// Frames per second of the data.
    pub fps: f64,
    pub data_digest: String,
    pub text_id: String,
    pub tokenizer_id: String,
    /// The user's trainer; `None` for the built-in one (then omitted from the hash, so ids stay stable).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerProgram>,
    /// Its values of varied keys, e.g. `train.lr=0.001`; omitted from the hash of other runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub varied: Option<String>,
}

/// The parts of a user's trainer that affect results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainerProgram {
    pub command: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
    /// Digests of the files that are named as its own; ids of others know no such field.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
}

impl RunSpec {
    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }

    /// The steps before the decay, as a run of their own: what runs that differ in budget alone
    /// have in common. It has no budget, and is measured once, at its end. `None` for a cosine.
    pub fn trunk(&self) -> Option<Self> {
        let steps = self.steps - self.decay_steps?;
        let decay_steps = Some(0);
        let own = Self { steps, decay_steps, budget_flops: 0.0, ..self.clone() };
        Some(Self { evaluations: 1, final_share: 0.0, ..own })
    }

    /// Whether a user's program trains it, so that nothing measured of the built-in model holds for it: neither
    /// time nor memory.
    pub fn is_users_own(&self) -> bool {
        self.trainer.as_ref().is_some_and(|trainer| !is_torch(&trainer.command))
    }

    /// The generator's layers and widths.
    pub fn shape(&self) -> &ModelShape {
        self.generator.shape()
    }

    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.codes.n_vocab()
    }

    /// The generator's parameters by group.
    pub fn params(&self) -> ParamCounts {
        self.generator.params(&self.codes)
    }

    /// D: supervised motion tokens.
    pub fn tokens(&self) -> usize {
        self.steps * self.batch_tokens
    }

    /// Names the cell for a person: `L2 d32 V240 C=1e10 seed 0`, and its share where that is not all.
    pub fn label(&self) -> String {
        let ModelShape { n_layer, d_model, .. } = *self.shape();
        let (v, c, seed) = (self.n_vocab(), self.budget_flops, self.seed);
        let share = self.share.said();
        format!("L{n_layer} d{d_model} V{v} C={c:e}{share} seed {seed}")
    }
}

/// One tokenizer to train, on which every run with its vocabulary waits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TokenizerJob {
    pub revision: u32,
    pub spec: TokenizerSpec,
    pub data_digest: String,
    /// The captions that a tokenizer with language sees; ids of others know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text_id: Option<String>,
}

impl TokenizerJob {
    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}

/// A share of the training split's clips, above 0 and at most 1.
///
/// The tokenizer and the unigram model of L_u are those of the whole split, so that losses of different
/// shares can be compared.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Share(f64);

impl Share {
    /// All of it.
    pub const WHOLE: Self = Self(1.0);

    /// None for what is no share.
    pub fn new(share: f64) -> Option<Self> {
        (share > 0.0 && share <= 1.0).then_some(Self(share))
    }

    /// As a number.
    pub fn value(self) -> f64 {
        self.0
    }

    /// Whether it is all of the split.
    pub fn is_whole(&self) -> bool {
        self.0 == 1.0
    }

    /// ` share 0.25`, and nothing if it is all.
    pub fn said(self) -> String {
        if self.is_whole() { String::new() } else { format!(" share {}", self.0) }
    }

    /// So many of `n` things, one at least where there are any.
    pub fn of(self, n: usize) -> usize {
        ((self.0 * n as f64).round() as usize).clamp(n.min(1), n)
    }
}

impl Default for Share {
    fn default() -> Self {
        Self::WHOLE
    }
}

/// Which of its captions a clip shows while a generator trains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShownCaptions {
    /// One of its captions, drawn anew in each epoch.
    #[default]
    Drawn,
    /// The caption that its codes were made with: clip i shows caption i mod n.
    Matched,
}

impl ShownCaptions {
    /// By default: those that the codes were made with, if the tokenizer reads captions to make codes.
    pub fn of(tokenizer: &TokenizerSpec) -> Self {
        let language = tokenizer.architecture.language();
        let reads = language.is_some_and(|language| language.places()[0]);
        if reads { Self::Matched } else { Self::Drawn }
    }
}

/// The numbers that large products are computed in.
///
/// Weights, moments, sums of squares, softmax and losses are in `f32` always, and so is every measure
/// on a split (mixed precision, Micikevicius et al. 2018).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Single precision: what processors compute in.
    #[default]
    F32,
    /// 5 bits of exponent, 10 of fraction: losses are scaled up on the way back.
    F16,
    /// 8 bits of exponent, 7 of fraction.
    Bf16,
}

impl Precision {
    /// The word in a sweep.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Bf16 => "bf16",
        }
    }

    /// The factor of the mean loss over targets before gradients are taken (they are divided by it afterwards): in `f16`
    /// about the number of targets, so that a target's part does not underflow below 6e-8. A power of two, which is
    /// exact.
    pub fn loss_scale(self, targets: usize) -> f64 {
        match self {
            Self::F16 => targets.next_power_of_two().min(MOST_SCALED) as f64,
            Self::F32 | Self::Bf16 => 1.0,
        }
    }
}

/// Above it, gradients by weights would come near the largest number of `f16`.
const MOST_SCALED: usize = 4096;

/// A section with the keys of sampling between its own.
macro_rules! sampling_section {
    ($(#[$about:meta])* pub struct $name:ident { { $($first:tt)* } { $($last:tt)* } }) => {
        section! {
            $(#[$about])*
            pub struct $name {
                $($first)*
                /// Strength of classifier-free guidance; `autoregressive` has none.
                guidance: f64 = 0.0, 0 to 1e3;
                /// Strength of caption guidance in decoding, for a tokenizer with language.
                detokenizer_guidance: f64 = 0.0, 0 to 1e3;
                /// Divisor of the logits; 0 takes the likeliest code.
                temperature: f64 = 1.0, 0 to 1e3;
                /// Codes are drawn among the likeliest so many.
                top_k: Option<usize> = None, 1 to 16_777_216, unless "Option::is_none";
                /// Codes are drawn among the likeliest that together hold this share.
                top_p: Option<f64> = None, 1e-6 to 1, unless "Option::is_none";
                /// `masked`: rounds in which codes are shown.
                rounds: usize = 10, 1 to 10_000;
                $($last)*
            }
        }
    };
}

sampling_section! {
    /// The `sampling` section: how motions are made, where `isoflop generate`, `isoflop evaluate` and the section
    /// `scores` do not say otherwise. No id of a run depends on it.
    pub struct SamplingSpec { {} {} }
}

sampling_section! {
    /// The `scores` section: how the motions of a run are made and scored by the sweep's evaluator.
    ///
    /// The numbers of repeats, texts and motions are those of the published tables.
    pub struct ScoresSpec {
        {
            /// Conditions, as `n_vocab == 512 and budget >= 1e12`; runs that meet one of them are scored, and
            /// all where there is none.
            only: Vec<String> = Vec::new(), unless "Vec::is_empty";
            /// Number of repeats, each with one motion per test clip.
            repeats: usize = 20, 1 to 10_000;
        }
        {
            /// Captions that MultiModality is measured on; 0 leaves it out.
            multimodal_captions: usize = 96, 0 to 1_000_000;
            /// Motions of each of them.
            multimodal_motions: usize = 30, 1 to 10_000;
            /// Motions of a run that are kept as files, in `samples/<run>/scored`; those of the first repeat.
            samples: usize = 16, 0 to 1_000_000;
            /// Seed of motions, pools and pairs.
            seed: u64 = 0, 0 to 18_446_744_073_709_551_615u64;
        }
    }
}

impl ScoresSpec {
    /// How a run is scored, whichever runs are: without the conditions, which change no score.
    #[must_use]
    pub fn of_a_run(&self) -> Self {
        Self { only: Vec::new(), ..self.clone() }
    }

    /// The same with the sampling of a sweep for the keys that its own section leaves out.
    #[must_use]
    pub fn sampled_by(mut self, sampling: &SamplingSpec, is_given: impl Fn(&str) -> bool) -> Self {
        macro_rules! take {
            ($($key:ident),*) => {$(
                if !is_given(stringify!($key)) {
                    self.$key = sampling.$key;
                }
            )*};
        }
        take!(guidance, detokenizer_guidance, temperature, top_k, top_p, rounds);
        self
    }

    /// Problems that make scoring fail.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let several = |n| self.multimodal_captions == 0 || n > 1;
        failed(each! {
            self;
            several, "two motions of a caption differ: at least 2" => multimodal_motions;
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_match_where_the_tokenizer_reads_them_to_make_codes() {
        use crate::spec::{ArchitectureSpec, LanguagePlace, LanguageSpec, TransformerSpec};
        let of = |at: &[LanguagePlace]| {
            let language = LanguageSpec { at: at.to_vec(), drop: 0.1, dim: 4, max_tokens: 8 };
            let own = TransformerSpec { language: Some(language), ..TransformerSpec::default() };
            let architecture = ArchitectureSpec::Transformer(own);
            ShownCaptions::of(&TokenizerSpec { architecture, ..TokenizerSpec::default() })
        };
        let [own, other] = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
        assert_eq!([&[own][..], &[own, other]].map(of), [ShownCaptions::Matched; 2]);
        assert_eq!(of(&[other]), ShownCaptions::Drawn);
        assert_eq!(ShownCaptions::of(&TokenizerSpec::default()), ShownCaptions::Drawn);
    }

    #[test]
    fn shares_lie_above_0_and_up_to_1() {
        let is_share = |share| Share::new(share).is_some();
        assert_eq!(
            [0.0, 0.25, 1.0, 1.5, f64::NAN].map(is_share),
            [false, true, true, false, false]
        );
        let of = |share, n| Share::new(share).unwrap().of(n);
        assert_eq!([of(0.25, 10), of(0.01, 10), of(0.5, 0), of(1.0, 7)], [3, 1, 0, 7]);
    }
}
