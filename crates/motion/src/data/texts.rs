//! The texts of a folder: its captions, which clip belongs to which split, and which were recorded together.

use std::collections::HashMap;
use std::fmt::Display;
use std::io::ErrorKind;
use std::path::Path;

use super::source::{DataError, Split, UsedFile};
use crate::files::read_text;

// Lines of a caption file: `caption#tokens#from#to`.

/// One line about a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// The caption, lower-case, with single spaces.
    pub caption: String,
    /// Its words with their parts of speech, `a/DET person/NOUN walk/VERB`; empty if the line has none.
    pub tokens: String,
    /// The part of the clip that it describes, `[from, to)` in seconds; the whole clip if absent.
    pub span_s: Option<(f64, f64)>,
}

/// Why a line cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaptionProblem {
    /// Neither a caption alone nor all four fields.
    #[error("has {0} fields between `#`; write `caption#tokens#from#to`, or the caption alone")]
    Fields(usize),
    /// The text before the first `#` is empty.
    #[error("has no caption")]
    NoCaption,
    /// A time is not a number.
    #[error("has `{0}` where a time in seconds is needed")]
    Time(String),
    /// The times are not a span.
    #[error(
        "describes the time from {from} to {to} s, which is no span; `0.0#0.0` is the whole clip"
    )]
    Span { from: f64, to: f64 },
}

/// The annotation in `line`.
///
/// `nan` counts as 0, and from 0 to 0 is the whole clip. A line without `#` is a caption of the whole clip, as Motion-X
/// writes them.
///
/// # Errors
/// [`CaptionProblem`] if the line is neither.
pub fn parse_annotation(line: &str) -> Result<Annotation, CaptionProblem> {
    let fields: Vec<&str> = line.split('#').collect();
    let (text, tokens, span_s) = match fields[..] {
        [text] => (text, "", None),
        [text, tokens, from, to] => (text, tokens, span(from, to)?),
        _ => return Err(CaptionProblem::Fields(fields.len())),
    };
    let words: Vec<String> = text.split_whitespace().map(str::to_lowercase).collect();
    if words.is_empty() {
        return Err(CaptionProblem::NoCaption);
    }
    Ok(Annotation { caption: words.join(" "), tokens: tokens.trim().to_owned(), span_s })
}

/// The annotations of a whole file, and a sentence for each line that holds none.
///
/// Empty lines are passed over, also the mark of byte order with which some editors begin a file.
pub fn parse_annotations(content: &str) -> (Vec<Annotation>, Vec<String>) {
    let (mut annotations, mut problems) = (Vec::new(), Vec::new());
    let lines = content.trim_start_matches('\u{feff}').lines().enumerate();
    for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        match parse_annotation(line) {
            Ok(annotation) => annotations.push(annotation),
            Err(problem) => problems.push(format!("line {} {problem}", index + 1)),
        }
    }
    (annotations, problems)
}

fn span(from: &str, to: &str) -> Result<Option<(f64, f64)>, CaptionProblem> {
    let (from, to) = (time_s(from)?, time_s(to)?);
    match (from, to) {
        (0.0, 0.0) => Ok(None),
        _ if 0.0 <= from && from < to => Ok(Some((from, to))),
        _ => Err(CaptionProblem::Span { from, to }),
    }
}

fn time_s(field: &str) -> Result<f64, CaptionProblem> {
    match field.trim().parse::<f64>() {
        Ok(time) if time.is_nan() => Ok(0.0),
        Ok(time) if time.is_finite() => Ok(time),
        _ => Err(CaptionProblem::Time(field.trim().to_owned())),
    }
}

// Splits: `train.txt`, `val.txt`, `test.txt`, a name a line.

/// The names in a data set's split files.
#[derive(Default)]
pub struct SplitLists {
    /// Every name once, with its split; train first, each split in its file's order.
    pub clips: Vec<(Split, String)>,
    /// Sentences about lines that were left out.
    pub problems: Vec<String>,
    /// The three files.
    pub files: Vec<UsedFile>,
}

/// Reads the three split files in `root`.
///
/// A name in two splits is kept in the safest one: test before val, val before train.
///
/// # Errors
/// [`DataError::Read`] if one of the files is missing or not UTF-8. Invalid lines and repeated names are not errors:
/// they are listed in `problems`.
pub fn read_splits(root: &Path, in_folders: bool) -> Result<SplitLists, DataError> {
    let advice = "a data set needs train.txt, val.txt and test.txt";
    let unwanted = if in_folders { "ending" } else { "folder and ending" };
    let (mut lists, mut owners) = (SplitLists::default(), HashMap::new());
    for split in [Split::Test, Split::Val, Split::Train] {
        let name = format!("{}.txt", split.name());
        let path = root.join(&name);
        let content = read_text(&path).map_err(DataError::read(&path, advice))?;
        lists.files.push(UsedFile::new(&name, content.as_bytes()));
        let (mut clips, mut problems) = (Vec::new(), Vec::new());
        let lines = content.trim_start_matches('\u{feff}').lines().map(str::trim).enumerate();
        for (index, id) in lines.filter(|(_, line)| !line.is_empty()) {
            let claimed = match is_name(id, in_folders) {
                true => claim(id, split, &mut owners),
                false => Err(format!("is `{id}`; write one clip's name, without {unwanted}")),
            };
            match claimed {
                Ok(()) => clips.push((split, id.to_owned())),
                Err(reason) => problems.push(format!("{name}: line {} {reason}", index + 1)),
            }
        }
        lists.clips.splice(0..0, clips);
        lists.problems.splice(0..0, problems);
    }
    Ok(lists)
}

