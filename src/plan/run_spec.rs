//! [`RunSpec`] and [`TokenizerJob`]: all that a worker needs to know, and the ids that follow.

use crate::data::DataFacts;
use crate::motion::N_FEATURES;
use crate::spec::{
    BegunFrom, EvaluatorSpec, FlopsPerToken, GeneratorSpec, Grid, ModelShape, ParamCounts,
    Precision, ScoresSpec, Share, TextSpec, TokenizerSpec, TokenizerTrainer, content_id,
};
use crate::sweep::condition::Condition;
use crate::sweep::is_torch;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    /// What it sees of the training split; left out where it is all of it.
    #[serde(default, skip_serializing_if = "Share::is_whole")]
    pub share: Share,
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
    /// `None` where gradients are not clipped.
    pub clip_norm: Option<f64>,
    /// Times a run that it is measured on the validation split.
    pub evaluations: usize,
    /// Frames per second of the data.
    pub fps: f64,
    pub data_digest: String,
    pub text_id: String,
    pub tokenizer_id: String,
    /// The program that trains it; `None` for the built-in trainer, whose ids know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerProgram>,
    /// What it has of the keys that the sweep varies, as `train.lr=0.001`; ids of others know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub varied: Option<String>,
}

/// What of a program of somebody's own its results follow from.
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

// [`PlannedRun`]: a run with its id and its price.

/// One run of the plan.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    pub run_id: String,
    pub spec: RunSpec,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub achieved_ratio: f64,
    /// What the built-in trainer takes.
    pub peak_bytes: u64,
    /// The trunk that it branches off; `None` where it is trained alone.
    pub trunk_id: Option<String>,
    /// Times that the run sees each token of the training split; `None` where it is not here.
    pub epochs: Option<f64>,
}

impl PlannedRun {
    /// Bytes at the run's peak; `None` where a trainer other than the built-in one takes what it takes.
    pub fn known_peak_bytes(&self) -> Option<u64> {
        self.spec.trainer.is_none().then_some(self.peak_bytes)
    }

    /// FLOPs of the budget that the run's own job trains: all but what its trunk does.
    pub fn own_flops(&self) -> f64 {
        match (&self.trunk_id, self.spec.decay_steps) {
            (Some(_), Some(decay)) => {
                self.spec.budget_flops * decay as f64 / self.spec.steps as f64
            }
            _ => self.spec.budget_flops,
        }
    }
}

// [`ScoreJob`]: a run whose motions are to be scored.

/// One run to score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreJob {
    pub revision: u32,
    pub run_id: String,
    pub evaluator_id: String,
    /// Without its conditions, which choose runs and change none.
    pub spec: ScoresSpec,
}

impl ScoreJob {
    /// The score of a run by an evaluator.
    pub fn new(run_id: &str, evaluator_id: &str, spec: &ScoresSpec) -> Self {
        Self {
            revision: TRAINING_REVISION,
            run_id: run_id.to_string(),
            evaluator_id: evaluator_id.to_string(),
            spec: spec.of_a_run(),
        }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }

    /// The scores of those runs that a `scores` section chooses.
    pub fn of_runs(runs: &[PlannedRun], evaluator_id: &str, spec: &ScoresSpec) -> Vec<Self> {
        let conditions: Vec<Condition> =
            spec.only.iter().filter_map(|text| Condition::parse(text).ok()).collect();
        let chosen = |run: &&PlannedRun| {
            conditions.is_empty() || conditions.iter().any(|condition| holds(condition, run))
        };
        runs.iter().filter(chosen).map(|run| Self::new(&run.run_id, evaluator_id, spec)).collect()
    }
}

fn holds(condition: &Condition, PlannedRun { spec, .. }: &PlannedRun) -> bool {
    let ModelShape { n_layer, n_head, d_model, .. } = *spec.shape();
    let [n_layer, n_head, d_model, v] =
        [n_layer, n_head, d_model, spec.n_vocab()].map(|n| n as f64);
    condition.holds([n_layer, n_head, d_model, v, spec.budget_flops, spec.share.value()])
}

