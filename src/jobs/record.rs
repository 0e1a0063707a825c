//! The record of a finished run.

use super::assignment::Assignment;
use crate::data::Split;
use crate::generator::autoregressive::zero_count_targets;
use crate::generator::{Inputs, Trained};
use crate::machine::peak::peak_bytes;
use crate::plan::RunSpec;
use crate::record::RunRecord;
use crate::spec::flops::TRAINING_PER_FORWARD;

/// Gathers what the run was, what it spent and how well it did.
pub fn of_training(
    assignment: &Assignment,
    spec: &RunSpec,
    inputs: &Inputs,
    trained: &Trained,
) -> RunRecord {
    let params = spec.params();
    let tokens = spec.tokens();
    let unique_tokens = inputs.tokens.n_targets(Split::Train);
    let per_token = spec.generator.flops_per_token(&spec.codes, 1);
    let training = |forward: f64| TRAINING_PER_FORWARD * forward * tokens as f64;
    RunRecord {
        run_id: assignment.job.id.clone(),
        seed: spec.seed,
        n_layer: spec.shape().n_layer,
        n_head: spec.shape().n_head,
        d_model: spec.shape().d_model,
        d_ff: spec.shape().d_ff,
        n_ctx: spec.shape().n_ctx,
        n_vocab: spec.n_vocab(),
        budget_flops: spec.budget_flops,
        flops_openai: training(per_token.openai as f64),
        flops_6nd: training(per_token.six_nd),
        flops_exact: trained.flops_exact,
        params_nonvocab: params.nonvocab,
        params_vocab: params.vocab,
        params_text: params.text,
        params_embedding: params.embedding,
        params_head: params.head,
        tokens,
        unique_tokens,
        epochs: tokens as f64 / unique_tokens as f64,
        steps: spec.steps,
        batch_tokens: spec.batch_tokens,
        lr: spec.lr,
        loss_nats: trained.test.loss_nats,
        loss_normalised: trained.test.loss_normalised,
        nats_per_frame: trained.test.nats_per_frame,
        nats_per_second: trained.test.nats_per_frame * spec.fps,
        zero_count_targets: zero_count_targets(inputs.tokens),
        wall_s: trained.wall_s,
        tokens_per_s: tokens as f64 / trained.wall_s,
        peak_bytes: peak_bytes(),
        tokenizer_id: spec.tokenizer_id.clone(),
        device: assignment.device_name.to_string(),
        git_revision: env!("ISOFLOP_GIT_REVISION").to_string(),
    }
}
