//! What several commands take on the command line, and how it is parsed.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use isoflop::engine::{ENGINES, Engine, Track, engine};
use isoflop::jobs::TrainedTokenizer;
use isoflop::machine::cards::{self, CARDS, Card};
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
    /// Jobs that run side by side, one thread each; by default one per core, or one on a GPU
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl SweepArgs {
    /// Jobs side by side: by default one a core, and one on a GPU, whose memory is not known here.
    pub fn slots(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let default = || if self.device.is_processor() { cores() } else { 1 };
        self.jobs.map_or_else(default, usize::from)
    }
}

/// What may stand in the place of a sweep file.
fn sweep_help() -> String {
    format!("The sweep file, or a preset: {}", NAMES.join(", "))
}

/// Which trained tokenizer: one of the two.
#[derive(Args)]
#[group(required = true, multiple = false)]
pub struct TokenizerPlace {
    /// A run's folder, or a sweep's, whose run with the lowest loss is taken
    #[arg(long, value_name = "RUN")]
    pub run: Option<PathBuf>,
    /// A tokenizer's own folder: `tokenizers/<id>` of a sweep's
    #[arg(long, value_name = "FOLDER")]
    pub tokenizer: Option<PathBuf>,
}

impl TokenizerPlace {
    /// Opens it.
    pub fn open(&self, device: DeviceName) -> Result<TrainedTokenizer> {
        let device = device.open()?;
        match (&self.run, &self.tokenizer) {
            (Some(run), _) => TrainedTokenizer::of_run(run, &device),
            (None, Some(folder)) => TrainedTokenizer::open(folder, &device),
            (None, None) => bail!("give a tokenizer by --run or --tokenizer"),
        }
    }
}

/// The parser of a number from 0 on.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 && x.is_finite() => Ok(x),
        _ => Err(format!("{text} is not a number from 0 on")),
    }
}

/// The parser of a device's name.
pub fn device() -> impl TypedValueParser<Value = DeviceName> {
    let names = DeviceName::ALL.map(|(_, name, about)| PossibleValue::new(name).help(about));
    PossibleValuesParser::new(names).map(|name| name.parse().expect("one of the possible values"))
}

/// The parser of a card's name.
pub fn a_card() -> impl TypedValueParser<Value = &'static Card> {
    let names = CARDS.each_ref().map(|card| card.name);
    PossibleValuesParser::new(names)
        .map(|name| cards::find(&name).expect("one of the possible values"))
}

/// The parser of an engine's name.
pub fn an_engine() -> impl TypedValueParser<Value = &'static dyn Engine> {
    let names = ENGINES.map(|engine| PossibleValue::new(engine.name()).help(engine.about()));
    PossibleValuesParser::new(names).map(|name| engine(&name).expect("one of the possible values"))
}

/// The parser of a tracker's name.
pub fn a_track() -> impl TypedValueParser<Value = Track> {
    let names = Track::ALL.map(|(track, about)| PossibleValue::new(track.name()).help(about));
    PossibleValuesParser::new(names).map(|name| {
        let mut all = Track::ALL.into_iter().map(|(track, _)| track);
        all.find(|track| track.name() == name).expect("one of the possible values")
    })
}

/// A budget in FLOPs, as 1e18 or 1_000.
pub fn budget(text: &str) -> Result<f64, String> {
    match text.replace('_', "").parse::<f64>() {
        Ok(budget) if budget > 0.0 && budget.is_finite() => Ok(budget),
        _ => Err(format!("{text} is not a number of FLOPs, as 1e18")),
    }
}

/// A share, above 0 and below 1.
pub fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err(format!("{text} is not a share between 0 and 1, as 0.02")),
    }
}
