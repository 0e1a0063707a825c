//! One clip as it lies on disk: its features and its captions.

use std::path::Path;

use super::captions::{Annotation, parse_annotations};
use super::digest::UsedFile;
use super::motion_files::MotionFiles;
use super::npy::parse_npy;
use crate::files::{LARGE, read_regular};
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

/// What one file of a clip holds.
type Held<T> = Result<(T, UsedFile), String>;

/// Reads the motion of a clip and `texts/<id>.txt` in `root`: the clip if it can be used at all, and a sentence
/// for each thing that is wrong with it.
///
/// Both are always read, so that all that is wrong is told at once. A bad line among good captions
/// is a problem, and the clip can still be used.
pub(super) fn load_clip(
    root: &Path,
    files: MotionFiles,
    id: &str,
) -> (Option<ClipFile>, Vec<String>) {
    crate::progress::moved();
    let mut problems = Vec::new();
    let features = read_features(root, files, id).map_err(|problem| problems.push(problem)).ok();
    let texts = format!("{}/{id}.txt", files.texts(root));
    let annotations = read_annotations(root, &texts, &mut problems);
    let annotations = annotations.map_err(|problem| problems.push(problem)).ok();
    let clip = features.zip(annotations).map(
        |((features, features_file), (annotations, captions_file))| ClipFile {
            id: id.to_owned(),
            features,
            annotations,
            files: [features_file, captions_file],
        },
    );
    (clip, problems)
}

fn read_features(root: &Path, files: MotionFiles, id: &str) -> Held<Vec<f32>> {
    let name = files.name(id);
    let bytes = read(root, &name)?;
    let features = parse_npy(&bytes).and_then(|array| files.features(array));
    let features = features.map_err(|problem| format!("{name}: {problem}"))?;
    Ok((features, UsedFile::new(&name, &bytes)))
}

/// The annotations of a file; `problems` are of lines that hold none.
fn read_annotations(root: &Path, name: &str, problems: &mut Vec<String>) -> Held<Vec<Annotation>> {
    let bytes = read(root, name)?;
    let content = std::str::from_utf8(&bytes).map_err(|_| format!("{name}: is not UTF-8"))?;
    let (annotations, lines) = parse_annotations(content);
    problems.extend(lines.iter().map(|line| format!("{name}: {line}")));
    if annotations.is_empty() {
        return Err(format!("{name}: holds no caption"));
    }
    Ok((annotations, UsedFile::new(name, &bytes)))
}

fn read(root: &Path, name: &str) -> Result<Vec<u8>, String> {
    read_regular(&root.join(name), LARGE)
        .map_err(|error| format!("{name}: cannot be read: {error}"))
}
