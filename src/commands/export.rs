//! `isoflop export`: a sweep's results in another form.

use super::prelude::*;
use clap::ValueEnum;
use isoflop::export::{NotebookInput, notebook};
use isoflop::files::tensorboard::{NAME, Scalar, events};
use isoflop::laws::Minimum;
use isoflop::progress::LogLine;
use isoflop::record::table;
use std::fs;
use std::path::Component;

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
        ExportForm::Notebook => write_notebook(&exporter)?,
        ExportForm::Csv => csv(&exporter)?,
        ExportForm::Parquet => parquet(&exporter)?,
        ExportForm::Tensorboard => write(&exporter)?,
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

// Tables of a sweep, each a file.

/// `runs.csv`, `scores.csv` where runs are scored, and `minima.csv` where there are laws.
fn csv(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.csv"])?;
    let mut paths = copied(exporter, "csv")?;
    let laws: Option<Laws> = read_if_there(&exporter.folder.file("laws.json"))?;
    if let Some(laws) = laws {
        let path = exporter.out.join("minima.csv");
        atomic::write_bytes(&path, minima(&laws).as_bytes())?;
        paths.push(path);
    }
    Ok(paths)
}

/// `runs.parquet`, and `scores.parquet` where runs are scored.
fn parquet(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.parquet"])?;
    copied(exporter, "parquet")
}

fn copied(exporter: &Exporter, ending: &str) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for name in ["runs", "scores"].map(|name| format!("{name}.{ending}")) {
        let from = exporter.folder.file(&name);
        if from.exists() {
            let bytes = fs::read(&from).with_context(|| format!("reading {}", from.display()))?;
            let path = exporter.out.join(&name);
            atomic::write_bytes(&path, &bytes)?;
            paths.push(path);
        }
    }
    Ok(paths)
}

/// A row a minimum, of every method.
fn minima(laws: &Laws) -> String {
    let mut text = String::from(
        "method,budget_flops,params_nonvocab,params_vocab,n_vocab,tokens,loss_normalised,trusted,flags\n",
    );
    for minimum in &laws.minima {
        let Minimum { budget_flops, params_nonvocab, params_vocab, n_vocab, tokens, .. } = minimum;
        let method = serde_json::to_value(minimum.method).unwrap_or_default();
        let _ = writeln!(
            text,
            "{},{budget_flops:?},{params_nonvocab:?},{params_vocab:?},{n_vocab:?},{tokens:?},{:?},{},{}",
            method.as_str().unwrap_or_default(),
            minimum.loss_normalised,
            minimum.trusted,
            flags(minimum)
        );
    }
    text
}

/// Their words, with blanks between.
fn flags(minimum: &Minimum) -> String {
    let flags = serde_json::to_value(&minimum.flags).unwrap_or_default();
    let words = flags.as_array().into_iter().flatten().filter_map(|flag| flag.as_str());
    words.collect::<Vec<_>>().join(" ")
}

// Runs as TensorBoard reads them: a folder a run.

/// Loss and learning rate along the training of each run that is in the folder, and its result.
fn write(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.parquet"])?;
    let mut paths = Vec::new();
    for record in table::read(exporter.folder.root())? {
        let log = exporter.folder.run(&record.planned.run_id).join("log.jsonl");
        let Some(lines) = read_text_if_there(&log)? else { continue };
        let lines = lines.lines().map(|line| {
            serde_json::from_str(line).with_context(|| format!("{} is damaged", log.display()))
        });
        let lines: Vec<LogLine> = lines.collect::<Result<_>>()?;
        let path = exporter.out.join(name(&record)).join(format!("{NAME}.0.isoflop"));
        atomic::write_bytes(&path, &events(&scalars(&record, &lines)))?;
        paths.push(path);
    }
    if paths.is_empty() {
        let runs = exporter.folder.file("runs");
        bail!("{} holds no log of a run: only the table was kept", runs.display());
    }
    Ok(paths)
}

/// `L2-d16-V240-C1e10-seed0`: what tells runs of a sweep apart, and their generator and tokenizer.
fn name(record: &RunRecord) -> String {
    let planned = &record.planned;
    let number = |value: Option<usize>| value.map_or("-".to_string(), |value| value.to_string());
    let (layers, d, v) = (number(planned.n_layer), number(planned.d_model), planned.n_vocab);
    let seed = planned.seed.unwrap_or_default();
    let (budget, id) = (planned.budget_flops, &planned.run_id);
    let generator = planned.generator.as_deref().unwrap_or("run");
    format!("{generator}-L{layers}-d{d}-V{v}-C{budget:e}-seed{seed}-{}", &id[..id.len().min(6)])
}

fn scalars(record: &RunRecord, lines: &[LogLine]) -> Vec<Scalar> {
    // The log holds no times: steps are taken to last alike.
    let steps = lines.last().map_or(1, |line| line.step.max(1));
    let wall_s = record.measured.wall_s.unwrap_or(0.0);
    let at = |line: &LogLine| wall_s * line.step as f64 / steps as f64;
    let of_line = |line: &LogLine| {
        let scalar = |tag, value| Scalar { tag, step: line.step, time_s: at(line), value };
        [
            scalar("train/loss_nats", line.train_loss_nats),
            scalar("train/lr", line.lr),
            scalar("train/tokens", line.tokens as f64),
            scalar("val/loss_normalised", line.val_loss_normalised),
        ]
    };
    let mut scalars: Vec<Scalar> = lines.iter().flat_map(of_line).collect();
    if let Ok(value) = record.loss_normalised() {
        scalars.push(Scalar { tag: "test/loss_normalised", step: steps, time_s: wall_s, value });
    }
    scalars
}

// A notebook that reads a sweep's table and laws.

/// `<name>.ipynb` in the folder asked for.
fn write_notebook(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.parquet", "laws.json"])?;
    let name = exporter.folder.name();
    let results = seen_from(exporter.folder.root(), &exporter.out)?;
    let document = notebook(&NotebookInput { name: &name, results: &results });
    let path = exporter.out.join(format!("{name}.ipynb"));
    atomic::write_json(&path, &document)?;
    Ok(vec![path])
}

/// The way to `target` from the folder `from`, which need not exist: `../results/quickstart`.
fn seen_from(target: &Path, from: &Path) -> Result<String> {
    let here = std::env::current_dir().context("finding the working folder")?;
    let [target, from] = [target, from].map(|path| normal(&here.join(path)));
    Ok(way(&from, &target).to_string_lossy().replace('\\', "/"))
}

/// The way to `target` from the folder `from`, both from the root on.
pub fn way(from: &Path, target: &Path) -> PathBuf {
    let shared = target.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(target.components().skip(shared)).collect()
}

/// Without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut done, component| {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                done.pop();
            }
            other => done.push(other),
        }
        done
    })
}

// [`Exporter`]: what every form needs to know.

/// From where, and to where.
struct Exporter {
    pub folder: ResultsFolder,
    pub out: PathBuf,
}

impl Exporter {
    /// Refuses a folder without files that the form is made of.
    pub fn needs(&self, names: &[&str]) -> Result<()> {
        let missing = names.iter().map(|name| self.folder.file(name)).find(|path| !path.exists());
        match missing {
            Some(path) => bail!("{} is missing; `isoflop run` writes it", path.display()),
            None => Ok(()),
        }
    }
}
