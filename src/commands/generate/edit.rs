//! The motion that is made anew in part.

use std::ops::Range;
use std::path::Path;

use anyhow::{Result, bail};
use isoflop::data::read_motion;
use isoflop::generator::Edit;
use isoflop::jobs::TrainedRun;
use isoflop::motion::N_FEATURES;

/// A motion of a file, and the seconds of it that are made anew.
pub struct Source {
    /// `[n_frames, 263]` row-major.
    features: Vec<f32>,
    /// Of each latent, whether it is made anew.
    anew: Vec<bool>,
}

impl Source {
    /// Reads a motion; where more frames are asked for than it has, it goes on from its end, and what
    /// comes after that is made anew too.
    ///
    /// # Errors
    /// The file is no motion, is longer than what is asked for, or nothing of it is made anew.
    pub fn read(
        path: &Path,
        spans: &[Range<f64>],
        asked: Option<usize>,
        run: &TrainedRun,
    ) -> Result<Self> {
        let mut features = read_motion(path, run.spec.fps)?;
        let own = features.len() / N_FEATURES;
        let n_frames = asked.unwrap_or(own);
        if n_frames < own {
            bail!("{} has {own} frames; ask for no fewer than that", path.display());
        }
        hold(&mut features, n_frames);
        let frames = run.tokenizer.spec().frames_per_latent();
        let is_anew = |latent: usize| {
            let middle = (latent as f64 + 0.5) * frames as f64;
            middle >= own as f64 || spans.iter().any(|s| s.contains(&(middle / run.spec.fps)))
        };
        let anew: Vec<bool> = (0..n_frames / frames).map(is_anew).collect();
        if !anew.contains(&true) {
            let length = own as f64 / run.spec.fps;
            bail!("--anew names no part of {}, which is {length:.2} s long", path.display());
        }
        Ok(Self { features, anew })
    }

    /// Its frames.
    pub fn n_frames(&self) -> usize {
        self.features.len() / N_FEATURES
    }

    /// Its codes, as a tokenizer with language sees them beside a caption.
    ///
    /// # Errors
    /// As [`isoflop::tokenizer::Tokenizer::encode`].
    pub fn codes(&self, run: &TrainedRun, text: &[f32]) -> Result<Vec<u32>> {
        Ok(run.tokenizer.encode(&self.features, Some(text))?)
    }

    /// What stays of it.
    pub fn edit<'a>(&'a self, codes: &'a [u32]) -> Edit<'a> {
        Edit { codes, anew: &self.anew }
    }
}

/// Repeats the last frame until there are `n_frames`.
fn hold(features: &mut Vec<f32>, n_frames: usize) {
    let last = features[features.len() - N_FEATURES..].to_vec();
    while features.len() < n_frames * N_FEATURES {
        features.extend(&last);
    }
}

/// A span of seconds: `1.5..3`, `..2` or `4..`.
pub fn span(text: &str) -> Result<Range<f64>, String> {
    let problem = || format!("{text} is no span of seconds such as 1.5..3, ..2 or 4..");
    let (from, to) = text.split_once("..").ok_or_else(problem)?;
    let end = |text: &str, open: f64| match text.trim() {
        "" => Ok(open),
        text => text.parse().map_err(|_| problem()),
    };
    let (from, to): (f64, f64) = (end(from, 0.0)?, end(to, f64::INFINITY)?);
    if from >= 0.0 && from < to { Ok(from..to) } else { Err(problem()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_may_be_open_at_either_end() {
        assert_eq!(span("1.5..3"), Ok(1.5..3.0));
        assert_eq!(span("..2"), Ok(0.0..2.0));
        assert_eq!(span("4.."), Ok(4.0..f64::INFINITY));
        assert_eq!(span(".."), Ok(0.0..f64::INFINITY));
        for wrong in ["", "3", "3..1", "2..2", "-1..2", "a..b", "nan..2"] {
            assert!(span(wrong).unwrap_err().contains("such as 1.5..3"), "{wrong}");
        }
    }
}
