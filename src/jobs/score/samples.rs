//! Motions of a scored run, kept as files: what a person looks at beside its scores.

use anyhow::Result;
use serde::Serialize;

use super::scoring::Scoring;
use crate::data::write_npy;
use crate::files::atomic::write_json;
use crate::motion::N_FEATURES;

/// An element of `motions.json`.
#[derive(Serialize)]
struct Sample<'a> {
    caption: &'a str,
    /// Frames.
    length: usize,
    /// Frames a second.
    fps: f64,
    run: &'a str,
}

/// Writes the first motions of the first repeat as `samples/<run>/scored/<n>.features.npy`, and last
/// `motions.json`, which lists them.
///
/// # Errors
/// A motion cannot be made, or a file cannot be written.
pub fn write_samples(scoring: &Scoring) -> Result<()> {
    let (run, truth) = (scoring.run, scoring.truth);
    let motions = scoring.first_motions(scoring.spec.samples.min(truth.n_clips()))?;
    if motions.is_empty() {
        return Ok(());
    }
    let folder = run.folder.file("samples").join(&run.run_id).join("scored");
    std::fs::create_dir_all(&folder)?;
    let mut listed = Vec::with_capacity(motions.len());
    for (index, (motion, caption)) in motions.iter().zip(&truth.captions).enumerate() {
        let length = motion.len() / N_FEATURES;
        let path = folder.join(format!("{index}.features.npy"));
        write_npy(&path, &[length, N_FEATURES], motion)?;
        listed.push(Sample { caption, length, fps: run.spec.fps, run: &run.run_id });
    }
    Ok(write_json(&folder.join("motions.json"), &listed)?)
}
