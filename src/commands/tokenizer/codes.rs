//! `isoflop tokenizer codes`: how often the codes of a tokenizer are met, and where they lie.

use std::fmt::Write;

use anyhow::Result;
use clap::Args;
use isoflop::data::Split;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::ops::DeviceName;
use isoflop::tokenizer::{CodeMap, ScaleUse};
use serde_json::json;

use crate::commands::args::{TokenizerPlace, device};
use crate::commands::exit::Exit;
use crate::commands::output::Output;

/// Scales that are listed, at most.
const LISTED: usize = 16;

#[derive(Args)]
pub struct CodesArgs {
    #[command(flatten)]
    tokenizer: TokenizerPlace,
    /// The backend that computes
    #[arg(long, value_parser = device(), default_value = "flex")]
    device: DeviceName,
}

pub fn codes(args: &CodesArgs, output: &Output) -> Result<Exit> {
    let trained = args.tokenizer.open(args.device)?;
    let map = CodeMap::of(&trained.tokenizer, &trained.tokens()?, Split::Test);
    let scales: Vec<ScaleUse> = map.scales.iter().map(|scale| ScaleUse::of(&scale.met)).collect();
    let name = format!("codes-{}", trained.id);
    let title = format!("{}: codes of tokenizer {}", trained.folder.name(), trained.id);
    let folder = trained.folder.file("figures");
    let paths = draw_alone(&name, figures::codes(&title, &map), &folder, &Format::ALL)?;
    let document = json!({
        "tokenizer": trained.id, "scales": scales, "explained": map.explained, "figures": paths,
    });
    output.result(&document, &text(&trained.id, &scales, &paths[0].display().to_string()))?;
    Ok(Exit::Done)
}

/// A line a scale.
fn text(id: &str, scales: &[ScaleUse], figure: &str) -> String {
    let mut text = format!("codes of tokenizer {id} on the test split\n\n");
    let _ = writeln!(text, "{:>7} {:>7} {:>9} {:>10}", "scale", "codes", "in use, %", "effective");
    for (i, own) in scales.iter().take(LISTED).enumerate() {
        let ScaleUse { n_vocab, utilisation, exponential_entropy } = own;
        let used = 100.0 * utilisation;
        let _ = writeln!(text, "{:>7} {n_vocab:>7} {used:>9.1} {exponential_entropy:>10.1}", i + 1);
    }
    if scales.len() > LISTED {
        let _ = writeln!(text, "  and {} more", scales.len() - LISTED);
    }
    text + &format!("\nfigure    {figure}")
}
