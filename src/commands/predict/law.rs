//! The laws that a command line names.

use std::path::Path;

use anyhow::{Result, bail};
use isoflop::files::read_if_there;
use isoflop::jobs::ResultsFolder;
use isoflop::laws::{Laws, scamo};

/// Laws at hand that are named where none was chosen.
const MOST_NAMED: usize = 3;

/// The published law, or those of a sweep's folder or of a file.
pub fn laws_named(law: &str) -> Result<Laws> {
    if law == "scamo" { Ok(scamo()) } else { laws_of(Path::new(law)) }
}

/// The laws of a sweep's folder or of a file.
pub fn laws_of(path: &Path) -> Result<Laws> {
    let several = ResultsFolder::new(path).generators();
    if several.is_dir() && !path.join("laws.json").exists() {
        bail!(
            "{} has laws for each of its generators; name the folder of one in {}",
            path.display(),
            several.display()
        );
    }
    not_of_groups(path)?;
    let path = if path.is_dir() { path.join("laws.json") } else { path.to_path_buf() };
    match read_if_there(&path)? {
        Some(laws) => Ok(laws),
        None => bail!(
            "{} does not exist; laws are those of a sweep's folder, a laws.json or scamo",
            path.display()
        ),
    }
}

/// Refuses a folder of laws alone, as `isoflop fit TABLE --by COLUMN --out FOLDER` writes it.
pub fn not_of_groups(folder: &Path) -> Result<()> {
    let of_sweep = ["sweep.yaml", "runs.parquet", "runs.csv", "laws.json", "generators"];
    if of_sweep.iter().any(|name| folder.join(name).exists()) {
        return Ok(());
    }
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let laws = files.filter(|path| path.extension().is_some_and(|end| end == "json"));
    match laws.min() {
        Some(one) => {
            bail!("{} holds laws of groups: name one, as {}", folder.display(), one.display())
        }
        None => Ok(()),
    }
}

/// The error where no law is named: the choices, with the laws that lie where the program was started.
pub(super) fn missing() -> anyhow::Error {
    let found = at_hand();
    let here = match &found[..] {
        [] => String::new(),
        all => format!("; here: --law {}", all.join(", --law ")),
    };
    anyhow::anyhow!(
        "no law to predict by: give --law results/NAME for a sweep's, --law FILE for one that \
         isoflop fit saved by --out, or --law scamo for the published one{here}"
    )
}

/// Where laws lie below the working directory, sorted: sweeps in `results`, and `laws.json`.
fn at_hand() -> Vec<String> {
    let entries = std::fs::read_dir("results").into_iter().flatten().flatten();
    let folders = entries.map(|entry| entry.path()).filter(|path| path.join("laws.json").exists());
    let mut found: Vec<String> = folders.map(|path| path.display().to_string()).collect();
    found.sort();
    found.extend(Path::new("laws.json").exists().then(|| "laws.json".to_string()));
    found.truncate(MOST_NAMED);
    found
}
