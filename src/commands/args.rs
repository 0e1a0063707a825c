//! What several commands take on the command line, and how it is parsed.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use isoflop::engine::{ENGINES, Engine, Track};
use isoflop::jobs::{ResultsFolder, TrainedTokenizer};
use isoflop::machine::cards::{CARDS, Card};
use isoflop::ops::DeviceName;
use isoflop::sweep::presets::NAMES;

/// What every command takes.
#[derive(Args, Clone, Debug)]
pub struct Common {
    /// Print one JSON document on standard output, everything else on standard error
    #[arg(long, global = true)]
    pub json: bool,
    /// Print results and errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print all there is to say of laws and predictions, in place of one screen
    #[arg(long, global = true)]
    pub full: bool,
    /// Log files that are opened and jobs that start and end; -vv adds each file written
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

/// A sweep file and what is laid over it.
#[derive(Args, Clone)]
pub struct SweepArgs {
    #[arg(help = sweep_help())]
    pub sweep: PathBuf,
    /// Override a setting of the file, as in train.min_steps=100; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub settings: Vec<String>,
    /// The folder in which the sweep's own folder lies
    #[arg(long, default_value = "results", value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// What may stand in the place of a sweep file.
fn sweep_help() -> String {
    format!("The sweep file, or a preset: {}", NAMES.join(", "))
}

/// What computes, and how much of it side by side.
#[derive(Args, Clone)]
pub struct WorkArgs {
    /// Jobs that run side by side, one thread each; by default one per core, or one on a GPU
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl WorkArgs {
    /// Jobs side by side: by default one a core, and one on a GPU, whose memory is not known here.
    pub fn slots(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let default = || if self.device.is_processor() { cores() } else { 1 };
        self.jobs.map_or_else(default, usize::from)
    }
}

/// A sweep's folder.
#[derive(Args)]
pub struct FolderArg {
    /// A sweep's folder
    pub results: PathBuf,
}

/// The folders of several sweeps.
#[derive(Args)]
pub struct FolderArgs {
    /// Sweeps' folders
    #[arg(required = true)]
    results: Vec<PathBuf>,
}

impl FolderArgs {
    /// What is read of each, one after another.
    ///
    /// # Errors
    /// A folder does not exist, or cannot be read.
    pub fn read<T>(&self, read: impl Fn(&ResultsFolder) -> Result<Vec<T>>) -> Result<Vec<T>> {
        let mut all = Vec::new();
        for folder in self.results.iter().map(ResultsFolder::new) {
            if !folder.root().is_dir() {
                bail!("{} does not exist; give a sweep's folder", folder.root().display());
            }
            all.extend(read(&folder)?);
        }
        Ok(all)
    }
}

/// A trained tokenizer, and what it runs on.
#[derive(Args)]
pub struct TokenizerChoice {
    #[command(flatten)]
    place: TokenizerPlace,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    device: DeviceName,
}

/// Which trained tokenizer: one of the two.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct TokenizerPlace {
    /// A run's folder, or a sweep's, whose run with the lowest loss is taken
    #[arg(long, value_name = "RUN")]
    run: Option<PathBuf>,
    /// A tokenizer's own folder: `tokenizers/<id>` of a sweep's
    #[arg(long, value_name = "FOLDER")]
    tokenizer: Option<PathBuf>,
}

impl TokenizerChoice {
    /// Opens it.
    pub fn open(&self) -> Result<TrainedTokenizer> {
        let device = self.device.open()?;
        match (&self.place.run, &self.place.tokenizer) {
            (Some(run), _) => TrainedTokenizer::of_run(run, &device),
            (None, Some(folder)) => TrainedTokenizer::open(folder, &device),
            (None, None) => bail!("give a tokenizer by --run or --tokenizer"),
        }
    }
}

/// The parser of one of several values, each by its name, with what the help says of it.
pub fn one_of<T: Clone + Send + Sync + 'static>(
    choices: impl IntoIterator<Item = (&'static str, &'static str, T)>,
) -> impl TypedValueParser<Value = T> {
    let choices: Vec<(&str, &str, T)> = choices.into_iter().collect();
    let values = choices.iter().map(|(name, about, _)| match *about {
        "" => PossibleValue::new(*name),
        about => PossibleValue::new(*name).help(about),
    });
    PossibleValuesParser::new(values.collect::<Vec<_>>()).map(move |given| {
        let chosen = choices.iter().find(|(name, ..)| *name == given);
        chosen.expect("one of the possible values").2.clone()
    })
}

/// The parser of a device's name.
pub fn device() -> impl TypedValueParser<Value = DeviceName> {
    one_of(DeviceName::ALL.map(|(device, name, about)| (name, about, device)))
}

/// The parser of a card's name.
pub fn a_card() -> impl TypedValueParser<Value = &'static Card> {
    one_of(CARDS.iter().map(|card| (card.name, "", card)))
}

/// The parser of an engine's name.
pub fn an_engine() -> impl TypedValueParser<Value = &'static dyn Engine> {
    one_of(ENGINES.map(|engine| (engine.name(), engine.about(), engine)))
}

/// The parser of a tracker's name.
pub fn a_track() -> impl TypedValueParser<Value = Track> {
    one_of(Track::ALL.map(|(track, about)| (track.name(), about, track)))
}

/// A number that is as it should be; else a sentence on what it is not.
pub fn number(text: &str, is_good: impl Fn(f64) -> bool, what: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite() && is_good(*x));
    number.ok_or_else(|| format!("{text} is not {what}"))
}

/// The parser of a number from 0 on.
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "a number from 0 on")
}

/// A budget in FLOPs, as 1e18 or 1_000.
pub fn budget(text: &str) -> Result<f64, String> {
    number(&text.replace('_', ""), |x| x > 0.0, "a number of FLOPs, as 1e18")
}

/// A share, above 0 and below 1.
pub fn share(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0 && x < 1.0, "a share between 0 and 1, as 0.02")
}
