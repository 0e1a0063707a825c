//! Facts of a data set: its size, the input of a plan, and its problems.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::humanml3d::{HumanMl3d, HumanMl3dOptions};
use super::motion_files::MotionFiles;
use super::source::{DataError, FAR, Member, MotionSource, Split};
use super::texts::read_splits;
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS, Pose, lowest, recover_joints};
use crate::spec::{BrokenFiles, ClipShape, Grid};

/// The facts of a data set for a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataFacts {
    /// Digest of the data; `absent` if there is none yet, so that ids are provisional.
    pub digest: String,
    /// Clips to train on, to validate on and to test on.
    pub clips: [usize; 3],
    /// Groups of test clips that were recorded together; a clip without a group counts as one.
    pub test_groups: usize,
    pub fps: f64,
    /// Digest of the file of caption vectors, if there is one; `absent` if it is missing.
    pub embeddings: Option<String>,
    /// Contents of the files that a user's program is made of, by their names.
    pub trainer_inputs: BTreeMap<String, String>,
    pub warnings: Vec<String>,
    /// The data sets of a union.
    pub members: Vec<MemberFacts>,
    /// Training clips by their frames; of a very large split a sample.
    lengths: BTreeMap<usize, usize>,
    /// Training clips by frames and caption tokens, each clip with weight one over all its captions; a sample of a large
    /// split. Empty if captions were not read.
    pub shapes: BTreeMap<ClipShape, f64>,
}

/// The facts of a data set of a union.
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
        let frames = |split| (0..source.n_clips(split)).map(|i| source.n_frames(split, i)).sum();
        Self {
            name: name.clone(),
            licence: licence.clone(),
            digest: source.digest().to_string(),
            fps: source.fps(),
            clips: Split::ALL.map(|split| source.n_clips(split)),
            frames: Split::ALL.map(frames),
        }
    }
}

/// The demand on an unlimited source.
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
        let mut lengths = BTreeMap::new();
        for clip in 0..source.n_clips(Split::Train).min(SAMPLED) {
            *lengths.entry(source.n_frames(Split::Train, clip)).or_default() += 1;
        }
        Self {
            digest: source.digest().to_string(),
            clips: Split::ALL.map(|split| source.n_clips(split)),
            test_groups: test_groups(source),
            fps: f64::from(source.fps()),
            warnings: source.warnings().to_vec(),
            members: source.members().iter().map(MemberFacts::of).collect(),
            lengths,
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

    /// Reads the token counts of captions by `n_tokens`; captions with unknown counts are left out.
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

    /// Sums a function of frames over training clips.
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

/// Clips that are examined one by one; larger splits are estimated from as many. A generated clip must be sketched to
/// know its length: a hundred million would take minutes.
const SAMPLED: usize = 1 << 18;

/// Groups of the test split.
pub fn test_groups(source: &dyn MotionSource) -> usize {
    let groups = (0..source.n_clips(Split::Test)).map(|clip| source.group(Split::Test, clip));
    groups.collect::<BTreeSet<_>>().len()
}

// The size of a data set.

/// Frames of a bin of the histogram of lengths.
pub const LENGTH_BIN: usize = 20;
/// Words of a bin of the histogram of captions.
pub const WORDS_BIN: usize = 5;

/// The size of a split, or of all.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    pub clips: usize,
    pub frames: usize,
    pub hours: f64,
    /// Codes of all clips at one, two, four and eight frames a code, end tokens not counted.
    pub tokens: BTreeMap<usize, usize>,
    pub captions: usize,
    pub distinct_captions: usize,
    /// Different words of the captions.
    pub words: usize,
    pub words_a_caption: f64,
}

/// A data set in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counted {
    pub fps: f32,
    pub train: Tally,
    pub val: Tally,
    pub test: Tally,
    pub all: Tally,
    /// Clips of all splits by their frames: the first of each bin of 20.
    pub lengths: BTreeMap<usize, usize>,
    /// Captions of all splits by their words: the first of each bin of 5.
    pub caption_words: BTreeMap<usize, usize>,
}

/// Frames a code that are counted.
const RATES: [usize; 4] = [1, 2, 4, 8];

/// Counts every clip.
pub fn count(data: &dyn MotionSource) -> Counted {
    let [train, val, test] = Split::ALL.map(|split| tally(data, &[split]));
    let mut lengths = BTreeMap::new();
    let mut caption_words = BTreeMap::new();
    for (split, index) in data.clips(&Split::ALL) {
        *lengths.entry(data.n_frames(split, index) / LENGTH_BIN * LENGTH_BIN).or_default() += 1;
        for caption in data.captions(split, index) {
            let words = caption.split_whitespace().count();
            *caption_words.entry(words / WORDS_BIN * WORDS_BIN).or_default() += 1;
        }
    }
    let all = tally(data, &Split::ALL);
    Counted { fps: data.fps(), train, val, test, all, lengths, caption_words }
}

