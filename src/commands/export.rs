//! `isoflop export`: a sweep's results in another form.

use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use isoflop::export::{NotebookInput, notebook};
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use serde_json::json;

use super::exit::Exit;
use super::output::Output;

#[derive(Args)]
pub struct ExportArgs {
    /// A sweep's folder
    pub results: PathBuf,
    /// The form
    #[arg(long, value_enum)]
    pub to: ExportForm,
    /// The folder to write to
    #[arg(long, default_value = "notebooks-export")]
    pub out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ExportForm {
    /// A Jupyter notebook that reads the sweep's table and laws
    Notebook,
}

pub fn export(args: &ExportArgs, output: &Output) -> Result<Exit> {
    let ExportForm::Notebook = args.to;
    let folder = ResultsFolder::new(&args.results);
    for needed in ["runs.parquet", "laws.json"] {
        if !folder.file(needed).exists() {
            bail!("{} is missing; `isoflop run` writes it", folder.file(needed).display());
        }
    }
    let name = folder.name();
    let results = seen_from(&args.results, &args.out)?;
    let document = notebook(&NotebookInput { name: &name, results: &results });
    let path = args.out.join(format!("{name}.ipynb"));
    atomic::write_json(&path, &document).with_context(|| format!("writing {}", path.display()))?;
    output.result(&json!({ "notebook": path }), &path.display().to_string())?;
    Ok(Exit::Done)
}

/// The way to `target` from the folder `from`, which need not exist: `../results/quickstart`.
fn seen_from(target: &Path, from: &Path) -> Result<String> {
    let here = std::env::current_dir().context("finding the working folder")?;
    let [target, from] = [target, from].map(|path| normal(&here.join(path)));
    let shared = target.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    let way: PathBuf = up.chain(target.components().skip(shared)).collect();
    Ok(way.to_string_lossy().replace('\\', "/"))
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
