//! The runs of a sweep with several generators, kept apart.

use anyhow::{Context, Result, bail};
use isoflop::figures::{self, Format, GeneratorRuns, draw_alone};
use isoflop::jobs::ResultsFolder;
use isoflop::predict::Codebook;
use isoflop::record::RunRecord;
use isoflop::spec::CodebookKind;
use isoflop::sweep::{self, LevelsSpec, ModelEntry, Sweep, VocabSpec, models, shape};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

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
    let names: BTreeSet<&str> = records
        .iter()
        .map(|record| record.planned.generator.as_deref().unwrap_or_default())
        .collect();
    if let (Some(first), 2..) = (names.first(), names.len()) {
        bail!(
            "{} has runs of several generators, each with laws of its own; name the folder of one, as {}",
            folder.root().display(),
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

/// The sweep that filled a folder; of the folder of one of its generators, the sweep of that one alone.
pub fn sweep_of(folder: &ResultsFolder) -> Result<Sweep> {
    let home = home(folder);
    let file = home.file("sweep.yaml");
    if !file.exists() {
        let folder = folder.root().display();
        bail!("{folder} has no sweep.yaml; give the folder of a sweep");
    }
    let mut sweep = sweep::read(&file, &[])?;
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

// Models and vocabularies that can be built, as near as may be to sizes that a law asks for.

/// Widths beyond which no model is looked for.
const WIDEST: usize = 1 << 15;

/// Each value once, in the order of its first.
pub fn distinct<T: PartialEq>(values: Vec<T>) -> Vec<T> {
    values.into_iter().fold(Vec::new(), |mut kept, value| {
        if !kept.contains(&value) {
            kept.push(value);
        }
        kept
    })
}

/// V codes in all codebooks together, as near as the sweep's quantizer has them.
pub fn codes(n_vocab: f64, sweep: &Sweep) -> VocabSpec {
    let quantizer = sweep.tokenizer.quantizer();
    let n_vocab = n_vocab / quantizer.n_codebooks() as f64;
    match quantizer.codebook_kind() {
        CodebookKind::Fsq if sweep.has_tokenizers() => {
            let levels = Codebook::near(n_vocab).levels;
            VocabSpec::Levels(LevelsSpec { levels: levels.iter().map(|l| *l as usize).collect() })
        }
        _ => VocabSpec::Size(n_vocab.round().max(2.0) as usize),
    }
}

/// The model of the sweep's family whose N_nv is nearest: depth and heads are those of the nearest
/// model tried, the width follows.
pub fn model(sweep: &Sweep, params_nonvocab: f64) -> Result<ModelEntry> {
    let off = |entry: &ModelEntry| (nonvocab(sweep, entry) / params_nonvocab).ln().abs();
    let nearer = |a: &ModelEntry, b: &ModelEntry| off(a).total_cmp(&off(b));
    let tried = models(&sweep.grid.models);
    let nearest = tried.iter().min_by(|a, b| nearer(a, b)).context("the sweep has no models")?;
    // The rotary positions want an even width of a head.
    let step = 2 * nearest.n_head;
    let of_width = |d_model| ModelEntry { d_model, d_ff: None, ..nearest.clone() };
    let widths = (step..WIDEST).step_by(step).map(of_width);
    widths.min_by(|a, b| nearer(a, b)).context("no width that can be built")
}

/// N_nv of a model, which does not depend on its vocabulary.
pub fn nonvocab(sweep: &Sweep, entry: &ModelEntry) -> f64 {
    shape(entry, &sweep.model, &sweep.text).params_of(1).nonvocab as f64
}
