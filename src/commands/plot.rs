//! `isoflop plot`: redraws the figures of a sweep from its table and laws, or draws those that another table or a
//! `laws.json` allows.

use super::args::one_of;
use super::fit;
use super::fit::{TableArgs, TableStudy, beside};
use super::generators::{draw as draw_side_by_side, home, parted};
use super::predict::{each, not_of_groups};
use super::prelude::*;
use isoflop::codes::{TokenizerMetrics, remarks};
use isoflop::figures::{self, Drawn, FigureInput, Format, LeftOut};
use isoflop::record::{Tuned, sliced, table};
use isoflop::spec::content_id;

#[derive(Args)]
pub struct PlotArgs {
    /// A sweep's folder, a table of runs made elsewhere (.csv, .tsv, .parquet), or a laws.json
    #[arg(value_name = "RESULTS|TABLE|LAWS")]
    pub results: PathBuf,
    /// The folder to draw into; by default `figures` in a sweep's folder, or NAME-figures next to a table
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    table: TableArgs,
    #[command(flatten)]
    wanted: Wanted,
}

/// The figure of several generators side by side.
const SIDE_BY_SIDE: &str = "generators";

/// The figures to draw and their formats; by default all possible figures in every format.
#[derive(Args, Default)]
pub struct Wanted {
    /// Draw only these figures, by file name
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Write only these formats
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
            "a sweep is drawn into its own folder, from all of its runs: --out and the options of a table are for tables only"
        );
    }
    not_of_groups(&args.results)?;
    let folder = ResultsFolder::new(&args.results);
    let records = table::read(folder.root())?;
    let (by_generator, wanted) = (parted(&records), &args.wanted);
    if by_generator.len() < 2 {
        return of_one_generator(&folder, &records, wanted, output);
    }
    // All of them side by side, then the figures of each.
    let sweep = folder.sweep()?;
    let mut paths = match wanted.has(SIDE_BY_SIDE) {
        true => draw_side_by_side(&sweep, &folder, &by_generator, wanted.formats())?,
        false => Vec::new(),
    };
    for (name, records) in &by_generator {
        paths.extend(of_one_generator(&folder.of_generator(name), records, wanted, output)?);
    }
    Ok(paths)
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
    let home = home(folder);
    let tokenizers = tokenizers(&home, output)?;
    let mut records = Tuned::of(records).records;
    // Runs are moved to equal FLOPs if the laws count by another rule than the plan. A table and its laws are drawn
    // without a sweep too.
    let has_sweep = home.file("sweep.yaml").exists();
    let planned = has_sweep.then(|| home.sweep()).transpose()?.map(|sweep| sweep.flops.rule);
    let counted = laws.as_ref().and_then(|laws| FlopsRule::named(&laws.flops_rule));
    if let (Some(planned), Some(counted)) = (planned, counted)
        && planned != counted
    {
        records = sliced(&records, counted)?;
    }
    Ok(draw(folder, &records, laws.as_ref(), &tokenizers, wanted, output)?.paths)
}

/// The metrics of every tokenizer in a folder; a damaged one is left out with a warning.
pub fn tokenizers(folder: &ResultsFolder, output: &Output) -> Result<Vec<TokenizerMetrics>> {
    Ok(folder.all_metrics(|problem| output.warn(&problem))?)
}

/// Draws into the sweep's `figures` folder. A figure that cannot be drawn is a warning, and its older file is removed.
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

// Results of records: table, laws, figures, predictions.

