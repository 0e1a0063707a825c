//! Which clip belongs to which split: `train.txt`, `val.txt`, `test.txt`, a name a line.

use std::collections::HashMap;
use std::path::Path;

use super::digest::UsedFile;
use super::source::{DataError, Split};

/// The names in a data set's split files.
pub(super) struct SplitLists {
    /// Every name once, with its split; train first, each split in its file's order.
    pub clips: Vec<(Split, String)>,
    /// Sentences about lines that were left out.
    pub problems: Vec<String>,
    /// The three files.
    pub files: Vec<UsedFile>,
}

/// Reads the three split files in `root`.
///
/// A name in two splits is kept where it hurts least: in test before val, in val before train.
///
/// # Errors
/// [`DataError::Read`] if one of the files is not there or not UTF-8. Lines that are no names,
/// and names that stand twice, are not errors: they are listed in `problems`.
pub(super) fn read_splits(root: &Path, in_folders: bool) -> Result<SplitLists, DataError> {
    let mut lists = SplitLists { clips: Vec::new(), problems: Vec::new(), files: Vec::new() };
    let mut owners = HashMap::new();
    for split in [Split::Test, Split::Val, Split::Train] {
        let name = format!("{}.txt", split.name());
        let content = read_text(root, &name)?;
        lists.files.push(UsedFile::new(&name, content.as_bytes()));
        let (ids, problems) = claim_lines(&content, split, in_folders, &mut owners);
        lists.clips.splice(0..0, ids.into_iter().map(|id| (split, id)));
        lists.problems.splice(0..0, problems);
    }
    Ok(lists)
}

fn read_text(root: &Path, name: &str) -> Result<String, DataError> {
    let path = root.join(name);
    let advice = "a data set needs train.txt, val.txt and test.txt";
    crate::files::read_text(&path).map_err(DataError::read(&path, advice))
}

/// The names in `content` that no split owns yet, and a sentence for each other line.
fn claim_lines(
    content: &str,
    split: Split,
    in_folders: bool,
    owners: &mut HashMap<String, Split>,
) -> (Vec<String>, Vec<String>) {
    let (mut ids, mut problems) = (Vec::new(), Vec::new());
    let unwanted = if in_folders { "ending" } else { "folder and ending" };
    for (index, line) in content.trim_start_matches('\u{feff}').lines().enumerate() {
        let id = line.trim();
        let claimed = match is_name(id, in_folders) {
            true => claim(id, split, owners),
            false => Some(format!("is `{id}`; write one clip's name, without {unwanted}")),
        };
        match claimed {
            _ if id.is_empty() => {}
            None => ids.push(id.to_owned()),
            Some(reason) => {
                problems.push(format!("{}.txt: line {} {reason}", split.name(), index + 1));
            }
        }
    }
    (ids, problems)
}

/// Makes `split` the owner of `id`, or says why not.
fn claim(id: &str, split: Split, owners: &mut HashMap<String, Split>) -> Option<String> {
    match owners.insert(id.to_owned(), split) {
        None => None,
        Some(owner) if owner == split => Some(format!("repeats {id}")),
        Some(owner) => {
            owners.insert(id.to_owned(), owner);
            Some(format!("lists {id}, which is in {}.txt too", owner.name()))
        }
    }
}

/// Whether a line can be the name of a clip, or of one in a folder below.
fn is_name(line: &str, in_folders: bool) -> bool {
    let is_part = |part: &str| {
        let odd = |c: char| c.is_whitespace() || c == '\\';
        !part.is_empty() && !part.starts_with('.') && !part.contains(odd)
    };
    line.split('/').all(is_part) && (in_folders || !line.contains('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
