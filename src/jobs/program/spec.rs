//! [`TrainerSpec`]: what a program is told of the run that it should train.

use std::path::{Path, PathBuf, absolute};

use anyhow::Result;
use serde::Serialize;

use crate::codes::TokenStore;
use crate::data::Split;
use crate::jobs::ResultsFolder;
use crate::jobs::folder::CHECKPOINT;
use crate::jobs::frozen_sweep;
use crate::plan::RunSpec;
use crate::spec::ModelShape;

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
    pub run_id: String,
    pub seed: u64,
    pub shape: ModelShape,
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
    /// Frames per second of the data.
    pub fps: f64,
    /// Distinct supervised tokens in the training split; 0 where isoflop has no data.
    pub unique_tokens: usize,
    /// The tokenizer's folder, the codes and the embedded captions; `null` where there are none.
    pub tokenizer: Option<PathBuf>,
    pub codes: Option<PathBuf>,
    pub text: Option<PathBuf>,
    /// The same paths as `{out}` and `{checkpoint}`.
    pub out: PathBuf,
    pub checkpoint: PathBuf,
}

impl TrainerSpec {
    /// Gathers what the run's spec says and where its inputs lie.
    pub fn new(folder: &ResultsFolder, id: &str, run: &RunSpec) -> Result<Self> {
        let there = |path: &Path| path.exists().then(|| absolute(path)).transpose();
        let place = absolute(folder.run(id))?;
        let codes = there(&folder.tokens(&run.tokenizer_id))?;
        let params = run.params();
        Ok(Self {
            run_id: id.to_string(),
            seed: run.seed,
            shape: run.shape().clone(),
            n_vocab: run.n_vocab(),
            max_text_tokens: frozen_sweep(folder)?.text.max_tokens,
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
            fps: run.fps,
            unique_tokens: codes.as_deref().map(unique_tokens).transpose()?.unwrap_or(0),
            tokenizer: there(&folder.tokenizer(&run.tokenizer_id))?,
            codes,
            text: there(&folder.text(&run.text_id))?,
            out: place.join("result.json"),
            checkpoint: place.join(CHECKPOINT),
        })
    }
}

/// Codes of the training split and an end token a clip, as the built-in trainer counts them.
fn unique_tokens(codes: &Path) -> Result<usize> {
    let store = TokenStore::open(codes)?;
    Ok(store.n_targets(Split::Train))
}
