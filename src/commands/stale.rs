//! Finished runs that a sweep no longer wants, and the settings that made them so.

use std::collections::{BTreeMap, HashMap, HashSet};

use isoflop::files::read_if_there;
use isoflop::jobs::ResultsFolder;
use isoflop::plan::{Plan, PlannedRun, RunSpec, TokenizerJob};
use isoflop::spec::changed_fields;
use serde::Serialize;

/// Finished runs of cells that the plan still has, under another id.
#[derive(Serialize)]
pub struct Stale {
    pub runs: usize,
    /// What differs: `lr`, `model.d_ff`, `tokenizer.width`, `data_digest`.
    pub fields: Vec<String>,
}

/// What lies in the folder and is out of date, by what differs.
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

/// What makes two runs the same cell of a grid: layers, width, V, budget, share and seed.
type CellKey = (usize, usize, usize, [u64; 2], u64);

fn cell(spec: &RunSpec) -> CellKey {
    let spent = [spec.budget_flops, spec.share.value()].map(f64::to_bits);
    (spec.shape().n_layer, spec.shape().d_model, spec.n_vocab(), spent, spec.seed)
}

/// The fields that differ, ids replaced by what they stand for.
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

/// Nothing where the old tokenizer's job is gone.
fn tokenizer_fields(folder: &ResultsFolder, new: &TokenizerJob, old_id: &str) -> Vec<String> {
    let path = folder.tokenizer(old_id).join("job.json");
    let Ok(Some(old)) = read_if_there::<TokenizerJob>(&path) else { return Vec::new() };
    // A sweep file has the keys of training beside those of the kind.
    let named = |field: String| match field.strip_prefix("spec.") {
        Some(setting) => format!("tokenizer.{}", setting.trim_start_matches("training.")),
        None => field,
    };
    changed_fields(new, &old).into_iter().map(named).collect()
}

fn finished_specs(folder: &ResultsFolder) -> Vec<RunSpec> {
    let Ok(entries) = std::fs::read_dir(folder.file("runs")) else { return Vec::new() };
    let places = entries.filter_map(|entry| Some(entry.ok()?.path()));
    places
        .filter(|place| place.join("record.json").exists())
        .filter_map(|place| read_if_there(&place.join("spec.json")).ok().flatten())
        .collect()
}
