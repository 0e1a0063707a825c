//! `finished.json`: what `isoflop run` made of its records, so that it is not made again.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::record::RunRecord;
use isoflop::spec::content_id;
use isoflop::sweep::Sweep;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::output::Output;

const FILES: [&str; 4] = ["runs.parquet", "runs.csv", "laws.json", "prediction.json"];

/// What `run` said when it last made something of its records, and what it wrote.
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
    /// Notes what was just said and written.
    pub fn write(
        folder: &ResultsFolder,
        stamp: String,
        document: Value,
        [text, full]: [String; 2],
        warnings: Vec<String>,
    ) -> Result<Self> {
        let files = digests(folder)?;
        let finished = Self { stamp, files, document, text, full, warnings };
        atomic::write_json(&folder.file("finished.json"), &finished)?;
        Ok(finished)
    }

    /// What was said of the same records, with its warnings; `None` where anything has changed
    /// since: the records, the sweep, or a file that was written.
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

/// Changes whenever something else would be said or written.
pub fn stamp(sweep: &Sweep, folder: &ResultsFolder, records: &[RunRecord]) -> String {
    content_id(&(records, sweep, folder.root(), env!("ISOFLOP_GIT_REVISION")))
}

/// Digests of the tables, the laws, the prediction and every figure that is there.
fn digests(folder: &ResultsFolder) -> Result<BTreeMap<String, String>> {
    let mut names: Vec<String> = FILES.map(String::from).to_vec();
    if let Ok(figures) = std::fs::read_dir(folder.file("figures")) {
        for figure in figures {
            names.push(format!("figures/{}", figure?.file_name().to_string_lossy()));
        }
    }
    let digest = |path: &Path| std::fs::read(path).ok().map(|bytes| blake3::hash(&bytes).to_hex());
    let found = |name: String| Some((name.clone(), digest(&folder.file(&name))?.to_string()));
    Ok(names.into_iter().filter_map(found).collect())
}
