//! `isoflop plan`: what a sweep will do and cost.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use burn::tensor::Device;
use clap::Args;
use isoflop::jobs::gpu::{Gpu, MfuSource};
use isoflop::jobs::history::{Finished, known};
use isoflop::jobs::{Job, JobId, JobKind, ResultsFolder, RunStates, inputs, missing_jobs, probe};
use isoflop::machine::cards::Card;
use isoflop::plan::{Plan, PlannedRun, TokenizerJob};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::args::{SweepArgs, a_card, not_negative};
use super::context::{OpenSweep, plan_sweep};
use super::doubts::doubts;
use super::exit::Exit;
use super::gpu_cost::GpuCost;
use super::output::Output;
use super::plan_text;
use super::stale::stale;

#[derive(Args)]
pub struct PlanArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Estimate hours and memory on this GPU, in place of the sweep's engine.gpu
    #[arg(long, value_name = "CARD", value_parser = a_card())]
    pub gpu: Option<&'static Card>,
    /// Dollars that an hour of the GPU costs, as 2.5
    #[arg(long, value_name = "DOLLARS", value_parser = not_negative)]
    pub price: Option<f64>,
}

impl PlanArgs {
    /// The GPU that is named here or in the sweep.
    fn gpu(
        &self,
        OpenSweep { sweep, plan, folder }: &OpenSweep,
        output: &Output,
    ) -> Result<Option<Gpu>> {
        let engine = sweep.engine.as_ref();
        let Some(card) = self.gpu.or_else(|| engine?.card()) else {
            if self.price.is_some() {
                bail!("--price is that of a GPU: name one by --gpu or engine.gpu");
            }
            return Ok(None);
        };
        let told = engine.and_then(|engine| engine.mfu).map(|mfu| mfu.0);
        let gpu = Gpu::new(card, told, plan, folder);
        if gpu.source == MfuSource::Reference && plan.runs.iter().any(|run| run.spec.is_users_own())
        {
            output.warn(&format!(
                "hours on a {} are not known: how much of it your trainer uses is told by engine.mfu, as \
                 `--set engine.mfu=0.3`, or by a finished run",
                card.name
            ));
            return Ok(None);
        }
        Ok(Some(gpu))
    }
}

pub fn plan(args: &PlanArgs, output: &Output) -> Result<Exit> {
    let device = args.sweep.work.device.open()?;
    let open = plan_sweep(&args.sweep)?;
    let gpu = args.gpu(&open, output)?;
    let OpenSweep { sweep, plan, folder } = open;
    let (warnings, doubts) = (plan.warnings(), doubts(&sweep, &plan));
    warnings.iter().for_each(|line| output.warn(line));
    doubts.iter().for_each(|doubt| output.warn(&doubt.sentence()));
    let states = folder.run_states();
    let jobs = missing_jobs(&plan, &folder);
    let on_gpu = gpu.as_ref().map(|gpu| GpuCost::new(gpu, args.price, &plan, &jobs));
    let hours = match &on_gpu {
        Some(cost) => Some(cost.hours_to_go),
        None => hours(&jobs, &plan, &folder, &device, args.sweep.work.slots()),
    };
    let stale = stale(&plan, &folder);
    let document = || {
        let mut document = json(&plan, &folder, &states);
        document["hours"] = json!(hours);
        document["stale"] = json!(stale);
        document["warnings"] = json!(warnings);
        document["doubts"] = json!(doubts);
        if let Some(cost) = &on_gpu {
            cost.add_to(&mut document);
        }
        document
    };
    let text = || {
        let (table, cost) = match &on_gpu {
            Some(cost) => (cost.table(), cost.sentences()),
            None => (
                plan_text::runs(&plan, &states),
                plan_text::cost(&plan, hours, args.sweep.work.slots()),
            ),
        };
        plan_text::text(&plan, &states, &stale, &table, &cost)
    };
    output.result_of(document, text)
}

