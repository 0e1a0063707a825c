//! A notebook that reads a sweep's table and laws.

use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result};
use isoflop::export::{NotebookInput, notebook};
use isoflop::files::atomic;

use super::exporter::Exporter;

/// `<name>.ipynb` in the folder asked for.
pub fn write(exporter: &Exporter) -> Result<Vec<PathBuf>> {
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
