//! Where the points of a fit come from: a sweep's folder, or a table made elsewhere.

use std::path::Path;

use anyhow::{Result, bail};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::{FitError, IsoFlopPoint, Parameters};
use isoflop::record::{RunRecord, Tuned, table as runs};
use isoflop::spec::FlopsRule;
use isoflop::sweep::Sweep;
use isoflop::table::{self, Dropped, TableRequest};

use super::request::FitRequest;
use crate::commands::by_generator::{of_one, sweep_of};
use crate::commands::validate::validation_folders;

/// Points, and what they were made of.
pub struct Source {
    pub name: String,
    pub points: Vec<IsoFlopPoint>,
    pub parameters: Parameters,
    /// The count of FLOPs of [`IsoFlopPoint::flops`].
    pub rule: FlopsRule,
    /// Whether rows can be grouped by a budget that somebody declared.
    pub budget_declared: bool,
    pub dropped: Vec<Dropped>,
    pub notes: Vec<String>,
    /// Where the points are a sweep's own, untouched.
    pub sweep: Option<OwnSweep>,
}

/// A sweep's folder with its file and records.
pub struct OwnSweep {
    pub folder: ResultsFolder,
    pub sweep: Sweep,
    pub records: Vec<RunRecord>,
}

impl Source {
    pub fn open(path: &Path, request: &FitRequest) -> Result<Self> {
        match (path.is_dir(), request.as_table) {
            (true, false) => of_sweep(path, request),
            (true, true) => {
                let sweep = sweep_of(&ResultsFolder::new(path))?;
                let rule = request.rule.unwrap_or(sweep.flops.rule);
                of_table(&path.join("runs.parquet"), &sweep.name, rule, request)
            }
            (false, _) => {
                let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
                let rule = request.rule.unwrap_or(FlopsRule::SixNd);
                of_table(path, &stem.unwrap_or_else(|| "table".into()), rule, request)
            }
        }
    }
}

fn of_sweep(path: &Path, request: &FitRequest) -> Result<Source> {
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
    let rule = request.rule.unwrap_or(sweep.flops.rule);
    let (points, left_out) = super::sweep::points(&records, rule);
    Ok(Source {
        name: sweep.name.clone(),
        points,
        parameters: Parameters::Split,
        rule,
        budget_declared: true,
        dropped: Vec::new(),
        notes: left_out.into_iter().chain(told).collect(),
        sweep: Some(OwnSweep { folder, sweep, records }),
    })
}

/// The runs of every validation that has a table, by budget.
fn of_validations(folder: &ResultsFolder) -> Result<Vec<RunRecord>> {
    let mut all = Vec::new();
    for place in validation_folders(folder) {
        if ["runs.parquet", "runs.csv"].iter().any(|name| place.join(name).exists()) {
            all.extend(runs::read(&place)?);
        }
    }
    runs::sort(&mut all);
    Ok(all)
}

fn of_table(path: &Path, name: &str, rule: FlopsRule, request: &FitRequest) -> Result<Source> {
    let table = table::read(path)?;
    let columns = with_flops(&table, rule, request.table.columns.as_deref())?;
    let wanted = TableRequest { columns, ..request.table.clone() };
    let loaded = table::load(&table, &wanted)?;
    if loaded.points.is_empty() {
        return Err(FitError::NoPoints.into());
    }
    Ok(Source {
        name: name.to_string(),
        points: loaded.points,
        parameters: loaded.parameters,
        rule,
        budget_declared: loaded.budget_declared,
        dropped: loaded.dropped,
        notes: loaded.notes,
        sweep: None,
    })
}

/// `--columns` with what a run spent under `rule`: 6ND follows from the rest, the others need a
/// column of their own, as a sweep's table has it.
fn with_flops(
    table: &table::Table,
    rule: FlopsRule,
    columns: Option<&str>,
) -> Result<Option<String>> {
    let own = format!("flops_{}", rule.name());
    let given = columns.is_some_and(|text| text.split(',').any(|c| c.trim().starts_with("flops=")));
    if given || (rule == FlopsRule::SixNd && table.column(&own).is_none()) {
        return Ok(columns.map(String::from));
    }
    if table.column(&own).is_none() {
        bail!(
            "--flops {} needs a column {own}, or flops=… in --columns: only 6nd follows from N and D",
            rule.name()
        );
    }
    let flops = format!("flops={own}");
    Ok(Some(columns.map_or(flops.clone(), |text| format!("{text},{flops}"))))
}
