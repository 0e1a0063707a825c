//! `isoflop plan`: what a sweep will do and cost.

use std::collections::{BTreeMap, HashSet};

use anyhow::Result;
use burn::tensor::Device;
use isoflop::plan::{Plan, PlannedRun, TokenizerJob, Trunk};
use isoflop::record::{JobId, JobKind, JobState, ResultsFolder, RunStates, flops_per_second};
use isoflop::schedule::{Job, inputs, probe};
use serde_json::{Value, json};

use super::args::PlanArgs;
use super::context::{device, plan_sweep};
use super::exit::Exit;
use super::output::Output;
use super::plan_text;
use super::stale::stale;

pub fn plan(args: &PlanArgs, output: &Output) -> Result<Exit> {
    let device = device(args.sweep.device)?;
    let (plan, folder) = plan_sweep(&args.sweep)?;
    plan.warnings().iter().for_each(|line| output.warn(line));
    let states = folder.run_states();
    let missing: Vec<&PlannedRun> =
        plan.runs.iter().filter(|run| states.of(&run.run_id) != JobState::Done).collect();
    let wanted: HashSet<&str> = missing.iter().map(|run| run.spec.tokenizer_id.as_str()).collect();
    let tokenizers: Vec<&TokenizerJob> = plan
        .tokenizers
        .iter()
        .filter(|job| wanted.contains(job.id().as_str()))
        .filter(|job| state_of_tokenizer(job, &folder) != JobState::Done)
        .collect();
    let trunks: Vec<&Trunk> = open_trunks(&plan, &missing, &folder);
    let to_do = ToDo { runs: missing, trunks, tokenizers };
    let hours = to_do.hours(&plan, &folder, &device, args.sweep.slots());
    let stale = stale(&plan, &folder);
    let document = || {
        let mut document = json(&plan, &folder);
        document["hours"] = json!(hours);
        document["stale"] = json!(stale);
        document
    };
    let text =
        || plan_text::text(&plan, &states, &stale, &plan_text::cost(&plan, hours, &args.sweep));
    output.result_of(document, text)?;
    Ok(Exit::Done)
}

/// What a plan still has to train.
struct ToDo<'a> {
    runs: Vec<&'a PlannedRun>,
    trunks: Vec<&'a Trunk>,
    tokenizers: Vec<&'a TokenizerJob>,
}

impl ToDo<'_> {
    /// Hours on `slots` slots. How fast a program of somebody's own is, its finished runs alone can
    /// tell: `None` before there are any.
    fn hours(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        device: &Device,
        slots: usize,
    ) -> Option<f64> {
        let Self { runs, trunks, tokenizers } = self;
        if runs.iter().all(|run| run.spec.trainer.is_none()) {
            return Some(probe::hours(runs, trunks, tokenizers, device, slots));
        }
        let rate = finished_rate(plan, folder)?;
        let seconds = |run: &&PlannedRun| run.own_flops() / rate;
        let together: f64 = self.runs.iter().map(seconds).sum();
        let longest = self.runs.iter().map(seconds).fold(0.0, f64::max);
        let first = probe::tokenizer_hours(runs, tokenizers, device, slots);
        Some(first + (together / slots as f64).max(longest) / 3600.0)
    }
}

/// FLOPs a second of finished runs; what cannot be read does not count.
fn finished_rate(plan: &Plan, folder: &ResultsFolder) -> Option<f64> {
    flops_per_second(plan.runs.iter().filter_map(|run| folder.record(&run.run_id).ok().flatten()))
}

/// The trunks that missing runs branch off, and those that these go on from.
fn open_trunks<'a>(
    plan: &'a Plan,
    missing: &[&PlannedRun],
    folder: &ResultsFolder,
) -> Vec<&'a Trunk> {
    let mut wanted: HashSet<&str> =
        missing.iter().filter_map(|run| run.trunk_id.as_deref()).collect();
    let state = |id: &str| folder.state(&JobId::new(JobKind::Trunk, id));
    let mut open = Vec::new();
    for trunk in plan.trunks.iter().rev() {
        let id = trunk.trunk_id.as_str();
        if wanted.contains(id) && state(id) != JobState::Done {
            wanted.extend(trunk.from.as_deref());
            open.push(trunk);
        }
    }
    open
}

/// The plan as a JSON document, but for the hours, which are measured, and what is stale.
pub fn json(plan: &Plan, folder: &ResultsFolder) -> Value {
    let states = folder.run_states();
    let inputs = inputs(plan);
    let jobs = jobs(plan, &inputs);
    json!({
        "runs": plan.runs.iter().map(|run| run_json(run, &states)).collect::<Vec<_>>(),
        "tokenizers": plan.tokenizers.iter().map(|job| tokenizer_json(job, folder)).collect::<Vec<_>>(),
        "dropped": plan.dropped,
        "inputs": inputs,
        "jobs": jobs,
        "total_flops": plan.total_flops(),
        "trained_flops": plan.trained_flops(),
        "disk_bytes": disk_bytes(plan),
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

fn run_json(run: &PlannedRun, states: &RunStates) -> Value {
    let model = &run.spec.model;
    json!({
        "run_id": run.run_id,
        "n_layer": model.n_layer,
        "n_head": model.n_head,
        "d_model": model.d_model,
        "d_ff": model.d_ff,
        "n_ctx": model.n_ctx,
        "n_vocab": run.spec.n_vocab,
        "seed": run.spec.seed,
        "budget_flops": run.spec.budget_flops,
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
        "peak_bytes": run.peak_bytes,
        "tokenizer_id": run.spec.tokenizer_id,
        "trunk_id": run.trunk_id,
        "own_flops": run.own_flops(),
        "state": states.of(&run.run_id),
    })
}

fn tokenizer_json(job: &TokenizerJob, folder: &ResultsFolder) -> Value {
    let id = job.id();
    json!({
        "tokenizer_id": id,
        "kind": job.spec.kind.name(),
        "n_vocab": job.spec.n_vocab(),
        "steps": job.spec.steps,
        "state": state_of_tokenizer(job, folder),
    })
}

fn state_of_tokenizer(job: &TokenizerJob, folder: &ResultsFolder) -> JobState {
    folder.state(&JobId::new(JobKind::Tokenizer, job.id()))
}

/// Weights of each run, weights and moments of each trunk, codes of each tokenizer; checkpoints
/// while they last are three times a run's weights.
pub fn disk_bytes(plan: &Plan) -> u64 {
    let weights: usize = plan.runs.iter().map(|run| 4 * run.params.total()).sum();
    let codes = plan.tokenizers.len() * 4 * plan.data.unique_tokens;
    let params = |trunk: &Trunk| trunk.spec.model.params(trunk.spec.n_vocab).total();
    let trunks: usize = plan.trunks.iter().map(|trunk| 12 * params(trunk)).sum();
    (weights + trunks + codes) as u64
}