/// Makes `split` the owner of the name `id`, or says why not.
fn claim(id: &str, split: Split, owners: &mut HashMap<String, Split>) -> Result<(), String> {
    match owners.get(id) {
        Some(owner) if *owner == split => return Err(format!("repeats {id}")),
        Some(owner) => return Err(format!("lists {id}, which is in {}.txt too", owner.name())),
        None => owners.insert(id.to_owned(), split),
    };
    Ok(())
}

/// Whether a line can be the name of a clip, or of one in a folder below.
fn is_name(line: &str, in_folders: bool) -> bool {
    let is_part = |part: &str| {
        let odd = |c: char| c.is_whitespace() || c == '\\';
        !part.is_empty() && !part.starts_with('.') && !part.contains(odd)
    };
    line.split('/').all(is_part) && (in_folders || !line.contains('/'))
}

// Groups: `manifest.csv`, with a column `id` and a column `group`.

/// The group of each clip that the folder says one of. Groups change no clip and are no part of a digest.
#[derive(Debug, Default, PartialEq)]
pub struct Groups(HashMap<String, String>);

impl Groups {
    /// The groups of the folder `path`; `None` without a manifest, or without its column `group`.
    ///
    /// # Errors
    /// A sentence: the manifest cannot be read.
    pub fn read(path: &Path) -> Result<Self, String> {
        match read_text(&path.join("manifest.csv")) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(problem(&error)),
            Ok(text) => Self::parse(&text).map_err(|error| problem(&error)),
        }
    }

    fn parse(text: &str) -> Result<Self, csv::Error> {
        let mut rows = csv::Reader::from_reader(text.as_bytes());
        let place = |name: &str, head: &csv::StringRecord| head.iter().position(|own| own == name);
        let head = rows.headers()?.clone();
        let Some((id, group)) = place("id", &head).zip(place("group", &head)) else {
            return Ok(Self::default());
        };
        let pair = |row: csv::StringRecord| (row[id].to_string(), row[group].to_string());
        let pairs = rows.records().map(|row| row.map(pair));
        // An empty cell names no group.
        let named = pairs.filter(|pair| pair.as_ref().map_or(true, |(_, group)| !group.is_empty()));
        Ok(Self(named.collect::<Result<_, _>>()?))
    }

    /// The group of a clip by stem; its own if the folder has none. A mirrored clip, `M000012`, belongs to the group of its
    /// original.
    pub fn of(&self, stem: &str) -> String {
        let (folder, name) = stem.split_at(stem.rfind('/').map_or(0, |at| at + 1));
        let twin =
            name.strip_prefix('M').filter(|own| own.starts_with(|c: char| c.is_ascii_digit()));
        let own = twin.map_or(stem.to_string(), |own| format!("{folder}{own}"));
        self.0.get(stem).or_else(|| self.0.get(&own)).cloned().unwrap_or(own)
    }
}

