//! `isoflop compare`: the laws of several studies side by side, and what differs in their sweeps.

mod quantities;
mod study;
mod sweeps;
mod text;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::laws::{LawKind, Laws};
use serde_json::json;

use super::args::budget;
use super::exit::Exit;
use super::output::Output;
use quantities::Quantity;
use study::Study;
use sweeps::SweepDifference;

#[derive(Args)]
pub struct CompareArgs {
    /// Sweeps' folders, laws.json files, or scamo; the others are compared with the first
    #[arg(required = true, num_args = 2.., value_name = "RESULTS")]
    studies: Vec<String>,
    /// The budget in FLOPs at which optima are compared; by default the largest one fitted
    #[arg(long, value_parser = budget)]
    budget: Option<f64>,
    /// The folder to draw compare.svg and its kin into
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn compare(args: &CompareArgs, output: &Output) -> Result<Exit> {
    let studies: Vec<Study> =
        args.studies.iter().map(|name| Study::of(name)).collect::<Result<_>>()?;
    let rules: Vec<&str> = studies.iter().map(|study| study.laws.flops_rule.as_str()).collect();
    if rules.iter().any(|rule| *rule != rules[0]) {
        output.warn(&format!("FLOPs are counted by different rules: {}", rules.join(", ")));
    }
    let fitted = studies.iter().filter(|study| study.laws.law != LawKind::Published);
    let largest = fitted.map(|study| study.laws.range()[1]).fold(f64::NAN, f64::max);
    let budget = args.budget.or(Some(largest).filter(|budget| budget.is_finite()));
    let budget = budget.context("no study says which budgets it was fitted to; give --budget")?;
    let quantities = Quantity::all(&studies, budget)?;
    let sweeps =
        SweepDifference::of(&studies.iter().map(|study| &*study.path).collect::<Vec<_>>())?;
    let figures = args.out.as_deref().map(|out| draw(&studies, out)).transpose()?;
    let document = json!({
        "studies": studies.iter().map(|study| &study.name).collect::<Vec<_>>(),
        "budget_flops": budget, "quantities": quantities, "sweeps": sweeps, "figures": figures,
    });
    output.result(&document, &text::text(&studies, budget, &quantities, &sweeps, output.full))?;
    figures.iter().flatten().for_each(|path| output.note(&path.display().to_string()));
    Ok(Exit::Done)
}

fn draw(studies: &[Study], out: &Path) -> Result<Vec<PathBuf>> {
    let named: Vec<(&str, &Laws)> =
        studies.iter().map(|study| (&*study.name, &study.laws)).collect();
    Ok(draw_alone("compare", figures::compare(&named), out, &Format::ALL)?)
}
