//! What a person reads of motions that were made of codes: a screen.

use std::fmt::Write;

use isoflop::jobs::TrainedTokenizer;

use super::args::DetokenizeArgs;
use super::made::Made;

/// Motions that are listed, at most.
const LISTED: usize = 12;

/// What a person reads: a screen.
pub fn text(
    tokenizer: &TrainedTokenizer,
    made: &[Made],
    mean: Option<f64>,
    args: &DetokenizeArgs,
) -> String {
    let n = made.len();
    let noun = if n == 1 { "motion" } else { "motions" };
    let mut text = format!("{n} {noun} by tokenizer {}\n\n", tokenizer.id);
    for Made { motion, frames, mpjpe_mm, .. } in made.iter().take(LISTED) {
        let off = mpjpe_mm.map_or_else(|| "-".to_string(), |mm| format!("{mm:.1}"));
        let _ = writeln!(text, "  {frames:>5} frames {off:>8} mm  {motion}");
    }
    if n > LISTED {
        let _ = writeln!(text, "  and {} more", n - LISTED);
    }
    text += &match mean {
        Some(mean) => format!("\nMPJPE     {mean:.1} mm from the originals, over their frames\n"),
        None => "\nMPJPE     unknown: no original lies beside the codes; name it by --truth\n"
            .to_string(),
    };
    let out = args.out.display();
    text + &format!("files     {out}/<motion>.svg .bvh .joints.npy .features.npy\n")
}
