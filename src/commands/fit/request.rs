//! What a fit was asked for: the command line, over the defaults of the analysis it follows.

use anyhow::{Context, Result};
use isoflop::laws::{
    Form, HoldOut, Huber, IsoFlopPoint, LawKind, MinimumMethod, ParametricOptions, Space, Starts,
};
use isoflop::spec::FlopsRule;
use isoflop::table::{OutlierStage, TableRequest};

use super::args::{
    CompatName, FitArgs, FlopsName, HuberName, MinimaName, SpaceName, StartsName, TableArgs,
};

/// Power laws' Huber δ where `mad` is asked for: 95 % of the precision of least squares.
const MADS: f64 = 1.345;

/// A fit, before anything is read.
pub struct FitRequest {
    pub law: LawKind,
    pub compat: Option<CompatName>,
    pub rule: Option<FlopsRule>,
    pub minima: Option<MinimumMethod>,
    pub keep_flagged: bool,
    pub hold_out: Option<HoldOut>,
    /// Huber's δ of power laws, in MADs.
    pub huber_mads: Option<f64>,
    pub bootstrap: Option<usize>,
    pub seed: u64,
    pub table: TableRequest,
    /// Whether the runs of a sweep's validations count too.
    pub validations: bool,
    /// Whether the table's options were used at all.
    pub as_table: bool,
    args: FitArgs,
}

impl FitRequest {
    pub fn of(args: &FitArgs) -> Result<Self> {
        let outliers: Result<Vec<OutlierStage>, _> =
            args.table.outliers.iter().map(|name| name.parse::<OutlierStage>()).collect();
        let outliers = outliers.context("--outliers")?;
        let compat = args.compat;
        let scamo = compat == Some(CompatName::Scamo);
        let as_table = args.table.columns.is_some()
            || !args.table.filters.is_empty()
            || args.table.drop_highest.is_some()
            || !outliers.is_empty()
            || args.by.is_some()
            || compat == Some(CompatName::Epoch);
        Ok(Self {
            law: args.table.law.unwrap_or_else(|| default_law(compat)),
            compat,
            rule: args.flops.map(rule),
            minima: args.minima.map(method).or(scamo.then_some(MinimumMethod::Argmin)),
            keep_flagged: args.keep_flagged || scamo,
            hold_out: match &args.hold_out {
                None => scamo.then_some(HoldOut::None),
                Some(text) => Some(hold_out(text)?),
            },
            huber_mads: match args.huber {
                Some(HuberName::Delta(delta)) => Some(delta),
                Some(HuberName::Mad) => Some(MADS),
                Some(HuberName::None) | None => None,
            },
            bootstrap: args.bootstrap,
            seed: args.seed.unwrap_or(0),
            table: TableRequest {
                columns: args.table.columns.clone(),
                group: None,
                filters: args.table.filters.clone(),
                drop_highest: args.table.drop_highest.unwrap_or_else(|| default_drop(compat)),
                outliers,
            },
            validations: args.validations,
            as_table,
            args: args.clone(),
        })
    }

    /// Of a table's rows and law alone.
    pub fn of_table(table: &TableArgs) -> Result<Self> {
        Self::of(&FitArgs { table: table.clone(), ..FitArgs::default() })
    }

    /// The options of a parametric law.
    pub fn parametric(&self, form: Form) -> ParametricOptions {
        let mut options = ParametricOptions::of(form);
        if self.compat == Some(CompatName::Epoch) {
            options.huber = Huber::Delta(1e-3);
            options.starts = Starts::Grid;
            options.bootstrap = 4000;
        }
        self.override_parametric(options)
    }

    fn override_parametric(&self, mut options: ParametricOptions) -> ParametricOptions {
        let args = &self.args;
        match args.huber {
            Some(HuberName::Delta(delta)) => options.huber = Huber::Delta(delta),
            Some(HuberName::Mad) => options.huber = Huber::Mad(MADS),
            Some(HuberName::None) => options.huber = Huber::None,
            None => {}
        }
        match args.space {
            Some(SpaceName::Log) => options.space = Space::Log,
            Some(SpaceName::Raw) => options.space = Space::Raw,
            None => {}
        }
        match args.starts {
            Some(StartsName::Grid) => options.starts = Starts::Grid,
            Some(StartsName::Default) => options.starts = Starts::Projected,
            None => {}
        }
        options.tied |= args.tied;
        options.bootstrap = args.bootstrap.unwrap_or(options.bootstrap);
        options.seed = args.seed.unwrap_or(options.seed);
        options
    }

    /// A note where the loss itself is fitted for want of logarithms, its space not being asked for.
    pub fn raw_note(&self, points: &[IsoFlopPoint]) -> Option<String> {
        let LawKind::Parametric(form) = self.law else { return None };
        let in_logs = self.args.space.is_none() && self.parametric(form).space == Space::Log;
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
        match (self.args.predict.as_slice(), largest) {
            ([], Some(largest)) => vec![largest, 10.0 * largest],
            (asked, _) => asked.to_vec(),
        }
    }
}

fn default_law(compat: Option<CompatName>) -> LawKind {
    match compat {
        Some(CompatName::Epoch) => LawKind::Parametric(Form::Approach3),
        Some(CompatName::Scamo) | None => LawKind::Isoflop,
    }
}

fn default_drop(compat: Option<CompatName>) -> usize {
    if compat == Some(CompatName::Epoch) { 5 } else { 0 }
}

fn rule(name: FlopsName) -> FlopsRule {
    match name {
        FlopsName::Openai => FlopsRule::OpenAi,
        FlopsName::SixNd => FlopsRule::SixNd,
        FlopsName::Exact => FlopsRule::Exact,
    }
}

fn method(name: MinimaName) -> MinimumMethod {
    match name {
        MinimaName::Argmin => MinimumMethod::Argmin,
        MinimaName::Parabola => MinimumMethod::Parabola,
        MinimaName::Cubic => MinimumMethod::Cubic,
        MinimaName::Akima => MinimumMethod::Akima,
        MinimaName::Surface => MinimumMethod::Surface,
    }
}

fn hold_out(text: &str) -> Result<HoldOut> {
    match text {
        "largest" => Ok(HoldOut::LargestBudget),
        "none" => Ok(HoldOut::None),
        budget => {
            let budget = budget.parse();
            Ok(HoldOut::Budget(budget.with_context(|| {
                format!("--hold-out {text}: largest, none or a number of FLOPs")
            })?))
        }
    }
}
