//! Clips as they lie on disk, and the items made of them: cropping, sub-captions, mirroring.

use std::path::Path;

use super::motion_files::MotionFiles;
use super::npy::parse_npy;
use super::source::{UNIT_FRAMES, UsedFile};
use super::texts::{Annotation, parse_annotations};
use crate::files::{LARGE, read_regular};
use crate::motion::{N_FEATURES, mirror_caption};

/// A clip whose two files are sound.
pub struct ClipFile {
    /// The stem of its files.
    pub id: String,
    /// `[T, 263]` row-major, T ≥ 1.
    pub features: Vec<f32>,
    /// At least one.
    pub annotations: Vec<Annotation>,
    pub files: [UsedFile; 2],
}

impl ClipFile {
    pub fn n_frames(&self) -> usize {
        self.features.len() / N_FEATURES
    }
}

/// The content of one file of a clip.
type Held<T> = Result<(T, UsedFile), String>;

/// Reads the motion of a clip of `fps` frames a second and `texts/<id>.txt` in `root`: the clip if it can be used at all, and a sentence
/// for each thing that is wrong with it.
///
/// Both are always read, so that all that is wrong is told at once. A bad line among good captions
/// is a problem, and the clip can still be used.
pub fn load_clip(
    root: &Path,
    (files, fps): (MotionFiles, f64),
    id: &str,
) -> (Option<ClipFile>, Vec<String>) {
    crate::progress::moved();
    let mut problems = Vec::new();
    let features = read_features(root, (files, fps), id);
    let features = features.map_err(|problem| problems.push(problem)).ok();
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

fn read_features(root: &Path, (files, fps): (MotionFiles, f64), id: &str) -> Held<Vec<f32>> {
    let name = files.name(id);
    let bytes = read(root, &name)?;
    let features = parse_npy(&bytes).and_then(|array| files.features(array, fps));
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

// Items.

/// The lengths that are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthRule {
    /// Clips and parts with fewer frames are left out.
    pub min_frames: usize,
    /// Longest item; items that exceed it after cropping to a multiple of 4 are left out.
    pub max_frames: usize,
}

impl Default for LengthRule {
    /// 40 to 196 frames: 199 are cropped, 200 left out.
    fn default() -> Self {
        Self { min_frames: 40, max_frames: 196 }
    }
}

impl LengthRule {
    /// Length of the item made of `n_frames`: the next lower multiple of 4.
    ///
    /// # Errors
    /// A clause on the problem, if there are fewer frames than the smallest number, or more than the largest after
    /// cropping.
    fn crop(self, n_frames: usize) -> Result<usize, String> {
        let cropped = n_frames - n_frames % UNIT_FRAMES;
        let fewest = self.min_frames.max(UNIT_FRAMES);
        match n_frames {
            n if n < fewest => Err(format!("has {n} frames, fewer than {fewest}")),
            n if cropped > self.max_frames => {
                Err(format!("has {n} frames, too many for items of {}", self.max_frames))
            }
            _ => Ok(cropped),
        }
    }
}

/// A range of frames of one clip, with captions.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Index of the clip among those kept in memory.
    pub clip: usize,
    /// The stem of the clip's files.
    pub stem: String,
    /// Tells the parts of a clip apart; absent for the whole.
    pub letter: Option<char>,
    pub first_frame: usize,
    pub n_frames: usize,
    /// Whether features are mirrored on their way out.
    pub mirrored: bool,
    pub captions: Vec<String>,
    /// The [tokens](Annotation::tokens) of each caption.
    pub tokens: Vec<String>,
}

impl Item {
    /// The name for messages: `000012`, `A_000012` for a part, with `M` before the stem if mirrored.
    pub fn id(&self) -> String {
        let part = self.letter.map(|letter| format!("{letter}_")).unwrap_or_default();
        format!("{part}{}{}", if self.mirrored { "M" } else { "" }, self.stem)
    }

    /// The item with left and right exchanged.
    pub fn mirrored(&self) -> Item {
        let [captions, tokens] = [&self.captions, &self.tokens]
            .map(|texts| texts.iter().map(|text| mirror_caption(text)).collect());
        Item { mirrored: true, captions, tokens, ..self.clone() }
    }
}

/// The items of a clip, and a sentence for each that its length rules out.
///
/// The whole clip with the captions that describe it all, if there are any; then, for each caption
/// of a part, that part. A clip whose own length is ruled out gives no parts either, as in
/// text-to-motion's loader.
pub fn items_of(
    clip: &ClipFile,
    index: usize,
    rule: LengthRule,
    fps: f64,
) -> (Vec<Item>, Vec<String>) {
    let n_frames = match rule.crop(clip.n_frames()) {
        Ok(n_frames) => n_frames,
        Err(clause) => return (Vec::new(), vec![format!("clip {} {clause}; left out", clip.id)]),
    };
    let whole = whole(clip, index, n_frames);
    let (parts, skipped) = parts_of(clip, &whole, rule, fps);
    let whole = (!whole.captions.is_empty()).then_some(whole);
    (whole.into_iter().chain(parts).collect(), skipped)
}

