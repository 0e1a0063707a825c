//! `isoflop report`: writes one HTML page on a sweep, on a table made elsewhere or on a `laws.json`; it needs no
//! network.

mod motions;

use super::fit::{TableArgs, TableStudy, beside};
use super::generators::{home, parted};
use super::predict::not_of_groups;
use super::prelude::*;
use super::{fit, plot, predict};
use isoflop::figures::{Format, draw_all};
use isoflop::record::{Tuned, table as runs};
use isoflop::report::{Figure, ReportInput, Study, page};
use motions::{MotionArgs, samples};
use std::collections::BTreeSet;
use std::fs;

#[derive(Args)]
pub struct ReportArgs {
    /// A sweep's folder, a table of runs made elsewhere (.csv, .tsv, .parquet), or a laws.json
    #[arg(value_name = "RESULTS|TABLE|LAWS")]
    pub results: PathBuf,
    /// The file to write; by default report.html in the sweep's folder, or NAME.html next to a table
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// A paragraph at the head of the page
    #[arg(long, value_name = "TEXT")]
    pub note: Option<String>,
    #[command(flatten)]
    motions: MotionArgs,
    #[command(flatten)]
    table: TableArgs,
}

pub fn report(args: &ReportArgs, output: &Output) -> Result<Exit> {
    if args.results.is_file() {
        if args.motions != MotionArgs::default() {
            bail!("a table has no motions: --captions and --withhold are for sweeps only");
        }
        let html = page_of(args, output)?;
        return written(args, beside(&args.results, ".html"), &html, output);
    }
    if args.table != TableArgs::default() {
        bail!(
            "a sweep's page shows all of its runs: --columns, --where and --law are for tables only"
        );
    }
    not_of_groups(&args.results)?;
    let folder = ResultsFolder::new(&args.results);
    let home = home(&folder);
    let records = runs::read(folder.root())?;
    let generators = of_each(&folder, &records, output)?;
    let several = generators.len() > 1;
    let (samples, not_shown) = samples(&home, &records, &args.motions)?;
    not_shown.iter().for_each(|sentence| output.warn(sentence));
    let html = page(&ReportInput {
        name: &folder.name(),
        studies: &generators.iter().map(GeneratorResults::study).collect::<Vec<_>>(),
        note: args.note.as_deref(),
        samples: &samples,
        not_shown: &not_shown,
        tokenizers: &plot::tokenizers(&home, output)?,
        figures: &if several { kept_figures(&folder.file("figures"), output)? } else { Vec::new() },
        sweep: &sweep_text(&home, output)?,
        dropped: &dropped(&home)?,
    });
    written(args, folder.file("report.html"), &html, output)
}

/// Writes the page to the requested file, or to the default one.
fn written(args: &ReportArgs, usual: PathBuf, html: &str, output: &Output) -> Result<Exit> {
    let path = args.out.clone().unwrap_or(usual);
    atomic::write_bytes(&path, html.as_bytes())?;
    let said = format!("{}, {:.1} MB", path.display(), html.len() as f64 / 1e6);
    output.result(&json!({ "report": path, "bytes": html.len() }), &said)
}

// The page of a table made elsewhere, or of a `laws.json`.

/// The page as HTML; a figure that cannot be drawn is a note.
fn page_of(args: &ReportArgs, output: &Output) -> Result<String> {
    let study = TableStudy::open(&args.results, &args.table, output)?;
    let folder = tempfile::tempdir().context("making a folder for the figures")?;
    let drawn = draw_all(&study.figures(), folder.path(), |_| true, &[Format::Svg])?;
    for left_out in &drawn.left_out {
        output.note(&format!("{} is left out: {}", left_out.name, left_out.reason));
    }
    let loss_name = study.loss_name().map(String::from);
    let mut own =
        GeneratorResults::new(study.laws, &[], study.records, kept_figures(folder.path(), output)?);
    own.loss_name = loss_name;
    Ok(page(&ReportInput {
        name: &study.name,
        studies: &[own.study()],
        note: args.note.as_deref(),
        samples: &[],
        not_shown: &[],
        tokenizers: &[],
        figures: &[],
        sweep: "",
        dropped: &[],
    }))
}

// The results of one generator of a sweep, for its page.

/// The slider ends at this factor times the largest fitted budget.
const FARTHEST: f64 = 1000.0;

/// Budgets of the slider per decade: ten rounded numbers with about equal ratios.
const STEPS: [f64; 10] = [1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.3, 8.0];

/// The runs of one generator, and the results in its folder.
struct GeneratorResults {
    generator: Option<String>,
    /// The name of the loss, if it is not L_u.
    pub loss_name: Option<String>,
    verdict: String,
    laws: Option<Laws>,
    predictions: Vec<Prediction>,
    records: Vec<RunRecord>,
    figures: Vec<Figure>,
}

