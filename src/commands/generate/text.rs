//! What a person reads of motions that were made: a screen.

use std::fmt::Write;
use std::path::Path;

use isoflop::jobs::TrainedRun;
use isoflop::scores::Physics;

use super::motion::Motion;
use crate::commands::screen::{clip, many, more, table};

/// Motions that are listed, at most.
const LISTED: usize = 12;

/// Characters of a caption that are shown.
const CAPTION: usize = 56;

/// The run, the motions, which took so many seconds to make, files apart, and where they are.
pub fn text(run: &TrainedRun, motions: &[Motion], out: &Path, made_s: f64) -> String {
    let n = motions.len();
    let row = |(index, motion): (usize, &Motion)| {
        let cut = if motion.ended { "" } else { "  cut" };
        let caption = clip(&motion.caption, CAPTION) + cut;
        [format!("  {index}"), format!("{:.1} s", motion.seconds), caption]
    };
    let rows = motions.iter().enumerate().take(LISTED).map(row);
    let mut text = format!(
        "{} in {:.2} s, {:.0} a minute, by\n{} ({})\n\n{}{}",
        many(n, "motion"),
        made_s,
        60.0 * n as f64 / made_s,
        run.spec.label(),
        run.run_id,
        table(["", "", "<"], rows),
        more(n, LISTED, "")
    );
    if motions.iter().any(|motion| !motion.ended) {
        text += "  cut: the model's context had no room for more\n";
    }
    let largest = motions.iter().map(|m| m.bvh_largest_mm).fold(0.0, f64::max);
    let out = out.display();
    let _ = writeln!(text, "\nfiles     {out}/<n>.svg .bvh .joints.npy .features.npy");
    let _ = writeln!(text, "          {out}/sheet.png, motions.json");
    let _ = writeln!(
        text,
        "BVH       bones have one length; joints are off by {largest:.0} mm at most"
    );
    text += &bodies(motions);
    text
}

/// What the motions of four frames and more show without an evaluator, on the mean.
fn bodies(motions: &[Motion]) -> String {
    let seen: Vec<&Physics> = motions.iter().filter_map(|m| m.physics.as_ref()).collect();
    if seen.is_empty() {
        return String::new();
    }
    let mean = |of: fn(&Physics) -> f64| {
        seen.iter().map(|physics| of(physics)).sum::<f64>() / seen.len() as f64
    };
    format!(
        "bodies    a foot slides in {:.0} % of the steps from frame to frame\n          \
             bones vary by {:.0} mm, the lowest joint is {:.0} mm under the floor\n",
        100.0 * mean(|physics| physics.foot_skate),
        mean(|physics| physics.bone_spread_mm),
        mean(|physics| physics.penetration_mm),
    )
}
