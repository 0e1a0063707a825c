//! A table of runs made elsewhere, or a sweep's own table taken as one.

use std::path::Path;

use anyhow::{Result, bail};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::FitError;
use isoflop::spec::FlopsRule;
use isoflop::table::{self, Group, Table, TableRequest};

use super::args::FitArgs;
use super::source::{Source, of_sweep};
use crate::commands::by_generator::sweep_of;

/// The points of a sweep's folder, or of a table.
pub fn open(path: &Path, request: &FitArgs) -> Result<Source> {
    match path.is_dir() && !request.is_of_rows() {
        true => of_sweep(path, request),
        false => RunTable::open(path, request.flops)?.source(&request.rows()),
    }
}

/// A table that was read, under a name.
pub struct RunTable {
    pub name: String,
    rule: FlopsRule,
    table: Table,
}

impl RunTable {
    /// Reads a file, or the table in a sweep's folder, whose rule of FLOPs it then has unless another
    /// is asked for.
    pub fn open(path: &Path, rule: Option<FlopsRule>) -> Result<Self> {
        if path.is_dir() {
            let sweep = sweep_of(&ResultsFolder::new(path))?;
            let rule = rule.unwrap_or(sweep.flops.rule);
            let table = table::read(&path.join("runs.parquet"))?;
            return Ok(Self { name: sweep.name, rule, table });
        }
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = stem.unwrap_or_else(|| "table".into());
        Ok(Self { name, rule: rule.unwrap_or(FlopsRule::SixNd), table: table::read(path)? })
    }

    /// The groups of a column that rows pass the filters in.
    pub fn groups(&self, request: &TableRequest, column: &str) -> Result<Vec<Group>> {
        Ok(table::groups(&self.table, request, column)?)
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

    /// `--columns` with what a run spent by the rule: 6ND follows from the rest, the others need a
    /// column of their own, as a sweep's table has it.
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
