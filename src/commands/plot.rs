//! `isoflop plot`: every figure of a sweep again, from its table and laws alone; those of a table made
//! elsewhere or of a `laws.json`, as far as it holds what they show.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use isoflop::figures::{self, Drawn, FigureInput, Format, LeftOut};
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::{ResultsFolder, frozen_sweep};
use isoflop::laws::Laws;
use isoflop::record::{RunRecord, Tuned, sliced, table};
use isoflop::spec::FlopsRule;
use isoflop::tokenizer::TokenizerMetrics;
use serde_json::json;

use super::args::one_of;
use super::by_generator::{draw as draw_side_by_side, home, parted};
use super::exit::Exit;
use super::fit::{TableArgs, TableStudy, beside};
use super::output::Output;
use super::predict::not_of_groups;

#[derive(Args)]
pub struct PlotArgs {
    /// A sweep's folder, a table of runs made elsewhere (.csv, .tsv, .parquet), or a laws.json
    #[arg(value_name = "RESULTS|TABLE|LAWS")]
    pub results: PathBuf,
    /// The folder to draw into; `figures` of a sweep's folder, or NAME-figures beside a table
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    #[command(flatten)]
    wanted: Wanted,
}

/// The figure of several generators side by side.
const SIDE_BY_SIDE: &str = "generators";

/// Which figures are drawn, and as what: all that can be, in every format, by default.
#[derive(Args, Default)]
pub struct Wanted {
    /// Draw these figures alone, by the names of their files
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Write files of these kinds alone
    #[arg(long, value_parser = one_of(FORMATS), value_name = "FORMAT", value_delimiter = ',')]
    format: Vec<Format>,
}

const FORMATS: [(&str, &str, Format); 3] = [
    ("svg", "For web pages", Format::Svg),
    ("png", "For slides", Format::Png),
    ("pdf", "For papers", Format::Pdf),
];

impl Wanted {
    /// Refuses names that no figure has.
    fn check(&self) -> Result<()> {
        let names = [&figures::names()[..], &[SIDE_BY_SIDE]].concat();
        match self.only.iter().find(|name| !names.contains(&name.as_str())) {
            Some(name) => bail!("no figure is named {name:?}; there are {}", names.join(", ")),
            None => Ok(()),
        }
    }

    fn has(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|only| only == name)
    }

    fn formats(&self) -> &[Format] {
        if self.format.is_empty() { &Format::ALL } else { &self.format }
    }
}

pub fn plot(args: &PlotArgs, output: &Output) -> Result<Exit> {
    args.wanted.check()?;
    let paths = match args.results.is_file() {
        true => of_table(args, output)?,
        false => of_sweep(args, output)?,
    };
    let text: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    output.result(&json!({ "figures": paths }), &text.join("\n"))
}

fn of_sweep(args: &PlotArgs, output: &Output) -> Result<Vec<PathBuf>> {
    if args.out.is_some() || args.table != TableArgs::default() {
        bail!(
            "a sweep is drawn into its own folder, from all of its runs: --out and the table's options are of a table"
        );
    }
    not_of_groups(&args.results)?;
    let folder = ResultsFolder::new(&args.results);
    let records = table::read(folder.root())?;
    let by_generator = parted(&records);
    match by_generator.len() {
        0 | 1 => of_one_generator(&folder, &records, &args.wanted, output),
        _ => of_several_generators(&folder, &by_generator, &args.wanted, output),
    }
}

/// The figures that a table or a `laws.json` allows.
fn of_table(args: &PlotArgs, output: &Output) -> Result<Vec<PathBuf>> {
    let study = TableStudy::open(&args.results, &args.table, output)?;
    let figures = args.out.clone().unwrap_or_else(|| beside(&args.results, "-figures"));
    let paths = draw_into(&figures, &study.figures(), &args.wanted, output)?.paths;
    if paths.is_empty() {
        bail!("no figure could be drawn of {}", args.results.display());
    }
    Ok(paths)
}

fn of_one_generator(
    folder: &ResultsFolder,
    records: &[RunRecord],
    wanted: &Wanted,
    output: &Output,
) -> Result<Vec<PathBuf>> {
    let laws: Option<Laws> = read_if_there(&folder.file("laws.json"))?;
    let tokenizers = tokenizers(&home(folder), output)?;
    let records = as_laws_count(&home(folder), Tuned::of(records).records, laws.as_ref())?;
    Ok(draw(folder, &records, laws.as_ref(), &tokenizers, wanted, output)?.paths)
}

/// The runs at equal FLOPs by the rule of their laws, where the sweep was planned by another.
fn as_laws_count(
    home: &ResultsFolder,
    records: Vec<RunRecord>,
    laws: Option<&Laws>,
) -> Result<Vec<RunRecord>> {
    // A table and its laws are drawn without the sweep too.
    let planned = frozen_sweep(home).ok().map(|sweep| sweep.flops.rule);
    let counted = laws.and_then(|laws| FlopsRule::named(&laws.flops_rule));
    match (planned, counted) {
        (Some(planned), Some(counted)) if counted != planned => Ok(sliced(&records, counted)?),
        _ => Ok(records),
    }
}

/// All of them side by side, then the figures of each.
fn of_several_generators(
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
    wanted: &Wanted,
    output: &Output,
) -> Result<Vec<PathBuf>> {
    let sweep = frozen_sweep(folder)?;
    let mut paths = match wanted.has(SIDE_BY_SIDE) {
        true => draw_side_by_side(&sweep, folder, by_generator, wanted.formats())?,
        false => Vec::new(),
    };
    for (name, records) in by_generator {
        paths.extend(of_one_generator(&folder.of_generator(name), records, wanted, output)?);
    }
    Ok(paths)
}

/// The metrics of every tokenizer in a folder; a damaged one is left out with a warning.
pub fn tokenizers(folder: &ResultsFolder, output: &Output) -> Result<Vec<TokenizerMetrics>> {
    Ok(folder.all_metrics(|problem| output.warn(&problem))?)
}

/// Draws into the sweep's `figures` folder; what cannot be drawn is a warning, and an older file
/// that showed it is removed.
pub fn draw(
    folder: &ResultsFolder,
    records: &[RunRecord],
    laws: Option<&Laws>,
    tokenizers: &[TokenizerMetrics],
    wanted: &Wanted,
    output: &Output,
) -> Result<Drawn> {
    let name = folder.name();
    let input = FigureInput { title: &name, loss_name: None, records, laws, tokenizers };
    draw_into(&folder.file("figures"), &input, wanted, output)
}

fn draw_into(
    figures: &Path,
    input: &FigureInput,
    wanted: &Wanted,
    output: &Output,
) -> Result<Drawn> {
    let drawn = figures::draw_all(input, figures, |name| wanted.has(name), wanted.formats())?;
    for LeftOut { name, reason } in &drawn.left_out {
        output.warn(&format!("{name} is left out: {reason}"));
        for format in Format::ALL {
            atomic::remove(&figures.join(format!("{name}.{}", format.extension())))?;
        }
    }
    Ok(drawn)
}
