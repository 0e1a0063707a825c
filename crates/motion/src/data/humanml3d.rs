//! [`HumanMl3d`]: a folder in the HumanML3D layout as a [`MotionSource`].
//!
//! The folder holds `new_joint_vecs/<id>.npy` or else `new_joints/<id>.npy`, `texts/<id>.txt`,
//! `train.txt`, `val.txt`, `test.txt`, and may hold `Mean.npy` and `Std.npy`, and a `manifest.csv` that
//! says which clips were recorded together. Motion-X has `vector_263/<id>.npy` and
//! `texts/semantic_labels/<id>.txt`, whose ids have folders in them.

use std::collections::{HashMap, HashSet};
use std::io;
use std::path::Path;

use rayon::prelude::*;

use super::clips::{ClipFile, Item, LengthRule, items_of, load_clip, long_item};
use super::look::{Found, Held, Look, Seen, is_image, look};
use super::motion_files::{FPS, MotionFiles, frame_rate};
use super::source::{
    DataError, FeatureStats, Metadata, MotionSource, Split, StatsAccumulator, UsedFile, digest,
    read_stats,
};
use super::texts::{Groups, read_splits};
use crate::motion::{N_FEATURES, mirror_features};
use crate::spec::{BrokenFiles, LongClips};

/// How clips are made from the files; by default not mirrored, broken files skipped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HumanMl3dOptions {
    /// Whether each training clip `<id>` is joined by its mirror image `M<id>`: from the data
    /// set's own files if it has them, listed or not; by [`mirror_features`] if not.
    pub mirror: bool,
    /// The treatment of broken files and lines.
    pub broken: BrokenFiles,
    /// The lengths that are used.
    pub lengths: LengthRule,
    /// The use of training clips above them.
    pub long_clips: LongClips,
    /// Frames per second, if the folder does not store it.
    pub fps: Option<f64>,
    /// Whether every clip is looked at for what is odd, in place of a sample of them.
    pub look_at_all: bool,
}

/// Clips that are looked at as a data set is opened.
const LOOKED_AT: usize = 256;

/// A data set in memory: each clip's features once, in single precision.
pub struct HumanMl3d {
    library: Library,
    groups: Groups,
    metadata: Metadata,
}

impl HumanMl3d {
    /// Reads the data set in the folder `path`.
    ///
    /// Files are read in parallel; the result does not depend on the number of threads. `Mean.npy` and `Std.npy` are used
    /// if present, otherwise computed from the training items.
    ///
    /// # Errors
    /// [`DataError`] if a split file or a folder is missing, if `Mean.npy` or `Std.npy` is wrong,
    /// if a split has no usable clip, and for broken files if `options` refuses them.
    pub fn open(path: &Path, options: &HumanMl3dOptions) -> Result<HumanMl3d, DataError> {
        let motion = check_folders(path)?;
        let fps = frame_rate(path, motion, options.fps)?;
        let lists = read_splits(path, motion.in_folders())?;
        let is_there = |id: &str| path.join(motion.name(id)).exists();
        let mut wanted = wanted_clips(&lists.clips, options.mirror, is_there);
        let load = |wanted: &Wanted| load_clip(path, (motion, fps), &wanted.id);
        let loaded: Vec<(Option<ClipFile>, Vec<String>)> = wanted.par_iter().map(load).collect();
        let (mut library, mut broken) = (Library::default(), lists.problems);
        let strangers = twins(&mut wanted, &loaded);
        for (wanted, (clip, problems)) in wanted.iter().zip(loaded) {
            if !wanted.is_used {
                continue;
            }
            broken.extend(problems);
            if let Some(clip) = clip {
                library.add(clip, wanted, options, fps);
            }
        }
        let shown = path.display().to_string();
        if options.broken != BrokenFiles::Skip && !broken.is_empty() {
            return Err(DataError::Broken { path: shown, problems: broken });
        }
        let is_empty = |split: &Split| library.items[*split as usize].is_empty();
        if let Some(split) = Split::ALL.into_iter().find(is_empty) {
            return Err(DataError::EmptySplit { path: shown, split: split.name() });
        }
        let (stats, stats_files) = library.stats(path)?;
        let most = if options.look_at_all { usize::MAX } else { LOOKED_AT };
        let of_these = !stats_files.is_empty();
        let found = look(&library.seen(), Look { most, stats: Some(&stats), of_these });
        let odd = found.iter().filter(|own| options.look_at_all || !own.finding.is_minor());
        let remarks: Vec<String> = odd.map(Found::to_string).chain(strangers).collect();
        let files = [&lists.files[..], &library.files, &stats_files].concat();
        let digest = digest(&rules(options, motion, fps), &files);
        let mut warnings = [&broken[..], &library.skipped].concat();
        let groups = Groups::read(path).map_err(|problem| warnings.push(problem));
        let groups = groups.unwrap_or_default();
        let half_long = options.long_clips == LongClips::Half;
        if options.long_clips != LongClips::Skip && library.long.is_empty() {
            let most = options.lengths.max_frames;
            warnings.push(format!(
                "long_clips: no training clip with a caption is longer than {most} frames"
            ));
        }
        let metadata = Metadata { stats, fps: fps as f32, digest, half_long, warnings, remarks };
        Ok(HumanMl3d { library, groups, metadata })
    }
}

