//! Reads the points of a fit from a sweep's folder or from a table made elsewhere.

use super::args::{FitArgs, MINIMA, TableArgs};
use super::sweep;
use crate::commands::generators::{of_one, sweep_of};
use crate::commands::predict::laws_of;
use crate::commands::prelude::*;
use isoflop::figures::FigureInput;
use isoflop::laws::{
    self, FitError, FitOptions, Form, Judgement, LOSS_NORMALISED, LawKind, MinimumMethod,
    Parameters, ParametricOptions, Space, fit_parametric, parametric_laws,
};
use isoflop::record::{Tuned, table as runs};
use isoflop::table::{self, Dropped, Loaded, Table, TableRequest};

/// Points, and their source.
pub struct Source {
    pub name: String,
    /// The count of FLOPs of [`IsoFlopPoint::flops`](isoflop::laws::IsoFlopPoint::flops).
    pub rule: FlopsRule,
    /// The points, the rows that were left out, and likely errors.
    pub rows: Loaded,
    /// Whether the points are a sweep's own, without filters.
    pub sweep: Option<OwnSweep>,
}

/// A sweep's folder with its file and records.
pub struct OwnSweep {
    pub folder: ResultsFolder,
    pub sweep: Sweep,
    pub records: Vec<RunRecord>,
}

impl Source {
    /// Notes on assumptions, and a sentence for each dropped row.
    pub fn told(&self) -> impl Iterator<Item = String> {
        let said =
            |row: &Dropped| format!("dropped {} ({}): {}", row.run_id, row.stage, row.reason);
        self.rows.notes.iter().cloned().chain(self.rows.dropped.iter().map(said))
    }
}

/// The runs of a sweep's folder.
pub fn of_sweep(path: &Path, request: &FitArgs) -> Result<Source> {
    let folder = ResultsFolder::new(path);
    let sweep = sweep_of(&folder)?;
    let mut records = runs::read(folder.root())?;
    of_one(&folder, &records)?;
    if request.validations {
        let more = of_validations(&folder)?;
        if more.is_empty() {
            bail!("{} has no validation that was run: see isoflop validate", path.display());
        }
        records.extend(more);
    }
    let Tuned { records, told } = Tuned::of(&records);
    let rule = request.flops.unwrap_or(sweep.flops.rule);
    let (points, left_out) = sweep::points(&records, rule);
    let rows = Loaded {
        points,
        parameters: Parameters::Split,
        budget_declared: true,
        dropped: Vec::new(),
        notes: left_out.into_iter().chain(told).collect(),
        doubts: Vec::new(),
    };
    let name = sweep.name.clone();
    Ok(Source { name, rule, rows, sweep: Some(OwnSweep { folder, sweep, records }) })
}

/// The runs of every validation with a table, by budget.
fn of_validations(folder: &ResultsFolder) -> Result<Vec<RunRecord>> {
    let has_table =
        |place: &PathBuf| ["runs.parquet", "runs.csv"].iter().any(|name| place.join(name).exists());
    let places = folder.validation_folders().filter(has_table);
    let mut all = places.map(|place| runs::read(&place)).collect::<Result<Vec<_>, _>>()?.concat();
    runs::sort(&mut all);
    Ok(all)
}

// A table of runs made elsewhere, or a sweep's own table read like one.

/// The points of a sweep's folder, or of a table.
pub fn open(path: &Path, request: &FitArgs) -> Result<Source> {
    match path.is_dir() && !request.is_of_rows() {
        true => of_sweep(path, request),
        false => RunTable::open(path, request.flops)?.source(&request.rows()),
    }
}

/// A table with a name.
pub struct RunTable {
    pub name: String,
    rule: FlopsRule,
    pub table: Table,
}

