//! The start of commands that train: a sweep with its data, plan and folder; a device; a trained tokenizer.

use super::args::one_of;
use super::prelude::*;
use clap::builder::TypedValueParser;
use isoflop::data::{self, DataFacts, MotionSource};
use isoflop::engine::{ENGINES, Engine, Track};
use isoflop::evaluator;
use isoflop::files::{ANY, read_regular};
use isoflop::jobs::TrainedTokenizer;
use isoflop::ops::DeviceName;
use isoflop::plan::{Plan, demand};
use isoflop::spec::{Clips, DataSource, EvaluatorSpec, Origin};
use isoflop::sweep;
use isoflop::sweep::presets::NAMES;
use isoflop::text::{self, TextEncoder};

/// A sweep file and its overrides.
#[derive(Args, Clone)]
pub struct SweepArgs {
    #[arg(help = format!("The sweep file, or a preset: {}", NAMES.join(", ")))]
    pub sweep: PathBuf,
    /// Override a setting of the file, e.g. train.min_steps=100; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub settings: Vec<String>,
    /// The parent of the sweep's folder
    #[arg(long, default_value = "results", value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// The device, and the number of parallel jobs.
#[derive(Args, Clone)]
pub struct WorkArgs {
    /// Jobs to run in parallel, one thread each; by default one per core, or one on a GPU
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// The compute backend
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl WorkArgs {
    /// Parallel jobs: by default one per core, and one on a GPU, whose memory is not known here.
    pub fn slots(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let default = || if self.device.is_processor() { cores() } else { 1 };
        self.jobs.map_or_else(default, usize::from)
    }
}

/// A trained tokenizer, and its device.
#[derive(Args)]
pub struct TokenizerChoice {
    #[command(flatten)]
    place: TokenizerPlace,
    /// The compute backend
    #[arg(long, value_parser = device(), default_value = "flex")]
    device: DeviceName,
}

/// The trained tokenizer, by one of two options.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct TokenizerPlace {
    /// A run's folder, or a sweep's, for its run with the lowest loss
    #[arg(long, value_name = "RUN")]
    run: Option<PathBuf>,
    /// A tokenizer's folder: `tokenizers/<id>` in a sweep's folder
    #[arg(long, value_name = "FOLDER")]
    tokenizer: Option<PathBuf>,
}

impl TokenizerChoice {
    /// Opens the tokenizer.
    pub fn open(&self) -> Result<TrainedTokenizer> {
        let device = self.device.open()?;
        match (&self.place.run, &self.place.tokenizer) {
            (Some(run), _) => TrainedTokenizer::of_run(run, &device),
            (None, Some(folder)) => TrainedTokenizer::open(folder, &device),
            (None, None) => bail!("give a tokenizer by --run or --tokenizer"),
        }
    }
}

/// The parser of a device's name.
pub fn device() -> impl TypedValueParser<Value = DeviceName> {
    one_of(DeviceName::ALL.map(|(device, name, about)| (name, about, device)))
}

/// The parser of an engine's name.
pub fn an_engine() -> impl TypedValueParser<Value = &'static dyn Engine> {
    one_of(ENGINES.map(|engine| (engine.name(), engine.about(), engine)))
}

/// The parser of a tracker's name.
pub fn a_track() -> impl TypedValueParser<Value = Track> {
    one_of(Track::ALL.map(|(track, about)| (track.name(), about, track)))
}

/// A sweep and its plan over its data.
#[derive(Clone)]
pub struct OpenSweep {
    /// The resolved sweep, if the data are opened: `clips: auto` is a number here, and the source of a union is
    /// named.
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
    facts.evaluator = loaded_evaluator(&sweep)?;
    let plan = Plan::new(&sweep, facts);
    Ok(OpenSweep { sweep, plan, folder })
}

/// The plan of a sweep whose data, or caption vectors, may be missing: then ids are provisional, and a warning
/// says so.
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
    match loaded_evaluator(&sweep) {
        Ok(spec) => facts.evaluator = spec,
        Err(error) => facts.warnings.push(format!("{error:#}; ids are provisional")),
    }
    Ok(OpenSweep { plan: Plan::new(&sweep, facts), sweep, folder })
}

/// Facts of the captions for an encoder; only the exact count of FLOPs needs their lengths.
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

/// The evaluator in the folder that the sweep names.
fn loaded_evaluator(sweep: &Sweep) -> Result<Option<EvaluatorSpec>> {
    let folder = sweep.evaluator.as_ref().and_then(|section| section.weights.as_deref());
    Ok(folder.map(evaluator::spec_of).transpose()?)
}

/// Digests of the files of a user's trainer.
fn trainer_inputs(sweep: &Sweep) -> Result<BTreeMap<String, String>> {
    let inputs = sweep.trainer.iter().flat_map(|trainer| &trainer.inputs);
    let digest = |path: &PathBuf| {
        let bytes = read_regular(path, ANY)
            .with_context(|| format!("reading {}, which trainer.inputs names", path.display()))?;
        Ok((path.display().to_string(), blake3::hash(&bytes).to_hex().to_string()))
    };
    inputs.map(digest).collect()
}