impl MotionSource for HumanMl3d {
    fn n_clips(&self, split: Split) -> usize {
        self.library.items[split as usize].len()
    }

    fn n_long(&self) -> usize {
        self.library.long.len()
    }

    fn clip_id(&self, split: Split, index: usize) -> String {
        self.library.item(split, index).id()
    }

    fn group(&self, split: Split, index: usize) -> String {
        self.groups.of(&self.library.item(split, index).stem)
    }

    fn n_frames(&self, split: Split, index: usize) -> usize {
        self.library.item(split, index).n_frames
    }

    fn captions(&self, split: Split, index: usize) -> Vec<String> {
        self.library.item(split, index).captions.clone()
    }

    fn tokens(&self, split: Split, index: usize) -> Vec<String> {
        self.library.item(split, index).tokens.clone()
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        Ok(self.library.features(self.library.item(split, index)))
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
}

/// The clips that were read: used ones, and their items.
#[derive(Default)]
struct Library {
    /// Features of each clip that some item refers to, `[T, 263]`.
    clips: Vec<Vec<f32>>,
    /// Split and name of each.
    names: Vec<(Split, String)>,
    /// Items of train, val and test.
    items: [Vec<Item>; 3],
    /// Training clips that are too long for items, where these are used.
    long: Vec<Item>,
    /// Files of the clips.
    files: Vec<UsedFile>,
    /// Sentences about sound clips whose length rules them out.
    skipped: Vec<String>,
}

impl Library {
    fn add(&mut self, clip: ClipFile, wanted: &Wanted, options: &HumanMl3dOptions, fps: f64) {
        let (index, rule) = (self.clips.len(), options.lengths);
        let uses_long = options.long_clips != LongClips::Skip && wanted.split == Split::Train;
        let long = uses_long.then(|| long_item(&clip, index, rule)).flatten();
        let place =
            if long.is_some() { &mut self.long } else { &mut self.items[wanted.split as usize] };
        let (items, skipped) = match long {
            Some(long) => (vec![long], Vec::new()),
            None => items_of(&clip, index, rule, fps),
        };
        self.skipped.extend(skipped);
        if items.is_empty() {
            return;
        }
        let twins: Vec<Item> =
            if wanted.twin { items.iter().map(Item::mirrored).collect() } else { Vec::new() };
        place.extend(items.into_iter().chain(twins));
        self.clips.push(clip.features);
        self.names.push((wanted.split, clip.id));
        self.files.extend(clip.files);
    }

    /// A clip of a split; long ones follow the others.
    fn item(&self, split: Split, index: usize) -> &Item {
        let own = &self.items[split as usize];
        own.get(index).unwrap_or_else(|| &self.long[index - own.len()])
    }

    /// The clips as they are looked at.
    fn seen(&self) -> Vec<Seen<'_>> {
        let clips = self.clips.iter().zip(&self.names);
        clips.map(|(rows, (split, id))| Seen::of(id, Some(*split), Held::Features(rows))).collect()
    }

    fn features(&self, item: &Item) -> Vec<f32> {
        let end = item.first_frame + item.n_frames;
        let rows = &self.clips[item.clip][item.first_frame * N_FEATURES..end * N_FEATURES];
        if item.mirrored { mirror_features(rows) } else { rows.to_vec() }
    }

    /// The folder's statistics with their files, or computed from the training items.
    fn stats(&self, path: &Path) -> Result<(FeatureStats, Vec<UsedFile>), DataError> {
        if let Some((stats, files)) = read_stats(path)? {
            return Ok((stats, files.to_vec()));
        }
        let mut accumulator = StatsAccumulator::default();
        for item in &self.items[Split::Train as usize] {
            accumulator.add(&self.features(item));
        }
        let problem = "a group of features is constant over the training clips, so that its \
                       deviation is zero; add other clips, or Mean.npy and Std.npy";
        let stats = accumulator.finish();
        Ok((stats.ok_or_else(|| DataError::invalid(path.display(), problem))?, Vec::new()))
    }
}