impl RunTable {
    /// Reads a file, or the table in a sweep's folder; the latter has the sweep's FLOP rule unless another is asked
    /// for.
    pub fn open(path: &Path, rule: Option<FlopsRule>) -> Result<Self> {
        if path.is_dir() {
            let sweep = sweep_of(&ResultsFolder::new(path))?;
            let rule = rule.unwrap_or(sweep.flops.rule);
            let table = checked_table(&path.join("runs.parquet"))?;
            return Ok(Self { name: sweep.name, rule, table });
        }
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = stem.unwrap_or_else(|| "table".into());
        Ok(Self { name, rule: rule.unwrap_or(FlopsRule::SixNd), table: checked_table(path)? })
    }

    /// Its points.
    pub fn source(&self, request: &TableRequest) -> Result<Source> {
        let columns = self.with_flops(request.columns.as_deref())?;
        let rows = table::load(&self.table, &TableRequest { columns, ..request.clone() })?;
        if rows.points.is_empty() {
            return Err(FitError::NoPoints.into());
        }
        Ok(Source { name: self.name.clone(), rule: self.rule, rows, sweep: None })
    }

    /// `--columns` with the FLOPs of a run by the rule: 6ND follows from N and D, other rules need their column, as in a
    /// sweep's table.
    fn with_flops(&self, columns: Option<&str>) -> Result<Option<String>> {
        let own = format!("flops_{}", self.rule.name());
        let is_flops = |column: &str| column.trim().starts_with("flops=");
        let given = columns.is_some_and(|text| text.split(',').any(is_flops));
        let has_own = self.table.column(&own).is_some();
        if given || (self.rule == FlopsRule::SixNd && !has_own) {
            return Ok(columns.map(String::from));
        }
        if !has_own {
            bail!(
                "--flops {} needs a column {own}, or flops=… in --columns: only 6nd follows from N and D",
                self.rule.name()
            );
        }
        let flops = format!("flops={own}");
        Ok(Some(columns.map_or(flops.clone(), |text| format!("{text},{flops}"))))
    }
}

/// A table; of a Parquet table with a digest, the bytes that it is of.
fn checked_table(path: &Path) -> Result<Table> {
    if path.is_file() && path.extension().is_some_and(|ending| ending == "parquet") {
        runs::checked(path)?;
    }
    Ok(table::read(path)?)
}

// Fits the requested law.

/// Replicates if neither the command line nor a sweep's file gives a number.
const BOOTSTRAP: usize = 1000;

/// Fits the requested law.
pub fn laws(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    let laws = match (request.law(), &source.sweep) {
        (LawKind::Isoflop, Some(own)) => {
            let fit = sweep::overridden(sweep::options(&own.sweep), request);
            sweep::fit_records(&own.records, &fit)
        }
        (LawKind::Isoflop, None) => of_budgets(source, request),
        (LawKind::Approach1, _) => approach1(source, request),
        (LawKind::Parametric(form), _) => parametric(source, request, form),
        (LawKind::Published, _) => unreachable!("no law that can be asked for"),
    }?;
    let laws = match (&source.sweep, request.law()) {
        // The laws of a sweep know its models already.
        (Some(own), law) if law != LawKind::Isoflop => sweep::of_own_models(laws, &own.records),
        _ => laws,
    };
    Ok(match &source.rows.doubts[..] {
        [] => laws,
        doubts => {
            let judgement =
                Judgement { rows: [doubts, &laws.judgement.rows].concat(), ..laws.judgement };
            Laws { judgement, ..laws }.answered()
        }
    })
}

fn of_budgets(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    if !source.rows.budget_declared {
        return Err(FitError::NoBudgets);
    }
    let is_split = source.rows.parameters == Parameters::Split;
    let mut methods = MINIMA.map(|(.., method)| method).to_vec();
    methods.retain(|method| is_split || *method != MinimumMethod::Surface);
    let options = sweep::asked(FitOptions { methods, ..named(source) }, request);
    laws::fit(&source.rows.points, &options)
}

fn named(source: &Source) -> FitOptions {
    FitOptions {
        name: source.name.clone(),
        flops_rule: source.rule.name().to_string(),
        parameters: source.rows.parameters,
        ..FitOptions::default()
    }
}

