//! What a plan needs to know of a data set, as plain values: a plan reads no motion.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::spec::{ClipShape, EvaluatorSpec, Grid};

/// What a plan needs to know of a data set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataFacts {
    /// Content of the data; `absent` where there is none yet, so that ids are provisional.
    pub digest: String,
    /// Clips to train on, to validate on and to test on.
    pub clips: [usize; 3],
    /// Groups of test clips that were recorded together; a clip of no group is one of its own.
    pub test_groups: usize,
    pub fps: f64,
    /// Content of the file that the captions' vectors come from, where they come from one; `absent`
    /// where it is not here.
    pub embeddings: Option<String>,
    /// Contents of the files that a program of somebody's own is made of, by their names.
    pub trainer_inputs: BTreeMap<String, String>,
    /// The evaluator in the folder that `evaluator.weights` names; `None` if it names none.
    pub evaluator: Option<EvaluatorSpec>,
    pub warnings: Vec<String>,
    /// The data sets of a union.
    pub members: Vec<MemberFacts>,
    /// Training clips by their frames; of a very large split a sample.
    pub(super) lengths: BTreeMap<usize, usize>,
    /// Training clips by their frames and the tokens of a caption, a clip counting as one over all its
    /// captions; of a large split a sample. Empty where the captions were not looked at.
    pub shapes: BTreeMap<ClipShape, f64>,
}

/// What a plan tells of a data set of a union.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MemberFacts {
    pub name: String,
    pub licence: Option<String>,
    pub digest: String,
    pub fps: f32,
    /// Clips to train on, to validate on and to test on.
    pub clips: [usize; 3],
    /// Frames of each split.
    pub frames: [usize; 3],
}

/// What is asked of a source without an end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Demand {
    /// Supervised tokens.
    pub targets: usize,
    /// The codes that they are.
    pub codes: Grid,
}

impl DataFacts {
    /// Stands in for data that is not here, so that a sweep can still be priced.
    pub fn absent(reason: String) -> Self {
        Self {
            digest: "absent".to_string(),
            fps: 20.0,
            warnings: vec![format!("{reason}; ids and epochs are provisional")],
            ..Self::default()
        }
    }

    /// Supervised tokens of the training split as codes of a grid, end tokens included; of a very
    /// large split an estimate.
    pub fn unique_tokens(&self, codes: &Grid) -> usize {
        self.over_clips(|n_frames| codes.n_targets(n_frames))
    }

    /// Frames of the training split; of a very large split an estimate.
    pub fn train_frames(&self) -> usize {
        self.over_clips(|n_frames| n_frames)
    }

    /// Frames of the longest training clip that was looked at; 0 without data.
    pub fn longest_clip(&self) -> usize {
        self.lengths.keys().next_back().copied().unwrap_or(0)
    }

    /// A sum over training clips of what depends on their frames.
    fn over_clips(&self, of_frames: impl Fn(usize) -> usize) -> usize {
        let sampled: usize = self.lengths.values().sum();
        let sum: usize =
            self.lengths.iter().map(|(frames, clips)| clips * of_frames(*frames)).sum();
        let [train, ..] = self.clips;
        if sampled == train { sum } else { (sum as f64 / sampled as f64 * train as f64) as usize }
    }
}
