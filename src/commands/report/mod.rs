//! `isoflop report`: results as one page that opens without a network: a sweep's, or those of a table
//! made elsewhere or of a `laws.json`, as far as it holds what the page shows.

mod generator;
mod kept;
mod samples;
mod table;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::record::table as runs;
use isoflop::report::{ReportInput, page};
use serde_json::json;

use super::by_generator::home;
use super::exit::Exit;
use super::fit::{TableArgs, beside};
use super::output::Output;
use super::plot;
use super::predict::not_of_groups;
use generator::{GeneratorResults, of_each};
use kept::{dropped, figures, text};
use samples::samples;

#[derive(Args)]
pub struct ReportArgs {
    /// A sweep's folder, a table of runs made elsewhere (.csv, .tsv, .parquet), or a laws.json
    #[arg(value_name = "RESULTS|TABLE|LAWS")]
    pub results: PathBuf,
    /// The file to write; by default report.html in the sweep's folder, or NAME.html beside a table
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
}

pub fn report(args: &ReportArgs, output: &Output) -> Result<Exit> {
    if args.results.is_file() {
        let html = table::page_of(&args.results, &args.table, output)?;
        return written(args, beside(&args.results, ".html"), &html, output);
    }
    if args.table != TableArgs::default() {
        bail!("a sweep's page is of all of its runs: --columns, --where and --law are of a table");
    }
    not_of_groups(&args.results)?;
    let folder = ResultsFolder::new(&args.results);
    let home = home(&folder);
    let records = runs::read(folder.root())?;
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
    written(args, folder.file("report.html"), &html, output)
}

/// Writes the page to the file asked for, or to the usual one.
fn written(args: &ReportArgs, usual: PathBuf, html: &str, output: &Output) -> Result<Exit> {
    let path = args.out.clone().unwrap_or(usual);
    atomic::write_bytes(&path, html.as_bytes())?;
    let said = format!("{}, {:.1} MB", path.display(), html.len() as f64 / 1e6);
    output.result(&json!({ "report": path, "bytes": html.len() }), &said)
}
