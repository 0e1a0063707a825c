//! The plan as a person reads it.

use std::collections::BTreeSet;
use std::fmt::Write;

use isoflop::data::MemberFacts;
use isoflop::jobs::{JobState, RunStates};
use isoflop::plan::{Dropped, Plan, PlannedRun, Renamed};
use isoflop::words::wrap;

use super::args::SweepArgs;
use super::stale::Stale;

/// Rows printed before a long table is cut.
const MOST_ROWS: usize = 40;

/// The whole plan, at most 80 columns wide; `cost` is its last sentence.
pub fn text(plan: &Plan, states: &RunStates, stale: &[Stale], cost: &str) -> String {
    let mut out = String::new();
    head(&mut out, plan, states);
    table(&mut out, plan, states);
    dropped(&mut out, plan);
    told_stale(&mut out, stale);
    out + "\n" + &wrap("", cost)
}

/// The plan on one screen: a table of its budgets in place of its runs, and no list of what is dropped; `cost`
/// is its last lines.
pub fn by_budget(
    plan: &Plan,
    states: &RunStates,
    stale: &[Stale],
    table: &str,
    cost: &str,
) -> String {
    let mut out = String::new();
    head(&mut out, plan, states);
    out += table;
    told_stale(&mut out, stale);
    out + "\n" + cost
}

fn told_stale(out: &mut String, stale: &[Stale]) {
    for Stale { runs, fields } in stale {
        let sentence = format!("{runs} finished runs differ in {}", fields.join(", "));
        *out += &wrap("stale: ", &sentence);
    }
}

/// What the plan takes: FLOPs, time, memory, disk.
pub fn cost(plan: &Plan, hours: Option<f64>, args: &SweepArgs) -> String {
    let hours = hours.map_or_else(
        || "time unknown before the trainer's first run is done".to_string(),
        |hours| format!("{} to go with {} jobs side by side", time(hours), args.slots()),
    );
    let peaks: Option<Vec<u64>> = plan.runs.iter().map(PlannedRun::known_peak_bytes).collect();
    let memory = match peaks {
        Some(peaks) => {
            let peak = bytes(peaks.into_iter().max().unwrap_or(0));
            format!("; {peak} of memory for the largest run, {} on disk", bytes(plan.disk_bytes()))
        }
        None => "; memory and disk are the trainer's".to_string(),
    };
    format!("{}; {hours}{memory}", flops(plan))
}

/// What the runs cost together, and what they save where they share trunks.
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

fn head(out: &mut String, plan: &Plan, states: &RunStates) {
    let done = count(plan, states, JobState::Done);
    let _ = writeln!(
        out,
        "{} tokenizers, {} runs ({done} done), {} cells dropped",
        plan.tokenizers.len(),
        plan.runs.len(),
        plan.dropped.len()
    );
    if plan.evaluator.is_some() {
        let _ = writeln!(out, "an evaluator, {} runs scored", plan.scores.len());
    }
    let [train, val, test] = plan.data.clips;
    let unique_tokens = plan.unique_tokens();
    if unique_tokens > 0 {
        *out += &wrap(
            "",
            &format!(
                "data: {train} clips to train on ({unique_tokens} tokens), {val} to validate, {test} to test"
            ),
        );
        plan.data.members.iter().for_each(|member| *out += &wrap("  ", &told(member)));
    }
    if plan.n_variants > 1 {
        *out += &wrap("", &format!("each cell in {} variants, of grid.vary", plan.n_variants));
    }
    let shares: BTreeSet<String> =
        plan.runs.iter().map(|run| run.spec.share.value().to_string()).collect();
    if shares.len() > 1 {
        let all: Vec<String> = shares.into_iter().collect();
        *out += &wrap("", &format!("each cell on shares {} of the clips", all.join(", ")));
    }
    if !plan.renamed.is_empty() {
        *out += &wrap("", &vocabularies(&plan.renamed));
    }
    out.push('\n');
}

/// `256 codes are 240 (levels 8, 6, 5)`.
fn vocabularies(renamed: &[Renamed]) -> String {
    let one = |Renamed { named, codes, levels }: &Renamed| {
        let levels: Vec<String> = levels.iter().map(ToString::to_string).collect();
        format!("{codes} for {named} (levels {})", levels.join(", "))
    };
    let all: Vec<String> = renamed.iter().map(one).collect();
    format!("V is the product of FSQ's levels: {}", all.join(", "))
}

/// A data set of a union.
fn told(MemberFacts { name, licence, clips, frames, fps, .. }: &MemberFacts) -> String {
    let minutes = frames.iter().sum::<usize>() as f64 / f64::from(*fps) / 60.0;
    let [train, val, test] = clips;
    let licence = licence.as_deref().unwrap_or("licence not given");
    format!("{name}: {minutes:.0} min in {train}, {val} and {test} clips; {licence}")
}

fn count(plan: &Plan, states: &RunStates, state: JobState) -> usize {
    plan.runs.iter().filter(|run| states.of(&run.run_id) == state).count()
}

fn table(out: &mut String, plan: &Plan, states: &RunStates) {
    let _ = writeln!(
        out,
        "{:>8} {:>3} {:>5} {:>6} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7}",
        "C", "L", "d", "V", "N_nv", "N_v", "D", "steps", "epochs", "state"
    );
    for run in plan.runs.iter().take(MOST_ROWS) {
        let _ = writeln!(out, "{}", row(run, states));
    }
    if let Some(more) = plan.runs.len().checked_sub(MOST_ROWS + 1) {
        let _ = writeln!(out, "… and {} more; --json lists all", more + 1);
    }
}

fn row(run: &PlannedRun, states: &RunStates) -> String {
    let spec = &run.spec;
    format!(
        "{:>8} {:>3} {:>5} {:>6} {:>8.2e} {:>8.2e} {:>8.2e} {:>8} {:>7} {:>7}",
        exponent(spec.budget_flops),
        spec.shape().n_layer,
        spec.shape().d_model,
        spec.n_vocab(),
        run.params.nonvocab as f64,
        run.params.vocab as f64,
        spec.tokens() as f64,
        spec.steps,
        run.epochs.map_or_else(|| "-".to_string(), epochs),
        format!("{:?}", states.of(&run.run_id)).to_lowercase(),
    )
}

fn dropped(out: &mut String, plan: &Plan) {
    for cell in plan.dropped.iter().take(MOST_ROWS) {
        let Dropped { n_layer, d_model, n_vocab, budget_flops, share, reason, .. } = cell;
        let sentence = format!(
            "L{n_layer} d{d_model} V{n_vocab} C={}{}: {reason}",
            exponent(*budget_flops),
            share.said()
        );
        *out += &wrap("dropped: ", &sentence);
    }
    if let Some(more) = plan.dropped.len().checked_sub(MOST_ROWS + 1) {
        let _ = writeln!(out, "… and {} more dropped; --json lists all", more + 1);
    }
}

/// A budget in at most four digits: `1.5e10`, `3e10`.
pub fn exponent(budget: f64) -> String {
    let shortest = format!("{budget:e}");
    if shortest.len() <= 8 { shortest } else { format!("{budget:.2e}") }
}

fn epochs(epochs: f64) -> String {
    if epochs < 1e4 { format!("{epochs:.2}") } else { format!("{epochs:.1e}") }
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
