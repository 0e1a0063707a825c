//! The `model` and `train` sections.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::{Ffn, Precision, ShownCaptions};
use crate::units::{ShortForm, number, section, short_form_schema};

section! {
    /// The `model` section: settings of all models of the sweep.
    pub struct ModelSection {
        ffn: Ffn = Ffn::default();
        /// d_ff is rounded up to a multiple of this; ScaMo has 256, which only large models can afford.
        ffn_multiple: usize = 8, 1 to 65_536;
        /// One matrix for the embedding and the head.
        tie_embeddings: bool = false;
        /// Base of the rotary positions' wavelengths.
        rope_base: f64 = 10_000.0, 1e-3 to 1e12;
        /// Motion slots of n_ctx: 49 codes, the end token and one spare, as in ScaMo. If a clip has codes on several
        /// scales, n_ctx has room for the codes of as many latents; `masked` needs one slot per latent, regardless of
        /// the number of layers.
        motion_slots: usize = 51, 3 to 65_536;
        /// `scalewise`: share of the codes that training shows as random ones, none; 0.5 in MoSa and
        /// LG-Tok. `masked`: the same of the hidden codes; 0.1 in MoMask.
        corruption: f64 = 0.0, 0 to 0.999;
        /// `scalewise` and `masked`: share of the captions that training leaves out, 0.1, so that motions can be guided.
        text_drop: f64 = 0.1, 0 to 0.999;
    }
}

/// How the learning rate moves over a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScheduleKind {
    /// Linear warm-up, then half a cosine down to `final_share` (ScaMo Table 4).
    Cosine,
    /// Linear warm-up, a constant rate, then a decay by 1 − √share over the last steps (Hägele et
    /// al. 2024): runs that differ in budget alone begin alike.
    #[default]
    Wsd,
}

section! {
    /// The `train.schedule` section: the learning rate over a run, as a share of its peak.
    pub struct ScheduleSection {
        kind: ScheduleKind = ScheduleKind::default();
        /// Share of the run spent warming up, at most; and at most one token a parameter.
        warmup: f64 = 0.1, 0 to 1;
        /// The last learning rate as a share of the peak.
        final_share: f64 = 0.0, 0 to 1;
        /// `wsd`: the fraction of the run that decays.
        decay: f64 = 0.2, 1e-6 to 0.999999;
        /// `wsd`: runs of one model, vocabulary and seed are trained together up to their decays,
        /// with one batch, rate and warm-up.
        share: bool = false;
    }
}

impl ScheduleSection {
    /// Whether runs branch off common trunks.
    pub fn shares(&self) -> bool {
        self.kind == ScheduleKind::Wsd && self.share
    }
}

/// The parameters that a learning rate goes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RateParams {
    /// N_nv: at one size the best rate is the same for every vocabulary.
    #[default]
    Nonvocab,
    /// N_nv + N_v.
    Total,
}

section! {
    /// The peak of the learning rate = `coefficient` · N^`params_exponent` · D^`tokens_exponent`.
    pub struct LrRule {
        /// The rate if both exponents are 0.
        coefficient: f64 = 0.5, 1e-30 to 1e30;
        /// The parameters counted by N: `nonvocab` or `total`.
        params: RateParams = RateParams::Nonvocab;
        /// How the rate goes with the parameters.
        params_exponent: f64 = -0.4, -10 to 10;
        /// How the rate goes with the tokens of the run.
        tokens_exponent: f64 = 0.0, -10 to 10;
        /// Upper bound of the rule's value.
        max: f64 = 5e-2, 1e-12 to 1e30;
    }
}

impl LrRule {
    /// Whether every run has one rate.
    pub fn is_constant(&self) -> bool {
        self.params_exponent == 0.0 && self.tokens_exponent == 0.0
    }
}

impl ShortForm for LrRule {
    const NUMBER: &'static str = "the rate of every run";
    const TYPE: &'static str = "number";
    const RANGE: [f64; 2] = [1e-12, 1e30];

