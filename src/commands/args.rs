//! Command-line arguments that several commands share, and their parsers.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use isoflop::jobs::ResultsFolder;
use isoflop::machine::{CARDS, Card};

/// The options of every command.
#[derive(Args, Clone, Debug)]
pub struct Common {
    /// Print one JSON document on standard output, everything else on standard error
    #[arg(long, global = true)]
    pub json: bool,
    /// Print results and errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print laws and predictions in full, in place of one screen
    #[arg(long, global = true)]
    pub full: bool,
    /// Log each file opened and each job's start and end; -vv adds each file written
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
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
    /// Reads each folder in turn.
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

/// The parser of one of several named values, each with its help.
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

/// The parser of a card's name.
pub fn a_card() -> impl TypedValueParser<Value = &'static Card> {
    one_of(CARDS.iter().map(|card| (card.name, "", card)))
}

/// A number that meets a condition; else a sentence that names the condition.
pub fn number(text: &str, is_good: impl Fn(f64) -> bool, what: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite() && is_good(*x));
    number.ok_or_else(|| format!("{text} is not {what}"))
}

/// The parser of a number from 0 on.
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "a number from 0 on")
}

/// A budget in FLOPs, e.g. 1e18 or 1_000.
pub fn budget(text: &str) -> Result<f64, String> {
    number(&text.replace('_', ""), |x| x > 0.0, "a number of FLOPs, e.g. 1e18")
}

/// A fraction, above 0 and below 1.
pub fn share(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0 && x < 1.0, "a fraction between 0 and 1, e.g. 0.02")
}
