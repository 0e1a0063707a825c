//! `isoflop generate --edit`: makes a part of a motion anew and joins it to the rest.

use super::args::GenerateArgs;
use crate::commands::prelude::*;
use crate::commands::tokenize::warn_of;
use isoflop::data::read_motion;
use isoflop::generator::Edit;
use isoflop::jobs::TrainedRun;
use isoflop::motion::{N_FEATURES, join_weights, joined};

/// A motion in a file, and the part of it to generate again.
pub struct Source {
    /// Its codes, made without a caption.
    codes: Vec<u32>,
    /// For each latent, whether it is generated again.
    anew: Vec<bool>,
    /// The frames outside of the part: the reconstruction of the motion, or with `--paste` its own, `[n_frames, 263]`
    /// row-major.
    rest: Vec<f32>,
    /// The weight of the new part in each frame.
    weights: Vec<f64>,
}

impl Source {
    /// Reads a motion; if more frames are asked for than it has, the frames beyond its end are generated too.
    ///
    /// # Errors
    /// The file is no motion, is longer than what is asked for, or nothing of it is made anew.
    pub fn read(
        path: &Path,
        args: &GenerateArgs,
        run: &TrainedRun,
        output: &Output,
    ) -> Result<Self> {
        let (mut features, fps) = (read_motion(path, run.spec.fps)?, run.spec.fps);
        let (tokenizer, own) = (&run.tokenizer, features.len() / N_FEATURES);
        warn_of(std::iter::once((path, &*features)), tokenizer.stats(), output);
        warn_of_captions(run, output);
        let asked = args.n_frames(fps).unwrap_or(own);
        if asked < own {
            bail!("{} has {own} frames; ask for no fewer than that", path.display());
        }
        let (kind, stride) = (&tokenizer.spec().architecture, tokenizer.spec().stride());
        let whole = asked / stride * stride;
        let last = features[features.len() - N_FEATURES..].to_vec();
        features.extend(last.repeat(asked - own));
        features.truncate(whole * N_FEATURES);
        // By the middle of a latent or frame, in frames.
        let is_anew = |middle: f64| {
            middle >= own as f64 || args.anew.iter().any(|span| span.contains(&(middle / fps)))
        };
        let anew: Vec<bool> = kind.middles(whole).into_iter().map(is_anew).collect();
        if !anew.contains(&true) {
            let length = own as f64 / fps;
            bail!("--anew names no part of {}, which is {length:.2} s long", path.display());
        }
        let part: Vec<bool> = (0..whole).map(|frame| is_anew(frame as f64 + 0.5)).collect();
        let weights = join_weights(&part, (args.fade * fps).round() as usize);
        let codes = tokenizer.encode_uncaptioned(&features);
        let rest = match args.paste {
            true => features,
            false => tokenizer.decode_uncaptioned(&codes, part.len())?,
        };
        Ok(Self { codes, anew, rest, weights })
    }

    /// Its frames.
    pub fn n_frames(&self) -> usize {
        self.weights.len()
    }

    /// Its codes, and those that are drawn.
    pub fn edit(&self) -> Edit<'_> {
        Edit { codes: &self.codes, anew: &self.anew }
    }

    /// The part of a motion that was made of [`Source::edit`], and the rest around it.
    pub fn joined(&self, made: &[f32], fps: f64) -> Vec<f32> {
        joined(&self.rest, made, &self.weights, fps)
    }
}

/// Warns of a tokenizer that has always seen a caption, which the motion to edit has none of.
fn warn_of_captions(run: &TrainedRun, output: &Output) {
    let language = run.tokenizer.spec().architecture.language();
    if language.is_some_and(|language| language.drop == 0.0) {
        output.warn(
            "the run's tokenizer was trained with every caption (tokenizer.language.drop: 0), and \
             an edit shows it the motion without one: what stays may be reconstructed badly",
        );
    }
}
