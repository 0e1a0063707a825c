//! Writes an imported data set into a temporary folder and renames it; also writes the procedural motion.

use std::collections::HashSet;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::clips::{CaptionSource, Clip, Clips, line};
use super::options::{ImportError, Skeleton};
use crate::data::npy::npy_bytes;
use crate::data::{FPS, MotionSource, Procedural, Split, StatsAccumulator};
use crate::files::FileError;
use crate::files::atomic::{PARTIAL, with_digest};
use crate::motion::{N_FEATURES, N_JOINTS, canonicalise, features_of_canonical_at};

/// The file that marks a folder of this command.
const MARK: &str = "import.json";

/// Clips with features in memory at a time.
const AT_ONCE: usize = 256;

/// The result of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// Clips by split: train, val, test.
    pub splits: [SplitCount; 3],
    /// Frames per second of the data set.
    pub fps: f64,
    pub skeletons: Vec<Skeleton>,
    /// Clips whose caption is the one given for motions without.
    pub uncaptioned: usize,
    /// Clips whose caption is the words of their name.
    pub captioned_by_name: usize,
    /// Sentences about files that cannot be used, and about the whole.
    pub problems: Vec<String>,
    /// Sentences about files and clips that are used and may be wrong.
    pub remarks: Vec<String>,
    /// Motions left out because they are shorter than a clip.
    pub too_short: usize,
    /// A mapping file to fill in, if some joints of a skeleton are unknown.
    pub draft: Option<String>,
}

/// Clips and frames of features of a split.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SplitCount {
    pub clips: usize,
    pub frames: usize,
    pub groups: usize,
}

/// Whether `to` may be written.
///
/// # Errors
/// It exists and must not be overwritten, or it was not made by an import.
pub fn check_place(to: &Path, overwrite: bool) -> Result<(), ImportError> {
    let path = to.to_path_buf();
    match (to.exists(), overwrite) {
        (false, _) => Ok(()),
        (true, false) => Err(ImportError::Exists { path }),
        (true, true) if to.join(MARK).exists() => Ok(()),
        (true, true) => Err(ImportError::NotImported { path }),
    }
}

/// Writes the data set `to`.
///
/// # Errors
/// A file cannot be written; then the previous state remains.
pub fn write(clips: Clips, to: &Path) -> Result<Imported, ImportError> {
    let partial = beside(to, PARTIAL);
    remove(&partial)?;
    let told = fill(&clips, &partial).inspect_err(|_| {
        // A partial folder is useless.
        let _ = fs::remove_dir_all(&partial);
    })?;
    let old = beside(to, &format!("{PARTIAL}old-"));
    remove(&old)?;
    if to.exists() {
        fs::rename(to, &old).map_err(FileError::write(&old))?;
    }
    fs::rename(&partial, to).map_err(FileError::write(to))?;
    remove(&old)?;
    Ok(imported(clips, told))
}

/// A folder next to `to`, removed by a later import if this one is killed.
fn beside(to: &Path, prefix: &str) -> PathBuf {
    to.with_file_name(format!("{prefix}{}", to.file_name().unwrap_or_default().to_string_lossy()))
}

fn remove(folder: &Path) -> Result<(), FileError> {
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(FileError::write(folder))
    } else {
        Ok(())
    }
}

/// Writes every file; the sentences are about the whole.
fn fill(clips: &Clips, to: &Path) -> Result<Vec<String>, FileError> {
    for folder in ["new_joints", "new_joint_vecs", "texts"] {
        let folder = to.join(folder);
        fs::create_dir_all(&folder).map_err(FileError::write(&folder))?;
    }
    let put = |name: &str, bytes: &[u8]| {
        let path = to.join(name);
        fs::write(&path, bytes).map_err(FileError::write(&path))
    };
    let mut sums = StatsAccumulator::default();
    for chunk in clips.clips.chunks(AT_ONCE) {
        let features = chunk.par_iter().map(|clip| write_clip(clip, clips.fps, &put));
        let features: Vec<Vec<f32>> = features.collect::<Result<_, _>>()?;
        let train = chunk.iter().zip(&features).filter(|(clip, _)| clip.split == Split::Train);
        train.for_each(|(_, rows)| sums.add(rows));
    }
    let mut told = Vec::new();
    match sums.finish() {
        Some(stats) => {
            put("Mean.npy", &npy_bytes(&[N_FEATURES], &stats.mean))?;
            put("Std.npy", &npy_bytes(&[N_FEATURES], &stats.std))?;
        }
        None => told.push(
            "a group of features is constant over the training clips, so that nothing can be divided by its \
             deviation; add motions"
                .to_string(),
        ),
    }
    let ids = |wanted: &[Split]| -> String {
        let of = clips.clips.iter().filter(|clip| wanted.contains(&clip.split));
        of.map(|clip| format!("{}\n", clip.id)).collect()
    };
    for split in Split::ALL {
        put(&format!("{}.txt", split.name()), ids(&[split]).as_bytes())?;
    }
    put("train_val.txt", ids(&[Split::Train, Split::Val]).as_bytes())?;
    put("all.txt", ids(&Split::ALL).as_bytes())?;
    put("manifest.csv", manifest(&clips.clips).as_bytes())?;
    let document = with_digest(clips).map_err(FileError::write(&to.join(MARK)))?;
    put(MARK, &document)?;
    Ok(told)
}

