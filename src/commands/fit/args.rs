//! The command line of `isoflop fit`, as it is typed.

use crate::commands::args::{budget, number, one_of};
use crate::commands::prelude::*;
use clap::ValueEnum;
use clap::builder::TypedValueParser;
use isoflop::laws::{
    Form, HoldOut, Huber, IsoFlopPoint, LawKind, MinimumMethod, ParametricOptions, Space, Starts,
};
use isoflop::table::{OutlierStage, TableRequest};

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  Refit a sweep
    isoflop fit results/cmu-motion

  Any table: map its columns; the rest is derived (here tokens = C/6N)
    isoflop fit runs.csv --columns 'params=Model Size,budget_flops=Training FLOP,loss=loss' \\
        --law approach3 --predict 1e24

  Units, conditions, doubtful rows
    isoflop fit runs.csv --columns 'params=N*1e6,tokens=D*1e9,loss=L,budget_flops=budget' \\
        --where 'model == \"llama\" and not outlier' --outliers duplicates,spline

  Budgets that were not declared, rounded to a tenth of a decade
    isoflop fit runs.csv --columns 'params=N,tokens=D,loss=L,budget_flops=10^(round(10*log10(6*N*D))/10)'

  One law for each experiment of a table
    isoflop fit runs.csv --by experiment

docs/fitting.md explains which law to choose and how to read the answer.";

/// The rows of a table to fit, and the law.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct TableArgs {
    /// The meaning of the table's columns, e.g. params=N,tokens=D*1e9,loss=L
    ///
    /// Names: params, params_nonvocab, params_vocab, n_vocab, d_model, tokens, budget_flops, flops,
    /// loss, seed, weight, run_id. The right side is a column or an expression of columns; a column
    /// whose own name is one of these needs no mention.
    #[arg(long, value_name = "NAME=EXPR,…", help_heading = "Table")]
    pub columns: Option<String>,
    /// Fit only rows that meet a condition, e.g. 'loss < 4 and model == "llama"'; may be repeated
    #[arg(long = "where", value_name = "EXPR", help_heading = "Table")]
    pub filters: Vec<String>,
    /// Leave out the K rows with the highest loss
    #[arg(long, value_name = "K", help_heading = "Table")]
    pub drop_highest: Option<usize>,
    /// Leave out doubtful rows, and name each: duplicates, few-levels, off-centre, spline
    #[arg(
        long,
        value_name = "STAGE,…",
        value_delimiter = ',',
        value_parser = str::parse::<OutlierStage>,
        help_heading = "Table"
    )]
    pub outliers: Vec<OutlierStage>,
    /// The law to fit
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
    /// Fit each group of rows separately, grouped by this column
    #[arg(
        long,
        value_name = "COLUMN",
        conflicts_with_all = ["save", "next", "validations"],
        help_heading = "Table"
    )]
    pub by: Option<String>,
    /// The kind of minimum that the laws are fitted to
    #[arg(long, value_parser = one_of(MINIMA), help_heading = "Law")]
    pub minima: Option<MinimumMethod>,
    /// Also fit the runs of a sweep's validations, as further budgets
    #[arg(long, help_heading = "Law")]
    pub validations: bool,
    /// Fit flagged minima too
    #[arg(long, help_heading = "Law")]
    pub keep_flagged: bool,
    /// The rule that counts the FLOPs of the laws
    #[arg(long, value_parser = a_rule(), help_heading = "Law")]
    pub flops: Option<FlopsRule>,
    /// Residuals of the loss or of its logarithm, for a parametric law
    #[arg(long, value_parser = one_of(SPACES), help_heading = "Law")]
    pub space: Option<Space>,
    /// Huber's threshold: a number, mad (1.345 standard deviations by the residuals' MAD) or none
    ///
    /// For a parametric law a number is in units of the loss or its logarithm; for the power laws of
    /// minima and of the frontier, in MADs of their residuals.
    #[arg(long, value_name = "DELTA|mad|none", value_parser = huber, help_heading = "Law")]
    pub huber: Option<Huber>,
    /// Starts of the search for a parametric law: a few good points, or Hoffmann's 4500
    #[arg(long, value_parser = one_of(STARTS), help_heading = "Law")]
    pub starts: Option<Starts>,
    /// Keep the exponents of model and data equal (alpha1 = beta)
    #[arg(long, help_heading = "Law")]
    pub tied: bool,
    /// Follow a published analysis in all options not given here
    #[arg(long, value_enum, help_heading = "Law")]
    pub compat: Option<CompatName>,

    /// The budget left out of the fit: largest, none, or a declared budget
    #[arg(long, value_name = "largest|none|C", value_parser = hold_out, help_heading = "Uncertainty")]
    pub hold_out: Option<HoldOut>,
    /// Bootstrap replicates; 0 for no intervals
    #[arg(long, value_name = "N", help_heading = "Uncertainty")]
    pub bootstrap: Option<usize>,
    /// Seed of the bootstrap; by default 42 for a parametric law, whose draws are numpy's, else 0
    #[arg(long, value_name = "S", help_heading = "Uncertainty")]
    pub seed: Option<u64>,

    /// Budgets in FLOPs to predict the optimum for; by default the table's largest and ten times it
    #[arg(long, value_name = "C,…", value_delimiter = ',', value_parser = budget)]
    pub predict: Vec<f64>,
    /// Save the laws in the sweep's folder: as laws.json, or laws-<law>.json for another law
    #[arg(long)]
    pub save: bool,
    /// Write the advised runs as a sweep file, with models and codebooks that can be built
    #[arg(long, value_name = "FILE")]
    pub next: Option<PathBuf>,
    /// The file to write the laws to; with --by a folder, for a file of each group
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// The kinds of minimum; the surface in both sizes is last.
pub const MINIMA: [(&str, &str, MinimumMethod); 5] = [
    ("argmin", "", MinimumMethod::Argmin),
    ("parabola", "", MinimumMethod::Parabola),
    ("cubic", "", MinimumMethod::Cubic),
    ("akima", "", MinimumMethod::Akima),
    ("surface", "", MinimumMethod::Surface),
];

