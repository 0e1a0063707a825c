//! The plan as text.

use super::prelude::*;
use isoflop::data::MemberFacts;
use isoflop::jobs::{JobState, RunStates};
use isoflop::plan::{Dropped, Plan, PlannedRun, Renamed};
use isoflop::spec::{RunSpec, TokenizerJob, changed_fields};
use std::collections::{BTreeSet, HashMap, HashSet};

/// Dropped cells named on the first screen.
const MOST_DROPPED: usize = 3;

/// The plan, at most 80 columns wide: `table` has its runs or its budgets, `cost` its last sentences.
pub fn text(plan: &Plan, states: &RunStates, stale: &[Stale], table: &str, cost: &str) -> String {
    let mut out = head(plan, states) + table;
    for Stale { runs, fields } in stale {
        let sentence = format!("{runs} finished runs differ in {}", fields.join(", "));
        out += &wrap("stale: ", &sentence);
    }
    out + "\n" + cost
}

/// The cost of the plan: FLOPs, time, memory, disk.
pub fn cost(plan: &Plan, hours: Option<f64>, slots: usize) -> String {
    let hours = hours.map_or_else(
        || "time unknown before the trainer's first run is done".to_string(),
        |hours| format!("{} to go with {slots} parallel jobs", time(hours)),
    );
    let peaks: Option<Vec<u64>> = plan.runs.iter().map(PlannedRun::known_peak_bytes).collect();
    let memory = match peaks {
        Some(peaks) => {
            let peak = bytes(peaks.into_iter().max().unwrap_or(0));
            format!("; {peak} of memory for the largest run, {} on disk", bytes(plan.disk_bytes()))
        }
        None => "; memory and disk are the trainer's".to_string(),
    };
    wrap("", &format!("{}; {hours}{memory}", flops(plan)))
}

/// The FLOPs of all runs, and the saving if they share trunks.
pub fn flops(plan: &Plan) -> String {
    let (alone, trained) = (plan.total_flops(), plan.trained_flops());
    if plan.trunks.is_empty() {
        return format!("{alone:.2e} FLOPs in all");
    }
    format!(
        "{trained:.2e} FLOPs in all, {:.1} % less than the {alone:.2e} of every run alone, since \
         runs share their beginnings",
        100.0 * (1.0 - trained / alone),
    )
}

fn head(plan: &Plan, states: &RunStates) -> String {
    let done = plan.runs.iter().filter(|run| states.of(&run.run_id) == JobState::Done).count();
    let mut out = format!(
        "{} tokenizers, {} runs ({done} done), {} cells dropped\n",
        plan.tokenizers.len(),
        plan.runs.len(),
        plan.dropped.len()
    );
    if plan.evaluator.is_some() {
        out += &format!("an evaluator, {} runs scored\n", plan.scores.len());
    }
    let [train, val, test] = plan.data.clips;
    let unique_tokens = plan.unique_tokens();
    if unique_tokens > 0 {
        let clips = format!("{train} clips to train on ({unique_tokens} tokens)");
        out += &wrap("", &format!("data: {clips}, {val} to validate, {test} to test"));
        plan.data.members.iter().for_each(|member| out += &wrap("  ", &told(member)));
    }
    if plan.n_variants > 1 {
        out += &wrap("", &format!("each cell in {} variants, of grid.vary", plan.n_variants));
    }
    let shares: BTreeSet<String> =
        plan.runs.iter().map(|run| run.spec.share.value().to_string()).collect();
    if shares.len() > 1 {
        let all: Vec<String> = shares.into_iter().collect();
        out += &wrap("", &format!("each cell on shares {} of the clips", all.join(", ")));
    }
    let one = |Renamed { named, codes, levels }: &Renamed| {
        let levels: Vec<String> = levels.iter().map(ToString::to_string).collect();
        format!("{codes} for {named} (levels {})", levels.join(", "))
    };
    let renamed: Vec<String> = plan.renamed.iter().map(one).collect();
    if !renamed.is_empty() {
        out += &wrap("", &format!("V is the product of FSQ's levels: {}", renamed.join(", ")));
    }
    out + "\n"
}

/// One data set of a union.
fn told(MemberFacts { name, licence, clips, frames, fps, .. }: &MemberFacts) -> String {
    let minutes = frames.iter().sum::<usize>() as f64 / f64::from(*fps) / 60.0;
    let [train, val, test] = clips;
    let licence = licence.as_deref().unwrap_or("licence not given");
    format!("{name}: {minutes:.0} min in {train}, {val} and {test} clips; {licence}")
}

