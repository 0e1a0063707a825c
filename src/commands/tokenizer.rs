//! `isoflop tokenizer`: trains and compares tokenizers, draws the use of codes, and measures guidance of the
//! detokenizer (LG-Tok, Fig. 5).

use super::args::{FolderArgs, not_negative};
use super::context::TokenizerChoice;
use super::plot;
use super::prelude::*;
use super::run::{RunArgs, run_only};
use clap::Subcommand;
use isoflop::codes::{
    CodeMap, Continuity, MOVEMENT, ScaleUse, TokenizerMetrics, percent, remarks, table as compared,
    two_decimals,
};
use isoflop::data::Split;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::jobs::JobKind;
use isoflop::spec::LanguageSpec;
use isoflop::tokenizer::Reconstruction;

/// Scales that are listed, at most.
const LISTED: usize = 16;

#[derive(Args)]
pub struct TokenizerArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Train only the tokenizers of a sweep
    Train(RunArgs),
    /// Compare the tokenizers of sweeps with one another and with k-means
    Eval(FolderArgs),
    /// Draw how often each code of a tokenizer is used, by scale, and where the codes lie
    Codes(TokenizerChoice),
    /// Measure reconstruction at several strengths of caption guidance
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

/// Trains missing tokenizers, then compares all tokenizers of the folder.
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
    let exit = output.result(&json!({ "tokenizers": tokenizers }), &compared(tokenizers))?;
    remarks(tokenizers).iter().for_each(|remark| output.warn(remark));
    Ok(exit)
}

fn codes(tokenizer: &TokenizerChoice, output: &Output) -> Result<Exit> {
    let trained = tokenizer.open()?;
    let map = CodeMap::of(&trained.tokenizer, &trained.tokens()?, Split::Test);
    let scales: Vec<ScaleUse> = map.scales.iter().map(|scale| ScaleUse::of(&scale.met)).collect();
    let name = format!("codes-{}", trained.id);
    let title = format!("{}: codes of tokenizer {}", trained.folder.name(), trained.id);
    let folder = trained.folder.file("figures");
    let paths = draw_alone(&name, figures::codes(&title, &map), &folder, &Format::ALL)?;
    let document = json!({
        "tokenizer": trained.id, "scales": scales, "explained": map.explained, "figures": paths,
    });
    output.result(&document, &codes_text(&trained.id, &scales, &paths[0].display().to_string()))
}

/// One line per scale.
fn codes_text(id: &str, scales: &[ScaleUse], figure: &str) -> String {
    let row = |(i, own): (usize, &ScaleUse)| {
        let ScaleUse { n_vocab, utilisation, exponential_entropy } = own;
        let used = format!("{:.1}", 100.0 * utilisation);
        [(i + 1).to_string(), n_vocab.to_string(), used, format!("{exponential_entropy:.1}")]
    };
    let rows = scales.iter().enumerate().take(LISTED).map(row);
    let rows = table(["scale", "codes", "in use, %", "effective"], rows);
    let unsaid = more(scales.len(), LISTED, "");
    format!("codes of tokenizer {id} on the test split\n\n{rows}{unsaid}\nfigure    {figure}")
}

#[derive(Args)]
struct GuidanceArgs {
    #[command(flatten)]
    tokenizer: TokenizerChoice,
    /// Strengths of language-free guidance
    #[arg(long, value_name = "STRENGTHS", value_delimiter = ',', value_parser = not_negative,
          default_value = "0,0.5,1,2,4")]
    at: Vec<f64>,
}

fn guidance(args: &GuidanceArgs, output: &Output) -> Result<Exit> {
    let trained = args.tokenizer.open()?;
    let language = trained.tokenizer.spec().architecture.language();
    if !language.is_some_and(|language| LanguageSpec::places(language)[1]) {
        bail!("the detokenizer reads no captions: there is nothing that guidance could follow");
    }
    let found = trained.reconstruct(Split::Test, &args.at)?;
    let row = |(at, made): (&f64, &Reconstruction)| json!({ "guidance": at, "made": made });
    let rows: Vec<_> = args.at.iter().zip(&found).map(row).collect();
    let document = json!({ "tokenizer": trained.id, "guidances": rows });
    output.result(&document, &guidance_text(&trained.id, &args.at, &found))
}

/// One line per strength.
fn guidance_text(id: &str, at: &[f64], found: &[Reconstruction]) -> String {
    let row = |(guidance, made): (&f64, &Reconstruction)| {
        let Reconstruction {
            mpjpe_mm: own, mpjpe_heading_mm: given, reconstruction_l1: l1, ..
        } = made;
        let Continuity { boundary_step_ratio, jerk_ratio, root_end_error, .. } = made.continuity;
        let [across, jerk] = [boundary_step_ratio, jerk_ratio].map(two_decimals);
        let [own, given] = [own, given].map(|mm| format!("{mm:.1}"));
        [
            guidance.to_string(),
            own,
            given,
            format!("{l1:.4}"),
            across,
            jerk,
            percent(root_end_error),
        ]
    };
    let head = ["guidance", "MPJPE, mm: own", "given", "L1", "boundary", "jerk", "root at end, %"];
    let rows = table(head, at.iter().zip(found).map(row));
    format!(
        "reconstruction of the test split by tokenizer {id}\n\n{rows}\
         MPJPE by the tokenizer's own heading and by the true one; L1 of normalised\n\
         features\n{MOVEMENT}"
    )
}