fn tally(data: &dyn MotionSource, splits: &[Split]) -> Tally {
    let mut tally = Tally::default();
    let (mut captions, mut words): (HashSet<String>, HashSet<String>) = Default::default();
    let mut n_words = 0;
    for (split, index) in data.clips(splits) {
        let frames = data.n_frames(split, index);
        tally.clips += 1;
        tally.frames += frames;
        RATES.iter().for_each(|rate| *tally.tokens.entry(*rate).or_default() += frames / rate);
        for caption in data.captions(split, index) {
            tally.captions += 1;
            let letters =
                |word: &str| word.trim_matches(|c: char| !c.is_alphanumeric()).to_string();
            let own: Vec<String> = caption.split_whitespace().map(letters).collect();
            n_words += own.len();
            words.extend(own.into_iter().filter(|word| !word.is_empty()));
            captions.insert(caption);
        }
    }
    tally.hours = tally.frames as f64 / f64::from(data.fps()) / 3600.0;
    tally.distinct_captions = captions.len();
    tally.words = words.len();
    tally.words_a_caption = n_words as f64 / tally.captions.max(1) as f64;
    tally
}

// Problems of a folder, and oddities.

/// Metres that bones may differ from HumanML3D's.
const BONES: f32 = 0.02;
/// Metres below or above the floor at which the lowest joint of a clip may be.
const FLOOR: f32 = 0.1;

/// The findings over all files.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Sentences about unusable items.
    pub problems: Vec<String>,
    /// Sentences about odd but usable items.
    pub remarks: Vec<String>,
}

/// Looks at every file of a folder in the HumanML3D layout.
pub fn check_folder(path: &Path) -> Checked {
    let options = |broken| HumanMl3dOptions { broken, ..HumanMl3dOptions::default() };
    let open = |broken| HumanMl3d::open(path, &options(broken));
    let (problems, data) = match open(BrokenFiles::Refuse) {
        // Sound clips among broken files are examined too.
        Err(DataError::Broken { problems, .. }) => (problems, open(BrokenFiles::Skip)),
        data => (Vec::new(), data),
    };
    let mut checked = Checked { problems, ..Checked::default() };
    match data {
        Ok(data) => {
            let broken: HashSet<&String> = checked.problems.iter().collect();
            let odd = data.warnings().iter().filter(|line| !broken.contains(line));
            checked.remarks.extend(odd.cloned());
            checked.remarks.extend(unlisted(path));
            checked.remarks.extend(odd_clips(&data));
        }
        Err(error) => checked.problems.push(error.to_string()),
    }
    checked
}

/// Motions that no split lists.
fn unlisted(path: &Path) -> Option<String> {
    let files = MotionFiles::of(path).filter(|files| !files.in_folders())?;
    let listed: HashSet<String> =
        read_splits(path, false).ok()?.clips.into_iter().map(|(_, id)| id).collect();
    let entries = std::fs::read_dir(path.join(files.folder)).ok()?.flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".npy")?.to_string()))
        .filter(|name| !listed.contains(name) && !listed.contains(name.trim_start_matches('M')))
        .collect();
    names.sort();
    let first = names.first()?;
    Some(format!("{} motions are in no split, as {first}", names.len()))
}

/// A sentence for each way in which clips are odd.
fn odd_clips(data: &HumanMl3d) -> Vec<String> {
    let clips = data.clips(&Split::ALL);
    let found: Vec<[bool; WAYS.len()]> =
        clips.par_iter().map(|clip| oddities(data, *clip)).collect();
    let sentence = |(way, words): (usize, &&str)| {
        let mut odd = clips.iter().zip(&found).filter(|(_, odd)| odd[way]).map(|(clip, _)| *clip);
        let (split, index) = odd.next()?;
        Some(format!("{} clips {words}, as {}", odd.count() + 1, data.clip_id(split, index)))
    };
    WAYS.iter().enumerate().filter_map(sentence).collect()
}

const WAYS: [&str; 4] = [
    "have bones that are not HumanML3D's",
    "do not touch the floor, or go below it",
    "have features far from their mean: Mean.npy and Std.npy are of other data, or the features are \
     normalised already",
    "repeat a frame through all their length",
];

fn oddities(data: &HumanMl3d, (split, index): (Split, usize)) -> [bool; WAYS.len()] {
    let Ok(features) = data.features(split, index) else { return [false; WAYS.len()] };
    let poses = recover_joints(&features);
    let far = data.stats().deviations(&features);
    let still = poses.windows(2).all(|pair| pair[0] == pair[1]);
    [!poses.first().is_some_and(has_bones), lowest(&poses).abs() > FLOOR, far > FAR, still]
}

fn has_bones(pose: &Pose) -> bool {
    (1..N_JOINTS).all(|joint| {
        let parent = pose[PARENTS[joint].unwrap_or(0)];
        let squares: f32 = (0..3).map(|c| (pose[joint][c] - parent[c]).powi(2)).sum();
        (squares.sqrt() - BONE_LENGTHS[joint]).abs() < BONES
    })
}
