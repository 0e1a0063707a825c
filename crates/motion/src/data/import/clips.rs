//! [`Clips`]: the motions cut into clips, each with captions, a group and a split.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::Path;

use serde::Serialize;

use super::listing::{Listing, SourceFile, groups, splits};
use super::options::{ImportError, ImportOptions, Motion, Motions, Skeleton};
use crate::data::texts::{parse_annotation, parse_annotations};
use crate::data::{Found, Held, Look, Seen, Split, look};
use crate::files::read_text;
use crate::motion::retarget::words;
use crate::motion::{Pose, canonicalise, is_canonical};

/// A clip of the data set.
pub struct Clip {
    pub id: String,
    /// The file that it comes from, relative to the folder that is imported.
    pub source: String,
    /// Frames of the whole motion, at the rate of the data set, that it is.
    pub frames: Range<usize>,
    /// Canonical; see [`canonicalise`].
    pub poses: Vec<Pose>,
    pub captions: Vec<String>,
    pub captioned_by: CaptionSource,
    pub group: String,
    pub split: Split,
    /// Frames per second of the file.
    pub source_fps: f64,
    /// Metres in one of the file's units; `None` if places stay as they are.
    pub unit_m: Option<f64>,
}

/// The clips of all files, and the rest of `import.json`: the imported files, the settings, and the files left out.
#[derive(Default, Serialize)]
pub struct Clips {
    /// The format of the files.
    pub form: &'static str,
    /// Frames per second.
    pub fps: f64,
    pub left_handed: bool,
    #[serde(skip)]
    pub clips: Vec<Clip>,
    pub skeletons: Vec<Skeleton>,
    /// A sentence for each file that cannot be used.
    pub problems: Vec<String>,
    /// Sentences about files and clips that are used and may be wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Sentences about motions shorter than a clip.
    pub too_short: Vec<String>,
    #[serde(skip)]
    pub draft: Option<String>,
}

impl Clips {
    /// Cuts, captions, groups and splits the motions.
    ///
    /// # Errors
    /// Nothing can be used, or there are too few groups.
    pub fn of(
        motions: Motions,
        listing: &Listing,
        options: &ImportOptions,
    ) -> Result<Self, ImportError> {
        let groups = groups(&listing.files, options.group);
        let Motions { motions, skeletons, draft } = motions;
        let fps = options.rate.of_all(&motions)?;
        let (form, left_handed) = (options.form.name(), options.left_handed);
        let mut all = Self { form, left_handed, fps, skeletons, draft, ..Self::default() };
        for ((motion, file), group) in motions.into_iter().zip(&listing.files).zip(groups) {
            let remark = motion.as_ref().ok().and_then(|motion| motion.remark.as_ref());
            all.remarks.extend(remark.map(|remark| format!("{}: {remark}", file.name)));
            match motion.and_then(|motion| clips(motion, file, (group, fps), listing, options)) {
                Ok(clips) if clips.is_empty() => {
                    all.too_short.push(format!("{}: too short", file.name));
                }
                Ok(clips) => all.clips.extend(clips),
                Err(problem) => all.problems.push(format!("{}: {problem}", file.name)),
            }
        }
        if all.clips.is_empty() {
            let problems = [all.problems, all.too_short].concat();
            return Err(ImportError::NothingUsable { problems, draft: all.draft });
        }
        all.split(listing.splits.as_ref())?;
        let seen = all.clips.iter();
        let seen = seen.map(|c| Seen::of(&c.id, Some(c.split), Held::Poses(&c.poses)));
        let found = look(&seen.collect::<Vec<_>>(), Look::ALL);
        let odd = found.iter().filter(|own| !own.finding.is_minor());
        all.remarks.extend(odd.map(Found::to_string));
        Ok(all)
    }

    /// Assigns each clip a split: from the folder, or by groups.
    fn split(&mut self, told: Option<&HashMap<String, Split>>) -> Result<(), ImportError> {
        if let Some(told) = told {
            let (known, other): (Vec<Clip>, Vec<Clip>) =
                self.clips.drain(..).partition(|clip| told.contains_key(base(&clip.id)));
            self.clips = known;
            let problem =
                |clip: &Clip| format!("{}: is in none of train, val and test.txt", clip.source);
            self.problems.extend(other.iter().map(problem));
            self.clips.iter_mut().for_each(|clip| clip.split = told[base(&clip.id)]);
            return Ok(());
        }
        let mut frames: BTreeMap<String, usize> = BTreeMap::new();
        for clip in &self.clips {
            *frames.entry(clip.group.clone()).or_default() += clip.poses.len();
        }
        let noun = if frames.len() == 1 { "group" } else { "groups" };
        let found = format!("{} {noun} of motions", frames.len());
        let splits = splits(&frames).ok_or(ImportError::TooFewGroups { found })?;
        self.clips.iter_mut().for_each(|clip| clip.split = splits[&clip.group]);
        Ok(())
    }
}

