//! What `isoflop detokenize` takes.

use std::path::PathBuf;

use clap::Args;

use crate::commands::args::{TokenizerChoice, not_negative};

#[derive(Args)]
pub struct DetokenizeArgs {
    /// Codes that `isoflop tokenize` wrote
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub tokenizer: TokenizerChoice,
    /// The original of a single file, or a folder that holds originals under their names; by default
    /// the codes' own folder
    #[arg(long, value_name = "PATH")]
    pub truth: Option<PathBuf>,
    /// How far a tokenizer with language follows the caption
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = not_negative)]
    pub detokenizer_guidance: f64,
    /// The folder to write to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write over motions that the folder holds
    #[arg(long)]
    pub overwrite: bool,
}
