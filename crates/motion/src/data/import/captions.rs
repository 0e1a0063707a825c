//! What motions are captioned with: lines of a file, words of their name, or the caption for all others.

use std::ops::Range;
use std::path::Path;

use super::cut::SHORTEST;
use super::listing::{Listing, SourceFile};
use super::options::ImportOptions;
use crate::data::captions::{parse_annotation, parse_annotations};
use crate::motion::retarget::words;

/// Where a motion's captions come from.
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

/// Lines of a motion, in HumanML3D's grammar, and where they come from.
pub type Captions = (Vec<String>, CaptionSource);

/// Words of names that say nothing of a motion.
const EMPTY: [&str; 10] =
    ["dataset", "take", "clip", "motion", "mocap", "anim", "animation", "capture", "final", "bvh"];

/// The captions of a file's motion.
///
/// # Errors
/// A sentence: the file of captions cannot be read, or a line is none.
pub fn captions(
    file: &SourceFile,
    listing: &Listing,
    options: &ImportOptions,
) -> Result<Captions, String> {
    let folder = options.texts.as_deref().or(listing.texts.as_deref());
    let beside = match folder {
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
    if listing.texts.is_some() || options.texts.is_some() {
        return Err(format!("has no captions: there is no {}", beside.display()));
    }
    Ok(match words_of(&file.id) {
        Some(words) => (vec![line(&words)], CaptionSource::Name),
        None => (vec![line(&options.caption)], CaptionSource::Given),
    })
}

fn lines(path: &Path) -> Result<Vec<String>, String> {
    let told = |problem: String| format!("{}: {problem}", path.display());
    let text = crate::files::read_text(path).map_err(|error| told(error.to_string()))?;
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

/// The words of `walk-left_normal_001` and of `WalkLeft01`; `None` where it has none.
fn words_of(id: &str) -> Option<String> {
    let is_word = |word: &str| {
        word.chars().count() > 1 && word.chars().all(char::is_alphabetic) && !EMPTY.contains(&word)
    };
    let words = words(id);
    let parts = words.iter().flat_map(|word| word.split(|c: char| c.is_ascii_digit()));
    let words: Vec<&str> = parts.filter(|word| is_word(word)).collect();
    (!words.is_empty()).then(|| words.join(" "))
}

/// The lines that hold for some poses of a motion of `fps` a second: captions of the whole as they are, those of a
/// part moved to where it is now. Parts of which less than a clip is left go.
pub fn within(lines: &[String], frames: &Range<usize>, fps: f64) -> Vec<String> {
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