/// Hours that jobs take on `slots` slots: at the speed of the folder's finished jobs, or else by a probe. How fast a
/// user's trainer is, its finished runs alone can tell: `None` before there are any.
fn hours(
    jobs: &[Job],
    plan: &Plan,
    folder: &ResultsFolder,
    device: &Device,
    slots: usize,
) -> Option<f64> {
    let known = known(folder, &Finished::of(plan, folder));
    let is_built_in = plan.runs.iter().all(|run| run.spec.trainer.is_none());
    let probed = || is_built_in.then(|| probe::speed_of(jobs, plan, device, slots));
    Some(known.or_else(probed)?.hours(jobs, plan, slots))
}

/// The plan as a JSON document, but for the hours, which are measured, and what is stale.
pub fn json(plan: &Plan, folder: &ResultsFolder, states: &RunStates) -> Value {
    let inputs = inputs(plan);
    let runs = plan.runs.par_iter().zip(JobKind::Run.jobs(plan));
    let runs: Vec<Value> = runs.map(|(run, job)| run_json(run, &job.needs, states)).collect();
    json!({
        "runs": runs,
        "tokenizers": plan.tokenizers.iter().map(|job| tokenizer_json(job, folder)).collect::<Vec<_>>(),
        "dropped": plan.dropped,
        "vocabularies": plan.renamed,
        "data_sets": plan.data.members,
        "inputs": inputs,
        "jobs": jobs(plan, &inputs),
        "total_flops": plan.total_flops(),
        "trained_flops": plan.trained_flops(),
        "disk_bytes": plan.disk_bytes(),
    })
}

/// Jobs by kind.
fn jobs(plan: &Plan, inputs: &[Job]) -> BTreeMap<JobKind, usize> {
    let mut jobs: BTreeMap<JobKind, usize> = JobKind::ALL.map(|kind| (kind, 0)).into();
    jobs.insert(JobKind::Run, plan.runs.len());
    for job in inputs {
        *jobs.entry(job.id.kind).or_default() += 1;
    }
    jobs
}

fn run_json(run: &PlannedRun, needs: &[JobId], states: &RunStates) -> Value {
    let model = run.spec.shape();
    json!({
        "run_id": run.run_id,
        "generator": run.spec.generator.name(),
        "n_layer": model.n_layer,
        "n_head": model.n_head,
        "d_model": model.d_model,
        "d_ff": model.d_ff,
        "n_ctx": model.n_ctx,
        "n_vocab": run.spec.n_vocab(),
        "seed": run.spec.seed,
        "budget_flops": run.spec.budget_flops,
        "share": run.spec.share,
        "flops_per_token_forward": run.flops_per_token,
        "params_nonvocab": run.params.nonvocab,
        "params_vocab": run.params.vocab,
        "params_text": run.params.text,
        "tokens": run.spec.tokens(),
        "epochs": run.epochs,
        "steps": run.spec.steps,
        "batch_tokens": run.spec.batch_tokens,
        "lr": run.spec.lr,
        "warmup_steps": run.spec.warmup_steps,
        "decay_steps": run.spec.decay_steps,
        "achieved_ratio": run.achieved_ratio,
        "peak_bytes": run.known_peak_bytes(),
        "tokenizer_id": run.spec.tokenizer_id,
        "trunk_id": run.trunk_id,
        "own_flops": run.own_flops(),
        "needs": needs.iter().map(JobId::to_string).collect::<Vec<_>>(),
        "state": states.of(&run.run_id),
    })
}

fn tokenizer_json(job: &TokenizerJob, folder: &ResultsFolder) -> Value {
    let id = job.id();
    json!({
        "tokenizer_id": id,
        "kind": job.spec.quantizer.name(),
        "n_vocab": job.spec.n_vocab(),
        "steps": job.spec.training.steps,
        "state": folder.state(&JobId::new(JobKind::Tokenizer, &id)),
    })
}
