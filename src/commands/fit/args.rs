//! The command line of `isoflop fit`, as it is typed.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use isoflop::laws::LawKind;

use crate::commands::args::budget;

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  The laws of a sweep, again
    isoflop fit results/cmu-motion

  Any table: name what its columns are; the rest is derived (here tokens = C/6N)
    isoflop fit runs.csv --columns 'params=Model Size,budget_flops=Training FLOP,loss=loss' \\
        --law approach3 --predict 1e24

  Units, conditions, doubtful rows
    isoflop fit runs.csv --columns 'params=N*1e6,tokens=D*1e9,loss=L,budget_flops=budget' \\
        --where 'model == \"llama\" and not outlier' --outliers duplicates,spline

  Budgets that were not declared, rounded to a tenth of a decade
    isoflop fit runs.csv --columns 'params=N,tokens=D,loss=L,budget_flops=10^(round(10*log10(6*N*D))/10)'

  One law for each experiment of a table
    isoflop fit runs.csv --by experiment

docs/fitting.md tells which law to choose and how to read the answer.";

/// Which rows of a table are fitted, by which law.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct TableArgs {
    /// What the table's columns mean, as in params=N,tokens=D*1e9,loss=L
    ///
    /// Names: params, params_nonvocab, params_vocab, n_vocab, d_model, tokens, budget_flops, flops,
    /// loss, seed, weight, run_id. The right side is a column or an expression of columns; a column
    /// whose own name is one of these needs no mention.
    #[arg(long, value_name = "NAME=EXPR,…", help_heading = "Table")]
    pub columns: Option<String>,
    /// Fit only rows that meet a condition, as 'loss < 4 and model == "llama"'; may be repeated
    #[arg(long = "where", value_name = "EXPR", help_heading = "Table")]
    pub filters: Vec<String>,
    /// Leave out the K rows of the highest loss
    #[arg(long, value_name = "K", help_heading = "Table")]
    pub drop_highest: Option<usize>,
    /// Leave out doubtful rows, naming each: duplicates, few-levels, off-centre, spline
    #[arg(long, value_name = "STAGE,…", value_delimiter = ',', help_heading = "Table")]
    pub outliers: Vec<String>,
    /// Which law to fit
    #[arg(long, value_parser = a_law(), help_heading = "Law")]
    pub law: Option<LawKind>,
}

#[derive(Args, Clone, Default)]
#[command(after_help = EXAMPLES)]
pub struct FitArgs {
    /// A sweep's folder, or a table of runs made elsewhere (.csv, .tsv, .parquet)
    #[arg(value_name = "RESULTS|TABLE")]
    pub source: PathBuf,

    #[command(flatten)]
    pub table: TableArgs,
    /// Fit the groups of a column side by side, each by its own rows
    #[arg(
        long,
        value_name = "COLUMN",
        conflicts_with_all = ["save", "next", "validations"],
        help_heading = "Table"
    )]
    pub by: Option<String>,
    /// The kind of minimum that the laws are fitted to
    #[arg(long, value_enum, help_heading = "Law")]
    pub minima: Option<MinimaName>,
    /// Fit the runs of a sweep's validations beside its own, as further budgets
    #[arg(long, help_heading = "Law")]
    pub validations: bool,
    /// Fit flagged minima too
    #[arg(long, help_heading = "Law")]
    pub keep_flagged: bool,
    /// The count of FLOPs that the laws are written in
    #[arg(long, value_enum, help_heading = "Law")]
    pub flops: Option<FlopsName>,
    /// Residuals of the loss or of its logarithm, for a parametric law
    #[arg(long, value_enum, help_heading = "Law")]
    pub space: Option<SpaceName>,
    /// Huber's threshold: a number, mad (1.345 standard deviations by the residuals' MAD) or none
    ///
    /// For a parametric law a number is in units of the loss or its logarithm; for the power laws of
    /// minima and of the frontier, in MADs of their residuals.
    #[arg(long, value_name = "DELTA|mad|none", value_parser = huber, help_heading = "Law")]
    pub huber: Option<HuberName>,
    /// Where the search for a parametric law begins: a few good points, or Hoffmann's 4500
    #[arg(long, value_enum, help_heading = "Law")]
    pub starts: Option<StartsName>,
    /// Keep the exponents of model and data equal (alpha1 = beta)
    #[arg(long, help_heading = "Law")]
    pub tied: bool,
    /// Follow a published analysis in everything that is not given here
    #[arg(long, value_enum, help_heading = "Law")]
    pub compat: Option<CompatName>,

    /// largest, none, or the declared budget that takes no part
    #[arg(long, value_name = "largest|none|C", help_heading = "Uncertainty")]
    pub hold_out: Option<String>,
    /// Bootstrap replicates; 0 for no intervals
    #[arg(long, value_name = "N", help_heading = "Uncertainty")]
    pub bootstrap: Option<usize>,
    /// Seed of the bootstrap; by default 42 for a parametric law, whose draws are numpy's, else 0
    #[arg(long, value_name = "S", help_heading = "Uncertainty")]
    pub seed: Option<u64>,

    /// Budgets in FLOPs to give the optimum for; by default the table's largest and ten times it
    #[arg(long, value_name = "C,…", value_delimiter = ',', value_parser = budget)]
    pub predict: Vec<f64>,
    /// Keep a sweep's laws as its own: its laws.json, or laws-<law>.json for another law
    #[arg(long)]
    pub save: bool,
    /// Write what to run next as a sweep file, with models and codebooks that can be built
    #[arg(long, value_name = "FILE")]
    pub next: Option<PathBuf>,
    /// The file to write the laws to; with --by a folder, for a file of each group
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum MinimaName {
    Argmin,
    Parabola,
    Cubic,
    Akima,
    Surface,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FlopsName {
    Openai,
    #[value(name = "6nd")]
    SixNd,
    Exact,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SpaceName {
    Log,
    Raw,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum StartsName {
    Grid,
    Default,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CompatName {
    /// Besiroglu et al. 2024 on Chinchilla's runs: approach 3, 5 highest losses dropped
    Epoch,
    /// ScaMo: the best run of each budget, least squares, nothing held out
    Scamo,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HuberName {
    Delta(f64),
    Mad,
    None,
}

fn huber(text: &str) -> Result<HuberName, String> {
    match text {
        "mad" => Ok(HuberName::Mad),
        "none" => Ok(HuberName::None),
        number => match number.parse::<f64>() {
            Ok(delta) if delta.is_finite() && delta > 0.0 => Ok(HuberName::Delta(delta)),
            _ => Err(format!("{number} is neither a number above 0, nor mad, nor none")),
        },
    }
}

/// The parser of a law's name.
fn a_law() -> impl TypedValueParser<Value = LawKind> {
    let names = LawKind::fitted().map(|law| PossibleValue::new(law.name()).help(law.about()));
    let named = |name: String| LawKind::fitted().find(|law| law.name() == name);
    PossibleValuesParser::new(names)
        .map(move |name| named(name).expect("one of the possible values"))
}
