//! The record of a finished run, whoever trained it: the one place where records are made.

use super::folder::ResultsFolder;
use super::id::JobId;
use super::kind::JobKind;
use super::program::TrainerResult;
use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::{Sums, losses_by_block};
use crate::record::facts::{LOSS_NATS, LOSS_NORMALISED, NATS_PER_FRAME, NATS_PER_SECOND};
use crate::record::{Measured, Metrics, Planned, RunRecord, block_metric};
use crate::spec::flops::TRAINING_PER_FORWARD;
use crate::spec::{RunSpec, TokenizerJob};

/// Frames of a code that stands for no fixed number of them.
const FRAMES_PER_CODE: f64 = 4.0;

/// A run whose trainer has ended, beside what that says of it.
pub struct FinishedRun<'a> {
    pub folder: &'a ResultsFolder,
    pub id: &'a str,
    pub spec: &'a RunSpec,
    /// The codes that it was trained on; `None` where isoflop has none.
    pub tokens: Option<&'a TokenStore>,
    /// Words of the longest caption, for FLOPs that the trainer did not count: those of full contexts.
    pub max_text_tokens: usize,
    /// Seconds since the trainer was started.
    pub ran_s: f64,
}

impl FinishedRun<'_> {
    /// The record; for what the result does not say the plan's value stands in.
    pub fn record(&self, result: &TrainerResult) -> RunRecord {
        RunRecord::new(self.planned(result), self.measured(result), self.metrics(result))
    }

    fn planned(&self, result: &TrainerResult) -> Planned {
        let (spec, shape, params) = (self.spec, self.spec.shape(), self.spec.params());
        let tokenizer = self.tokenizer();
        let or = |told: Option<f64>, planned: usize| told.map_or(planned, |x| x as usize);
        Planned {
            run_id: self.id.to_string(),
            seed: Some(spec.seed),
            n_layer: Some(shape.n_layer),
            n_head: Some(shape.n_head),
            d_model: Some(shape.d_model),
            d_ff: Some(shape.d_ff),
            n_ctx: Some(shape.n_ctx),
            n_vocab: spec.n_vocab(),
            budget_flops: spec.budget_flops,
            params_nonvocab: or(result.params_nonvocab, params.nonvocab),
            params_vocab: or(result.params_vocab, params.vocab),
            params_text: Some(or(result.params_text, params.text)),
            params_embedding: Some(params.embedding),
            params_head: Some(params.head),
            steps: Some(or(result.steps, spec.steps)),
            batch_tokens: Some(or(result.batch_tokens, spec.batch_tokens)),
            lr: Some(result.lr.unwrap_or(spec.lr)),
            tokenizer_id: Some(spec.tokenizer_id.clone()),
            generator: Some(spec.generator.name().to_string()),
            tokenizer_kind: tokenizer.as_ref().map(|job| job.spec.architecture.name().to_string()),
            quantizer: tokenizer.map(|job| job.spec.quantizer.name().to_string()),
            varied: spec.varied.clone(),
            share: Some(spec.share.value()),
        }
    }

    /// The tokenizer; `None` if the sweep has no data. A name is not worth a trained run, so the name of
    /// one whose description is damaged is unknown.
    fn tokenizer(&self) -> Option<TokenizerJob> {
        self.folder.known_spec(&JobId::new(JobKind::Tokenizer, &self.spec.tokenizer_id))
    }

    fn measured(&self, result: &TrainerResult) -> Measured {
        let (spec, codes) = (self.spec, self.tokens);
        let or = |told: Option<f64>, known: usize| told.map_or(known, |x| x as usize);
        let tokens = or(result.tokens, spec.tokens());
        let known = codes.map_or(0, |codes| codes.training_targets(spec.share));
        let unique = or(result.unique_tokens, known);
        let zero_count = codes.map_or(0, TokenStore::zero_count_targets);
        // Only the exact count, where it is not known, asks for the words.
        let words = if result.flops_exact.is_some() { 0 } else { self.max_text_tokens };
        let per_token = spec.generator.flops_per_token(&spec.codes, words);
        let training = |forward: f64| TRAINING_PER_FORWARD * forward * tokens as f64;
        let wall_s = result.wall_s.unwrap_or(self.ran_s);
        Measured {
            flops_openai: Some(training(per_token.openai as f64)),
            flops_6nd: Some(training(per_token.six_nd)),
            flops_exact: Some(result.flops_exact.unwrap_or_else(|| training(per_token.exact))),
            tokens,
            unique_tokens: Some(unique),
            epochs: Some(if unique > 0 { tokens as f64 / unique as f64 } else { 0.0 }),
            zero_count_targets: Some(or(result.zero_count_targets, zero_count)),
            wall_s: Some(wall_s),
            tokens_per_s: Some(result.tokens_per_s.unwrap_or(tokens as f64 / wall_s.max(1e-9))),
            peak_bytes: result.peak_bytes.map(|x| x as u64),
            device: Some(result.device.clone().unwrap_or_else(|| "custom".to_string())),
            git_revision: Some(env!("ISOFLOP_GIT_REVISION").to_string()),
        }
    }

    fn metrics(&self, result: &TrainerResult) -> Metrics {
        let fps = self.spec.fps;
        let per_second = result.nats_per_second.map(|x| x / fps);
        let frames = self.spec.codes.frames_per_code().unwrap_or(FRAMES_PER_CODE);
        let per_frame = result.nats_per_frame.or(per_second).unwrap_or(result.loss_nats / frames);
        let metrics = [
            (LOSS_NATS, result.loss_nats),
            (LOSS_NORMALISED, result.normalised()),
            (NATS_PER_FRAME, per_frame),
            (NATS_PER_SECOND, result.nats_per_second.unwrap_or(per_frame * fps)),
        ];
        let mut metrics: Metrics = metrics.into_iter().collect();
        for (scale, loss) in result.normalised_by_scale.iter().enumerate() {
            metrics.set(format!("{LOSS_NORMALISED}_scale_{}", scale + 1), *loss);
        }
        let codes = self.tokens.filter(|_| !result.clips.is_empty());
        let by_block = codes.map_or_else(Vec::new, |codes| by_block(codes, &result.clips));
        for (block, loss) in by_block.into_iter().enumerate() {
            metrics.set(block_metric(block), loss);
        }
        metrics
    }
}

/// L_u of each block of the test split; empty if the codes do not say which clips go together.
fn by_block(tokens: &TokenStore, clips: &[Sums]) -> Vec<f64> {
    let Some(groups) = tokens.groups(Split::Test) else { return Vec::new() };
    let frames = (0..groups.len()).map(|clip| tokens.clip_frames(Split::Test, clip));
    losses_by_block(clips, groups, &frames.collect::<Vec<_>>())
}
