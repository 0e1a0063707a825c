//! How every cell is built and trained: the `model` and `train` sections.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::short_form::{self, ShortForm, section_or_number};
use crate::spec::{Ffn, Precision};
use crate::units::number;

/// The `model` section: what all models of the sweep share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ModelSection {
    pub ffn: Ffn,
    /// d_ff is rounded up to a multiple of this; ScaMo has 256, which only large models can afford.
    #[serde(deserialize_with = "number::count")]
    pub ffn_multiple: usize,
    /// One matrix for the embedding and the head.
    pub tie_embeddings: bool,
    /// Base of the rotary positions' wavelengths.
    #[serde(deserialize_with = "number::number")]
    pub rope_base: f64,
    /// Motion slots of n_ctx: 49 codes, the end token and one to spare, as in ScaMo. Where a clip has
    /// codes on several scales, n_ctx has room for those of as many latents; `masked` takes one slot a
    /// latent, however many layers it has.
    #[serde(deserialize_with = "number::count")]
    pub motion_slots: usize,
    /// `scalewise`: share of the codes that training shows as random ones, none; 0.5 in MoSa and
    /// LG-Tok. `masked`: the same of the hidden codes; 0.1 in MoMask.
    #[serde(deserialize_with = "number::number")]
    pub corruption: f64,
    /// `scalewise` and `masked`: share of the captions that training leaves out, 0.1, so that motions can be guided.
    #[serde(deserialize_with = "number::number")]
    pub text_drop: f64,
}

impl Default for ModelSection {
    fn default() -> Self {
        Self {
            ffn: Ffn::default(),
            ffn_multiple: 8,
            tie_embeddings: false,
            rope_base: 10_000.0,
            motion_slots: 51,
            corruption: 0.0,
            text_drop: 0.1,
        }
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

/// The `train.schedule` section: the learning rate over a run, as a share of its peak.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScheduleSection {
    pub kind: ScheduleKind,
    /// Share of the run spent warming up, at most; and at most one token a parameter.
    #[serde(deserialize_with = "number::number")]
    pub warmup: f64,
    /// The last learning rate as a share of the peak.
    #[serde(deserialize_with = "number::number")]
    pub final_share: f64,
    /// Of `wsd`: the share of the run that decays.
    #[serde(deserialize_with = "number::number")]
    pub decay: f64,
    /// Of `wsd`: runs of one model, vocabulary and seed are trained together up to their decays,
    /// with one batch, rate and warm-up.
    pub share: bool,
}

impl ScheduleSection {
    /// Whether runs branch off common trunks.
    pub fn shares(&self) -> bool {
        self.kind == ScheduleKind::Wsd && self.share
    }
}

impl Default for ScheduleSection {
    fn default() -> Self {
        let kind = ScheduleKind::default();
        Self { kind, warmup: 0.1, final_share: 0.0, decay: 0.2, share: false }
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

/// The peak of the learning rate = `coefficient` · N^`params_exponent` · D^`tokens_exponent`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LrRule {
    /// The rate where both exponents are 0.
    #[serde(deserialize_with = "number::number")]
    pub coefficient: f64,
    /// Which parameters N counts: `nonvocab` or `total`.
    pub params: RateParams,
    /// How the rate goes with the parameters.
    #[serde(deserialize_with = "number::number")]
    pub params_exponent: f64,
    /// How the rate goes with the tokens of the run.
    #[serde(deserialize_with = "number::number")]
    pub tokens_exponent: f64,
    /// The rule's value is held under this.
    #[serde(deserialize_with = "number::number")]
    pub max: f64,
}

impl Default for LrRule {
    fn default() -> Self {
        Self {
            coefficient: 0.5,
            params: RateParams::Nonvocab,
            params_exponent: -0.4,
            tokens_exponent: 0.0,
            max: 5e-2,
        }
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

/// Tokens a step = `coefficient` · D^`tokens_exponent`, rounded within bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BatchRule {
    /// Tokens a step where the exponent is 0.
    #[serde(deserialize_with = "number::number")]
    pub coefficient: f64,
    /// How the batch goes with the tokens of the run.
    #[serde(deserialize_with = "number::number")]
    pub tokens_exponent: f64,
    /// Fewest tokens a step.
    #[serde(deserialize_with = "number::count")]
    pub min: usize,
    /// Most tokens a step.
    #[serde(deserialize_with = "number::count")]
    pub max: usize,
    /// Tokens a step are a multiple of it; where left out, a power of two, which leaves a factor of 1.4
    /// to either side of the rule.
    #[serde(deserialize_with = "number::optional_count")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiple_of: Option<usize>,
}

impl Default for BatchRule {
    fn default() -> Self {
        Self { coefficient: 0.35, tokens_exponent: 0.5, min: 64, max: 4096, multiple_of: None }
    }
}

impl ShortForm for BatchRule {
    const NUMBER: &'static str = "tokens a step of every run";
    const TYPE: &'static str = "integer";

