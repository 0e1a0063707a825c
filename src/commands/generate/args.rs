//! The arguments of `isoflop generate`, and the motions that they ask for.

use crate::commands::args::{not_negative, number, share};
use crate::commands::context::device;
use crate::commands::prelude::*;
use crate::commands::tokenize::lines_of;
use isoflop::generator::{Draw, Sampling};
use isoflop::jobs::TrainedRun;
use isoflop::ops::DeviceName;
use std::ops::Range;

#[derive(Args)]
pub struct GenerateArgs {
    /// Captions, one motion each
    #[arg(value_name = "TEXT")]
    pub captions: Vec<String>,
    /// A file with one caption per line, in addition to TEXT
    #[arg(long, value_name = "FILE")]
    pub texts: Option<PathBuf>,
    /// A run's folder, or a sweep's, for its run with the lowest loss
    #[arg(long, value_name = "RUN")]
    pub run: PathBuf,
    /// The folder to write to; by default `samples/<run>` in the sweep's folder
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite motions in the folder
    #[arg(long)]
    pub overwrite: bool,
    /// Motions per caption
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub samples: u16,
    /// The same seed gives the same motions
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Length in seconds, or `auto`: drawn by the length estimator from the caption. By default the model ends the motion,
    /// or the length is `auto`
    #[arg(long, value_name = "S|auto", conflicts_with = "frames", value_parser = seconds)]
    pub seconds: Option<Seconds>,
    /// Length in frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: Option<u32>,
    /// Divisor of the logits; 0 takes the likeliest code
    #[arg(long, value_name = "T", value_parser = not_negative)]
    pub temperature: Option<f64>,
    /// Draw among the likeliest K codes
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub top_k: Option<u32>,
    /// Draw among the likeliest codes whose probabilities sum to this
    #[arg(long, value_name = "P", value_parser = share)]
    pub top_p: Option<f64>,
    /// Strength of classifier-free guidance; `scalewise` raises it to this at its last scale
    #[arg(long, value_name = "S", value_parser = not_negative)]
    pub guidance: Option<f64>,
    /// Strength of caption guidance in decoding, for a tokenizer with language
    #[arg(long, value_name = "S", value_parser = not_negative)]
    pub detokenizer_guidance: Option<f64>,
    /// `masked`: decoding rounds; each keeps the surest codes
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub rounds: Option<u16>,
    /// A motion (.npy or .bvh) to edit: the part given by --anew is generated again
    #[arg(long, value_name = "FILE", requires = "anew")]
    pub edit: Option<PathBuf>,
    /// Seconds of --edit to generate again: `1.5..3`, `..2` or `4..`; may be repeated
    #[arg(long, value_name = "FROM..TO", requires = "edit", value_parser = span)]
    pub anew: Vec<Range<f64>>,
    /// Put the frames of --edit back outside of --anew, in place of their reconstruction
    #[arg(long, requires = "edit")]
    pub paste: bool,
    /// Seconds before and after --anew over which the new part goes over into the rest
    #[arg(long, value_name = "S", requires = "edit", default_value_t = 0.5, value_parser = not_negative)]
    pub fade: f64,
    /// Pin feet that slide to one place on the floor in each contact, by inverse kinematics of the legs
    #[arg(long)]
    pub clean_feet: bool,
    /// Make no files: measure the time per motion, by batch size, with and without guidance
    #[arg(long, conflicts_with_all = ["edit", "out", "texts", "clean_feet"])]
    pub times: bool,
    /// The compute backend
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl GenerateArgs {
    /// All captions in order: from the command line, then from the file.
    pub fn all_captions(&self) -> Result<Vec<String>> {
        let mut captions = self.captions.clone();
        if let Some(path) = &self.texts {
            captions.extend(lines_of(path)?);
        }
        if captions.is_empty() {
            bail!("no caption; give one, as in `isoflop generate \"a person walks\" --run RUN`");
        }
        Ok(captions)
    }

    /// The requested length in frames; `None` for `--seconds auto`.
    pub fn n_frames(&self, fps: f64) -> Option<usize> {
        match self.seconds {
            Some(Seconds::Given(seconds)) => Some((seconds * fps).round().max(1.0) as usize),
            _ => self.frames.map(|frames| frames as usize),
        }
    }

    /// The sampling options over those of the run's sweep, and the guidance of the detokenizer. Guidance that only the
    /// sweep names is left out where the run has none.
    ///
    /// # Errors
    /// The sweep cannot be read.
    pub fn sampling(&self, run: &TrainedRun) -> Result<(Sampling, f64)> {
        let sweep = run.folder.sweep()?.sampling;
        let has_language = run.tokenizer.spec().architecture.language().is_some();
        let of_sweep = |is_taken, guidance| if is_taken { guidance } else { 0.0 };
        let draw = Draw {
            temperature: self.temperature.unwrap_or(sweep.temperature),
            top_k: self.top_k.map(|k| k as usize).or(sweep.top_k),
            top_p: self.top_p.or(sweep.top_p),
        };
        let guidance = of_sweep(run.takes_guidance(), sweep.guidance);
        let rounds = self.rounds.map_or(sweep.rounds, usize::from);
        let sampling = Sampling { draw, guidance: self.guidance.unwrap_or(guidance), rounds };
        let detokenizer = of_sweep(has_language, sweep.detokenizer_guidance);
        Ok((sampling, self.detokenizer_guidance.unwrap_or(detokenizer)))
    }
}

/// What `--seconds` asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seconds {
    /// A length by the length estimator.
    Auto,
    Given(f64),
}

fn seconds(text: &str) -> Result<Seconds, String> {
    match text {
        "auto" => Ok(Seconds::Auto),
        text => number(text, |x| x > 0.0, "a number above 0, or auto").map(Seconds::Given),
    }
}

/// A span of seconds: `1.5..3`, `..2` or `4..`.
pub fn span(text: &str) -> Result<Range<f64>, String> {
    let problem = || format!("{text} is no span of seconds such as 1.5..3, ..2 or 4..");
    let (from, to) = text.split_once("..").ok_or_else(problem)?;
    let end = |text: &str, open: f64| match text.trim() {
        "" => Ok(open),
        text => text.parse().map_err(|_| problem()),
    };
    let (from, to): (f64, f64) = (end(from, 0.0)?, end(to, f64::INFINITY)?);
    if from >= 0.0 && from < to { Ok(from..to) } else { Err(problem()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_may_be_open_at_either_end() {
        assert_eq!(span("1.5..3"), Ok(1.5..3.0));
        assert_eq!(span("..2"), Ok(0.0..2.0));
        assert_eq!(span("4.."), Ok(4.0..f64::INFINITY));
        assert_eq!(span(".."), Ok(0.0..f64::INFINITY));
        for wrong in ["", "3", "3..1", "2..2", "-1..2", "a..b", "nan..2"] {
            assert!(span(wrong).unwrap_err().contains("such as 1.5..3"), "{wrong}");
        }
    }
}