fn problem(error: &dyn Display) -> String {
    format!("manifest.csv cannot be read, so each clip counts as recorded by itself: {error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn annotation(caption: &str, span_s: Option<(f64, f64)>) -> Annotation {
        Annotation { caption: caption.to_owned(), tokens: String::new(), span_s }
    }

    #[test]
    fn a_line_gives_its_caption_and_its_span() {
        let line = "A man  waves, slowly.#a/DET man/NOUN wave/VERB slowly/ADV#1.5#4.0\r";
        let tokens = "a/DET man/NOUN wave/VERB slowly/ADV".to_owned();
        let expected = annotation("a man waves, slowly.", Some((1.5, 4.0)));
        assert_eq!(parse_annotation(line), Ok(Annotation { tokens, ..expected }));
    }

    #[test]
    fn zeros_nan_and_a_bare_caption_mean_the_whole_clip() {
        for line in
            ["he sits#he/PRON sit/VERB#0.0#0.0", "he sits##nan#nan", "he sits##0.0#NaN", "he sits"]
        {
            let found =
                parse_annotation(line).map(|own| Annotation { tokens: String::new(), ..own });
            assert_eq!(found, Ok(annotation("he sits", None)), "{line}");
        }
    }

    #[test]
    fn bad_lines_say_what_is_wrong() {
        let cases = [
            ("he sits#he/PRON#0.0", CaptionProblem::Fields(3)),
            ("a #1 hit#a/DET hit/NOUN#0.0#0.0", CaptionProblem::Fields(5)),
            (" #he/PRON#0.0#0.0", CaptionProblem::NoCaption),
            ("he sits##zero#0.0", CaptionProblem::Time("zero".to_owned())),
            ("he sits##0.0#inf", CaptionProblem::Time("inf".to_owned())),
            ("he sits##3.0#1.0", CaptionProblem::Span { from: 3.0, to: 1.0 }),
            ("he sits##-1.0#1.0", CaptionProblem::Span { from: -1.0, to: 1.0 }),
            ("he sits##2.0#nan", CaptionProblem::Span { from: 2.0, to: 0.0 }),
        ];
        for (line, problem) in cases {
            assert_eq!(parse_annotation(line), Err(problem), "{line}");
        }
    }

    #[test]
    fn a_file_gives_its_good_lines_and_the_numbers_of_its_bad_ones() {
        let (annotations, problems) =
            parse_annotations("\u{feff}he sits\n\n##0#0\nshe runs##0#0\n");
        assert_eq!(annotations, [annotation("he sits", None), annotation("she runs", None)]);
        assert_eq!(problems, ["line 3 has no caption"]);
    }

    fn lists(train: &str, val: &str, test: &str) -> SplitLists {
        let root = tempfile::tempdir().expect("a temporary folder");
        for (name, content) in [("train.txt", train), ("val.txt", val), ("test.txt", test)] {
            std::fs::write(root.path().join(name), content).expect("a writable folder");
        }
        read_splits(root.path(), false).expect("three split files")
    }

    #[test]
    fn names_keep_their_order_and_empty_lines_are_passed_over() {
        let lists = lists("b\r\na\r\n\r\n", "\u{feff}c\n", "d");
        let expected =
            [(Split::Train, "b"), (Split::Train, "a"), (Split::Val, "c"), (Split::Test, "d")];
        assert_eq!(lists.clips, expected.map(|(split, id)| (split, id.to_owned())));
        assert_eq!(lists.problems, [""; 0]);
    }

    #[test]
    fn a_name_in_two_splits_stays_where_it_is_tested() {
        let lists = lists("a\nb\na\n", "b\n", "b\n");
        let expected = [(Split::Train, "a"), (Split::Test, "b")];
        assert_eq!(lists.clips, expected.map(|(split, id)| (split, id.to_owned())));
        assert_eq!(
            lists.problems,
            [
                "train.txt: line 2 lists b, which is in test.txt too",
                "train.txt: line 3 repeats a",
                "val.txt: line 1 lists b, which is in test.txt too",
            ]
        );
    }

    #[test]
    fn lines_that_are_no_names_are_reported() {
        let lists = lists("../a\nnew_joint_vecs/a\na b\nc\n", "", "");
        assert_eq!(lists.clips, [(Split::Train, "c".to_owned())]);
        assert_eq!(lists.problems.len(), 3);
        assert!(
            lists.problems[2].starts_with("train.txt: line 3 is `a b`"),
            "{:?}",
            lists.problems
        );
    }

    #[test]
    fn names_in_folders_are_names_where_clips_lie_so() {
        for (line, alone, in_folders) in [
            ("a", true, true),
            ("humanml/000012", false, true),
            ("../a", false, false),
            ("a//b", false, false),
            ("/a", false, false),
            ("a b", false, false),
            ("a/.b", false, false),
        ] {
            assert_eq!([is_name(line, false), is_name(line, true)], [alone, in_folders], "{line}");
        }
    }

    #[test]
    fn a_missing_split_file_is_named() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let error = read_splits(root.path(), false).err().expect("no file is there").to_string();
        assert!(error.contains("test.txt") && error.contains("needs train.txt"), "{error}");
    }

    fn of(text: &str) -> Groups {
        Groups::parse(text).unwrap()
    }

    #[test]
    fn clips_of_a_manifest_are_of_its_groups() {
        let groups = of("id,label,group\n000001,\"walks, turns\",s1\n000002,runs,s1\n");
        assert_eq!(["000001", "000002", "M000002"].map(|stem| groups.of(stem)), ["s1"; 3]);
        assert_eq!(groups.of("000003"), "000003");
    }

    #[test]
    fn without_groups_a_clip_and_its_image_are_one() {
        let groups = of("id,label\n000001,walks\n");
        assert_eq!(["000007", "M000007"].map(|stem| groups.of(stem)), ["000007"; 2]);
        assert_eq!(["a/M1", "Moon"].map(|stem| groups.of(stem)), ["a/1", "Moon"]);
    }

    #[test]
    fn a_torn_manifest_is_told_and_a_missing_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Groups::read(folder.path()), Ok(Groups::default()));
        std::fs::write(folder.path().join("manifest.csv"), "id,group\n1,a\n2\n").unwrap();
        let problem = Groups::read(folder.path()).unwrap_err();
        assert!(problem.starts_with("manifest.csv cannot be read, so each clip"), "{problem}");
    }
}
