//! `isoflop plan`: the runs and the cost of a sweep.

use super::args::{a_card, not_negative};
use super::context::{OpenSweep, SweepArgs, plan_sweep};
use super::doubts::doubts;
use super::plan_text::{self, by_budget, bytes, exponent, flops, stale};
use super::prelude::*;
use isoflop::jobs::gpu::{Gpu, MfuSource, too_large};
use isoflop::jobs::speed::{Finished, Speed, known};
use isoflop::jobs::{Job, JobId, JobKind, RunStates, inputs, missing_jobs};
use isoflop::machine::Card;
use isoflop::plan::{Plan, PlannedRun, bytes_on_card};
use isoflop::spec::{Precision, TokenizerJob};
use rayon::prelude::*;

#[derive(Args)]
pub struct PlanArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Estimate hours and memory on this GPU, instead of the sweep's engine.gpu
    #[arg(long, value_name = "CARD", value_parser = a_card())]
    pub gpu: Option<&'static Card>,
    /// Dollars per GPU hour, e.g. 2.5
    #[arg(long, value_name = "DOLLARS", value_parser = not_negative)]
    pub price: Option<f64>,
}

impl PlanArgs {
    /// The GPU from the command line or the sweep.
    fn gpu(&self, open: &OpenSweep, output: &Output) -> Result<Option<Gpu>> {
        let OpenSweep { sweep, plan, folder } = open;
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
                "hours on a {} are not known: give your trainer's utilisation as engine.mfu, as \
                 in `--set engine.mfu=0.3`, or finish a run",
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
    let slots = args.sweep.work.slots();
    // By the speed of the folder's finished jobs, or else by a timing. The speed of a user's trainer is known from its
    // finished runs alone: `None` before there are any.
    let is_built_in = plan.runs.iter().all(|run| run.spec.trainer.is_none());
    let probed = || is_built_in.then(|| Speed::measured_of(&jobs, &plan, &device, slots));
    let hours = match &on_gpu {
        Some(cost) => Some(cost.hours_to_go),
        None => known(&folder, &Finished::of(&plan, &folder))
            .or_else(probed)
            .map(|speed| speed.hours(&jobs, &plan, slots)),
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
            None => {
                (plan_text::runs(&plan, &states, output.full), plan_text::cost(&plan, hours, slots))
            }
        };
        plan_text::text(&plan, &states, &stale, &table, &cost)
    };
    output.result_of(document, text)
}

/// The plan as JSON, without hours (which are measured) and stale runs.
pub fn json(plan: &Plan, folder: &ResultsFolder, states: &RunStates) -> Value {
    let inputs = inputs(plan);
    let mut jobs: BTreeMap<JobKind, usize> = JobKind::ALL.map(|kind| (kind, 0)).into();
    jobs.insert(JobKind::Run, plan.runs.len());
    for job in &inputs {
        *jobs.entry(job.id.kind).or_default() += 1;
    }
    let runs = plan.runs.par_iter().zip(JobKind::Run.jobs(plan));
    let runs: Vec<Value> = runs.map(|(run, job)| run_json(run, &job.needs, states)).collect();
    json!({
        "runs": runs,
        "tokenizers": plan.tokenizers.iter().map(|job| tokenizer_json(job, folder)).collect::<Vec<_>>(),
        "dropped": plan.dropped,
        "vocabularies": plan.renamed,
        "data_sets": plan.data.members,
        "inputs": inputs,
        "jobs": jobs,
        "total_flops": plan.total_flops(),
        "trained_flops": plan.trained_flops(),
        "disk_bytes": plan.disk_bytes(),
    })
}