/// All of a clip that is too long for an item, with the captions that describe it all; `None` if it is not, or has no
/// such caption.
pub fn long_item(clip: &ClipFile, index: usize, rule: LengthRule) -> Option<Item> {
    let n_frames = clip.n_frames() - clip.n_frames() % UNIT_FRAMES;
    let whole = whole(clip, index, n_frames);
    (n_frames > rule.max_frames && !whole.captions.is_empty()).then_some(whole)
}

/// The clip from its start, with the captions that describe it all.
fn whole(clip: &ClipFile, index: usize, n_frames: usize) -> Item {
    let of_whole = clip.annotations.iter().filter(|own| own.span_s.is_none());
    Item {
        clip: index,
        stem: clip.id.clone(),
        letter: None,
        first_frame: 0,
        n_frames,
        mirrored: false,
        captions: of_whole.clone().map(|own| own.caption.clone()).collect(),
        tokens: of_whole.map(|own| own.tokens.clone()).collect(),
    }
}

fn parts_of(clip: &ClipFile, whole: &Item, rule: LengthRule, fps: f64) -> (Vec<Item>, Vec<String>) {
    let (mut parts, mut skipped) = (Vec::new(), Vec::new());
    let spans = clip.annotations.iter().filter_map(|own| Some((own.span_s?, own)));
    for (((from_s, to_s), own), letter) in spans.zip(('A'..='Z').cycle()) {
        let [first_frame, end] = [from_s, to_s].map(|s| clip.n_frames().min((s * fps) as usize));
        match rule.crop(end - first_frame) {
            Ok(n_frames) => parts.push(Item {
                letter: Some(letter),
                first_frame,
                n_frames,
                captions: vec![own.caption.clone()],
                tokens: vec![own.tokens.clone()],
                ..whole.clone()
            }),
            Err(clause) => skipped.push(format!(
                "clip {}: the part from {from_s} to {to_s} s {clause}; left out",
                clip.id
            )),
        }
    }
    (parts, skipped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::parse_annotation;

    const RULE: LengthRule = LengthRule { min_frames: 40, max_frames: 196 };

    fn clip(n_frames: usize, lines: &[&str]) -> ClipFile {
        ClipFile {
            id: "000007".to_owned(),
            features: vec![0.0; n_frames * N_FEATURES],
            annotations: lines
                .iter()
                .map(|line| parse_annotation(line).expect("a good line"))
                .collect(),
            files: [UsedFile::new("a", b""), UsedFile::new("b", b"")],
        }
    }

    #[test]
    fn lengths_are_cropped_to_multiples_of_four_and_bounded() {
        let lengths = [39, 40, 43, 195, 196, 199].map(|n| RULE.crop(n).ok());
        assert_eq!(lengths, [None, Some(40), Some(40), Some(192), Some(196), Some(196)]);
        assert_eq!(RULE.crop(200).unwrap_err(), "has 200 frames, too many for items of 196");
        let no_minimum = LengthRule { min_frames: 0, ..RULE };
        assert_eq!(no_minimum.crop(3).unwrap_err(), "has 3 frames, fewer than 4");
    }

    #[test]
    fn captions_of_parts_become_items_of_their_own() {
        let clip = clip(150, &["he walks", "he sits##1.0#4.26", "he waves", "he left##5.0#99.0"]);
        let (items, skipped) = items_of(&clip, 3, RULE, 20.0);
        let seen: Vec<_> = items
            .iter()
            .map(|item| {
                (item.id(), item.clip, item.first_frame, item.n_frames, item.captions.join("|"))
            })
            .collect();
        // 1.0 to 4.26 s is frames 20 to 85; the last part ends with the clip, at frame 150.
        assert_eq!(
            seen,
            [
                ("000007".to_owned(), 3, 0, 148, "he walks|he waves".to_owned()),
                ("A_000007".to_owned(), 3, 20, 64, "he sits".to_owned()),
                ("B_000007".to_owned(), 3, 100, 48, "he left".to_owned()),
            ]
        );
        assert_eq!(skipped, [""; 0]);
        let mirrored = items[2].mirrored();
        assert_eq!((mirrored.id(), mirrored.mirrored), ("B_M000007".to_owned(), true));
        assert_eq!(mirrored.captions, ["he right"]);
        assert_eq!(items[0].mirrored().id(), "M000007");
    }

    #[test]
    fn times_are_frames_at_the_rate_of_the_data() {
        let (items, _) = items_of(&clip(150, &["he sits##1.0#4.0"]), 0, RULE, 30.0);
        assert_eq!((items[0].first_frame, items[0].n_frames), (30, 88));
    }

    #[test]
    fn a_clip_with_parts_alone_has_no_whole_item() {
        let (items, skipped) =
            items_of(&clip(150, &["he sits##1.0#4.0", "he runs##8.0#9.0"]), 0, RULE, 20.0);
        assert_eq!(items.iter().map(Item::id).collect::<Vec<_>>(), ["A_000007"]);
        assert_eq!(
            skipped,
            ["clip 000007: the part from 8 to 9 s has 0 frames, fewer than 40; left out"]
        );
    }

    #[test]
    fn a_clip_that_is_too_long_gives_no_parts_either() {
        let (items, skipped) = items_of(&clip(200, &["he sits##1.0#4.0"]), 0, RULE, 20.0);
        assert_eq!(items, []);
        assert_eq!(skipped, ["clip 000007 has 200 frames, too many for items of 196; left out"]);
    }
}