/// The results of records, made or found in the folder; `home` has the tokenizers of the runs.
pub fn analysed(
    sweep: &Sweep,
    (folder, home): (&ResultsFolder, &ResultsFolder),
    records: &[RunRecord],
    output: &Output,
) -> Result<Finished> {
    // Changes whenever the output would change.
    let stamp = content_id(&(records, sweep, folder.root(), env!("ISOFLOP_GIT_REVISION")));
    if let Some(finished) = Finished::again(folder, &stamp, output)? {
        return Ok(finished);
    }
    let n_warned = output.warned().len();
    table::write(folder.root(), records)?;
    let tuned = Tuned::of(records);
    tuned.told.iter().for_each(|told| output.warn(told));
    let laws = write_laws(sweep, folder, &tuned.records, output)?;
    let laws = laws.as_ref();
    let tokenizers = tokenizers(home, output)?;
    let wanted = Wanted::default();
    let drawn = draw(folder, &tuned.records, laws, &tokenizers, &wanted, output)?;
    remarks(&tokenizers).iter().for_each(|remark| output.warn(remark));
    let mut predictions = Vec::new();
    if let Some(laws) = laws {
        predictions = each(laws, &sweep.predict.budgets, output);
        atomic::write_json(&folder.file("prediction.json"), &predictions)?;
    }
    let document = json!({
        "results": folder.root(),
        "runs": records.len(),
        "laws": laws,
        "predictions": predictions,
        "figures": drawn.paths,
    });
    let files = format!(
        "{}: {} finished runs{}, {} figures",
        folder.root().display(),
        records.len(),
        if laws.is_some() { ", laws.json" } else { "" },
        drawn.paths.len() / Format::ALL.len()
    );
    let story = |full| laws.map(|laws| fit::text(laws, &predictions, full)).unwrap_or_default();
    let [text, full] = [false, true].map(|full| story(full) + &files);
    let (files, warnings) = (digests(folder)?, output.warned().split_off(n_warned));
    let finished = Finished { stamp, files, document, text, full, warnings };
    atomic::write_json(&folder.file("finished.json"), &finished)?;
    Ok(finished)
}

/// Removes files of an earlier state of the sweep, which would be taken for current ones.
pub fn forget(folder: &ResultsFolder) -> Result<()> {
    for file in ["laws.json", "prediction.json", "finished.json"] {
        atomic::remove(&folder.file(file))?;
    }
    Ok(())
}

fn write_laws(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<Option<Laws>> {
    match fit::fit_records(records, &fit::options(sweep)) {
        Ok(mut laws) => {
            laws.judgement.validations = folder.validations(|line| output.warn(&line));
            atomic::write_json(&folder.file("laws.json"), &laws)?;
            Ok(Some(laws))
        }
        Err(error) => {
            output.warn(&format!("no laws: {error:#}"));
            forget(folder)?;
            Ok(None)
        }
    }
}

// `finished.json`: a digest of the results, so that unchanged ones are not made again.

const FILES: [&str; 4] = ["runs.parquet", "runs.csv", "laws.json", "prediction.json"];

/// The text and the files of the last `run`.
#[derive(Serialize, Deserialize)]
pub struct Finished {
    /// Hash of the records, the sweep, the folder's name and the revision of the program.
    stamp: String,
    /// Digest of each file, by its name in the folder.
    files: BTreeMap<String, String>,
    pub document: Value,
    /// One screen.
    pub text: String,
    /// Everything.
    pub full: String,
    warnings: Vec<String>,
}

impl Finished {
    /// The text of the same records, with its warnings; `None` if the records, the sweep or a written file has changed.
    pub fn again(folder: &ResultsFolder, stamp: &str, output: &Output) -> Result<Option<Self>> {
        let Ok(Some(finished)) = read_if_there::<Self>(&folder.file("finished.json")) else {
            return Ok(None);
        };
        if finished.stamp != stamp || finished.files != digests(folder)? {
            return Ok(None);
        }
        finished.warnings.iter().for_each(|line| output.warn(line));
        Ok(Some(finished))
    }
}

/// Digests of the tables, the laws, the prediction and every figure in the folder.
fn digests(folder: &ResultsFolder) -> Result<BTreeMap<String, String>> {
    let mut names: Vec<String> = FILES.map(String::from).to_vec();
    for figure in std::fs::read_dir(folder.file("figures")).into_iter().flatten() {
        names.push(format!("figures/{}", figure?.file_name().to_string_lossy()));
    }
    let digest = |path: &Path| std::fs::read(path).ok().map(|bytes| blake3::hash(&bytes).to_hex());
    let found = |name: String| Some((name.clone(), digest(&folder.file(&name))?.to_string()));
    Ok(names.into_iter().filter_map(found).collect())
}
