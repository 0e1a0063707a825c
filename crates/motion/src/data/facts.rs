//! [`DataFacts`]: what a plan needs to know of a data set.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::source::{Member, MotionSource, Split};
use crate::spec::{ClipShape, Grid};

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
    pub warnings: Vec<String>,
    /// The data sets of a union.
    pub members: Vec<MemberFacts>,
    /// Training clips by their frames; of a very large split a sample.
    lengths: BTreeMap<usize, usize>,
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

impl MemberFacts {
    fn of(Member { name, licence, source }: &Member) -> Self {
        let clips = Split::ALL.map(|split| source.n_clips(split));
        let frames = |split| (0..source.n_clips(split)).map(|i| source.n_frames(split, i)).sum();
        Self {
            name: name.clone(),
            licence: licence.clone(),
            digest: source.digest().to_string(),
            fps: source.fps(),
            clips,
            frames: Split::ALL.map(frames),
        }
    }
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
    /// Looks at a source.
    pub fn of(source: &dyn MotionSource) -> Self {
        Self {
            digest: source.digest().to_string(),
            clips: Split::ALL.map(|split| source.n_clips(split)),
            test_groups: test_groups(source),
            fps: f64::from(source.fps()),
            warnings: source.warnings().to_vec(),
            members: source.members().iter().map(MemberFacts::of).collect(),
            lengths: lengths(source),
            ..Self::default()
        }
    }

    /// Stands in for data that is not here, so that a sweep can still be priced.
    pub fn absent(reason: String) -> Self {
        Self {
            digest: "absent".to_string(),
            fps: 20.0,
            warnings: vec![format!("{reason}; ids and epochs are provisional")],
            ..Self::default()
        }
    }

    /// Looks at what the captions of its clips take, by `n_tokens` of each; a caption of which that is not
    /// known is left out.
    pub fn look_at_captions(
        &mut self,
        source: &dyn MotionSource,
        n_tokens: impl Fn(&str) -> Option<usize>,
    ) {
        let n_clips = source.n_clips(Split::Train);
        let looked_at = n_clips.min(CAPTIONED);
        for clip in (0..looked_at).map(|i| i * n_clips / looked_at) {
            let captions = source.captions(Split::Train, clip);
            for n_text in captions.iter().filter_map(|caption| n_tokens(caption)) {
                let shape = ClipShape { n_frames: source.n_frames(Split::Train, clip), n_text };
                *self.shapes.entry(shape).or_default() += 1.0 / captions.len() as f64;
            }
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

/// Clips whose captions are looked at, spread over the split.
const CAPTIONED: usize = 1 << 12;

/// Clips that are looked at one by one; larger splits are estimated from as many.
const SAMPLED: usize = 1 << 18;

/// A generated clip must be sketched to know its length: a hundred million would take minutes.
fn lengths(source: &dyn MotionSource) -> BTreeMap<usize, usize> {
    let mut lengths = BTreeMap::new();
    for clip in 0..source.n_clips(Split::Train).min(SAMPLED) {
        *lengths.entry(source.n_frames(Split::Train, clip)).or_default() += 1;
    }
    lengths
}
/// Groups of the test split.
pub fn test_groups(source: &dyn MotionSource) -> usize {
    let groups = (0..source.n_clips(Split::Test)).map(|clip| source.group(Split::Test, clip));
    groups.collect::<BTreeSet<_>>().len()
}
