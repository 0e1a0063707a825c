//! `isoflop tokenizer guidance`: reconstruction as the detokenizer follows the caption the more (LG-Tok,
//! Fig. 5).

use anyhow::{Result, bail};
use clap::Args;
use isoflop::data::Split;
use isoflop::spec::LanguageSpec;
use isoflop::tokenizer::Reconstruction;
use serde_json::json;

use crate::commands::exit::{Exit, TokenizerChoice, not_negative, table};

use crate::commands::output::Output;

#[derive(Args)]
pub struct GuidanceArgs {
    #[command(flatten)]
    tokenizer: TokenizerChoice,
    /// Strengths of language-free guidance
    #[arg(long, value_name = "STRENGTHS", value_delimiter = ',', value_parser = not_negative,
          default_value = "0,0.5,1,2,4")]
    at: Vec<f64>,
}

pub fn guidance(args: &GuidanceArgs, output: &Output) -> Result<Exit> {
    let trained = args.tokenizer.open()?;
    let language = trained.tokenizer.spec().architecture.language();
    if !language.is_some_and(|language| LanguageSpec::places(language)[1]) {
        bail!("the detokenizer reads no captions: there is nothing that guidance could follow");
    }
    let found = trained.reconstruct(Split::Test, &args.at)?;
    let row = |(at, made): (&f64, &Reconstruction)| json!({ "guidance": at, "made": made });
    let rows: Vec<_> = args.at.iter().zip(&found).map(row).collect();
    let document = json!({ "tokenizer": trained.id, "guidances": rows });
    output.result(&document, &text(&trained.id, &args.at, &found))
}

/// A line a strength.
fn text(id: &str, at: &[f64], found: &[Reconstruction]) -> String {
    let row = |(guidance, made): (&f64, &Reconstruction)| {
        let Reconstruction { mpjpe_mm: own, mpjpe_heading_mm: given, reconstruction_l1: l1 } = made;
        [guidance.to_string(), format!("{own:.1}"), format!("{given:.1}"), format!("{l1:.4}")]
    };
    let rows = table(["guidance", "MPJPE, mm: own", "given", "L1"], at.iter().zip(found).map(row));
    format!(
        "reconstruction of the test split by tokenizer {id}\n\n{rows}\
         MPJPE by the tokenizer's own heading and by the true one; L1 of normalised features"
    )
}