/// One row a budget, and the number of dropped cells; every run and every dropped cell if `full`.
pub fn runs(plan: &Plan, states: &RunStates, full: bool) -> String {
    let table = if full { every_run(plan, states) } else { budgets(plan, states) };
    table + &dropped(&plan.dropped, full)
}

/// Entries of runs by the bits of their budgets: positive numbers are ordered like their bits.
pub fn by_budget<T>(entries: &[T], run: impl Fn(&T) -> &PlannedRun) -> BTreeMap<u64, Vec<&T>> {
    let mut by_budget: BTreeMap<u64, Vec<&T>> = BTreeMap::new();
    for entry in entries {
        by_budget.entry(run(entry).spec.budget_flops.to_bits()).or_default().push(entry);
    }
    by_budget
}

fn budgets(plan: &Plan, states: &RunStates) -> String {
    let by_budget = by_budget(&plan.runs, |run| run);
    let row = |(budget, runs): (&u64, &Vec<&PlannedRun>)| {
        let range = |of: &dyn Fn(&PlannedRun) -> f64, digits: &dyn Fn(f64) -> String| {
            let values = || runs.iter().map(|run| of(run));
            let ends = [values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max)];
            let [low, high] = ends.map(digits);
            if low == high { low } else { format!("{low}..{high}") }
        };
        let (whole, two) = (|n: f64| n.to_string(), |n: f64| format!("{n:.1e}"));
        let done = runs.iter().filter(|run| states.of(&run.run_id) == JobState::Done).count();
        let epochs = runs.iter().filter_map(|run| run.epochs).reduce(f64::max);
        [
            exponent(f64::from_bits(*budget)),
            runs.len().to_string(),
            done.to_string(),
            range(&|run| run.spec.shape().d_model as f64, &whole),
            range(&|run| run.params.nonvocab as f64, &two),
            range(&|run| run.spec.n_vocab() as f64, &whole),
            range(&|run| run.spec.tokens() as f64, &two),
            dash(epochs, few_digits),
        ]
    };
    let heads = ["C", "runs", "done", "d", "N_nv", "V", "D", "epochs"];
    table(heads, by_budget.iter().map(row))
}

fn every_run(plan: &Plan, states: &RunStates) -> String {
    let heads = ["C", "L", "d", "V", "N_nv", "N_v", "D", "steps", "epochs", "state"];
    table(heads, plan.runs.iter().map(|run| row(run, states)))
}

/// The cells that `grid.exclude` names are counted; the first of the others are named with their reasons.
fn dropped(cells: &[Dropped], full: bool) -> String {
    let is_named = |cell: &&Dropped| full || !cell.is_excluded;
    let named: Vec<&Dropped> = cells.iter().filter(is_named).collect();
    let most = if full { usize::MAX } else { MOST_DROPPED };
    let mut out = String::new();
    if named.len() < cells.len() {
        let excluded = many(cells.len() - named.len(), "cell");
        out += &wrap("dropped: ", &format!("{excluded} by grid.exclude; --full lists them"));
    }
    for cell in named.iter().take(most) {
        let Dropped { n_layer, d_model, n_vocab, budget_flops, share, reason, .. } = cell;
        let sentence = format!(
            "L{n_layer} d{d_model} V{n_vocab} C={}{}: {reason}",
            exponent(*budget_flops),
            share.said()
        );
        out += &wrap("dropped: ", &sentence);
    }
    out + &more(named.len(), most, " dropped; --full lists them")
}

fn row(run: &PlannedRun, states: &RunStates) -> [String; 10] {
    let (spec, shape) = (&run.spec, run.spec.shape());
    let [size, vocab, tokens] = [run.params.nonvocab, run.params.vocab, spec.tokens()]
        .map(|count| format!("{:.2e}", count as f64));
    [
        exponent(spec.budget_flops),
        shape.n_layer.to_string(),
        shape.d_model.to_string(),
        spec.n_vocab().to_string(),
        size,
        vocab,
        tokens,
        spec.steps.to_string(),
        dash(run.epochs, few_digits),
        format!("{:?}", states.of(&run.run_id)).to_lowercase(),
    ]
}

/// Times that a run sees its data.
fn few_digits(epochs: f64) -> String {
    match epochs {
        n if n < 100.0 => format!("{n:.2}"),
        n if n < 1e4 => format!("{n:.0}"),
        n => format!("{n:.1e}"),
    }
}

