//! Where the points of a fit come from: a sweep's folder, or a table made elsewhere.

use std::path::Path;

use anyhow::{Result, bail};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Parameters;
use isoflop::record::{RunRecord, Tuned, table as runs};
use isoflop::spec::FlopsRule;
use isoflop::sweep::Sweep;
use isoflop::table::{Dropped, Loaded};

use super::args::FitArgs;
use crate::commands::by_generator::{of_one, sweep_of};
use crate::commands::output::Output;
use crate::commands::validate::validation_folders;

/// Points, and what they were made of.
pub struct Source {
    pub name: String,
    /// The count of FLOPs of [`IsoFlopPoint::flops`](isoflop::laws::IsoFlopPoint::flops).
    pub rule: FlopsRule,
    /// The points, what became of other rows, and what is likely wrong.
    pub rows: Loaded,
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
    /// Says what became of rows, and what was taken without being asked.
    pub fn tell(&self, output: &Output) {
        self.rows.notes.iter().cloned().chain(self.lost()).for_each(|line| output.note(&line));
    }

    /// A sentence for each row that was dropped.
    pub fn lost(&self) -> impl Iterator<Item = String> {
        let said =
            |row: &Dropped| format!("dropped {} ({}): {}", row.run_id, row.stage, row.reason);
        self.rows.dropped.iter().map(said)
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
    let (points, left_out) = super::sweep::points(&records, rule);
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