fn approach1(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    let options = FitOptions {
        huber: request.huber_mads(),
        bootstrap: request.bootstrap.unwrap_or(BOOTSTRAP),
        seed: request.seed.unwrap_or(0),
        ..named(source)
    };
    laws::approach1(&laws::of_largest_share(&source.rows.points), &options)
}

fn parametric(source: &Source, request: &FitArgs, form: Form) -> Result<Laws, FitError> {
    if form.parameters() == Parameters::Split && source.rows.parameters == Parameters::Total {
        return Err(FitError::NotIdentified(format!(
            "{} needs N_nv and N_v apart: name params_nonvocab, and params_vocab or n_vocab and \
             d_model, in --columns",
            form.name()
        )));
    }
    let points = laws::of_largest_share(&source.rows.points);
    let budgets = points.iter().map(|point| point.budget_flops).reduce(f64::max);
    let influence_at = request.budgets(budgets).into_iter().reduce(f64::max);
    let mut options = ParametricOptions { influence_at, ..request.parametric(form) };
    let raw_note = request.raw_note(&source.rows.points);
    if raw_note.is_some() {
        options.space = Space::Raw;
    }
    let parametric = fit_parametric(&points, &options)?;
    let mut laws = parametric_laws(&points, parametric, &source.name, source.rule.name());
    laws.warnings.extend(raw_note);
    Ok(laws)
}

// [`TableStudy`]: a table or a `laws.json` as input of figures and pages.

/// Runs and laws outside a sweep's folder.
pub struct TableStudy {
    pub name: String,
    /// Empty for a `laws.json`.
    pub records: Vec<RunRecord>,
    /// `None` if no laws could be fitted.
    pub laws: Option<Laws>,
    loss: String,
}

impl TableStudy {
    /// Reads a `laws.json`, or a table and fits its runs; if no laws can be fitted, that is a warning.
    pub fn open(path: &Path, args: &TableArgs, output: &Output) -> Result<Self> {
        if path.extension().is_some_and(|extension| extension == "json") {
            return Self::of_laws(path, args);
        }
        let request = FitArgs { table: args.clone(), ..FitArgs::default() };
        let source = RunTable::open(path, request.flops)?.source(&request.rows())?;
        source.told().for_each(|line| output.note(&line));
        let laws = laws(&source, &request);
        if let Err(error) = &laws {
            output.warn(&format!("no laws: {}", sentence(&anyhow::anyhow!(error.clone()))));
        }
        let records =
            source.rows.points.iter().map(|point| RunRecord::of_point(point, source.rule));
        Ok(Self {
            records: records.collect(),
            loss: source.rows.points[0].metric.name().to_string(),
            name: source.name,
            laws: laws.ok(),
        })
    }

    fn of_laws(path: &Path, args: &TableArgs) -> Result<Self> {
        if args.columns.is_some() || !args.filters.is_empty() || args.law.is_some() {
            bail!(
                "{} holds laws, not runs: --columns, --where and --law are for tables only",
                path.display()
            );
        }
        let laws = laws_of(path)?;
        let (name, loss) = (laws.name.clone(), laws.metric.name().to_string());
        Ok(Self { name, records: Vec::new(), laws: Some(laws), loss })
    }

    /// The input of figures.
    pub fn figures(&self) -> FigureInput<'_> {
        FigureInput {
            title: &self.name,
            loss_name: self.loss_name(),
            records: &self.records,
            laws: self.laws.as_ref(),
            tokenizers: &[],
        }
    }

    /// The name of the loss, if it is not L_u.
    pub fn loss_name(&self) -> Option<&str> {
        Some(&*self.loss).filter(|name| *name != LOSS_NORMALISED)
    }
}

/// A path next to a file: its name without the ending, and `end`.
pub fn beside(path: &Path, end: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}{end}"))
}
