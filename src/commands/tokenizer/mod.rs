//! `isoflop tokenizer`: the tokenizers of a sweep on their own, and several beside one another.

mod codes;
mod guidance;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use isoflop::jobs::JobKind;
use isoflop::tokenizer::{TokenizerMetrics, remarks, table};
use serde_json::json;

use super::exit::{Exit, FolderArgs};

use super::output::Output;
use super::plot;
use super::run::{RunArgs, run_only};
use codes::{CodesArgs, codes};
use guidance::{GuidanceArgs, guidance};

#[derive(Args)]
pub struct TokenizerArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Train the tokenizers of a sweep, and nothing else of it
    Train(RunArgs),
    /// Compare the tokenizers of sweeps with one another and with k-means
    Eval(FolderArgs),
    /// Draw how often the codes of a tokenizer are met, scale by scale, and where they lie
    Codes(CodesArgs),
    /// Measure reconstruction as the detokenizer follows the caption the more
    Guidance(GuidanceArgs),
}

pub fn tokenizer(args: &TokenizerArgs, output: &Output) -> Result<Exit> {
    match &args.what {
        What::Train(args) => train(args, output),
        What::Eval(args) => eval(args, output),
        What::Codes(args) => codes(args, output),
        What::Guidance(args) => guidance(args, output),
    }
}

/// Trains what is missing; then all of the folder's are compared, if any is there.
fn train(args: &RunArgs, output: &Output) -> Result<Exit> {
    run_only(args, JobKind::Tokenizer, output, |open| {
        let tokenizers = plot::tokenizers(&open.folder, output)?;
        if !tokenizers.is_empty() {
            compare(&tokenizers, output)?;
        }
        Ok(())
    })
}

fn eval(args: &FolderArgs, output: &Output) -> Result<Exit> {
    let tokenizers = args.read(|folder| plot::tokenizers(folder, output))?;
    if tokenizers.is_empty() {
        bail!("no tokenizer is trained yet; `isoflop tokenizer train` trains those of a sweep");
    }
    compare(&tokenizers, output)
}

fn compare(tokenizers: &[TokenizerMetrics], output: &Output) -> Result<Exit> {
    let exit = output.result(&json!({ "tokenizers": tokenizers }), &table(tokenizers))?;
    remarks(tokenizers).iter().for_each(|remark| output.warn(remark));
    Ok(exit)
}
