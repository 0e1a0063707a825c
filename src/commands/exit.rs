//! Exit codes, and how an error that ends the program is shown.

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use isoflop::engine::{ENGINES, Engine, Track};
use isoflop::failure::Consequence;
use isoflop::files::failure_kind;
use isoflop::jobs::{ResultsFolder, TrainedTokenizer};
use isoflop::laws::FitError;
use isoflop::machine::{CARDS, Card};
use isoflop::ops::DeviceName;
use isoflop::predict::PredictError;
use isoflop::sweep::SweepErrors;
use isoflop::sweep::presets::NAMES;
use serde_json::json;
use std::array::from_fn;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// What the program tells its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Done = 0,
    SomeRunsFailed = 1,
    Usage = 2,
    NotIdentifiable = 3,
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// Ends the program: with help where it was asked for, or with what is wrong with the command line.
pub fn refuse(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args_os().any(|arg| arg == "--json") {
        let message = error.to_string();
        document(message.trim_start_matches("error: ").trim_end(), Exit::Usage);
    }
    error.exit()
}

/// Shows an error on standard error, and with `--json` as a document on standard output; says how to exit.
pub fn report(error: &anyhow::Error, json: bool) -> Exit {
    let exit = told(error);
    if json {
        let message = match error.downcast_ref::<SweepErrors>() {
            Some(errors) => errors.render(false),
            None => sentence(error),
        };
        document(&message, exit);
    }
    exit
}

/// An error as a document on standard output.
fn document(message: &str, exit: Exit) {
    let document = json!({ "error": { "message": message, "exit": exit as u8 } });
    // Nobody reads a pipe that is closed.
    let _ = writeln!(std::io::stdout(), "{document:#}");
}

/// An error and what caused it, each said once: some messages hold their causes already.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut said = String::new();
    for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
        if said.is_empty() {
            said = cause;
        } else if !said.contains(&cause) {
            said = format!("{said}: {cause}");
        }
    }
    said
}

fn told(error: &anyhow::Error) -> Exit {
    if let Some(errors) = error.downcast_ref::<SweepErrors>() {
        say(&errors.render(is_coloured()));
        return Exit::Usage;
    }
    say(&format!("error: {}", sentence(error)));
    if let Some(kind) = failure_kind(error.as_ref())
        && kind.consequence() == Consequence::StopsAll
    {
        say(&format!("  {}; then the same command goes on", kind.advice().unwrap_or("mend that")));
        return Exit::SomeRunsFailed;
    }
    let unidentifiable = error.downcast_ref::<FitError>().is_some_and(FitError::is_unidentifiable)
        || matches!(error.downcast_ref(), Some(PredictError::NoOptimum { .. }));
    if unidentifiable { Exit::NotIdentifiable } else { Exit::Usage }
}

// Tables, lists and counts as a person reads them.

/// Lines of a table, its columns two blanks apart and as wide as what stands in them: flush left if the head begins
/// with `<`, else flush right. Without any head there is no first line.
pub fn table<const N: usize>(
    heads: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let head = heads.map(|head| head.trim_start_matches('<').to_string());
    let head = head.iter().any(|head| !head.is_empty()).then_some(head);
    let lines: Vec<[String; N]> = head.into_iter().chain(rows).collect();
    let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = from_fn(width);
    let padded = |line: &[String; N]| {
        let cells: [String; N] = from_fn(|i| match heads[i].starts_with('<') {
            true => format!("{:<1$}", line[i], widths[i]),
            false => format!("{:>1$}", line[i], widths[i]),
        });
        cells.join("  ").trim_end().to_string() + "\n"
    };
    lines.iter().map(padded).collect()
}

/// How many of a list of `n` are not shown if `most` are; nothing if all are. `how` says where they can be seen.
pub fn more(n: usize, most: usize, how: &str) -> String {
    if n > most { format!("  and {} more{how}\n", n - most) } else { String::new() }
}

/// `1 motion`, `3 motions`.
pub fn many(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// What is known, as it is shown, or a dash.
pub fn dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_string(), shown)
}

/// The beginning of a line of `most` characters at most.
pub fn clip(line: &str, most: usize) -> String {
    if line.chars().count() <= most {
        return line.to_string();
    }
    line.chars().take(most - 1).chain(['…']).collect()
}

/// A line on standard error; that nobody reads it any more is no error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Whether standard error is a terminal that colours are wanted on.
pub fn is_coloured() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

// What several commands take on the command line, and how it is parsed.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_never_run_together() {
        let rows = [["a", "1", "x"], ["long name", "123456789", ""]];
        let rows = rows.map(|row| row.map(String::from));
        let lines = "name               n  word\na                  1  x\nlong name  123456789\n";
        assert_eq!(table(["<name", "n", "<word"], rows.clone()), lines);
        let bare = lines.split_once('\n').expect("a head").1;
        assert_eq!(table(["<", "", "<"], rows), bare);
    }

    #[test]
    fn what_is_not_shown_is_counted() {
        assert_eq!(more(13, 12, ": --full"), "  and 1 more: --full\n");
        assert_eq!((more(12, 12, ""), clip("walks", 4)), (String::new(), "wal…".to_string()));
        assert_eq!([many(1, "motion"), many(2, "motion")], ["1 motion", "2 motions"]);
    }
}
