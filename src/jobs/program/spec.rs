//! [`TrainerSpec`]: the specification of a run for a user's trainer.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf, absolute};

use anyhow::Result;
use serde::Serialize;

use crate::codes::TokenStore;
use crate::jobs::folder::{CHECKPOINT, ResultsFolder};
use crate::machine::CARDS;
use crate::plan::bytes_on_card;
use crate::spec::{
    GeneratorSpec, Grid, ModelShape, Precision, RunSpec, ShownCaptions, TARGETS_PER_PASS,
};

/// Raised when a key changes its meaning or goes.
const VERSION: u32 = 2;

/// How the learning rate moves: linearly up to `peak`, then half a cosine (`cosine`) down to
/// `final_share · peak` at the last step, or on to the last `decay_steps` and down there by 1 − √share
/// (`wsd`).
#[derive(Clone, Debug, Serialize)]
pub struct TrainerLr {
    pub peak: f64,
    pub schedule: &'static str,
    pub warmup_steps: usize,
    pub final_share: f64,
    /// `null` for `cosine`.
    pub decay_steps: Option<usize>,
}

/// One run as its trainer reads it, in `{spec}`: complete, with absolute paths.
#[derive(Clone, Debug, Serialize)]
pub struct TrainerSpec {
    pub version: u32,
    pub run_id: String,
    pub seed: u64,
    /// The kind of generator with its options.
    pub generator: GeneratorSpec,
    /// The scales of the codes.
    pub grid: Grid,
    /// The layers and widths of the generator.
    pub shape: ModelShape,
    /// The precision of products.
    pub precision: Precision,
    /// V, without special tokens.
    pub n_vocab: usize,
    /// Words of the longest caption: `shape.n_ctx` is these and the motion slots.
    pub max_text_tokens: usize,
    /// N_nv of the built-in architecture in this shape.
    pub params_nonvocab: usize,
    /// N_v = V·d.
    pub params_vocab: usize,
    /// C.
    pub budget_flops: f64,
    /// D = `steps · batch_tokens`: supervised tokens that the budget buys.
    pub tokens: usize,
    pub steps: usize,
    pub batch_tokens: usize,
    pub lr: TrainerLr,
    pub weight_decay: f64,
    pub betas: [f64; 2],
    pub epsilon: f64,
    /// `null` where gradients are not clipped.
    pub clip_norm: Option<f64>,
    pub evaluations: usize,
    /// Targets that are measured at once at most, but for a single clip.
    pub targets_per_pass: usize,
    /// Seconds between two checkpoints.
    pub checkpoint_s: f64,
    /// Frames per second of the data.
    pub fps: f64,
    /// Distinct supervised tokens in the training split; 0 if isoflop has no data.
    pub unique_tokens: usize,
    /// The clips of the training split that the run sees, by their place in it; `null` for all.
    pub clips: Option<Vec<usize>>,
    /// Which of its captions a clip shows.
    pub captions: ShownCaptions,
    /// What the run takes of a GPU, as the plan counts it.
    pub gpu_bytes: u64,
    /// Dense bf16 FLOP/s of cards, by a word of the driver's name of the device.
    pub peak_flops: BTreeMap<&'static str, f64>,
    /// The tokenizer's folder, the codes and the embedded captions; `null` if there are none.
    pub tokenizer: Option<PathBuf>,
    pub codes: Option<PathBuf>,
    pub text: Option<PathBuf>,
    /// The same paths as `{out}`, `{checkpoint}` and `{init}`; the last is `null` if the command does not use it.
    pub out: PathBuf,
    pub checkpoint: PathBuf,
    pub init: Option<PathBuf>,
}

impl TrainerSpec {
    /// Combines the run's spec with the paths of its inputs.
    pub fn new(
        folder: &ResultsFolder,
        id: &str,
        run: &RunSpec,
        tokens: Option<&TokenStore>,
    ) -> Result<Self> {
        let there = |path: &Path| path.exists().then(|| absolute(path)).transpose();
        let place = absolute(folder.run(id))?;
        let params = run.params();
        let sweep = folder.sweep()?;
        let is_part = !run.share.is_whole();
        Ok(Self {
            version: VERSION,
            run_id: id.to_string(),
            seed: run.seed,
            generator: run.generator.clone(),
            grid: run.codes.clone(),
            shape: run.shape().clone(),
            precision: run.precision,
            n_vocab: run.n_vocab(),
            max_text_tokens: sweep.text.max_tokens,
            params_nonvocab: params.nonvocab,
            params_vocab: params.vocab,
            budget_flops: run.budget_flops,
            tokens: run.tokens(),
            steps: run.steps,
            batch_tokens: run.batch_tokens,
            lr: TrainerLr {
                peak: run.lr,
                schedule: if run.decay_steps.is_some() { "wsd" } else { "cosine" },
                warmup_steps: run.warmup_steps,
                final_share: run.final_share,
                decay_steps: run.decay_steps,
            },
            weight_decay: run.weight_decay,
            betas: run.betas,
            epsilon: run.epsilon,
            clip_norm: run.clip_norm,
            evaluations: run.evaluations,
            targets_per_pass: TARGETS_PER_PASS,
            checkpoint_s: sweep.train.checkpoint_s,
            captions: run.captions,
            fps: run.fps,
            gpu_bytes: bytes_on_card(run),
            peak_flops: CARDS.iter().map(|card| (card.word, card.peak_flops)).collect(),
            unique_tokens: tokens.map_or(0, |tokens| tokens.training_targets(run.share)),
            clips: tokens.filter(|_| is_part).map(|tokens| tokens.training_clips(run.share)),
            tokenizer: there(&folder.tokenizer(&run.tokenizer_id))?,
            codes: there(&folder.tokens(&run.tokenizer_id))?,
            text: there(&folder.text(&run.text_id))?,
            out: place.join("result.json"),
            checkpoint: place.join(CHECKPOINT),
            init: None,
        })
    }
}
