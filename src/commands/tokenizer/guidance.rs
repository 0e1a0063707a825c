//! `isoflop tokenizer guidance`: reconstruction as the detokenizer follows the caption the more (LG-Tok,
//! Fig. 5).

use std::fmt::Write;

use anyhow::{Result, bail};
use clap::Args;
use isoflop::data::Split;
use isoflop::ops::DeviceName;
use isoflop::spec::LanguageSpec;
use isoflop::tokenizer::Reconstruction;
use serde_json::json;

use crate::commands::args::{TokenizerPlace, device, not_negative};
use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
pub struct GuidanceArgs {
    #[command(flatten)]
    tokenizer: TokenizerPlace,
    /// Strengths of language-free guidance
    #[arg(long, value_name = "STRENGTHS", value_delimiter = ',', value_parser = not_negative,
          default_value = "0,0.5,1,2,4")]
    at: Vec<f64>,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    device: DeviceName,
}

pub fn guidance(args: &GuidanceArgs, output: &Output) -> Result<Exit> {
    let trained = args.tokenizer.open(args.device)?;
    let language = trained.tokenizer.spec().architecture.language();
    if !language.is_some_and(|language| LanguageSpec::places(language)[1]) {
        bail!("the detokenizer reads no captions: there is nothing that guidance could follow");
    }
    let found = trained.reconstruct(Split::Test, &args.at)?;
    let row = |(at, made): (&f64, &Reconstruction)| json!({ "guidance": at, "made": made });
    let rows: Vec<_> = args.at.iter().zip(&found).map(row).collect();
    let document = json!({ "tokenizer": trained.id, "guidances": rows });
    output.result(&document, &text(&trained.id, &args.at, &found))?;
    Ok(Exit::Done)
}

/// A line a strength.
fn text(id: &str, at: &[f64], found: &[Reconstruction]) -> String {
    let mut text = format!("reconstruction of the test split by tokenizer {id}\n\n");
    let _ = writeln!(text, "{:>10} {:>19} {:>12}", "guidance", "MPJPE, mm: own", "given");
    for (guidance, made) in at.iter().zip(found) {
        let Reconstruction { mpjpe_mm: own, mpjpe_heading_mm: given, reconstruction_l1: l1 } = made;
        let _ = writeln!(text, "{guidance:>10} {own:>19.1} {given:>12.1}   L1 {l1:.4}");
    }
    text + "MPJPE by the tokenizer's own heading and by the true one; L1 of normalised features"
}
