//! `isoflop init`: a sweep file for one's data, sized to a time.

mod design;
mod text;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use isoflop::data::{self, DataFacts};
use isoflop::files::atomic;
use isoflop::jobs::{ResultsFolder, missing_jobs, probe};
use isoflop::ops::DeviceName;
use isoflop::plan::{Plan, demand};
use isoflop::sweep;
use isoflop::units::quoted;
use serde_json::json;

use super::args::device;
use super::exit::Exit;
use super::output::Output;
use design::Design;

#[derive(Args)]
pub struct InitArgs {
    /// The sweep file to write, as study.yaml
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A data set in the HumanML3D layout; by default the procedural motion
    #[arg(long, value_name = "DATA")]
    data: Option<PathBuf>,
    /// Hours that the sweep may take on this machine
    #[arg(long, default_value_t = 1.0, value_parser = hours)]
    hours: f64,
    /// Jobs that run side by side; by default one per core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    device: DeviceName,
    /// Write over a file that is there
    #[arg(long)]
    overwrite: bool,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours: f64 = text.parse().map_err(|_| "is no number of hours".to_string())?;
    let sensible = hours > 0.0 && hours <= 10_000.0;
    sensible.then_some(hours).ok_or_else(|| "hours are above 0, and at most 10000".to_string())
}

/// The largest budget of the smallest sweep that is offered, FLOPs.
const LEAST: f64 = 1.6e10;
/// Doublings of it that are tried.
const DOUBLINGS: i32 = 15;
/// Times that the expected optimum of the largest budget may see the data.
const EPOCHS: f64 = 4.0;
/// Seeds of each run where there is time for them.
const SEEDS: u64 = 3;

pub fn init(args: &InitArgs, output: &Output) -> Result<Exit> {
    if args.file.exists() && !args.overwrite {
        bail!("{} is there already; give another file, or --overwrite", args.file.display());
    }
    let desk = Desk::open(args)?;
    let offer = desk.largest()?;
    let text = desk.text(&offer.design);
    atomic::write_bytes(&args.file, text.as_bytes())?;
    let hours = offer.hours;
    if let Some(epochs) = desk.epochs(&offer.design).filter(|epochs| *epochs > EPOCHS) {
        output.warn(&format!(
            "the optimum of the largest budget will see the data about {epochs:.0} times: laws of so little \
             motion are laws of its repetition"
        ));
    }
    if hours > args.hours {
        output.warn(&format!("the smallest sweep that bears laws takes {hours:.1} hours"));
    }
    let Design { budgets, widths, vocab, seeds, .. } = &offer.design;
    let document = json!({
        "file": args.file, "hours": hours, "runs": offer.runs, "budgets": budgets,
        "d_model": widths, "vocab": vocab, "seeds": seeds, "bound_by": offer.bound_by,
    });
    let file = quoted(&args.file.display().to_string());
    let said = format!(
        "{}: {} runs, about {} by a probe of this machine\n{}\nnext     isoflop run {file}",
        args.file.display(),
        offer.runs,
        duration(hours),
        offer.bound_by
    );
    output.result(&document, &said)?;
    Ok(Exit::Done)
}

fn duration(hours: f64) -> String {
    if hours < 1.0 { format!("{:.0} min", hours * 60.0) } else { format!("{hours:.1} h") }
}

/// Codes of the training split at four frames a code.
fn unique_tokens(facts: &DataFacts) -> usize {
    facts.train_frames() / 4
}

/// What sweeps are sized with.
struct Desk<'a> {
    args: &'a InitArgs,
    name: String,
    /// Those of the data set; `None` for the procedural motion, which has no end.
    facts: Option<DataFacts>,
}

/// A sweep that fits.
struct Offer {
    design: Design,
    hours: f64,
    runs: usize,
    /// What keeps it from being larger.
    bound_by: String,
}

impl<'a> Desk<'a> {
    fn open(args: &'a InitArgs) -> Result<Self> {
        let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
        let name: String =
            stem.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        let mut desk = Self { args, name, facts: None };
        if args.data.is_some() {
            let sweep = sweep::parse("init", &desk.text(&Design::up_to(LEAST, None)), &[])?;
            let source = data::open(&sweep.data, None).context("opening the data")?;
            desk.facts = Some(DataFacts::of(&*source));
        }
        Ok(desk)
    }

    fn text(&self, design: &Design) -> String {
        text::text(&self.name, self.args.data.as_deref(), design)
    }

    /// How often the expected optimum of the largest budget sees the data; `None` where they have no end.
    fn epochs(&self, design: &Design) -> Option<f64> {
        let facts = self.facts.as_ref()?;
        Some(design.most_tokens() / unique_tokens(facts) as f64)
    }

    /// The largest sweep within the time and the data, with seeds where there is time for them.
    fn largest(&self) -> Result<Offer> {
        let unique = self.facts.as_ref().map(unique_tokens);
        let design = |doublings: i32| Design::up_to(LEAST * 2f64.powi(doublings), unique);
        let is_fresh =
            |doublings: i32| self.epochs(&design(doublings)).is_none_or(|epochs| epochs <= EPOCHS);
        let by_data = (0..=DOUBLINGS).rev().find(|doublings| is_fresh(*doublings)).unwrap_or(0);
        let (mut best, mut cost) = (0, self.price(&design(0))?);
        // Hours grow with each doubling, but not by a fixed factor: small models are slow.
        let (mut low, mut high) = (0, by_data);
        while low < high {
            let middle = (low + high + 1) / 2;
            let priced = self.price(&design(middle))?;
            if priced.0 <= self.args.hours {
                (best, cost, low) = (middle, priced, middle);
            } else {
                high = middle - 1;
            }
        }
        let mut design = design(best);
        let bound_by = match (best == by_data && best < DOUBLINGS, &self.args.data) {
            (true, Some(data)) => format!(
                "larger budgets would see {} more than {EPOCHS} times: more data bear more",
                data.display()
            ),
            _ => "larger budgets would take longer: --hours".to_string(),
        };
        if cost.0 * SEEDS as f64 <= self.args.hours {
            design.seeds = (0..SEEDS).collect();
            cost = self.price(&design)?;
        }
        Ok(Offer { design, hours: cost.0, runs: cost.1, bound_by })
    }

    /// Hours and runs.
    fn price(&self, design: &Design) -> Result<(f64, usize)> {
        let sweep = sweep::parse("init", &self.text(design), &[])?;
        let facts = match &self.facts {
            Some(facts) => facts.clone(),
            None => DataFacts::of(&*data::open(&sweep.data, demand(&sweep).as_ref())?),
        };
        let plan = Plan::new(&sweep, facts);
        let nowhere = ResultsFolder::new(Path::new("results").join(".init"));
        let jobs = missing_jobs(&plan, &nowhere);
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let slots = self.args.jobs.map_or_else(cores, usize::from);
        let device = self.args.device.open()?;
        Ok((probe::hours(&jobs, &plan, &device, slots, None), plan.runs.len()))
    }
}
