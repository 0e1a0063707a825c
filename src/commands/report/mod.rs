//! `isoflop report`: a sweep's results as one page that opens without a network.

mod generator;
mod kept;
mod samples;

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::record::table;
use isoflop::report::{ReportInput, page};
use serde_json::json;

use super::by_generator::home;
use super::exit::Exit;
use super::output::Output;
use super::plot;
use generator::{GeneratorResults, of_each};
use kept::{dropped, figures, text};
use samples::samples;

#[derive(Args)]
pub struct ReportArgs {
    /// A sweep's folder
    pub results: PathBuf,
    /// The file to write; report.html in the sweep's folder by default
    #[arg(long)]
    pub out: Option<PathBuf>,
}

pub fn report(args: &ReportArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let home = home(&folder);
    let records = table::read(folder.root())?;
    let generators = of_each(&folder, &records)?;
    let several = generators.len() > 1;
    let html = page(&ReportInput {
        name: &folder.name(),
        studies: &generators.iter().map(GeneratorResults::study).collect::<Vec<_>>(),
        samples: &samples(&home, &records)?,
        tokenizers: &plot::tokenizers(&home, output)?,
        figures: &if several { figures(&folder.file("figures"))? } else { Vec::new() },
        sweep: &text(&home.file("sweep.yaml"))?,
        dropped: &dropped(&home)?,
    });
    let path = args.out.clone().unwrap_or_else(|| folder.file("report.html"));
    atomic::write_bytes(&path, html.as_bytes())
        .with_context(|| format!("writing {}", path.display()))?;
    let said = format!("{}, {:.1} MB", path.display(), html.len() as f64 / 1e6);
    output.result(&json!({ "report": path, "bytes": html.len() }), &said)?;
    Ok(Exit::Done)
}
