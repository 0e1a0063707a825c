//! Evaluators: networks that embed motions and captions together, and tests of these networks.
//!
//! An [`Evaluator`] is trained on the data at hand, since no published one covers every data set and representation;
//! only scores by the same evaluator can be compared. [`Gates`] decide whether its scores are meaningful: they are
//! measured before any score.
//!
//! # Example
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use burn::tensor::Device;
//! use isoflop_motion::data::{self, Split};
//! use isoflop_model::evaluator::train;
//! use isoflop_spec::spec::{EvaluatorSection, EvaluatorSpec};
//! use isoflop_spec::spec::{Clips, DataSection};
//!
//! let section = DataSection { clips: Clips::Count(16), ..DataSection::default() };
//! let source = data::open(&section, None)?;
//! let small = EvaluatorSection { width: Some(16), layers: Some(1), heads: Some(1), ..Default::default() };
//! let spec = EvaluatorSpec { dim: 16, steps: 2, evaluations: 1, batch: 4, pool_clips: 8, ..small.spec() };
//! let mut no_progress = |_| ControlFlow::Continue(());
//! let trained = train(&spec, &*source, &Device::flex(), None, &mut no_progress)?;
//! let walk = source.features(Split::Test, 0)?;
//! let embedded = trained.evaluator.motions([walk.as_slice()])?;
//! assert_eq!(embedded.dim(), 16);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod codec;
mod corruption;
mod gates;
mod loaded;
mod matching;
mod motion_clip;
mod report;
mod seen;
mod tagged;
mod train;
mod truth;

pub use codec::Evaluator;
pub use corruption::Corruption;
pub use gates::{Corrupted, Gates, SameCaption, Swapped, halves_fid, measure};
pub use loaded::spec_of;
pub use report::{EvaluatorReport, Verdict, comparable, table};
pub use train::{Course, TrainedEvaluator, ValidationLine, train};
pub use truth::{Embedded, OneScore, Truth};

use crate::data::DataError;
use crate::failure::FailureKind;
use crate::files::FileError;
use crate::learn::weights::WeightsError;
use crate::learn::{Cause, LearnError, TrainingError};
use crate::scores::ScoreError;

