//! A look at a data set: how much it holds, for a plan and for people, and what is wrong or odd.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use serde::Serialize;

use super::humanml3d::{HumanMl3d, HumanMl3dOptions};
use super::look::is_image;
use super::motion_files::{FPS, MotionFiles, read_motion};
use super::source::{DataError, Member, MotionSource, Split};
use super::summary::{DataFacts, MemberFacts};
use super::texts::read_splits;
use crate::spec::{BrokenFiles, ClipShape};

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
            warnings: [source.warnings(), source.remarks()].concat(),
            members: source.members().iter().map(MemberFacts::of).collect(),
            lengths,
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

/// What a look at every file found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Sentences about unusable items.
    pub problems: Vec<String>,
    /// Sentences about odd but usable items.
    pub remarks: Vec<String>,
}

/// Looks at every file of a folder in the HumanML3D layout.
pub fn check_folder(path: &Path) -> Checked {
    let options =
        |broken| HumanMl3dOptions { broken, look_at_all: true, ..HumanMl3dOptions::default() };
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
            checked.remarks.extend(data.remarks().iter().cloned());
        }
        Err(error) => checked.problems.push(error.to_string()),
    }
    checked
}

/// Whether the motion `M<id>` is the mirror image of a listed one.
fn is_image_of_one(path: &Path, files: MotionFiles, name: &str, listed: &HashSet<String>) -> bool {
    let Some(own) = name.strip_prefix('M').filter(|own| listed.contains(*own)) else {
        return false;
    };
    let read = |id: &str| read_motion(&path.join(files.name(id)), FPS).ok();
    read(own).zip(read(name)).is_some_and(|(own, image)| is_image(&own, &image))
}

/// Motions that no split lists.
fn unlisted(path: &Path) -> Option<String> {
    let files = MotionFiles::of(path).filter(|files| !files.in_folders())?;
    let listed: HashSet<String> =
        read_splits(path, false).ok()?.clips.into_iter().map(|(_, id)| id).collect();
    let entries = std::fs::read_dir(path.join(files.folder)).ok()?.flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".npy")?.to_string()))
        .filter(|name| !listed.contains(name) && !is_image_of_one(path, files, name, &listed))
        .collect();
    names.sort();
    let first = names.first()?;
    Some(format!("{} motions are in no split, as {first}", names.len()))
}
