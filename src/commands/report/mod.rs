//! `isoflop report`: a sweep's results as one page that opens without a network.

mod samples;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;
use isoflop::predict::Prediction;
use isoflop::record::{Tuned, table};
use isoflop::report::{Figure, ReportInput, page};
use serde_json::{Value, json};

use super::by_generator::{home, of_one};
use super::exit::Exit;
use super::output::Output;
use super::{fit, plot, predict};
use samples::samples;

/// The slider ends at so many times the largest budget that laws were fitted to.
const FARTHEST: f64 = 1000.0;

/// Budgets of a decade: rounded, ten of about the same ratio.
const STEPS: [f64; 10] = [1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.3, 8.0];

#[derive(Args)]
pub struct ReportArgs {
    /// A sweep's folder
    pub results: PathBuf,
    /// The file to write; report.html in the sweep's folder by default
    #[arg(long)]
    pub out: Option<PathBuf>,
}

pub fn report(args: &ReportArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let records = table::read(folder.root())?;
    of_one(&folder, &records)?;
    let laws: Option<Laws> = read_if_there(&folder.file("laws.json"))?;
    let told: Vec<Prediction> = read_if_there(&folder.file("prediction.json"))?.unwrap_or_default();
    let verdict = laws.as_ref().map_or_else(
        || "The runs bear no laws; `isoflop fit` says why.".to_string(),
        |laws| fit::text(laws, &[], false),
    );
    let predictions = laws.as_ref().map(|laws| along(laws, &told)).unwrap_or_default();
    let html = page(&ReportInput {
        name: &folder.name(),
        verdict: &verdict,
        laws: laws.as_ref(),
        predictions: &predictions,
        records: &Tuned::of(&records).records,
        samples: &samples(&home(&folder), &records)?,
        tokenizers: &plot::tokenizers(&home(&folder), output)?,
        figures: &figures(&folder.file("figures"))?,
        sweep: &text(&home(&folder).file("sweep.yaml"))?,
        dropped: &dropped(&home(&folder))?,
    });
    let path = args.out.clone().unwrap_or_else(|| folder.file("report.html"));
    atomic::write_bytes(&path, html.as_bytes())
        .with_context(|| format!("writing {}", path.display()))?;
    let said = format!("{}, {:.1} MB", path.display(), html.len() as f64 / 1e6);
    output.result(&json!({ "report": path, "bytes": html.len() }), &said)?;
    Ok(Exit::Done)
}

/// Predictions for the slider: rounded budgets from the first fitted one on, and those of the sweep.
fn along(laws: &Laws, told: &[Prediction]) -> Vec<Prediction> {
    let fitted = &laws.of_all_budgets().fitted_budgets;
    let (Some(first), Some(last)) = (fitted.first(), fitted.last()) else { return told.to_vec() };
    let powers = first.log10().floor() as i32..=(last * FARTHEST).log10().ceil() as i32;
    let rounded = powers.flat_map(|power| STEPS.map(|step| format!("{step}e{power}")));
    let rounded = rounded.filter_map(|budget| budget.parse().ok());
    let within = rounded.filter(|budget| (*first..=last * FARTHEST).contains(budget));
    let mut budgets: Vec<f64> =
        within.chain(told.iter().map(|prediction| prediction.budget_flops)).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets.into_iter().filter_map(|budget| predict::predict_one(laws, budget).ok()).collect()
}

/// The figures of a folder, by name; none where there is no folder.
fn figures(folder: &Path) -> Result<Vec<Figure>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_drawing = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "svg");
    let paths: BTreeSet<PathBuf> = entries.map(|entry| entry.path()).filter(is_drawing).collect();
    let read = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Figure { name, svg: text(path)? })
    };
    paths.iter().map(read).collect()
}

/// A file's text; empty where there is none.
fn text(path: &Path) -> Result<String> {
    match fs::read_to_string(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        read => read.with_context(|| format!("reading {}", path.display())),
    }
}

/// The cells that were not run, each in a line; none where no plan is kept.
fn dropped(folder: &ResultsFolder) -> Result<Vec<String>> {
    let plan: Option<Value> = read_if_there(&folder.file("plan.json"))?;
    let cells = plan.as_ref().and_then(|plan| plan["dropped"].as_array());
    Ok(cells.into_iter().flatten().map(dropped_line).collect())
}

fn dropped_line(cell: &Value) -> String {
    let reason = cell["reason"].as_str().unwrap_or_default();
    let facts = cell.as_object().into_iter().flatten();
    let facts = facts.filter(|(key, value)| *key != "reason" && !value.is_null());
    let facts: Vec<String> = facts.map(|(key, value)| format!("{key} {value}")).collect();
    format!("{}: {reason}", facts.join(", "))
}
