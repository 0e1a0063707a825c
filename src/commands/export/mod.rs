//! `isoflop export`: a sweep's results in another form.

mod exporter;
mod notebook;
mod tables;
mod tensorboard;

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use isoflop::jobs::ResultsFolder;
use serde_json::json;

use super::exit::Exit;
use super::output::Output;
use exporter::Exporter;
pub use notebook::way;

#[derive(Args)]
pub struct ExportArgs {
    /// A sweep's folder
    results: PathBuf,
    /// The form
    #[arg(long, value_enum)]
    to: ExportForm,
    /// The folder to write to; by default notebooks-export, or export/NAME
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ExportForm {
    /// A Jupyter notebook that reads the sweep's table and laws
    Notebook,
    /// Runs, scores and minima as CSV
    Csv,
    /// Runs and scores as Parquet
    Parquet,
    /// The loss of each run as it was trained, for TensorBoard
    Tensorboard,
}

pub fn export(args: &ExportArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let default = match args.to {
        ExportForm::Notebook => PathBuf::from("notebooks-export"),
        _ => PathBuf::from("export").join(folder.name()),
    };
    let exporter = Exporter { folder, out: args.out.clone().unwrap_or(default) };
    let paths = match args.to {
        ExportForm::Notebook => notebook::write(&exporter)?,
        ExportForm::Csv => tables::csv(&exporter)?,
        ExportForm::Parquet => tables::parquet(&exporter)?,
        ExportForm::Tensorboard => tensorboard::write(&exporter)?,
    };
    let text = match &paths[..] {
        [.., last] if paths.len() > SHOWN => {
            format!("{} files in {}, as {}", paths.len(), exporter.out.display(), last.display())
        }
        _ => paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join("\n"),
    };
    let document = match args.to {
        ExportForm::Notebook => json!({ "notebook": paths[0] }),
        _ => json!({ "files": paths }),
    };
    output.result(&document, &text)
}

/// Files that are named one by one, at most.
const SHOWN: usize = 8;
