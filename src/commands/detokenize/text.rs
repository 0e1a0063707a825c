//! What a person reads of motions that were made of codes: a screen.

use isoflop::jobs::TrainedTokenizer;

use super::args::DetokenizeArgs;
use super::made::Made;
use crate::commands::screen::{dash, many, more, table};

/// Motions that are listed, at most.
const LISTED: usize = 12;

/// What a person reads: a screen.
pub fn text(
    tokenizer: &TrainedTokenizer,
    made: &[Made],
    mean: Option<f64>,
    args: &DetokenizeArgs,
) -> String {
    let heading = many(made.len(), "motion");
    let row = |Made { motion, frames, mpjpe_mm, .. }: &Made| {
        let off = dash(*mpjpe_mm, |mm| format!("{mm:.1}"));
        [format!("  {frames} frames"), format!("{off} mm"), motion.clone()]
    };
    let rows = table(["", "", "<"], made.iter().take(LISTED).map(row));
    let unsaid = more(made.len(), LISTED, "");
    let mut text = format!("{heading} by tokenizer {}\n\n{rows}{unsaid}", tokenizer.id);
    text += &match mean {
        Some(mean) => format!("\nMPJPE     {mean:.1} mm from the originals, over their frames\n"),
        None => "\nMPJPE     unknown: no original lies beside the codes; name it by --truth\n"
            .to_string(),
    };
    let out = args.out.display();
    text + &format!("files     {out}/<motion>.svg .bvh .joints.npy .features.npy\n")
}