    fn of_number(tokens: f64) -> Result<Self, String> {
        let whole = number::whole(tokens.into())?;
        let rule = Self { coefficient: tokens, tokens_exponent: 0.0, ..Self::default() };
        Ok(Self { min: whole, max: whole, ..rule })
    }
}

/// The `train` section: how every run is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrainSection {
    pub schedule: ScheduleSection,
    /// The highest learning rate of each run: one number, or a rule.
    #[serde(deserialize_with = "section_or_number")]
    #[schemars(schema_with = "short_form::schema::<LrRule>")]
    pub lr: LrRule,
    /// Tokens a step: one number, or a rule.
    #[serde(deserialize_with = "section_or_number")]
    #[schemars(schema_with = "short_form::schema::<BatchRule>")]
    pub batch: BatchRule,
    /// `f32`, or what a GPU is faster in: `f16`, `bf16`.
    pub precision: Precision,
    /// A cell whose budget buys fewer steps is dropped: it would show its warm-up, not its size.
    #[serde(deserialize_with = "number::count")]
    pub min_steps: usize,
    /// AdamW's decoupled weight decay.
    #[serde(deserialize_with = "number::number")]
    pub weight_decay: f64,
    /// AdamW's β₁ and β₂.
    #[serde(deserialize_with = "number::numbers")]
    pub betas: Vec<f64>,
    /// What AdamW adds to the root of the second moment.
    #[serde(deserialize_with = "number::number")]
    pub epsilon: f64,
    /// Global norm to which gradients are clipped; 0 for none.
    #[serde(deserialize_with = "number::number")]
    pub clip_norm: f64,
    /// Times a run that it is measured on the validation split.
    #[serde(deserialize_with = "number::count")]
    pub evaluations: usize,
    /// Seconds between checkpoints; never changes a result.
    #[serde(deserialize_with = "number::number")]
    pub checkpoint_s: f64,
    /// Seconds without progress after which a worker is taken for hung, ended and started again; 0
    /// for never. Longer than the longest step; never changes a result.
    #[serde(deserialize_with = "number::number")]
    pub hang_s: f64,
}

impl TrainSection {
    /// Time between checkpoints.
    pub fn checkpoint_every(&self) -> Duration {
        Duration::from_secs_f64(self.checkpoint_s.max(0.0))
    }

    /// How long a worker may make no progress; `None` where it may for ever.
    pub fn hang(&self) -> Option<Duration> {
        (self.hang_s > 0.0).then(|| Duration::from_secs_f64(self.hang_s))
    }
}

impl Default for TrainSection {
    fn default() -> Self {
        Self {
            schedule: ScheduleSection::default(),
            lr: LrRule::default(),
            batch: BatchRule::default(),
            precision: Precision::default(),
            min_steps: 200,
            weight_decay: 1e-6,
            betas: vec![0.9, 0.95],
            epsilon: 1e-8,
            clip_norm: 1.0,
            evaluations: 4,
            checkpoint_s: 20.0,
            hang_s: 600.0,
        }
    }
}
