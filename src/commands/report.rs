//! `isoflop report`: writes one HTML page on a sweep, on a table made elsewhere or on a `laws.json`; it needs no
//! network.

use super::fit::{TableArgs, TableStudy, beside};
use super::generators::{home, parted};
use super::predict::not_of_groups;
use super::prelude::*;
use super::{fit, plot, predict};
use isoflop::data::{self, Split, read_motion};
use isoflop::figures::{Format, draw_all};
use isoflop::motion::{Pose, recover_joints};
use isoflop::plan::demand;
use isoflop::record::{Tuned, table as runs};
use isoflop::report::{Figure, ReportInput, Sample, Study, page};
use std::collections::{BTreeSet, HashMap};
use std::fs;

#[derive(Args)]
pub struct ReportArgs {
    /// A sweep's folder, a table of runs made elsewhere (.csv, .tsv, .parquet), or a laws.json
    #[arg(value_name = "RESULTS|TABLE|LAWS")]
    pub results: PathBuf,
    /// The file to write; by default report.html in the sweep's folder, or NAME.html next to a table
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
}

pub fn report(args: &ReportArgs, output: &Output) -> Result<Exit> {
    if args.results.is_file() {
        let html = page_of(&args.results, &args.table, output)?;
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
    let generators = of_each(&folder, &records)?;
    let several = generators.len() > 1;
    let html = page(&ReportInput {
        name: &folder.name(),
        studies: &generators.iter().map(GeneratorResults::study).collect::<Vec<_>>(),
        samples: &samples(&home, &records)?,
        tokenizers: &plot::tokenizers(&home, output)?,
        figures: &if several { kept_figures(&folder.file("figures"))? } else { Vec::new() },
        sweep: &text(&home.file("sweep.yaml"))?,
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
fn page_of(path: &Path, args: &TableArgs, output: &Output) -> Result<String> {
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
        figures: &Path,
    ) -> Result<Self> {
        let verdict = laws.as_ref().map_or_else(
            || "No laws could be fitted; `isoflop fit` says why.".to_string(),
            |laws| fit::text(laws, &[], false),
        );
        let predictions = laws.as_ref().map(|laws| along(laws, told)).unwrap_or_default();
        let (generator, loss_name, figures) = (None, None, kept_figures(figures)?);
        Ok(Self { generator, loss_name, verdict, laws, predictions, records, figures })
    }

    fn read(folder: &ResultsFolder, records: &[RunRecord]) -> Result<Self> {
        let laws = read_if_there(&folder.file("laws.json"))?;
        let told: Option<Vec<Prediction>> = read_if_there(&folder.file("prediction.json"))?;
        let (told, records) = (told.unwrap_or_default(), Tuned::of(records).records);
        Self::new(laws, &told, records, &folder.file("figures"))
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

/// One study for a sweep with one generator; else one per generator, from its own folder.
fn of_each(folder: &ResultsFolder, records: &[RunRecord]) -> Result<Vec<GeneratorResults>> {
    let parted = parted(records);
    if parted.len() < 2 {
        return Ok(vec![GeneratorResults::read(folder, records)?]);
    }
    let own = |(name, records): (String, Vec<RunRecord>)| {
        let own = GeneratorResults::read(&folder.of_generator(&name), &records)?;
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

/// The figures of a folder, by name; none without the folder.
fn kept_figures(folder: &Path) -> Result<Vec<Figure>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_drawing = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "svg");
    let paths: BTreeSet<PathBuf> = entries.map(|entry| entry.path()).filter(is_drawing).collect();
    let read = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Figure { name, svg: text(path)? })
    };
    paths.iter().map(read).collect()
}

/// A file's text; empty without the file.
fn text(path: &Path) -> Result<String> {
    Ok(read_text_if_there(path)?.unwrap_or_default())
}

/// The cells that were not run, one per line; none without a plan.
fn dropped(folder: &ResultsFolder) -> Result<Vec<String>> {
    let plan: Option<Value> = read_if_there(&folder.file("plan.json"))?;
    let line = |cell: &Value| {
        let facts = cell.as_object().into_iter().flatten();
        let facts = facts.filter(|(key, value)| *key != "reason" && !value.is_null());
        let facts: Vec<String> = facts.map(|(key, value)| format!("{key} {value}")).collect();
        format!("{}: {}", facts.join(", "), cell["reason"].as_str().unwrap_or_default())
    };
    let cells = plan.as_ref().and_then(|plan| plan["dropped"].as_array());
    Ok(cells.into_iter().flatten().map(line).collect())
}

// Motions of a sweep's folder, for its page.

/// Motions that a page shows.
const SHOWN: usize = 6;

/// The part of `motions.json` that is read.
#[derive(Deserialize)]
struct Made {
    caption: String,
    fps: f64,
}

/// The first motions of the run with the lowest L_u among runs with motions.
fn samples(folder: &ResultsFolder, records: &[RunRecord]) -> Result<Vec<Sample>> {
    let with_loss = |record| Some((record, RunRecord::loss_normalised(record).ok()?));
    let mut by_loss: Vec<(&RunRecord, f64)> = records.iter().filter_map(with_loss).collect();
    by_loss.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (record, _) in by_loss {
        let run_id = &record.planned.run_id;
        let place = folder.file("samples").join(run_id);
        for place in [place.join("scored"), place] {
            if let Some(made) = read_if_there(&place.join("motions.json"))? {
                return of_run(folder, run_id, &place, made);
            }
        }
    }
    Ok(Vec::new())
}

fn of_run(home: &ResultsFolder, id: &str, place: &Path, made: Vec<Made>) -> Result<Vec<Sample>> {
    let files = (0..).map(|n| place.join(format!("{n}.features.npy")));
    let kept = files.zip(made).filter(|(path, _)| path.exists());
    let kept: Vec<(PathBuf, Made)> = kept.take(SHOWN).collect();
    let captions: Vec<&str> = kept.iter().map(|(_, made)| made.caption.as_str()).collect();
    let mut truth = truth(home, &captions);
    let read = |(path, Made { caption, fps }): (PathBuf, Made)| {
        let features =
            read_motion(&path, fps).with_context(|| format!("reading {}", path.display()))?;
        let (poses, truth) = (recover_joints(&features), truth.remove(&caption));
        Ok(Sample { caption, run_id: id.to_string(), fps, poses, truth })
    };
    kept.into_iter().map(read).collect()
}

/// The true motion of each caption, from the first clip of the test split with it; none without the data.
fn truth(folder: &ResultsFolder, captions: &[&str]) -> HashMap<String, Vec<Pose>> {
    let Ok(sweep) = folder.sweep() else { return HashMap::new() };
    let Ok(data) = data::open(&sweep.data, demand(&sweep).as_ref()) else {
        return HashMap::new();
    };
    let mut found = HashMap::new();
    for clip in 0..data.n_clips(Split::Test) {
        let own = data.captions(Split::Test, clip);
        if let Some(caption) = own.iter().find(|own| captions.contains(&own.as_str()))
            && !found.contains_key(caption)
            && let Ok(features) = data.features(Split::Test, clip)
        {
            found.insert(caption.clone(), recover_joints(&features));
        }
    }
    found
}