    fn of_number(rate: f64) -> Result<Self, String> {
        let rule = Self {
            coefficient: rate,
            params_exponent: 0.0,
            tokens_exponent: 0.0,
            ..Self::default()
        };
        Ok(Self { max: rule.max.max(rate), ..rule })
    }
}

section! {
    /// Tokens a step = `coefficient` · D^`tokens_exponent`, rounded within bounds.
    pub struct BatchRule {
        /// Tokens per step if the exponent is 0.
        coefficient: f64 = 0.35, 1e-30 to 1e30;
        /// How the batch goes with the tokens of the run.
        tokens_exponent: f64 = 0.5, -10 to 10;
        /// Fewest tokens a step.
        min: usize = 64, 1 to 1_000_000_000;
        /// Most tokens a step.
        max: usize = 4096, 1 to 1_000_000_000;
        /// Tokens a step are a multiple of it; where left out, a power of two, which leaves a factor of 1.4
        /// to either side of the rule.
        multiple_of: Option<usize> = None, 1 to 1_000_000_000, unless "Option::is_none";
    }
}

impl ShortForm for BatchRule {
    const NUMBER: &'static str = "tokens a step of every run";
    const TYPE: &'static str = "integer";
    const RANGE: [f64; 2] = [1.0, 1e9];

    fn of_number(tokens: f64) -> Result<Self, String> {
        let whole = number::whole(&tokens.into())?;
        let rule = Self { coefficient: tokens, tokens_exponent: 0.0, ..Self::default() };
        Ok(Self { min: whole, max: whole, ..rule })
    }
}

section! {
    /// The `train` section: how every run is trained.
    pub struct TrainSection {
        schedule: ScheduleSection = ScheduleSection::default();
        /// The highest learning rate of each run: one number, or a rule.
        #[schemars(schema_with = "short_form_schema::<LrRule>")]
        lr: LrRule = LrRule::default();
        /// Tokens a step: one number, or a rule.
        #[schemars(schema_with = "short_form_schema::<BatchRule>")]
        batch: BatchRule = BatchRule::default();
        /// Which of its captions a clip shows: `matched`, the one that its codes were made with, or `drawn`. Where
        /// left out, `matched` if the tokenizer reads captions (`tokenizer.language.at` has `tokenizer`).
        captions: Option<ShownCaptions> = None, unless "Option::is_none";
        /// `f32`, or what a GPU is faster in: `f16`, `bf16`.
        precision: Precision = Precision::default();
        /// A cell whose budget buys fewer steps is dropped: it would show its warm-up, not its size.
        min_steps: usize = 200, 1 to 1_000_000_000;
        /// AdamW's decoupled weight decay.
        weight_decay: f64 = 1e-6, 0 to 1e3;
        /// AdamW's β₁ and β₂.
        #[schemars(inner(range(min = 0, max = 0.9999999)))]
        betas: Vec<f64> = vec![0.9, 0.95];
        /// Added by AdamW to the root of the second moment, which underflows in f32 below 1e-22: 0 / 0 would be NaN.
        epsilon: f64 = 1e-8, 1e-20 to 1;
        /// Global norm to which gradients are clipped; 0 for none.
        clip_norm: f64 = 1.0, 0 to 1e6;
        /// Times a run that it is measured on the validation split.
        evaluations: usize = 4, 0 to 100_000;
        /// Seconds between checkpoints; never changes a result.
        checkpoint_s: f64 = 20.0, 0 to 1e9;
        /// Seconds without progress after which a worker is taken for hung, ended and started again; 0
        /// for never. Longer than the longest step; never changes a result.
        hang_s: f64 = 600.0, 0 to 1e9;
    }
}

impl TrainSection {
    /// Time between checkpoints.
    pub fn checkpoint_every(&self) -> Duration {
        Duration::from_secs_f64(self.checkpoint_s.max(0.0))
    }

    /// Longest time without progress of a worker; `None` for no limit.
    pub fn hang(&self) -> Option<Duration> {
        (self.hang_s > 0.0).then(|| Duration::from_secs_f64(self.hang_s))
    }
}
