//! The runs of a sweep with several generators, kept apart.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use isoflop::figures::{GeneratorRuns, draw_generators};
use isoflop::jobs::ResultsFolder;
use isoflop::record::RunRecord;
use isoflop::sweep::Sweep;

/// The runs of each generator, by its name.
pub fn parted(records: &[RunRecord]) -> BTreeMap<String, Vec<RunRecord>> {
    let mut parted: BTreeMap<String, Vec<RunRecord>> = BTreeMap::new();
    for record in records {
        let generator = record.planned.generator.clone().unwrap_or_default();
        parted.entry(generator).or_default().push(record.clone());
    }
    parted
}

/// Refuses runs of several generators: a law of all of them would say nothing of any.
pub fn of_one(folder: &ResultsFolder, records: &[RunRecord]) -> Result<()> {
    let parted = parted(records);
    if let ([first, _, ..], root) = (&parted.keys().collect::<Vec<_>>()[..], folder.root()) {
        bail!(
            "{} has runs of several generators, each with laws of its own; name the folder of one, as {}",
            root.display(),
            folder.of_generator(first).root().display()
        );
    }
    Ok(())
}

/// The sweep's folder of the folder of one of its generators; any other folder itself.
pub fn home(folder: &ResultsFolder) -> ResultsFolder {
    let above = folder.root().parent().filter(|above| above.ends_with("generators"));
    let home = above.and_then(Path::parent).filter(|home| home.join("sweep.yaml").is_file());
    ResultsFolder::new(home.unwrap_or(folder.root()))
}

/// The best runs of each generator side by side; gives the paths.
pub fn draw(
    sweep: &Sweep,
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
) -> Result<[PathBuf; 2]> {
    let runs: Vec<GeneratorRuns> =
        by_generator.iter().map(|(name, records)| GeneratorRuns { name, records }).collect();
    Ok(draw_generators(&sweep.name, &runs, sweep.flops.rule, &folder.file("figures"))?)
}
