//! The page of a table made elsewhere, or of a `laws.json`.

use std::path::Path;

use anyhow::{Context, Result};
use isoflop::figures::{Format, draw_all};
use isoflop::report::{ReportInput, page};

use super::generator::GeneratorResults;
use crate::commands::fit::{TableArgs, TableStudy};
use crate::commands::output::Output;

/// The page as HTML; what cannot be drawn is a note.
pub fn page_of(path: &Path, args: &TableArgs, output: &Output) -> Result<String> {
    let study = TableStudy::open(path, args, output)?;
    let folder = tempfile::tempdir().context("making a folder for the figures")?;
    let drawn = draw_all(&study.figures(), folder.path(), |_| true, &[Format::Svg])?;
    for left_out in &drawn.left_out {
        output.note(&format!("{} is left out: {}", left_out.name, left_out.reason));
    }
    let loss_name = study.loss_name().map(String::from);
    let mut own = GeneratorResults::new(study.laws, &[], study.records, folder.path())?;
    own.loss_name = loss_name;
    Ok(page(&ReportInput {
        name: &study.name,
        studies: &[own.study()],
        samples: &[],
        tokenizers: &[],
        figures: &[],
        sweep: "",
        dropped: &[],
    }))
}