/// Moves the poses to the origin, on the floor, facing +z; unchanged if they are there already.
fn canonical(poses: &[Pose]) -> Vec<Pose> {
    if is_canonical(poses) { poses.to_vec() } else { canonicalise(poses) }
}

/// The file's name of a clip that is a part of it.
fn base(id: &str) -> &str {
    id.split('~').next().unwrap_or(id)
}

fn clips(
    motion: Motion,
    file: &SourceFile,
    (group, fps): (String, f64),
    listing: &Listing,
    options: &ImportOptions,
) -> Result<Vec<Clip>, String> {
    let poses: Vec<Pose> =
        motion.poses.iter().map(|pose| pose.map(|joint| joint.map(|c| c as f32))).collect();
    if poses.len() < SHORTEST {
        return Ok(Vec::new());
    }
    let (lines, captioned_by) = captions(file, listing, options)?;
    let cuts = cuts(&poses);
    let parts = cuts.len();
    let clip = |(part, frames): (usize, Range<usize>)| Clip {
        id: if parts == 1 { file.id.clone() } else { format!("{}~{}", file.id, part + 1) },
        source: file.name.clone(),
        poses: canonical(&poses[frames.clone()]),
        captions: if parts == 1 { lines.clone() } else { within(&lines, &frames, fps) },
        captioned_by,
        group: group.clone(),
        split: Split::Train,
        source_fps: motion.fps,
        unit_m: motion.unit_m,
        frames,
    };
    let clips = cuts.into_iter().enumerate().map(clip);
    Ok(clips.filter(|clip| !clip.captions.is_empty()).collect())
}

// Long motions into clips.

/// Poses of the shortest clip that a data set takes: 40 frames of features.
pub const SHORTEST: usize = 41;
/// Poses of the longest clip that stays whole: 199 frames of features.
const LONGEST: usize = 200;
/// Poses of the longest part of a motion that is cut.
const WINDOW: usize = 196;
/// Poses on either side of an even division among which the calmest is looked for.
const NEAR: usize = 20;

/// The clips of a motion: all of it up to 200 poses; of a longer one even parts of at most 196, parted where
/// the body is calmest near the even division. Parts too short for a clip do not come about.
fn cuts(poses: &[Pose]) -> Vec<Range<usize>> {
    let n = poses.len();
    if n <= LONGEST {
        return std::iter::once(0..n).collect();
    }
    let parts = n.div_ceil(WINDOW);
    let mut cuts = Vec::with_capacity(parts);
    let mut first = 0;
    for part in 1..parts {
        let even = n * part / parts;
        // The rest must still fit into the remaining parts.
        let least = even.saturating_sub(NEAR).max(n.saturating_sub(WINDOW * (parts - part)));
        let most = (even + NEAR).min(first + WINDOW);
        let at = (least..=most).min_by(|a, b| speed(poses, *a).total_cmp(&speed(poses, *b)));
        let at = at.unwrap_or(even);
        cuts.push(first..at);
        first = at;
    }
    cuts.push(first..n);
    cuts
}

/// The squares of the joints' steps to this pose.
fn speed(poses: &[Pose], at: usize) -> f32 {
    let [before, here] = [&poses[at - 1], &poses[at]].map(|pose| pose.as_flattened());
    before.iter().zip(here).map(|(a, b)| (a - b) * (a - b)).sum()
}

// Captions of motions: lines of a file, words of the name, or the default caption.

/// The source of a motion's captions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptionSource {
    /// A `.txt` file.
    File,
    /// Words of the file's name.
    Name,
    /// The caption that is given for motions without one.
    Given,
}

impl CaptionSource {
    pub fn name(self) -> &'static str {
        ["file", "name", "given"][self as usize]
    }
}

/// Words of names that say nothing of a motion.
const EMPTY: [&str; 10] =
    ["dataset", "take", "clip", "motion", "mocap", "anim", "animation", "capture", "final", "bvh"];

/// The captions of a file's motion, in HumanML3D's grammar, and their source.
///
/// # Errors
/// A sentence: the file of captions cannot be read, or a line is none.
fn captions(
    file: &SourceFile,
    listing: &Listing,
    options: &ImportOptions,
) -> Result<(Vec<String>, CaptionSource), String> {
    let beside = match &listing.texts {
        Some(folder) => {
            // Under the file's own name, which may hold blanks, or under the name of the clip.
            let named = |name: &String| folder.join(format!("{name}.txt"));
            let own = file.stem.as_ref().map(named).filter(|path| path.exists());
            own.unwrap_or_else(|| named(&file.id))
        }
        None => file.path.with_extension("txt"),
    };
    if beside.exists() {
        return Ok((lines(&beside)?, CaptionSource::File));
    }
    if listing.texts.is_some() {
        return Err(format!("has no captions: there is no {}", beside.display()));
    }
    Ok(match words_of(&file.id) {
        Some(words) => (vec![line(&words)], CaptionSource::Name),
        None => (vec![line(&options.caption)], CaptionSource::Given),
    })
}

