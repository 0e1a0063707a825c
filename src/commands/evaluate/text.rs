//! What a person reads of scores: a screen.

use std::fmt::Write;

use isoflop::evaluator::MotionScores;
use isoflop::jobs::{RunScores, ScoredPhysics};
use isoflop::scores::Repeated;

use super::files::{FileScore, FileScores};
use crate::commands::screen::{dash, many, table};

/// The scores of a run's motions, beside those of motions that are known to be better or worse.
pub fn of_run(label: &str, scores: &RunScores) -> String {
    let RunScores { made, shuffled, truth, reconstructed, .. } = scores;
    let row = |(name, scores): (&str, &MotionScores)| {
        let MotionScores { fid, precision: [first, _, third], cosine, .. } = scores;
        let [fid, cosine] = [fid.shown(4), cosine.shown(2)];
        [name.to_string(), fid, first.shown(3), third.shown(3), cosine]
    };
    let rows = [
        ("made", made),
        ("made, captions mixed", shuffled),
        ("true", truth),
        ("true, reconstructed", reconstructed),
    ];
    let mut text = format!(
        "motions of {label} ({})\n{} captions of the test split, {} times\n\n{}",
        scores.run_id,
        scores.n_clips,
        made.fid.repeats,
        table(["<", "<FID", "<R@1", "<R@3", "<cosine"], rows.map(row))
    );
    let _ = writeln!(
        text,
        "\nFID of one half of the true motions from the other: {}\ndiversity {}, of true motions {}",
        scores.halves_fid.shown(4),
        made.diversity.shown(3),
        truth.diversity.shown(3)
    );
    if let Some(multimodality) = scores.multimodality {
        let spread = multimodality.shown(3);
        let _ = writeln!(text, "MultiModality {spread}: distance of motions of one caption");
    }
    text += &bodies(&scores.made_physics, &scores.truth_physics);
    text + &comparable(&scores.evaluator_id)
}

/// The scores of motions of files.
pub fn of_files(scores: &FileScores) -> String {
    let FileScores { n_motions, n_captions, n_truth, .. } = scores;
    let shown = |score: Option<Repeated>| dash(score, |score| score.shown(3));
    let row = |score: &FileScore| [score.name.to_string(), shown(score.found), shown(score.truth)];
    let mut text = format!(
        "{}, {n_captions} with a caption, beside {n_truth} true ones\n\n{}",
        many(*n_motions, "motion"),
        table(["<", "<these", "<true"], scores.scores.iter().map(row))
    );
    text.push('\n');
    let mut reasons: Vec<&String> =
        scores.scores.iter().filter_map(|score| score.reason.as_ref()).collect();
    reasons.dedup();
    reasons.iter().for_each(|reason| text += &format!("{reason}\n"));
    let n = FileScores::true_motions(*n_motions, *n_truth);
    text += &format!("FID of true motions: {n} from the {} others\n", n_truth - n);
    text += &bodies(&scores.physics, &scores.truth_physics);
    text + &comparable(&scores.evaluator_id)
}

fn bodies(made: &ScoredPhysics, truth: &ScoredPhysics) -> String {
    let [made, truth] = [made.mean, truth.mean];
    format!(
        "a foot slides in {:.1} % of the steps (true: {:.1}), jerk {:.0} m/s³ (true: {:.0})\n\
         bones vary by {:.1} mm (true: {:.1}), the lowest joint is {:.1} mm under the floor\n",
        100.0 * made.foot_skate,
        100.0 * truth.foot_skate,
        made.jerk,
        truth.jerk,
        made.bone_spread_mm,
        truth.bone_spread_mm,
        made.penetration_mm + 0.0,
    )
}

fn comparable(evaluator_id: &str) -> String {
    format!("means and 95 % intervals of repeats; comparable only with evaluator\n{evaluator_id}")
}
