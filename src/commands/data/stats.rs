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
use crate::commands::screen::table;

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
    output.result(&json!({ "counted": counted, "left_out": left_out }), &text(&counted, left_out))
}

fn text(counted: &Counted, left_out: usize) -> String {
    let Counted { train, val, test, all, .. } = counted;
    let row = |(name, tally): (&str, &Tally)| {
        let Tally { clips, frames, tokens, captions, distinct_captions, words, .. } = tally;
        let at = |rate: usize| tokens.get(&rate).copied().unwrap_or(0);
        let counts = [at(1), at(2), at(4), *captions, *distinct_captions, *words];
        let [one, two, four, captions, distinct, words] = counts.map(|n| n.to_string());
        let [clips, frames, hours] =
            [clips.to_string(), frames.to_string(), format!("{:.2}", tally.hours)];
        [name.to_string(), clips, frames, hours, one, two, four, captions, distinct, words]
    };
    let rows = [("train", train), ("val", val), ("test", test), ("all", all)];
    let heads = [
        "<split",
        "clips",
        "frames",
        "hours",
        "codes at 1",
        "2",
        "4 frames",
        "captions",
        "distinct",
        "words",
    ];
    let mut text = table(heads, rows.map(row));
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
    let row = |(first, count): (&usize, &usize)| {
        let bar = "#".repeat((count * WIDTH).div_ceil(most));
        [format!("  {first} to {}", first + width - 1), count.to_string(), bar]
    };
    *text += &table(["<", "", "<"], bins.iter().map(row));
}
