//! `isoflop export`: a sweep's results in another form.

use super::prelude::*;
use clap::ValueEnum;
use isoflop::export::{NotebookInput, notebook};
use isoflop::files::lines::{Lines, read_lines};
use isoflop::files::tensorboard::{NAME, Scalar, events};
use isoflop::laws::Minimum;
use isoflop::progress::LogLine;
use isoflop::record::table;
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
    /// The loss of each run over its training, for TensorBoard
    Tensorboard,
}

pub fn export(args: &ExportArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let is_notebook = args.to == ExportForm::Notebook;
    let own = || Path::new("export").join(folder.name());
    let default = if is_notebook { PathBuf::from("notebooks-export") } else { own() };
    let out = args.out.as_ref().unwrap_or(&default);
    let paths = match args.to {
        ExportForm::Notebook => vec![write_notebook(&folder, out)?],
        ExportForm::Csv => csv(&folder, out)?,
        ExportForm::Parquet => copied(&folder, out, "parquet")?,
        ExportForm::Tensorboard => tensorboard(&folder, out, output)?,
    };
    let text = match &paths[..] {
        [.., last] if paths.len() > SHOWN => {
            format!("{} files in {}, as {}", paths.len(), out.display(), last.display())
        }
        _ => paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join("\n"),
    };
    let document =
        if is_notebook { json!({ "notebook": paths[0] }) } else { json!({ "files": paths }) };
    output.result(&document, &text)
}

/// Refuses a folder that lacks files of the form.
fn needs(folder: &ResultsFolder, names: &[&str]) -> Result<()> {
    match names.iter().map(|name| folder.file(name)).find(|path| !path.exists()) {
        Some(path) => bail!("{} is missing; `isoflop run` writes it", path.display()),
        None => Ok(()),
    }
}

/// Files that are listed, at most.
const SHOWN: usize = 8;

// Tables of a sweep, each a file.

/// `runs.csv`, `scores.csv` if runs are scored, and `minima.csv` if there are laws.
fn csv(folder: &ResultsFolder, out: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = copied(folder, out, "csv")?;
    if let Some(laws) = read_if_there(&folder.file("laws.json"))? {
        let path = out.join("minima.csv");
        atomic::write_bytes(&path, minima(&laws).as_bytes())?;
        paths.push(path);
    }
    Ok(paths)
}

/// The table of runs, and the table of scores if runs are scored.
fn copied(folder: &ResultsFolder, out: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let names = ["runs", "scores"].map(|name| format!("{name}.{ending}"));
    needs(folder, &[&names[0]])?;
    let mut paths = Vec::new();
    for name in names {
        let from = folder.file(&name);
        if from.exists() {
            let bytes = table::checked(&from)?;
            let path = out.join(&name);
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
        // Their words, with blanks between.
        let flags = serde_json::to_value(&minimum.flags).unwrap_or_default();
        let flags = flags.as_array().into_iter().flatten().filter_map(Value::as_str);
        let _ = writeln!(
            text,
            "{},{budget_flops:?},{params_nonvocab:?},{params_vocab:?},{n_vocab:?},{tokens:?},{:?},{},{}",
            method.as_str().unwrap_or_default(),
            minimum.loss_normalised,
            minimum.trusted,
            flags.collect::<Vec<_>>().join(" ")
        );
    }
    text
}

// Runs as TensorBoard reads them: a folder a run.

/// Loss and learning rate over the training of each run in the folder, and its result.
fn tensorboard(folder: &ResultsFolder, out: &Path, output: &Output) -> Result<Vec<PathBuf>> {
    needs(folder, &["runs.parquet"])?;
    let mut paths = Vec::new();
    for record in table::read(folder.root())? {
        let log = folder.run(&record.planned.run_id).join("log.jsonl");
        let Some(Lines { whole: lines, damage }) = read_lines(&log)? else { continue };
        if let Some(damage) = damage {
            output.warn(&format!(
                "{} is damaged ({damage}); lines of it that are exported: {}",
                log.display(),
                lines.len()
            ));
        }
        let path = out.join(name(&record)).join(format!("{NAME}.0.isoflop"));
        atomic::write_bytes(&path, &events(&scalars(&record, &lines)))?;
        paths.push(path);
    }
    if paths.is_empty() {
        let runs = folder.file("runs");
        bail!("{} holds no log of a run: only the table was kept", runs.display());
    }
    Ok(paths)
}

/// A run's name, `L2-d16-V240-C1e10-seed0`, with its generator and tokenizer.
fn name(record: &RunRecord) -> String {
    let planned = &record.planned;
    let [layers, d] = [planned.n_layer, planned.d_model].map(|n| dash(n, |n| n.to_string()));
    let v = planned.n_vocab;
    let seed = planned.seed.unwrap_or_default();
    let (budget, id) = (planned.budget_flops, &planned.run_id);
    let generator = planned.generator.as_deref().unwrap_or("run");
    format!("{generator}-L{layers}-d{d}-V{v}-C{budget:e}-seed{seed}-{}", &id[..id.len().min(6)])
}

fn scalars(record: &RunRecord, lines: &[LogLine]) -> Vec<Scalar> {
    // The log has no times: all steps are assumed to take equally long.
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
fn write_notebook(folder: &ResultsFolder, out: &Path) -> Result<PathBuf> {
    needs(folder, &["runs.parquet", "laws.json"])?;
    let name = folder.name();
    // From a folder that need not exist: `../results/quickstart`.
    let here = std::env::current_dir().context("finding the working folder")?;
    let [target, from] = [folder.root(), out].map(|path| normal(&here.join(path)));
    let results = way(&from, &target).to_string_lossy().replace('\\', "/");
    let path = out.join(format!("{name}.ipynb"));
    atomic::write_plain_json(&path, &notebook(&NotebookInput { name: &name, results: &results }))?;
    Ok(path)
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
