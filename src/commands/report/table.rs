//! The page of a table made elsewhere, or of a `laws.json`.

use std::path::Path;

use anyhow::{Context, Result};
use isoflop::figures::{FigureInput, Format, draw_all};
use isoflop::report::{ReportInput, Study, page};

use super::generator::along;
use super::kept::figures;
use crate::commands::fit::{self, TableArgs, TableStudy};
use crate::commands::output::Output;

/// The page as HTML; what cannot be drawn is a note.
pub fn page_of(path: &Path, args: &TableArgs, output: &Output) -> Result<String> {
    let study = TableStudy::open(path, args, output)?;
    let folder = tempfile::tempdir().context("making a folder for the figures")?;
    let input = FigureInput {
        title: &study.name,
        loss_name: study.loss_name(),
        records: &study.records,
        laws: study.laws.as_ref(),
        tokenizers: &[],
    };
    let drawn = draw_all(&input, folder.path(), |_| true, &[Format::Svg])?;
    for left_out in &drawn.left_out {
        output.note(&format!("{} is left out: {}", left_out.name, left_out.reason));
    }
    let verdict = match &study.laws {
        Some(laws) => fit::text(laws, &[], false),
        None => "The runs bear no laws; `isoflop fit` says why.".to_string(),
    };
    let predictions = study.laws.as_ref().map(|laws| along(laws, &[])).unwrap_or_default();
    let own = Study {
        generator: None,
        loss_name: study.loss_name(),
        verdict: &verdict,
        laws: study.laws.as_ref(),
        predictions: &predictions,
        records: &study.records,
        figures: &figures(folder.path())?,
    };
    Ok(page(&ReportInput {
        name: &study.name,
        studies: &[own],
        samples: &[],
        tokenizers: &[],
        figures: &[],
        sweep: "",
        dropped: &[],
    }))
}
