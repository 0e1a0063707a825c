//! What `isoflop evaluate` takes.

use std::path::PathBuf;

use clap::Args;
use isoflop::ops::DeviceName;
use isoflop::spec::ScoresSpec;

use crate::commands::exit::{device, not_negative, share};

#[derive(Args)]
pub struct EvaluateArgs {
    /// Motions: .npy of features, T × 263, or of joints, T × 22 × 3; .bvh with the 22 joints; or folders
    /// of such, as `isoflop generate` makes them
    #[arg(value_name = "FILE", required_unless_present = "run", conflicts_with = "run")]
    pub motions: Vec<PathBuf>,
    /// A run's folder, or a sweep's, whose run with the lowest loss is taken: its motions are made and
    /// scored
    #[arg(long, value_name = "RUN")]
    pub run: Option<PathBuf>,
    /// An evaluator's folder, `evaluators/<id>`, or a sweep's that has one; by default that of the run
    #[arg(long, value_name = "FOLDER", required_unless_present = "run")]
    pub evaluator: Option<PathBuf>,
    /// A file with a caption a line, in the order of the motions; by default those of `motions.json` or
    /// of a .txt beside each
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    pub texts: Option<PathBuf>,
    /// How often motions are made; of files, how often pools and pairs are drawn
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..))]
    pub repeats: u16,
    /// How far motions are moved away from those without text; `autoregressive` knows no guidance
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = not_negative, requires = "run")]
    pub guidance: f64,
    /// How far a tokenizer with language follows the caption when it decodes
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = not_negative, requires = "run")]
    pub detokenizer_guidance: f64,
    /// What logits are divided by; 0 takes the likeliest code
    #[arg(long, value_name = "T", default_value_t = 1.0, value_parser = not_negative, requires = "run")]
    pub temperature: f64,
    /// Draw among the likeliest codes that together hold this share
    #[arg(long, value_name = "P", value_parser = share, requires = "run")]
    pub top_p: Option<f64>,
    /// Leave MultiModality out, which takes as many motions as six repeats
    #[arg(long, requires = "run")]
    pub no_multimodality: bool,
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0,
        help = "The same seed gives the same scores"
    )]
    pub seed: u64,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl EvaluateArgs {
    /// How a run's motions are made and scored.
    pub fn spec(&self) -> ScoresSpec {
        let default = ScoresSpec::default();
        let captions = if self.no_multimodality { 0 } else { default.multimodal_captions };
        ScoresSpec {
            repeats: usize::from(self.repeats),
            guidance: self.guidance,
            detokenizer_guidance: self.detokenizer_guidance,
            temperature: self.temperature,
            top_p: self.top_p,
            multimodal_captions: captions,
            seed: self.seed,
            ..default
        }
    }
}