impl GeneratorResults {
    /// Runs with their `laws`, if any, and predictions for the slider and for the budgets in `told`.
    pub fn new(
        laws: Option<Laws>,
        told: &[Prediction],
        records: Vec<RunRecord>,
        figures: Vec<Figure>,
    ) -> Self {
        let verdict = laws.as_ref().map_or_else(
            || "No laws could be fitted; `isoflop fit` says why.".to_string(),
            |laws| fit::text(laws, &[], false),
        );
        let predictions = laws.as_ref().map(|laws| along(laws, told)).unwrap_or_default();
        let (generator, loss_name) = (None, None);
        Self { generator, loss_name, verdict, laws, predictions, records, figures }
    }

    fn read(folder: &ResultsFolder, records: &[RunRecord], output: &Output) -> Result<Self> {
        let laws = read_if_there(&folder.file("laws.json"))?;
        let told: Option<Vec<Prediction>> = read_if_there(&folder.file("prediction.json"))?;
        let (told, records) = (told.unwrap_or_default(), Tuned::of(records).records);
        let figures = kept_figures(&folder.file("figures"), output)?;
        Ok(Self::new(laws, &told, records, figures))
    }

    /// Its contents on the page.
    pub fn study(&self) -> Study<'_> {
        Study {
            generator: self.generator.as_deref(),
            loss_name: self.loss_name.as_deref(),
            verdict: &self.verdict,
            laws: self.laws.as_ref(),
            predictions: &self.predictions,
            records: &self.records,
            figures: &self.figures,
        }
    }
}

/// One of a sweep with one generator, and else one for each, of its own folder.
fn of_each(
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<Vec<GeneratorResults>> {
    let parted = parted(records);
    if parted.len() < 2 {
        return Ok(vec![GeneratorResults::read(folder, records, output)?]);
    }
    let own = |(name, records): (String, Vec<RunRecord>)| {
        let own = GeneratorResults::read(&folder.of_generator(&name), &records, output)?;
        Ok(GeneratorResults { generator: Some(name), ..own })
    };
    parted.into_iter().map(own).collect()
}

/// Predictions for the slider: rounded budgets from the first fitted one on, and the sweep's own.
fn along(laws: &Laws, told: &[Prediction]) -> Vec<Prediction> {
    let [first, last] = laws.range();
    if first >= last {
        return told.to_vec();
    }
    let powers = first.log10().floor() as i32..=(last * FARTHEST).log10().ceil() as i32;
    let rounded = powers.flat_map(|power| STEPS.map(|step| format!("{step}e{power}")));
    let rounded = rounded.filter_map(|budget| budget.parse().ok());
    let within = rounded.filter(|budget| (first..=last * FARTHEST).contains(budget));
    let mut budgets: Vec<f64> =
        within.chain(told.iter().map(|prediction| prediction.budget_flops)).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets.into_iter().filter_map(|budget| predict::predict_one(laws, budget).ok()).collect()
}

// Files of a results folder, for its page.

/// The figures of a folder, by name; none where there is no folder. What isoflop does not draw is left out, with a
/// warning.
fn kept_figures(folder: &Path, output: &Output) -> Result<Vec<Figure>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_drawing = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "svg");
    let paths: BTreeSet<PathBuf> = entries.map(|entry| entry.path()).filter(is_drawing).collect();
    let mut figures = Vec::new();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match Figure::read(name, &text(&path)?) {
            Ok(figure) => figures.push(figure),
            Err(reason) => output.warn(&format!(
                "{} is left out of the page, since it is no figure of isoflop's: {reason}; `isoflop plot` draws \
                 figures anew",
                path.display()
            )),
        }
    }
    Ok(figures)
}

/// A file's text; empty without the file.
fn text(path: &Path) -> Result<String> {
    Ok(read_text_if_there(path)?.unwrap_or_default())
}

/// The sweep's file; empty without it, or with a warning where it is damaged.
fn sweep_text(home: &ResultsFolder, output: &Output) -> Result<String> {
    match read_yaml_if_there(&home.file("sweep.yaml")) {
        Err(error) if error.is_damage() => {
            output.warn(&format!("the page has no sweep: {error}"));
            Ok(String::new())
        }
        read => Ok(read?.unwrap_or_default()),
    }
}

/// The cells that were not run, one per line; none without a plan.
fn dropped(folder: &ResultsFolder) -> Result<Vec<String>> {
    /// What is read of it.
    #[derive(Deserialize)]
    struct Planned {
        #[serde(default)]
        dropped: Vec<serde_json::Map<String, Value>>,
    }
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    let line = |cell: &serde_json::Map<String, Value>| {
        let facts = cell.iter().filter(|(key, value)| *key != "reason" && !value.is_null());
        let facts: Vec<String> = facts.map(|(key, value)| format!("{key} {value}")).collect();
        let reason = cell.get("reason").and_then(Value::as_str);
        format!("{}: {}", facts.join(", "), reason.unwrap_or_default())
    };
    Ok(plan.iter().flat_map(|plan| &plan.dropped).map(line).collect())
}
