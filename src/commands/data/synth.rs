//! `isoflop data synth`: the built-in procedural motion as a data set.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use isoflop::data::import::write_procedural;
use isoflop::data::{Procedural, ProceduralOptions};
use serde_json::json;

use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
pub struct SynthArgs {
    /// The data set to write
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// Clips to train on
    #[arg(long, default_value_t = 1024)]
    clips: usize,
    /// Clips to validate on
    #[arg(long, default_value_t = 64)]
    val_clips: usize,
    /// Clips to test on
    #[arg(long, default_value_t = 128)]
    test_clips: usize,
    /// Another seed gives other clips throughout
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Replace a data set that was made so
    #[arg(long)]
    overwrite: bool,
}

pub fn synth(args: &SynthArgs, output: &Output) -> Result<Exit> {
    let SynthArgs { seed, clips: train_clips, val_clips, test_clips, .. } = *args;
    let options = ProceduralOptions { seed, train_clips, val_clips, test_clips };
    let written = write_procedural(&Procedural::new(options), &args.out, args.overwrite)?;
    written.problems.iter().for_each(|problem| output.warn(problem));
    let [train, val, test] = written.splits;
    let text = format!(
        "{}: {}, {} and {} clips to train, validate and test on",
        args.out.display(),
        train.clips,
        val.clips,
        test.clips
    );
    output.result(&json!({ "data": args.out, "train": train, "val": val, "test": test }), &text)
}