const SPACES: [(&str, &str, Space); 2] = [("log", "", Space::Log), ("raw", "", Space::Raw)];

const STARTS: [(&str, &str, Starts); 2] =
    [("grid", "", Starts::Grid), ("default", "", Starts::Projected)];

/// The parser of the name of a count of FLOPs.
fn a_rule() -> impl TypedValueParser<Value = FlopsRule> {
    one_of(FlopsRule::ALL.map(|rule| (rule.name(), "", rule)))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CompatName {
    /// Besiroglu et al. 2024 on Chinchilla's runs: approach 3, 5 highest losses dropped
    Epoch,
    /// ScaMo: the best run of each budget, least squares, nothing held out
    Scamo,
}

/// Huber δ of power laws for `mad`: 95 % of the precision of least squares.
const MADS: f64 = 1.345;

fn huber(text: &str) -> Result<Huber, String> {
    match text {
        "mad" => Ok(Huber::Mad(MADS)),
        "none" => Ok(Huber::None),
        delta => number(delta, |x| x > 0.0, "a number above 0, mad or none").map(Huber::Delta),
    }
}

fn hold_out(text: &str) -> Result<HoldOut, String> {
    match text {
        "largest" => Ok(HoldOut::LargestBudget),
        "none" => Ok(HoldOut::None),
        budget => {
            number(budget, |_| true, "largest, none or a number of FLOPs").map(HoldOut::Budget)
        }
    }
}

/// The parser of a law's name.
fn a_law() -> impl TypedValueParser<Value = LawKind> {
    one_of(LawKind::fitted().map(|law| (law.name(), law.about(), law)))
}

// The options of a fit: the command line over the defaults of the analysis that it follows.

impl FitArgs {
    /// Fills options that are not given from the published analysis.
    pub fn resolved(&self) -> Self {
        let mut own = self.clone();
        if own.compat == Some(CompatName::Scamo) {
            own.minima.get_or_insert(MinimumMethod::Argmin);
            own.hold_out.get_or_insert(HoldOut::None);
            own.keep_flagged = true;
        }
        if own.compat == Some(CompatName::Epoch) {
            own.table.drop_highest.get_or_insert(5);
        }
        own
    }

    pub fn law(&self) -> LawKind {
        self.table.law.unwrap_or(match self.compat {
            Some(CompatName::Epoch) => LawKind::Parametric(Form::Approach3),
            Some(CompatName::Scamo) | None => LawKind::Isoflop,
        })
    }

    /// The rows of a table to fit.
    pub fn rows(&self) -> TableRequest {
        let TableArgs { columns, filters, drop_highest, outliers, .. } = self.table.clone();
        let drop_highest = drop_highest.unwrap_or(0);
        TableRequest { columns, group: None, filters, drop_highest, outliers }
    }

    /// Whether a sweep's folder is read like any other table.
    pub fn is_of_rows(&self) -> bool {
        self.rows() != TableRequest::default() || self.table.drop_highest.is_some()
    }

    /// Huber's δ of power laws, in MADs.
    pub fn huber_mads(&self) -> Option<f64> {
        match self.huber? {
            Huber::Delta(delta) | Huber::Mad(delta) => Some(delta),
            Huber::None => None,
        }
    }

    /// The options of a parametric law.
    pub fn parametric(&self, form: Form) -> ParametricOptions {
        let own = ParametricOptions::of(form);
        let epoch = self.compat == Some(CompatName::Epoch);
        let huber = if epoch { Huber::Delta(1e-3) } else { own.huber };
        ParametricOptions {
            huber: self.huber.unwrap_or(huber),
            space: self.space.unwrap_or(own.space),
            starts: self.starts.unwrap_or(if epoch { Starts::Grid } else { own.starts }),
            tied: self.tied,
            bootstrap: self.bootstrap.unwrap_or(if epoch { 4000 } else { own.bootstrap }),
            seed: self.seed.unwrap_or(own.seed),
            ..own
        }
    }

    /// A note if the loss itself is fitted because it has no logarithm, and no space was asked for.
    pub fn raw_note(&self, points: &[IsoFlopPoint]) -> Option<String> {
        let LawKind::Parametric(form) = self.law() else { return None };
        let in_logs = self.space.is_none() && self.parametric(form).space == Space::Log;
        let below = points.iter().filter(|point| point.loss <= 0.0).count();
        (in_logs && below > 0).then(|| {
            format!(
                "{below} of {} losses are not above 0, so the loss itself is fitted, not its logarithm \
                 (--space raw)",
                points.len()
            )
        })
    }

    /// Budgets to give the optimum for: those asked for, else `largest` and ten times it.
    pub fn budgets(&self, largest: Option<f64>) -> Vec<f64> {
        match (self.predict.as_slice(), largest) {
            ([], Some(largest)) => vec![largest, 10.0 * largest],
            (asked, _) => asked.to_vec(),
        }
    }
}
