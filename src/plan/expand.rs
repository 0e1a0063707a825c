//! Priced cells into tokenizers and runs.

use std::ops::Range;

use super::planned_run::PlannedRun;
use super::priced_cell::PricedCell;
use super::run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob, TrainerProgram};
use crate::data::DataFacts;
use crate::spec::TokenizerSpec;
use crate::sweep::{Origin, ScheduleKind, ScheduleSection, Sweep};

/// Stands in a run for the id of a tokenizer where the sweep has no motion.
pub const NO_TOKENIZER: &str = "none";

/// The tokenizers of all cells, each once, and where each cell's own are, one a seed; none where the
/// sweep has no data to train one on.
pub(super) fn tokenizers(
    sweep: &Sweep,
    cells: &[PricedCell],
    data: &DataFacts,
    text_id: &str,
) -> (Vec<TokenizerJob>, Vec<Range<usize>>) {
    if sweep.data.origin() == Origin::None {
        return (Vec::new(), vec![0..1; cells.len()]);
    }
    let mut jobs: Vec<TokenizerJob> = Vec::new();
    let mut own = Vec::with_capacity(cells.len());
    for cell in cells {
        let known = jobs.iter().position(|job| job.spec.quantizer == cell.grid_cell.quantizer);
        let specs = sweep.tokenizer.specs(&cell.grid_cell.quantizer, &sweep.text);
        let first = known.unwrap_or(jobs.len());
        own.push(first..first + specs.len());
        if known.is_none() {
            jobs.extend(specs.into_iter().map(|spec| tokenizer_job(spec, data, text_id)));
        }
    }
    (jobs, own)
}

fn tokenizer_job(spec: TokenizerSpec, data: &DataFacts, text_id: &str) -> TokenizerJob {
    let text_id = spec.architecture.language().map(|_| text_id.to_string());
    TokenizerJob { revision: TRAINING_REVISION, spec, data_digest: data.digest.clone(), text_id }
}

/// What the runs of a tokenizer read.
pub(super) struct RunInputs {
    tokenizer_id: String,
    text_id: String,
    /// Supervised tokens of the training split.
    unique_tokens: usize,
}

impl RunInputs {
    pub(super) fn of(job: &TokenizerJob, text_id: &str, data: &DataFacts) -> Self {
        Self {
            tokenizer_id: job.id(),
            text_id: text_id.to_string(),
            unique_tokens: data.unique_tokens(&job.spec.grid()),
        }
    }

    /// Those of a sweep without motion.
    pub(super) fn none(text_id: String) -> Self {
        Self { tokenizer_id: NO_TOKENIZER.to_string(), text_id, unique_tokens: 0 }
    }
}

fn decay_steps(schedule: &ScheduleSection, steps: usize) -> Option<usize> {
    let share = |decay: f64| ((decay * steps as f64).round() as usize).clamp(1, steps);
    (schedule.kind == ScheduleKind::Wsd).then(|| share(schedule.decay))
}

pub(super) fn planned_run(
    sweep: &Sweep,
    cell: &PricedCell,
    seed: u64,
    (inputs, varied): (&RunInputs, &Option<String>),
    data: &DataFacts,
) -> PlannedRun {
    let spec = RunSpec { varied: varied.clone(), ..run_spec(sweep, cell, seed, inputs, data) };
    let (tokens, unique_tokens) = (spec.tokens() as f64, spec.share.of(inputs.unique_tokens));
    PlannedRun {
        run_id: spec.id(),
        params: cell.params,
        flops_per_token: cell.flops_per_token,
        achieved_ratio: cell.spending.achieved_ratio,
        peak_bytes: cell.generator.peak_bytes(&cell.codes, spec.batch_tokens),
        trunk_id: None,
        epochs: (unique_tokens > 0).then(|| tokens / unique_tokens as f64),
        spec,
    }
}

fn run_spec(
    sweep: &Sweep,
    cell: &PricedCell,
    seed: u64,
    inputs: &RunInputs,
    data: &DataFacts,
) -> RunSpec {
    let train = &sweep.train;
    let steps = cell.spending.steps;
    RunSpec {
        revision: TRAINING_REVISION,
        seed,
        generator: cell.generator.clone(),
        codes: cell.codes.clone(),
        budget_flops: cell.grid_cell.budget_flops,
        share: cell.grid_cell.share,
        batch_tokens: cell.spending.batch_tokens,
        steps,
        lr: cell.pace.lr,
        warmup_steps: cell.pace.warmup_steps,
        final_share: train.schedule.final_share,
        decay_steps: decay_steps(&train.schedule, steps),
        precision: train.precision,
        weight_decay: train.weight_decay,
        betas: [train.betas[0], train.betas[1]],
        epsilon: train.epsilon,
        clip_norm: (train.clip_norm > 0.0).then_some(train.clip_norm),
        evaluations: train.evaluations,
        fps: data.fps,
        data_digest: data.digest.clone(),
        text_id: inputs.text_id.clone(),
        tokenizer_id: inputs.tokenizer_id.clone(),
        trainer: sweep.trainer.as_ref().map(|section| TrainerProgram {
            command: section.command.clone(),
            revision: section.revision.clone(),
            inputs: data.trainer_inputs.clone(),
        }),
        varied: None,
    }
}