/// A clip to read.
struct Wanted {
    split: Split,
    id: String,
    /// The clip that its name says is its mirror image, `M<id>` of `<id>` or the other way round: its place.
    image: Option<usize>,
    /// Whether a mirrored twin of each item is made.
    twin: bool,
    /// Whether a split lists it; if not, it is read for its name.
    is_listed: bool,
    is_used: bool,
}

/// The listed clips; with `mirror`, each training clip's twin too, read or made.
fn wanted_clips(
    listed: &[(Split, String)],
    mirror: bool,
    is_there: impl Fn(&str) -> bool,
) -> Vec<Wanted> {
    let names: HashSet<&str> = listed.iter().map(|(_, id)| id.as_str()).collect();
    let mut wanted = Vec::with_capacity(listed.len());
    for (split, id) in listed {
        let mut want = |id: String, twin, is_listed| {
            wanted.push(Wanted { split: *split, id, image: None, twin, is_listed, is_used: true });
        };
        let needs_twin = mirror && *split == Split::Train;
        want(id.clone(), needs_twin, true);
        let twin_id = image_id(id);
        if needs_twin && !names.contains(&*twin_id) && is_there(&twin_id) {
            want(twin_id, false, false);
        }
    }
    let places: HashMap<String, usize> =
        wanted.iter().enumerate().map(|(place, own)| (own.id.clone(), place)).collect();
    for id in wanted.iter().map(|own| own.id.clone()).collect::<Vec<_>>() {
        if let Some(&image) = places.get(&image_id(&id)) {
            let own = places[&id];
            (wanted[own].image, wanted[image].image) = (Some(image), Some(own));
        }
    }
    wanted
}

/// The name that HumanML3D gives a clip's mirror image.
fn image_id(id: &str) -> String {
    let (folder, name) = id.split_at(id.rfind('/').map_or(0, |at| at + 1));
    format!("{folder}M{name}")
}

/// Decides by their motion which clips with such a name are mirror images: `March` is none of `arch`. The sentences
/// are about the others.
fn twins(wanted: &mut [Wanted], loaded: &[(Option<ClipFile>, Vec<String>)]) -> Vec<String> {
    let mut told = Vec::new();
    for own in 0..wanted.len() {
        let Some(image) = wanted[own].image.filter(|_| wanted[own].twin) else { continue };
        let features = |place: usize| loaded[place].0.as_ref().map(|clip| &clip.features);
        let are_read = features(own).zip(features(image));
        // Of a file that cannot be read the name is believed: it is told apart.
        if are_read.is_none_or(|(own, image)| is_image(own, image)) {
            wanted[own].twin = false;
            continue;
        }
        wanted[image].is_used = wanted[image].is_listed;
        let [id, other] = [own, image].map(|place| &wanted[place].id);
        let is_numbered = id
            .rsplit('/')
            .next()
            .is_some_and(|name| name.starts_with(|c: char| c.is_ascii_digit()));
        if is_numbered && *other == image_id(id) {
            told.push(format!(
                "{other} is not the mirror image of {id}, which gets one of its own"
            ));
        }
    }
    told
}

/// What the items follow from beside the files; its first word changes when the rules do.
///
/// The treatment of broken files is left out: it changes no item if nothing is broken, and refusing gives no data
/// set.
fn rules(options: &HumanMl3dOptions, motion: MotionFiles, fps: f64) -> String {
    let HumanMl3dOptions { mirror, lengths, long_clips, broken: _, fps: _, look_at_all: _ } =
        options;
    let LengthRule { min_frames, max_frames } = lengths;
    let rule = motion.rule;
    // Features that are made of joints are others at another rate since contacts and headings know it.
    let of_joints = if motion == MotionFiles::JOINTS { " contacts-2" } else { "" };
    let long = match long_clips {
        LongClips::Skip => "",
        LongClips::Mix => " long=mix",
        LongClips::Half => " long=half",
    };
    let rate = if fps == FPS { String::new() } else { format!(" fps={fps}{of_joints}") };
    format!(
        "humanml3d-1 mirror={mirror} min_frames={min_frames} max_frames={max_frames}{rule}{rate}{long}"
    )
}

/// How the folder holds its motion.
fn check_folders(path: &Path) -> Result<MotionFiles, DataError> {
    let advice = "a data set in the HumanML3D layout has its features in new_joint_vecs, or its \
                  joints in new_joints, and its captions in texts";
    let missing = |folder: &str| {
        DataError::read(&path.join(folder), advice)(io::Error::other("no such folder"))
    };
    let motion = MotionFiles::of(path).ok_or_else(|| missing("new_joint_vecs"))?;
    if path.join("texts").is_dir() { Ok(motion) } else { Err(missing("texts")) }
}

#[cfg(test)]
mod tests;
