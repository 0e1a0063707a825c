//! The record of a finished run, whoever trained it: the one place where records are made.

use super::folder::ResultsFolder;
use super::id::JobId;
use super::tokenizer;
use crate::files::read_if_there;
use crate::plan::{RunSpec, TokenizerJob};
use crate::record::facts::{LOSS_NATS, LOSS_NORMALISED, NATS_PER_FRAME, NATS_PER_SECOND};
use crate::record::{Measured, Metrics, Planned, RunRecord, block_metric};
use crate::spec::FlopsPerToken;
use crate::spec::flops::TRAINING_PER_FORWARD;

/// Frames of a code that stands for no fixed number of them.
const FRAMES_PER_CODE: f64 = 4.0;

/// What a trainer says of a run that it finished; for what is `None` the plan's value stands in.
pub struct Report {
    pub device: String,
    pub loss_nats: f64,
    pub loss_normalised: f64,
    /// L_u of each scale; empty where there is one.
    pub normalised_by_scale: Vec<f64>,
    /// L_u of each block of the test split; empty where it is not known.
    pub normalised_by_block: Vec<f64>,
    /// By default from `nats_per_second`, or from `loss_nats`: a code stands for four frames.
    pub nats_per_frame: Option<f64>,
    pub nats_per_second: Option<f64>,
    pub tokens: Option<usize>,
    /// 0 where it is not known.
    pub unique_tokens: usize,
    pub steps: Option<usize>,
    pub batch_tokens: Option<usize>,
    pub lr: Option<f64>,
    pub flops_exact: ExactFlops,
    pub zero_count_targets: usize,
    pub wall_s: f64,
    pub tokens_per_s: Option<f64>,
    /// `None` where the trainer does not say.
    pub peak_bytes: Option<u64>,
    /// Parameters of the model as built, by group.
    pub params_nonvocab: Option<usize>,
    pub params_vocab: Option<usize>,
    pub params_text: Option<usize>,
}

/// Training FLOPs of a model as built.
#[derive(Clone, Copy)]
pub enum ExactFlops {
    /// As the trainer counted them.
    Counted(f64),
    /// Those of full contexts: so many words, the longest caption's, and every motion slot.
    FullContexts { max_text_tokens: usize },
}

impl Report {
    /// The record of the run that was planned as `spec`.
    pub fn record(&self, folder: &ResultsFolder, id: &str, spec: &RunSpec) -> RunRecord {
        let (planned, price) = subject(folder, id, spec, self.flops_exact);
        let planned = Planned {
            steps: self.steps.or(planned.steps),
            batch_tokens: self.batch_tokens.or(planned.batch_tokens),
            lr: self.lr.or(planned.lr),
            params_nonvocab: self.params_nonvocab.unwrap_or(planned.params_nonvocab),
            params_vocab: self.params_vocab.unwrap_or(planned.params_vocab),
            params_text: self.params_text.or(planned.params_text),
            ..planned
        };
        RunRecord::new(planned, self.measured(&price), self.metrics(&price))
    }

    fn measured(&self, price: &Price) -> Measured {
        let (tokens, unique) = (self.tokens.unwrap_or(price.tokens), self.unique_tokens);
        let training = |forward: f64| TRAINING_PER_FORWARD * forward * tokens as f64;
        let flops_exact = match self.flops_exact {
            ExactFlops::Counted(flops) => flops,
            ExactFlops::FullContexts { .. } => training(price.per_token.exact),
        };
        let per_s = self.tokens_per_s.unwrap_or(tokens as f64 / self.wall_s.max(1e-9));
        Measured {
            flops_openai: Some(training(price.per_token.openai as f64)),
            flops_6nd: Some(training(price.per_token.six_nd)),
            flops_exact: Some(flops_exact),
            tokens,
            unique_tokens: Some(unique),
            epochs: Some(if unique > 0 { tokens as f64 / unique as f64 } else { 0.0 }),
            zero_count_targets: Some(self.zero_count_targets),
            wall_s: Some(self.wall_s),
            tokens_per_s: Some(per_s),
            peak_bytes: self.peak_bytes,
            device: Some(self.device.clone()),
            git_revision: Some(env!("ISOFLOP_GIT_REVISION").to_string()),
        }
    }