fn lines(path: &Path) -> Result<Vec<String>, String> {
    let told = |problem: String| format!("{}: {problem}", path.display());
    let text = read_text(path).map_err(|error| told(error.to_string()))?;
    let (_, problems) = parse_annotations(&text);
    if let Some(problem) = problems.first() {
        return Err(told(problem.clone()));
    }
    let full =
        text.trim_start_matches('\u{feff}').lines().map(str::trim).filter(|line| !line.is_empty());
    let whole = |text: &str| if text.contains('#') { text.to_string() } else { line(text) };
    let lines: Vec<String> = full.map(whole).collect();
    if lines.is_empty() { Err(told("holds no caption".to_string())) } else { Ok(lines) }
}

/// A caption of the whole clip. Parts of speech are not known: each word is `OTHER`.
pub fn line(caption: &str) -> String {
    let words = caption.split_whitespace().map(str::to_lowercase).collect::<Vec<_>>();
    let tags = words.iter().map(|word| {
        let letters: String = word.chars().filter(|c| c.is_alphabetic()).collect();
        format!("{letters}/OTHER")
    });
    let tags: Vec<String> = tags.filter(|tag| !tag.starts_with('/')).collect();
    format!("{}#{}#0.0#0.0", words.join(" "), tags.join(" "))
}

/// The words of `walk-left_normal_001` and of `WalkLeft01`; `None` if it has none.
fn words_of(id: &str) -> Option<String> {
    let is_word = |word: &str| {
        word.chars().count() > 1 && word.chars().all(char::is_alphabetic) && !EMPTY.contains(&word)
    };
    let words = words(id);
    let parts = words.iter().flat_map(|word| word.split(|c: char| c.is_ascii_digit()));
    let words: Vec<&str> = parts.filter(|word| is_word(word)).collect();
    (!words.is_empty()).then(|| words.join(" "))
}

/// The lines that apply to some poses of a motion at `fps`: captions of the whole are unchanged, those of a part are
/// shifted. Parts shorter than a clip are dropped.
fn within(lines: &[String], frames: &Range<usize>, fps: f64) -> Vec<String> {
    let [from, to] = [frames.start, frames.end].map(|frame| frame as f64 / fps);
    let moved = |line: &String| {
        let Some((begin, stop)) = parse_annotation(line).ok()?.span_s else {
            return Some(line.clone());
        };
        let (begin, stop) = (begin.max(from) - from, stop.min(to) - from);
        let fields: Vec<&str> = line.split('#').collect();
        let lasts = (stop - begin) * fps >= SHORTEST as f64 - 1.0;
        lasts.then(|| format!("{}#{}#{begin:.3}#{stop:.3}", fields[0], fields[1]))
    };
    lines.iter().filter_map(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    /// Poses that move by a millimetre a frame, but for one at rest.
    fn poses(n: usize, rest: usize) -> Vec<Pose> {
        let mut x = 0.0;
        let place = |t: usize| {
            x += if t == rest { 0.0 } else { 0.001 };
            [[x, 0.0, 0.0]; N_JOINTS]
        };
        (0..n).map(place).collect()
    }

    #[test]
    fn motions_of_any_length_are_parted_without_a_gap() {
        for n in (41..1200).step_by(7) {
            let cuts = cuts(&poses(n, 0));
            let longest = if n <= LONGEST { LONGEST } else { WINDOW };
            assert_eq!((cuts[0].start, cuts[cuts.len() - 1].end), (0, n));
            assert!(cuts.windows(2).all(|pair| pair[0].end == pair[1].start), "{n}");
            assert!(
                cuts.iter().all(|cut| (SHORTEST..=longest).contains(&cut.len())),
                "{n}: {cuts:?}"
            );
        }
    }

    #[test]
    fn the_calmest_frame_near_the_middle_parts_a_motion() {
        assert_eq!(cuts(&poses(300, 141)), [0..141, 141..300]);
        assert_eq!(cuts(&poses(300, 90))[0].end.abs_diff(150), 20);
    }

    #[test]
    fn names_give_words_where_they_hold_some() {
        let cases = [
            ("dataset-1_walk-left_normal_001", Some("walk left normal")),
            ("WalkLeft01", Some("walk left")),
            ("RunFast_take_02", Some("run fast")),
            ("02_03", None),
            ("b1_x", None),
        ];
        for (id, words) in cases {
            assert_eq!(words_of(id).as_deref(), words, "{id}");
        }
        assert_eq!(line("A man,  runs"), "a man, runs#a/OTHER man/OTHER runs/OTHER#0.0#0.0");
    }

    #[test]
    fn captions_of_parts_move_with_the_clip() {
        let lines = ["a#a/X#0.0#0.0", "b#b/X#2.0#9.0", "c#c/X#0.0#4.0", "d"].map(String::from);
        let expected = ["a#a/X#0.0#0.0", "b#b/X#0.000#4.000", "d"].map(String::from);
        assert_eq!(within(&lines, &(100..200), 20.0), expected);
    }
}
