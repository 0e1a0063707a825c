//! Splits the runs of a sweep by generator: each generator has its own folder.

use super::prelude::*;
use isoflop::figures::{self, Format, GeneratorRuns, draw_alone};
use std::collections::BTreeSet;

/// The runs of each generator, by its name.
pub fn parted(records: &[RunRecord]) -> BTreeMap<String, Vec<RunRecord>> {
    let mut parted: BTreeMap<String, Vec<RunRecord>> = BTreeMap::new();
    for record in records {
        let generator = record.planned.generator.clone().unwrap_or_default();
        parted.entry(generator).or_default().push(record.clone());
    }
    parted
}

/// Refuses runs of several generators: one law for all of them would be meaningless.
pub fn of_one(folder: &ResultsFolder, records: &[RunRecord]) -> Result<()> {
    let names: BTreeSet<&str> = records
        .iter()
        .map(|record| record.planned.generator.as_deref().unwrap_or_default())
        .collect();
    if let (Some(first), 2..) = (names.first(), names.len()) {
        bail!(
            "{} has runs of several generators, each with its own laws; name the folder of one, e.g. {}",
            folder.root().display(),
            folder.of_generator(first).root().display()
        );
    }
    Ok(())
}

/// The sweep's folder, given the folder of one of its generators; any other folder unchanged.
pub fn home(folder: &ResultsFolder) -> ResultsFolder {
    let above = folder.root().parent().filter(|above| above.ends_with("generators"));
    let home = above.and_then(Path::parent).filter(|home| home.join("sweep.yaml").is_file());
    ResultsFolder::new(home.unwrap_or(folder.root()))
}

/// The sweep that filled a folder; for the folder of one generator, the sweep of that generator alone.
pub fn sweep_of(folder: &ResultsFolder) -> Result<Sweep> {
    let home = home(folder);
    let file = home.file("sweep.yaml");
    if !file.exists() {
        let folder = folder.root().display();
        bail!("{folder} has no sweep.yaml; give the folder of a sweep");
    }
    let mut sweep = home.sweep()?;
    if home.root() != folder.root() {
        let own = folder.name();
        sweep.name = format!("{} {own}", sweep.name);
        sweep.generator.0.retain(|kind| kind.name() == own);
    }
    Ok(sweep)
}

/// The best runs of each generator side by side; gives the paths.
pub fn draw(
    sweep: &Sweep,
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
    formats: &[Format],
) -> Result<Vec<PathBuf>> {
    let runs: Vec<GeneratorRuns> =
        by_generator.iter().map(|(name, records)| GeneratorRuns { name, records }).collect();
    let drawing = figures::generators(&sweep.name, &runs, sweep.flops.rule);
    Ok(draw_alone("generators", drawing, &folder.file("figures"), formats)?)
}