/// Writes the files of a clip of `fps` frames a second and returns its features.
fn write_clip(
    clip: &Clip,
    fps: f64,
    put: &impl Fn(&str, &[u8]) -> Result<(), FileError>,
) -> Result<Vec<f32>, FileError> {
    crate::progress::moved();
    let id = &clip.id;
    let joints = clip.poses.as_flattened().as_flattened();
    let features = features_of_canonical_at(&clip.poses, fps);
    let rows = features.len() / N_FEATURES;
    put(&format!("new_joints/{id}.npy"), &npy_bytes(&[clip.poses.len(), N_JOINTS, 3], joints))?;
    put(&format!("new_joint_vecs/{id}.npy"), &npy_bytes(&[rows, N_FEATURES], &features))?;
    put(&format!("texts/{id}.txt"), (clip.captions.join("\n") + "\n").as_bytes())?;
    Ok(features)
}

fn imported(clips: Clips, told: Vec<String>) -> Imported {
    let count = |split: Split| {
        let own: Vec<&Clip> = clips.clips.iter().filter(|clip| clip.split == split).collect();
        let groups: HashSet<&String> = own.iter().map(|clip| &clip.group).collect();
        let frames = own.iter().map(|clip| clip.poses.len() - 1).sum();
        SplitCount { clips: own.len(), frames, groups: groups.len() }
    };
    let by = |source| clips.clips.iter().filter(|clip| clip.captioned_by == source).count();
    Imported {
        fps: clips.fps,
        splits: Split::ALL.map(count),
        uncaptioned: by(CaptionSource::Given),
        captioned_by_name: by(CaptionSource::Name),
        too_short: clips.too_short.len(),
        problems: [clips.problems, told].concat(),
        remarks: clips.remarks,
        skeletons: clips.skeletons,
        draft: clips.draft,
    }
}

// `manifest.csv`: a row a clip.

/// The head of `manifest.csv`.
const COLUMNS: &str = "id,source_file,start,end,frames,source_fps,unit_m,captions,group,split";

/// The rows of all clips.
fn manifest(clips: &[Clip]) -> String {
    let mut text = format!("{COLUMNS}\n");
    for clip in clips {
        let unit_m = clip.unit_m.map_or(String::new(), |unit_m| format!("{unit_m:.6}"));
        let [id, source, group] = [&clip.id, &clip.source, &clip.group].map(|field| quoted(field));
        let Range { start, end } = &clip.frames;
        let (n, fps) = (clip.poses.len(), clip.source_fps);
        let (by, split) = (clip.captioned_by.name(), clip.split.name());
        text += &format!("{id},{source},{start},{end},{n},{fps},{unit_m},{by},{group},{split}\n");
    }
    text
}

/// A field as RFC 4180 writes it.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", field.replace('"', "\"\""));
    }
    field.to_string()
}

// The procedural motion as a folder.

/// Writes every clip of `source` as the data set `to`; train, val and test are its own.
///
/// # Errors
/// [`ImportError`]: the folder is there already or cannot be written.
pub fn write_procedural(
    source: &Procedural,
    to: &Path,
    overwrite: bool,
) -> Result<Imported, ImportError> {
    check_place(to, overwrite)?;
    let clip = |&(split, index): &(Split, usize)| {
        let id = source.clip_id(split, index);
        let poses = canonicalise(&source.poses(split, index));
        Clip {
            source: String::new(),
            frames: 0..poses.len(),
            poses,
            captions: source.captions(split, index).iter().map(|caption| line(caption)).collect(),
            captioned_by: CaptionSource::File,
            group: id.clone(),
            split,
            source_fps: FPS,
            unit_m: None,
            id,
        }
    };
    let clips = source.clips(&Split::ALL).par_iter().map(clip).collect();
    write(Clips { form: "procedural", fps: FPS, clips, ..Clips::default() }, to)
}
