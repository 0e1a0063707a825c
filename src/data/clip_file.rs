//! One clip as it lies on disk: its features and its captions.

use std::path::Path;

use super::captions::{Annotation, parse_annotations};
use super::digest::UsedFile;
use super::npy::{NpyProblem, parse_npy};
use crate::motion::N_FEATURES;

/// A clip whose two files are sound.
pub(super) struct ClipFile {
    /// The stem of its files.
    pub id: String,
    /// `[T, 263]` row-major, T ≥ 1.
    pub features: Vec<f32>,
    /// At least one.
    pub annotations: Vec<Annotation>,
    pub files: [UsedFile; 2],
}

impl ClipFile {
    pub(super) fn n_frames(&self) -> usize {
        self.features.len() / N_FEATURES
    }
}

/// A clip as far as it could be read, and a sentence for each thing that is wrong with it.
pub(super) struct LoadedClip {
    /// Absent if the clip cannot be used at all.
    pub clip: Option<ClipFile>,
    pub problems: Vec<String>,
}

/// Reads `new_joint_vecs/<id>.npy` and `texts/<id>.txt` in `root`.
///
/// Both are always read, so that all that is wrong is told at once. A bad line among good captions
/// is a problem, and the clip can still be used.
pub(super) fn load_clip(root: &Path, id: &str) -> LoadedClip {
    crate::progress::moved();
    let mut problems = Vec::new();
    let features = read_features(root, id).map_err(|problem| problems.push(problem)).ok();
    let annotations = read_annotations(root, id, &mut problems);
    let clip = features.zip(annotations).map(
        |((features, features_file), (annotations, captions_file))| ClipFile {
            id: id.to_owned(),
            features,
            annotations,
            files: [features_file, captions_file],
        },
    );
    LoadedClip { clip, problems }
}

/// Name within the data set of the features of clip `id`.
pub(super) fn features_name(id: &str) -> String {
    format!("new_joint_vecs/{id}.npy")
}

fn read_features(root: &Path, id: &str) -> Result<(Vec<f32>, UsedFile), String> {
    let name = features_name(id);
    let bytes = read(root, &name)?;
    let array = parse_npy(&bytes).map_err(|problem| format!("{name}: {problem}"))?;
    match array.shape[..] {
        [n_frames, N_FEATURES] if n_frames > 0 => Ok((array.values, UsedFile::new(&name, &bytes))),
        _ => {
            let shape = NpyProblem::Shape { found: array.shape, expected: "[frames, 263]" };
            Err(format!("{name}: {shape}"))
        }
    }
}

fn read_annotations(
    root: &Path,
    id: &str,
    problems: &mut Vec<String>,
) -> Option<(Vec<Annotation>, UsedFile)> {
    let name = format!("texts/{id}.txt");
    let bytes = read(root, &name).map_err(|problem| problems.push(problem)).ok()?;
    let Ok(content) = std::str::from_utf8(&bytes) else {
        problems.push(format!("{name}: is not UTF-8"));
        return None;
    };
    let (annotations, lines) = parse_annotations(content);
    problems.extend(lines.iter().map(|line| format!("{name}: {line}")));
    if annotations.is_empty() {
        problems.push(format!("{name}: holds no caption"));
        return None;
    }
    Some((annotations, UsedFile::new(&name, &bytes)))
}

fn read(root: &Path, name: &str) -> Result<Vec<u8>, String> {
    std::fs::read(root.join(name)).map_err(|error| format!("{name}: cannot be read: {error}"))
}