/// A budget in at most four digits: `1.5e10`, `3e10`.
pub fn exponent(budget: f64) -> String {
    let shortest = format!("{budget:e}");
    if shortest.len() <= 8 { shortest } else { format!("{budget:.2e}") }
}

pub fn time(hours: f64) -> String {
    // A sum of nothing is −0.
    match hours + 0.0 {
        h if h < 1.0 / 60.0 => format!("{:.0} s", 3600.0 * h),
        h if h < 1.5 => format!("{:.0} min", 60.0 * h),
        h if h < 72.0 => format!("{h:.1} h"),
        h => format!("{:.0} days", h / 24.0),
    }
}

pub fn bytes(n: u64) -> String {
    match n as f64 {
        n if n < 1e9 => format!("{:.0} MB", n / 1e6),
        n if n < 1e12 => format!("{:.1} GB", n / 1e9),
        n => format!("{:.1} TB", n / 1e12),
    }
}

// Stale runs: finished, but under settings that the sweep no longer has.

/// Finished runs of cells that the plan has under another id.
#[derive(Serialize)]
pub struct Stale {
    pub runs: usize,
    /// The fields that differ: `lr`, `model.d_ff`, `tokenizer.width`, `data_digest`.
    pub fields: Vec<String>,
}

/// The stale runs of a folder, grouped by the fields that differ.
pub fn stale(plan: &Plan, folder: &ResultsFolder) -> Vec<Stale> {
    let finished = finished_specs(folder);
    if finished.is_empty() {
        return Vec::new();
    }
    let wanted: HashSet<&str> = plan.runs.iter().map(|run| run.run_id.as_str()).collect();
    let cells: HashMap<CellKey, &PlannedRun> =
        plan.runs.iter().map(|run| (cell(&run.spec), run)).collect();
    let mut runs: BTreeMap<Vec<String>, usize> = BTreeMap::new();
    for old in finished.iter().filter(|old| !wanted.contains(old.id().as_str())) {
        if let Some(twin) = cells.get(&cell(old)) {
            *runs.entry(fields(plan, folder, twin, old)).or_default() += 1;
        }
    }
    runs.into_iter().map(|(fields, runs)| Stale { runs, fields }).collect()
}

/// The key of a cell of the grid: layers, width, V, budget, share and seed.
type CellKey = (usize, usize, usize, [u64; 2], u64);

fn cell(spec: &RunSpec) -> CellKey {
    let spent = [spec.budget_flops, spec.share.value()].map(f64::to_bits);
    (spec.shape().n_layer, spec.shape().d_model, spec.n_vocab(), spent, spec.seed)
}

/// The fields that differ, with ids replaced by their contents.
fn fields(plan: &Plan, folder: &ResultsFolder, run: &PlannedRun, old: &RunSpec) -> Vec<String> {
    let mut fields = changed_fields(&run.spec, old);
    let has = |fields: &[String], name: &str| fields.iter().any(|field| field == name);
    if has(&fields, "tokenizer_id")
        && let Some(new) = plan.tokenizer_of(run)
    {
        let changed = tokenizer_fields(folder, new, &old.tokenizer_id);
        if !changed.is_empty() {
            fields.retain(|field| field != "tokenizer_id");
            fields.extend(changed.into_iter().filter(|field| field != "data_digest"));
        }
    }
    if has(&fields, "data_digest") {
        fields.retain(|field| field != "text_id");
    }
    fields
}

/// Empty if the old tokenizer's job is gone.
fn tokenizer_fields(folder: &ResultsFolder, new: &TokenizerJob, old_id: &str) -> Vec<String> {
    let path = folder.tokenizer(old_id).join("job.json");
    let Ok(Some(old)) = read_if_there::<TokenizerJob>(&path) else { return Vec::new() };
    // In a sweep file, training keys and keys of the kind are on one level.
    let named = |field: String| match field.strip_prefix("spec.") {
        Some(setting) => format!("tokenizer.{}", setting.trim_start_matches("training.")),
        None => field,
    };
    changed_fields(new, &old).into_iter().map(named).collect()
}

fn finished_specs(folder: &ResultsFolder) -> Vec<RunSpec> {
    let entries = std::fs::read_dir(folder.file("runs")).into_iter().flatten().flatten();
    let done = entries.map(|entry| entry.path()).filter(|place| place.join("record.json").exists());
    done.filter_map(|place| read_if_there(&place.join("spec.json")).ok().flatten()).collect()
}