fn run_json(run: &PlannedRun, needs: &[JobId], states: &RunStates) -> Value {
    let model = run.spec.shape();
    json!({
        "run_id": run.run_id,
        "generator": run.spec.generator.name(),
        "n_layer": model.n_layer, "n_head": model.n_head, "d_model": model.d_model,
        "d_ff": model.d_ff, "n_ctx": model.n_ctx,
        "n_vocab": run.spec.n_vocab(),
        "seed": run.spec.seed,
        "budget_flops": run.spec.budget_flops,
        "share": run.spec.share,
        "flops_per_token_forward": run.flops_per_token,
        "params_nonvocab": run.params.nonvocab, "params_vocab": run.params.vocab,
        "params_text": run.params.text,
        "tokens": run.spec.tokens(),
        "epochs": run.epochs,
        "steps": run.spec.steps, "batch_tokens": run.spec.batch_tokens, "lr": run.spec.lr,
        "warmup_steps": run.spec.warmup_steps, "decay_steps": run.spec.decay_steps,
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

// [`GpuCost`]: hours, dollars and memory of a plan's runs on a GPU.

/// The cost of a plan on one GPU, one run at a time.
pub struct GpuCost<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    /// Dollars an hour.
    price: Option<f64>,
    runs: Vec<RunCost<'a>>,
    /// Hours of the trunks (training that runs share).
    trunk_hours: f64,
    /// Hours of the missing jobs.
    pub hours_to_go: f64,
}

struct RunCost<'a> {
    run: &'a PlannedRun,
    hours: f64,
    /// `None` for a user's program.
    bytes: Option<u64>,
    mfu: f64,
}

impl<'a> GpuCost<'a> {
    pub fn new(gpu: &'a Gpu, price: Option<f64>, plan: &'a Plan, missing: &[Job]) -> Self {
        let cost = |run: &'a PlannedRun| RunCost {
            run,
            hours: gpu.run_hours(run),
            bytes: (!run.spec.is_users_own()).then(|| bytes_on_card(&run.spec)),
            mfu: gpu.mfu(run.params.nonvocab),
        };
        Self {
            gpu,
            plan,
            price,
            runs: plan.runs.iter().map(cost).collect(),
            // The sum of nothing is −0.
            trunk_hours: 0.0 + plan.trunks.iter().map(|trunk| gpu.trunk_hours(trunk)).sum::<f64>(),
            hours_to_go: gpu.hours(plan, missing),
        }
    }

    /// Hours of all runs and trunks, including finished ones.
    fn hours(&self) -> f64 {
        self.trunk_hours + self.runs.iter().map(|cost| cost.hours).sum::<f64>()
    }

    fn peak_bytes(&self) -> Option<u64> {
        self.runs.iter().filter_map(|cost| cost.bytes).max()
    }

    /// Adds `gpu_hours` and `gpu_bytes` to each run of a plan's document, and the totals as `gpu`.
    pub fn add_to(&self, document: &mut Value) {
        let is_too_large =
            |cost: &&RunCost| cost.bytes.is_some_and(|n| n as f64 > self.gpu.card.memory_bytes);
        let runs = document["runs"].as_array_mut().into_iter().flatten();
        for (run, cost) in runs.zip(&self.runs) {
            run["gpu_hours"] = json!(cost.hours);
            run["gpu_bytes"] = json!(cost.bytes);
        }
        let (card, hours) = (self.gpu.card, self.hours());
        let mut mfu = json!(self.gpu.source);
        let [least, most] = range(&self.runs);
        (mfu["least"], mfu["most"]) = (json!(least), json!(most));
        document["gpu"] = json!({
            "name": card.name, "peak_flops": card.peak_flops,
            "memory_bytes": card.memory_bytes, "bytes_per_s": card.bytes_per_s,
            "hours": hours,
            "hours_to_go": self.hours_to_go,
            "trunk_hours": self.trunk_hours,
            "dollars_per_hour": self.price,
            "dollars": self.price.map(|price| price * hours),
            "peak_bytes": self.peak_bytes(),
            "too_large": self.runs.iter().filter(is_too_large).count(),
            "mfu": mfu,
        });
    }

    /// A line for each budget: runs, the largest model and memory, MFU, hours, dollars.
    pub fn table(&self) -> String {
        let by_budget = by_budget(&self.runs, |cost| cost.run);
        let dollars = |hours: f64| self.price.map(|price| format!("{:.2}", price * hours));
        let row = |name: &str, runs: usize, [size, memory, mfu]: [String; 3], hours: f64| {
            let dollars = dollars(hours).unwrap_or_default();
            [name.to_string(), runs.to_string(), size, memory, mfu, format!("{hours:.2}"), dollars]
        };
        let of_budget = |(budget, costs): (&u64, &Vec<&RunCost>)| {
            let hours: f64 = costs.iter().map(|cost| cost.hours).sum();
            let most = costs.iter().map(|cost| cost.run.params.nonvocab).max().unwrap_or(0);
            let memory = costs.iter().filter_map(|cost| cost.bytes).max();
            let mfu = percent(range(costs.iter().copied()));
            let facts = [format!("{:.2e}", most as f64), dash(memory, bytes), mfu];
            row(&exponent(f64::from_bits(*budget)), costs.len(), facts, hours)
        };
        let n_trunks = self.plan.trunks.len();
        let trunks =
            (n_trunks > 0).then(|| row("trunks", n_trunks, Default::default(), self.trunk_hours));
        let all = row("all", self.runs.len(), Default::default(), self.hours());
        let dollars = if self.price.is_some() { "dollars" } else { "" };
        let heads = ["C", "runs", "max N_nv", "max memory", "MFU", "GPU hours", dollars];
        table(heads, by_budget.iter().map(of_budget).chain(trunks).chain([all]))
    }

    /// The cost of the plan with its basis, and whether its runs fit.
    pub fn sentences(&self) -> String {
        let Self { gpu, plan, price, .. } = self;
        let (card, hours) = (gpu.card, self.hours());
        let dollars =
            price.map(|price| format!(" = {:.2} dollars at {price} an hour", price * hours));
        let to_go = format!(" ({:.1} to go)", self.hours_to_go);
        let memory = self.peak_bytes().map(|peak| {
            let all = bytes(card.memory_bytes as u64);
            format!("; {} of its {all} for the largest run", bytes(peak))
        });
        let cost = format!(
            "{}; {hours:.1} hours of one {}{}{}, one run at a time{}; MFU {}, {}",
            flops(plan),
            card.name,
            dollars.unwrap_or_default(),
            // Sums in a different order differ in their last digits.
            if self.hours_to_go < 0.999999 * hours { to_go.as_str() } else { "" },
            memory.unwrap_or_default(),
            percent(range(&self.runs)),
            source(gpu.source),
        );
        let is_f32 = plan.runs.iter().any(|run| run.spec.precision == Precision::F32);
        let of_bf16 = is_f32.then_some(
            "hours are for train.precision: bf16; memory is for f32, the sweep's precision",
        );
        let apart = !plan.tokenizers.is_empty();
        let apart = apart.then_some("tokenizers are trained on CPUs and not counted");
        let large = too_large(card, &plan.runs);
        let notes: Vec<&str> = of_bf16.into_iter().chain(apart).collect();
        let notes = (!notes.is_empty()).then(|| notes.join("; "));
        [Some(cost), notes, large].into_iter().flatten().map(|said| wrap("", &said)).collect()
    }
}

/// The least and the largest MFU.
fn range<'a>(runs: impl IntoIterator<Item = &'a RunCost<'a>>) -> [f64; 2] {
    let of = |[least, most]: [f64; 2], cost: &RunCost| [least.min(cost.mfu), most.max(cost.mfu)];
    let [least, most] = runs.into_iter().fold([f64::INFINITY, 0.0], of);
    [least.min(most), most]
}

/// `30 to 45 %`, or `0.5 %`.
fn percent([least, most]: [f64; 2]) -> String {
    let digits = |share: f64| {
        let share = 100.0 * share;
        if share < 9.95 { format!("{share:.1}") } else { format!("{share:.0}") }
    };
    let (least, most) = (digits(least), digits(most));
    if least == most { format!("{most} %") } else { format!("{least} to {most} %") }
}

/// `measured by 12 finished runs`.
fn source(source: MfuSource) -> String {
    match source {
        MfuSource::Reference => "as on an H200 from 0.1M to 731M".to_string(),
        MfuSource::Told => "as engine.mfu says".to_string(),
        MfuSource::Measured { runs } => format!("measured by {}", many(runs, "finished run")),
    }
}
