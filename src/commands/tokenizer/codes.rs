//! `isoflop tokenizer codes`: how often the codes of a tokenizer are met, and where they lie.

use anyhow::Result;
use clap::Args;
use isoflop::data::Split;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::tokenizer::{CodeMap, ScaleUse};
use serde_json::json;

use crate::commands::exit::{Exit, TokenizerChoice, more, table};

use crate::commands::output::Output;

/// Scales that are listed, at most.
const LISTED: usize = 16;

#[derive(Args)]
pub struct CodesArgs {
    #[command(flatten)]
    tokenizer: TokenizerChoice,
}

pub fn codes(args: &CodesArgs, output: &Output) -> Result<Exit> {
    let trained = args.tokenizer.open()?;
    let map = CodeMap::of(&trained.tokenizer, &trained.tokens()?, Split::Test);
    let scales: Vec<ScaleUse> = map.scales.iter().map(|scale| ScaleUse::of(&scale.met)).collect();
    let name = format!("codes-{}", trained.id);
    let title = format!("{}: codes of tokenizer {}", trained.folder.name(), trained.id);
    let folder = trained.folder.file("figures");
    let paths = draw_alone(&name, figures::codes(&title, &map), &folder, &Format::ALL)?;
    let document = json!({
        "tokenizer": trained.id, "scales": scales, "explained": map.explained, "figures": paths,
    });
    output.result(&document, &text(&trained.id, &scales, &paths[0].display().to_string()))
}

/// A line a scale.
fn text(id: &str, scales: &[ScaleUse], figure: &str) -> String {
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
