//! [`TableStudy`]: a table or a `laws.json` as what figures and pages are made of.

use super::args::{FitArgs, TableArgs};
use super::source::{RunTable, laws};
use crate::commands::predict::laws_of;
use crate::commands::prelude::*;
use isoflop::figures::FigureInput;
use isoflop::laws::LOSS_NORMALISED;

/// Runs and laws that lie in no sweep's folder.
pub struct TableStudy {
    pub name: String,
    /// Empty for a `laws.json`.
    pub records: Vec<RunRecord>,
    /// `None` if the table's runs bear none.
    pub laws: Option<Laws>,
    loss: String,
}

impl TableStudy {
    /// Reads a `laws.json`, or a table whose runs are then fitted; that they bear no laws is a warning.
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
                "{} holds laws, not runs: --columns, --where and --law are of a table",
                path.display()
            );
        }
        let laws = laws_of(path)?;
        let (name, loss) = (laws.name.clone(), laws.metric.name().to_string());
        Ok(Self { name, records: Vec::new(), laws: Some(laws), loss })
    }

    /// What figures show of it.
    pub fn figures(&self) -> FigureInput<'_> {
        FigureInput {
            title: &self.name,
            loss_name: self.loss_name(),
            records: &self.records,
            laws: self.laws.as_ref(),
            tokenizers: &[],
        }
    }

    /// What the loss is called, if it is not L_u.
    pub fn loss_name(&self) -> Option<&str> {
        Some(&*self.loss).filter(|name| *name != LOSS_NORMALISED)
    }
}

/// A path beside a file: its name without the ending, and `end`.
pub fn beside(path: &Path, end: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}{end}"))
}