// [`EvaluatorJob`]: an evaluator to train, which all scores of a sweep are taken by.

/// One evaluator to train. It hangs on the data alone, so that sweeps that differ in anything else share
/// it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorJob {
    pub revision: u32,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
}

impl EvaluatorJob {
    /// The job of a sweep's `evaluator` section on its data.
    pub fn new(spec: EvaluatorSpec, data: &DataFacts) -> Self {
        Self { revision: TRAINING_REVISION, spec, data_digest: data.digest.clone() }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}

// Peak memory of what runs need, from measured estimates.

/// Bytes of a frame's features in the pool of a tokenizer, with what the allocator adds.
const POOL_BYTES_PER_FRAME: f64 = 1.1 * 4.0 * N_FEATURES as f64;

/// Frames that are tokenised together.
const FRAMES_ENCODED: f64 = 2048.0;

/// What the runtime and the data's statistics take in a worker that reads motion.
const MOTION_BASE_BYTES: f64 = 30e6;

/// What PyTorch takes before its first tensor: 500 MB of libraries were measured, and 100 MB more once
/// clips and weights were read.
const TORCH_BASE_BYTES: f64 = 600e6;

/// Copies of the pool that a worker holds while it writes it for another trainer.
const POOLS_WRITTEN: f64 = 3.0;

/// Bytes of a patch that weights begin from: the features of four frames, twice.
const BYTES_PER_PATCH: f64 = 2.0 * 4.0 * 4.0 * N_FEATURES as f64;

/// Peak bytes that training a tokenizer has to itself: its pool of clips, and for each frame of a
/// step what the backward pass keeps of every channel; or, where that is more, what k-means takes that
/// it is measured beside.
///
/// Measured at widths 16, 64 and 128 with a pool of 2048 clips: 400, 430 and 463 MB, within 3 % of
/// this; the share of a channel at depths 1 to 6 and 8 to 128 windows a step, within 20 %.
pub fn tokenizer_peak_bytes(spec: &TokenizerSpec, data: &DataFacts) -> u64 {
    let [train, ..] = data.clips;
    let frames_per_clip = data.train_frames() as f64 / train.max(1) as f64;
    let pool_frames = |spec: &TokenizerSpec| {
        let images = if spec.training.mirror { 2.0 } else { 1.0 };
        images * spec.training.pool_clips.min(train) as f64 * frames_per_clip
    };
    // A pool has no more patches than frames.
    let begun = |spec: &TokenizerSpec| {
        let Some(BegunFrom { weights, codes }) = spec.begun_from() else { return 0.0 };
        let most = pool_frames(spec);
        let bytes_per_latent = 3.0 * 4.0 * spec.architecture.code_dim() as f64;
        BYTES_PER_PATCH * most.min(weights as f64) + bytes_per_latent * most.min(codes as f64)
    };
    let pool = |spec: &TokenizerSpec| POOL_BYTES_PER_FRAME * pool_frames(spec);
    let frames = (spec.training.batch * spec.training.window) as f64;
    let step = frames * spec.training_bytes_per_frame();
    let training = match spec.trainer {
        TokenizerTrainer::BuiltIn => pool(spec) + step.max(begun(spec)),
        TokenizerTrainer::Torch => {
            (POOLS_WRITTEN * pool(spec)).max(TORCH_BASE_BYTES + pool(spec) + step)
        }
    };
    let beside = spec.k_means_beside().map_or(0.0, |spec| pool(&spec) + begun(&spec));
    (MOTION_BASE_BYTES + training.max(beside)) as u64
}

/// Peak bytes that tokenising a data set has to itself: a batch of clips in the encoder, and all
/// codes twice.
///
/// Measured at widths 16, 64 and 128: 35, 42 and 82 MB, where this says 37, 55 and 78.
pub fn tokens_peak_bytes(spec: &TokenizerSpec, data: &DataFacts) -> u64 {
    let codes = 2.0 * 4.0 * data.unique_tokens(&spec.grid()) as f64;
    (MOTION_BASE_BYTES + FRAMES_ENCODED * spec.architecture.encoding_bytes_per_frame() + codes)
        as u64
}

/// Peak bytes that an evaluator has to itself: its pool of clips, with what the backward pass keeps of
/// each row of a step; or the test clips beside such that were made worse.
pub fn evaluator_peak_bytes(spec: &EvaluatorSpec, data: &DataFacts) -> u64 {
    let [train, _, test] = data.clips;
    let frames_per_clip = data.train_frames() as f64 / train.max(1) as f64;
    let n_features = spec.representation.n_features(N_FEATURES) as f64;
    let pool = spec.pool_clips.min(train) as f64 * frames_per_clip * 4.4 * n_features;
    let rows =
        frames_per_clip.min(spec.window as f64) / spec.frames() as f64 + WORDS_PER_CAPTION as f64;
    let step = spec.batch as f64 * rows * spec.networks.training_bytes_per_row();
    let gates = 2.0 * 4.0 * N_FEATURES as f64 * test as f64 * frames_per_clip;
    (MOTION_BASE_BYTES + (pool + step).max(gates)) as u64
}

/// What the runtime and an encoder take before the first caption.
const TEXT_BASE_BYTES: f64 = 40e6;

/// Captions of a clip, and words of a caption, for an estimate of what their vectors take.
const CAPTIONS_PER_CLIP: usize = 3;
const WORDS_PER_CAPTION: usize = 12;

/// Peak bytes that embedding the captions of a data set has to itself: every vector three times while
/// the file is written. Captions that are alike are embedded once: 162 MB where 160 were measured
/// (4416 clips, width 64), and less where captions repeat.
pub fn text_peak_bytes(spec: &TextSpec, data: &DataFacts) -> u64 {
    let captions = data.clips.iter().sum::<usize>() * CAPTIONS_PER_CLIP;
    let words = captions * WORDS_PER_CAPTION.min(spec.max_tokens);
    (TEXT_BASE_BYTES + 3.0 * 4.0 * (words * spec.dim) as f64) as u64
}

/// Rows of a batch for each supervised token: captions come on top.
const ROWS_PER_TARGET: f64 = 1.6;

/// Logits that the head holds at once, at most.
const LOGITS_AT_ONCE: f64 = (1 << 28) as f64;

/// What CUDA and its kernels take before there is a model.
const CONTEXT_BYTES: f64 = 1e9;

/// Bytes on the card of a run that PyTorch trains; the trainer ends before its first step where fewer are free.
/// Measured on an H200 at 44M and 343M, V = 1024 and 65,536: 0.8 to 1.2 of it.
///
/// 16 N + rows · n_layer · (8 d + b (8 d + 3 d_ff)) + logits · (8 + 2 b) + 1e9, where
///
/// - N: all parameters; weights, gradients and two moments in f32
/// - rows: 1.6 for each supervised token of a batch
/// - b: bytes of a number in products, 2 in bf16 and 4 in f32
/// - 8 d: the inputs of both halves of a block, in f32; 8 d + 3 d_ff: what its products take and give
/// - logits: batch_tokens · V, at most 2²⁸ at once
pub fn bytes_on_card(spec: &RunSpec) -> u64 {
    let (shape, targets) = (spec.shape(), spec.batch_tokens as f64);
    let bytes = if spec.precision == Precision::F32 { 4.0 } else { 2.0 };
    let (d, d_ff) = (shape.d_model as f64, shape.d_ff as f64);
    let of_row = shape.n_layer as f64 * (8.0 * d + bytes * (8.0 * d + 3.0 * d_ff));
    let logits = LOGITS_AT_ONCE.min(targets * spec.n_vocab() as f64);
    let parameters = 16.0 * spec.params().total() as f64;
    let kept = ROWS_PER_TARGET * targets * of_row;
    (parameters + kept + logits * (8.0 + 2.0 * bytes) + CONTEXT_BYTES) as u64
}
