//! [`TrustedEvaluator`]: an evaluator that passes its gates, opened to score motions.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use burn::tensor::Device;

use super::assignment::frozen_sweep;
use super::folder::ResultsFolder;
use crate::data;
use crate::evaluator::{Evaluator, EvaluatorReport, Truth};

/// An evaluator that passes its gates, and the sweep that it was trained for.
pub struct TrustedEvaluator {
    pub id: String,
    /// The sweep's folder.
    pub folder: ResultsFolder,
    pub evaluator: Evaluator,
}

impl TrustedEvaluator {
    /// Opens `…/evaluators/<id>`, or the evaluator of a sweep's folder that has one.
    ///
    /// # Errors
    /// There is none, there are several, it does not pass its gates, or a file is missing or damaged.
    pub fn open(path: &Path, device: &Device) -> Result<Self> {
        let place = place_of(path)?;
        let full = place.canonicalize().with_context(|| format!("finding {}", place.display()))?;
        let id = full.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let root = full.parent().and_then(Path::parent).map(Path::to_path_buf);
        Self::of(&ResultsFolder::new(root.unwrap_or_default()), &id, device)
    }

    /// Opens the evaluator of an id.
    ///
    /// # Errors
    /// It is not trained, does not pass its gates, or a file is missing or damaged.
    pub fn of(folder: &ResultsFolder, id: &str, device: &Device) -> Result<Self> {
        let report = folder.gates(id)?.with_context(|| format!("evaluator {id} is not trained"))?;
        if !report.passes {
            let failed: Vec<&str> = report.failed().map(|verdict| verdict.gate.as_str()).collect();
            bail!("evaluator {id} scores nothing: it fails {}", failed.join(", "));
        }
        let evaluator = Evaluator::load(&folder.evaluator(id), device)
            .with_context(|| format!("opening evaluator {id}"))?;
        Ok(Self { id: id.to_string(), folder: folder.clone(), evaluator })
    }

    /// True clips of the data that it was trained on.
    ///
    /// # Errors
    /// The data cannot be opened, or holds too few clips.
    pub fn truth(&self) -> Result<Truth> {
        let data = frozen_sweep(&self.folder)?.data;
        let source = data::open(&data, None).context("opening the data of the evaluator")?;
        Ok(Truth::load(&self.evaluator, &*source)?)
    }
}

/// The folder of an evaluator that a path names: of several in a sweep's folder, that which the sweep
/// describes.
fn place_of(path: &Path) -> Result<PathBuf> {
    if path.join("gates.json").is_file() {
        return Ok(path.to_path_buf());
    }
    let folder = ResultsFolder::new(path);
    let place = |report: &EvaluatorReport| folder.evaluator(&report.evaluator_id);
    let trained = folder.all_gates(|_| ()).unwrap_or_default();
    match trained.as_slice() {
        [one] => Ok(place(one)),
        [] => bail!(
            "{} has no trained evaluator; `isoflop evaluator train` trains that of a sweep",
            path.display()
        ),
        [first, ..] => match described(&folder)?.as_slice() {
            [one] => Ok(place(one)),
            _ => bail!(
                "{} has {} evaluators; name one, as {}",
                path.display(),
                trained.len(),
                place(first).display()
            ),
        },
    }
}

/// The evaluators that the frozen sweep of a folder describes.
fn described(folder: &ResultsFolder) -> Result<Vec<EvaluatorReport>> {
    let sweep = frozen_sweep(folder)?;
    let section = sweep.evaluator.as_ref();
    Ok(section.map_or(Ok(Vec::new()), |section| folder.gates_of(section, |_| ()))?)
}