/// Why an evaluator could not be trained, judged, saved, loaded or used.
#[derive(Debug, thiserror::Error)]
pub enum EvaluatorError {
    /// A split of too few clips.
    #[error("an evaluator needs {least} clips of the {split} split, there are {found}")]
    TooFewClips { split: &'static str, least: usize, found: usize },
    /// A motion shorter than one row of frames.
    #[error("a motion of {n_frames} frames is too short: the evaluator sees {least} as one")]
    TooShort { n_frames: usize, least: usize },
    /// A motion of other features.
    #[error("a motion of {values} values is not made of frames of {wanted} features")]
    Features { values: usize, wanted: usize },
    /// A folder that `evaluator.weights` names, without a converted evaluator.
    #[error("{folder} holds no evaluator that experiments/convert_evaluator.py made: {problem}")]
    NotConverted { folder: String, problem: String },
    /// Data at another rate than the evaluator's.
    #[error(
        "the evaluator knows motions of {wanted} frames a second, and the data have {found}; import them at {wanted}"
    )]
    Rate { found: f64, wanted: f64 },
    /// A caption whose parts of speech are not known.
    #[error(
        "the evaluator reads words with parts of speech, and no text of the test split gives those of `{caption}`; \
         lines of texts must be `caption#word/TAG word/TAG#from#to`, as HumanML3D has them"
    )]
    Untagged { caption: String },
    /// Embeddings that have no score.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// Learning ended before its end.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// The data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Weights of another evaluator, or their file.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TrainingError for EvaluatorError {
    fn cause(&self) -> Cause<'_> {
        Cause::Other(match self {
            Self::Learn(error) => return Cause::Learn(error),
            Self::Data(error) => error.failure_kind(),
            Self::File(error) => error.failure_kind(),
            Self::Weights(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;
    use std::time::Duration;

    use burn::tensor::Device;

    use super::seen::Seen;
    use super::train::fresh;
    use super::*;
    use crate::data::{MotionSource, Procedural, ProceduralOptions, Split};
    use crate::learn::Checkpoints;
    use crate::motion::N_FEATURES;
    use crate::progress::Step;
    use crate::spec::{EvaluatorSection, EvaluatorSpec};

    fn source() -> Procedural {
        let (train_clips, val_clips, test_clips) = (256, 32, 96);
        Procedural::new(ProceduralOptions { seed: 1, train_clips, val_clips, test_clips })
    }

    /// A small one of each kind.
    const KINDS: [&str; 2] =
        ["width: 32, layers: 1, heads: 2, lr: 4e-3", "kind: matching, width: 32, lr: 1e-2"];

    fn of_kind(kind: &str, steps: usize) -> EvaluatorSpec {
        let shared = "dim: 16, warmup_steps: 10, batch: 32, evaluations: 4";
        let yaml = format!("{{{kind}, {shared}, steps: {steps}}}");
        serde_yaml::from_str::<EvaluatorSection>(&yaml).unwrap().spec()
    }

    fn spec(steps: usize) -> EvaluatorSpec {
        of_kind(KINDS[0], steps)
    }

    fn untrained(spec: &EvaluatorSpec, source: &Procedural) -> Evaluator {
        let seen = Seen { spec: spec.clone(), stats: source.stats().clone(), fps: 20.0 };
        let networks = fresh(spec, seen.n_features(), &Device::flex());
        Evaluator::new(networks, seen)
    }

    fn trained(spec: &EvaluatorSpec, source: &Procedural) -> TrainedEvaluator {
        train(spec, source, &Device::flex(), None, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    fn bytes(evaluator: &Evaluator, folder: &Path) -> Vec<u8> {
        evaluator.save(folder).unwrap();
        std::fs::read(folder.join("weights.safetensors")).unwrap()
    }

    /// An untrained evaluator fails the gates; one of a few steps finds captions and sees jitter.
    #[test]
    fn gates_tell_a_trained_evaluator_from_an_untrained_one() {
        let (before, after) = gates_tell(KINDS[0], 0.15);
        let jitter = |gates: &Gates| {
            let last = |own: &&Corrupted| own.corruption == Corruption::Jitter;
            let jitter = gates.corrupted.iter().rfind(last).unwrap();
            jitter.halves_fid.mean / gates.halves_fid.mean
        };
        let [before, after] = [before, after].map(|gates| jitter(&gates));
        assert!(after > 3.0 && after > 2.0 * before, "{before} {after}");
        // A recurrence learns more slowly.
        gates_tell(&format!("{}, corrupted: 0", KINDS[1]), 0.1);
    }

    fn gates_tell(kind: &str, least: f64) -> (Gates, Gates) {
        let (source, spec) = (source(), of_kind(kind, 120));
        let before = measure(&untrained(&spec, &source), &source).unwrap();
        let TrainedEvaluator { evaluator, course } = trained(&spec, &source);
        let after = measure(&evaluator, &source).unwrap();
        let passes = before.verdicts_of(&spec).iter().all(Verdict::is_enough);
        assert!(!passes && before.truth[0].mean < 0.15, "{before:?}");
        assert!(
            after.truth[0].is_above(&before.truth[0]) && after.truth[0].mean > least,
            "{after:?}"
        );
        let all = after.swapped.last().unwrap().precision.mean;
        assert!(all < 0.1, "swapped captions find nothing: {all}");
        assert!(after.fid_by_n.iter().is_sorted_by(|(_, few), (_, many)| few.mean > many.mean));
        assert_eq!(course.log.len(), 4);
        let lowest = course.log.iter().map(|line| line.val_loss).fold(f64::INFINITY, f64::min);
        let best = course.log.iter().find(|line| line.step == course.best_step).unwrap();
        assert_eq!(best.val_loss, lowest);
        (before, after)
    }

    #[test]
    fn a_resumed_training_ends_on_the_same_bits() {
        for kind in KINDS {
            resumed_is_straight(kind);
        }
    }

    fn resumed_is_straight(kind: &str) {
        let (source, spec) = (source(), of_kind(kind, 8));
        let folder = tempfile::tempdir().unwrap();
        let straight = trained(&spec, &source);
        let expected = bytes(&straight.evaluator, folder.path());
        let path = folder.path().join("checkpoint.safetensors");
        let checkpoints =
            Checkpoints { path: &path, every: Duration::from_secs(3600), branch: None };
        // Before the first measure, just after one, and long after one.
        for stop_at in [1, 2, 5] {
            let mut progress = |Step { step, .. }| {
                if step == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let ended = train(&spec, &source, &Device::flex(), Some(&checkpoints), &mut progress);
            assert!(matches!(ended, Err(EvaluatorError::Learn(LearnError::Stopped { .. }))));
        }
        let mut progress = |_| ControlFlow::Continue(());
        let resumed =
            train(&spec, &source, &Device::flex(), Some(&checkpoints), &mut progress).unwrap();
        assert!(bytes(&resumed.evaluator, folder.path()) == expected);
        assert_eq!(resumed.course.log, straight.course.log);
        assert_eq!(resumed.course.best_step, straight.course.best_step);
    }

    #[test]
    fn a_saved_evaluator_embeds_as_before_and_each_thing_by_itself() {
        for kind in KINDS {
            saved_embeds_as_before(kind);
        }
    }

    fn saved_embeds_as_before(kind: &str) {
        let (source, spec) = (source(), of_kind(kind, 4));
        let evaluator = untrained(&spec, &source);
        let folder = tempfile::tempdir().unwrap();
        evaluator.save(folder.path()).unwrap();
        let loaded = Evaluator::load(folder.path(), &Device::flex()).unwrap();
        assert_eq!((loaded.spec(), loaded.fps()), (&spec, 20.0));
        let clips: Vec<Vec<f32>> =
            (0..5).map(|clip| source.features(Split::Test, clip).unwrap()).collect();
        let all = loaded.motions(clips.iter().map(Vec::as_slice)).unwrap();
        assert_eq!(all, evaluator.motions(clips.iter().map(Vec::as_slice)).unwrap());
        for (clip, together) in clips.iter().zip(all.rows()) {
            let alone = loaded.motions([clip.as_slice()]).unwrap();
            let off = alone.row(0).iter().zip(together).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-5);
            let square = together.iter().map(|x| x * x).sum::<f64>();
            assert!(kind != KINDS[0] || (square - 1.0).abs() < 1e-5, "towers give unit vectors");
        }
        let captions = loaded.captions(["a person walks", "", "a person walks"]).unwrap();
        assert_eq!(captions.row(0), captions.row(2));
        assert_ne!(captions.row(0), captions.row(1));
    }

    #[test]
    fn the_first_window_is_seen_of_a_long_motion() {
        let (source, spec) = (source(), EvaluatorSpec { window: 40, ..spec(1) });
        let evaluator = untrained(&spec, &source);
        let long = (0..96).find(|&clip| source.n_frames(Split::Test, clip) >= 60).unwrap();
        let clip = source.features(Split::Test, long).unwrap();
        let of = |frames: usize| evaluator.motions([&clip[..frames * N_FEATURES]]).unwrap();
        assert_eq!(of(40), of(60));
        assert_eq!(of(40), of(43), "frames after the last whole row");
        assert_ne!(of(40), of(36));
    }

    #[test]
    fn what_cannot_be_embedded_is_refused_with_the_reason() {
        let (source, spec) = (source(), spec(1));
        let evaluator = untrained(&spec, &source);
        let refused = |motion: &[f32]| evaluator.motions([motion]).unwrap_err().to_string();
        let short = refused(&[0.0; 3 * N_FEATURES]);
        assert_eq!(short, "a motion of 3 frames is too short: the evaluator sees 4 as one");
        assert!(refused(&[0.0; 300]).contains("300 values is not made of frames of 263 features"));
        assert!(refused(&[f32::NAN; 8 * N_FEATURES]).contains("no finite number"));
        let few = ProceduralOptions { seed: 1, train_clips: 64, val_clips: 8, test_clips: 40 };
        let error = measure(&evaluator, &Procedural::new(few)).unwrap_err().to_string();
        assert_eq!(error, "an evaluator needs 64 clips of the test split, there are 40");
    }
}
