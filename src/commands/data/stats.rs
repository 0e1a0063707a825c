//! `isoflop data stats`: a data set in numbers.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use isoflop::data::{Counted, HumanMl3d, HumanMl3dOptions, MotionSource, Tally, count};
use serde_json::json;

use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
pub struct StatsArgs {
    /// A folder in the HumanML3D layout
    data: PathBuf,
    /// Count the mirror image of every training clip too, as sweeps do by default
    #[arg(long)]
    mirror: bool,
}

pub fn stats(args: &StatsArgs, output: &Output) -> Result<Exit> {
    let options = HumanMl3dOptions { mirror: args.mirror, ..HumanMl3dOptions::default() };
    let data = HumanMl3d::open(&args.data, &options)?;
    let left_out = data.warnings().len();
    let counted = count(&data);
    output
        .result(&json!({ "counted": counted, "left_out": left_out }), &text(&counted, left_out))?;
    Ok(Exit::Done)
}

fn text(counted: &Counted, left_out: usize) -> String {
    let mut text = String::from(
        "split   clips  frames  hours   codes at 1, 2, 4 frames  captions distinct  words\n",
    );
    let rows = [
        ("train", &counted.train),
        ("val", &counted.val),
        ("test", &counted.test),
        ("all", &counted.all),
    ];
    for (name, tally) in rows {
        let Tally { clips, frames, hours, tokens, captions, distinct_captions, words, .. } = tally;
        let at = |rate: usize| tokens.get(&rate).copied().unwrap_or(0);
        let _ = writeln!(
            text,
            "{name:<6}{clips:>7}{frames:>8}{hours:>7.2}{:>10}{:>8}{:>8}{captions:>9}{distinct_captions:>9}{words:>7}",
            at(1),
            at(2),
            at(4)
        );
    }
    let _ = writeln!(text, "\n{:.1} words a caption", counted.all.words_a_caption);
    text += "\nclips by frames\n";
    bars(&mut text, &counted.lengths, isoflop::data::LENGTH_BIN);
    text += "\ncaptions by words\n";
    bars(&mut text, &counted.caption_words, isoflop::data::WORDS_BIN);
    if left_out > 0 {
        let _ = writeln!(text, "\n{left_out} clips or parts are left out: isoflop data check");
    }
    text
}

/// Characters of the longest bar.
const WIDTH: usize = 50;

fn bars(text: &mut String, bins: &BTreeMap<usize, usize>, width: usize) {
    let most = bins.values().max().copied().unwrap_or(1).max(1);
    for (first, count) in bins {
        let bar = "#".repeat((count * WIDTH).div_ceil(most));
        let range = format!("{first} to {}", first + width - 1);
        let _ = writeln!(text, "  {range:<12}{count:>7}  {bar}");
    }
}
