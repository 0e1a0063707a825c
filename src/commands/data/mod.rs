//! `isoflop data`: data sets made, checked and counted.

mod check;
mod import;
mod stats;
mod synth;

use anyhow::Result;
use clap::{Args, Subcommand};

use super::exit::Exit;
use super::output::Output;

#[derive(Args)]
pub struct DataArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Make a data set of BVH files or joints: retarget, resample, cut, caption, split
    Import(import::ImportArgs),
    /// Look at every file of a data set and tell all that is wrong
    Check(check::CheckArgs),
    /// Count a data set: clips, hours, tokens, captions, words
    Stats(stats::StatsArgs),
    /// Write the built-in procedural motion as a data set
    Synth(synth::SynthArgs),
}

pub fn data(args: &DataArgs, output: &Output) -> Result<Exit> {
    match &args.what {
        What::Import(args) => import::import(args, output),
        What::Check(args) => check::check(args, output),
        What::Stats(args) => stats::stats(args, output),
        What::Synth(args) => synth::synth(args, output),
    }
}