    fn metrics(&self, price: &Price) -> Metrics {
        let per_second = self.nats_per_second.map(|x| x / price.fps);
        let per_code = self.loss_nats / price.frames_per_code;
        let per_frame = self.nats_per_frame.or(per_second).unwrap_or(per_code);
        let metrics = [
            (LOSS_NATS, self.loss_nats),
            (LOSS_NORMALISED, self.loss_normalised),
            (NATS_PER_FRAME, per_frame),
            (NATS_PER_SECOND, self.nats_per_second.unwrap_or(per_frame * price.fps)),
        ];
        let mut metrics: Metrics = metrics.into_iter().collect();
        for (scale, loss) in self.normalised_by_scale.iter().enumerate() {
            metrics.set(format!("{LOSS_NORMALISED}_scale_{}", scale + 1), *loss);
        }
        for (block, loss) in self.normalised_by_block.iter().enumerate() {
            metrics.set(block_metric(block), *loss);
        }
        metrics
    }
}

/// What of a spec is no fact of a record, but goes into some.
struct Price {
    tokens: usize,
    per_token: FlopsPerToken,
    /// Frames per second of the data.
    fps: f64,
    frames_per_code: f64,
}

/// What the plan says of a run. Nothing else here reads its spec.
fn subject(
    folder: &ResultsFolder,
    id: &str,
    spec: &RunSpec,
    flops_exact: ExactFlops,
) -> (Planned, Price) {
    let (shape, params) = (spec.shape(), spec.params());
    let frames = spec.codes.frames_per_code();
    // Only the exact count, where it is not known, asks for the words.
    let max_text_tokens = match flops_exact {
        ExactFlops::Counted(_) => 0,
        ExactFlops::FullContexts { max_text_tokens } => max_text_tokens,
    };
    let price = Price {
        tokens: spec.tokens(),
        per_token: spec.generator.flops_per_token(&spec.codes, max_text_tokens),
        fps: spec.fps,
        frames_per_code: frames.unwrap_or(FRAMES_PER_CODE),
    };
    let tokenizer = tokenizer_of(folder, &spec.tokenizer_id);
    let planned = Planned {
        run_id: id.to_string(),
        seed: Some(spec.seed),
        n_layer: Some(shape.n_layer),
        n_head: Some(shape.n_head),
        d_model: Some(shape.d_model),
        d_ff: Some(shape.d_ff),
        n_ctx: Some(shape.n_ctx),
        n_vocab: spec.n_vocab(),
        budget_flops: spec.budget_flops,
        params_nonvocab: params.nonvocab,
        params_vocab: params.vocab,
        params_text: Some(params.text),
        params_embedding: Some(params.embedding),
        params_head: Some(params.head),
        steps: Some(spec.steps),
        batch_tokens: Some(spec.batch_tokens),
        lr: Some(spec.lr),
        tokenizer_id: Some(spec.tokenizer_id.clone()),
        generator: Some(spec.generator.name().to_string()),
        tokenizer_kind: tokenizer.as_ref().map(|job| job.spec.architecture.name().to_string()),
        quantizer: tokenizer.map(|job| job.spec.quantizer.name().to_string()),
        varied: spec.varied.clone(),
        share: Some(spec.share.value()),
    };
    (planned, price)
}

/// The tokenizer of a run; `None` where the sweep has no data. A name is not worth a trained run, so
/// the name of one whose description is damaged is unknown.
fn tokenizer_of(folder: &ResultsFolder, tokenizer_id: &str) -> Option<TokenizerJob> {
    read_if_there(&folder.spec(&JobId::new(tokenizer::KIND, tokenizer_id))).ok().flatten()
}
