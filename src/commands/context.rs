//! What several commands begin with: the sweep, its data, its plan and its folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use isoflop::data::{self, DataFacts, MotionSource};
use isoflop::jobs::ResultsFolder;
use isoflop::plan::{Plan, demand};
use isoflop::spec::FlopsRule;
use isoflop::spec::{Clips, DataSource, Origin};
use isoflop::sweep::{self, Sweep};
use isoflop::text::{self, TextEncoder};

use super::exit::SweepArgs;

/// A sweep and its plan over its data.
#[derive(Clone)]
pub struct OpenSweep {
    /// As resolved, where the data are opened to be used: `clips: auto` is a number here, and the source of a
    /// union is named.
    pub sweep: Sweep,
    pub plan: Plan,
    pub folder: ResultsFolder,
}

/// Reads a sweep file and names its folder.
pub fn read_sweep(args: &SweepArgs) -> Result<(Sweep, ResultsFolder)> {
    let sweep = sweep::read(&args.sweep, &args.settings)?;
    let folder = ResultsFolder::new(args.out.join(&sweep.name));
    Ok((sweep, folder))
}

/// Reads a sweep file, opens its data and plans it.
pub fn open_sweep(args: &SweepArgs) -> Result<OpenSweep> {
    let (mut sweep, folder) = read_sweep(args)?;
    let source = data::open(&sweep.data, demand(&sweep).as_ref()).context("opening the data")?;
    match sweep.data.origin() {
        Origin::Procedural => {
            sweep.data.clips = Clips::Count(source.n_clips(data::Split::Train));
        }
        Origin::Union(_) => sweep.data.source = DataSource::HumanMl3d,
        _ => {}
    }
    let clips = data::Split::ALL.map(|split| source.n_clips(split));
    tracing::info!(?clips, digest = source.digest(), "data opened");
    let encoder = text::encoder(&sweep.text).context("opening the vectors of captions")?;
    let mut facts = with_text(DataFacts::of(&*source), &sweep, &*source, &*encoder);
    facts.trainer_inputs = trainer_inputs(&sweep)?;
    let plan = Plan::new(&sweep, facts);
    Ok(OpenSweep { sweep, plan, folder })
}

/// The plan of a sweep whose data, or vectors of captions, may not be here: then ids are
/// provisional, and it says so.
pub fn plan_sweep(args: &SweepArgs) -> Result<OpenSweep> {
    let (sweep, folder) = read_sweep(args)?;
    let source = data::open(&sweep.data, demand(&sweep).as_ref());
    let mut facts = match &source {
        Ok(source) => DataFacts::of(&**source),
        Err(error) => DataFacts::absent(format!("the data could not be opened: {error}")),
    };
    match (text::encoder(&sweep.text), &source) {
        (Ok(encoder), Ok(source)) => facts = with_text(facts, &sweep, &**source, &*encoder),
        (Ok(encoder), Err(_)) => facts.embeddings = encoder.digest(),
        (Err(error), _) => {
            facts.embeddings = Some("absent".to_string());
            facts.warnings.push(format!(
                "the vectors of captions could not be opened: {error}; ids are provisional"
            ));
        }
    }
    match trainer_inputs(&sweep) {
        Ok(digests) => facts.trainer_inputs = digests,
        Err(error) => facts.warnings.push(format!("{error:#}; ids are provisional")),
    }
    Ok(OpenSweep { plan: Plan::new(&sweep, facts), sweep, folder })
}

/// Facts with what the captions are to an encoder; the exact count alone asks how long they are.
fn with_text(
    mut facts: DataFacts,
    sweep: &Sweep,
    source: &dyn MotionSource,
    encoder: &dyn TextEncoder,
) -> DataFacts {
    facts.embeddings = encoder.digest();
    if sweep.flops.rule == FlopsRule::Exact {
        facts.look_at_captions(source, |caption| encoder.n_tokens(caption).ok());
    }
    facts
}

/// Digests of the files that a trainer of one's own is made of.
fn trainer_inputs(sweep: &Sweep) -> Result<BTreeMap<String, String>> {
    let inputs = sweep.trainer.iter().flat_map(|trainer| &trainer.inputs);
    let digest = |path: &PathBuf| {
        let bytes = fs::read(path)
            .with_context(|| format!("reading {}, which trainer.inputs names", path.display()))?;
        Ok((path.display().to_string(), blake3::hash(&bytes).to_hex().to_string()))
    };
    inputs.map(digest).collect()
}
