//! The digest of a data set: what its clips follow from, and nothing of where it lies.

use blake3::{Hash, Hasher};

/// A file that took part in making the clips.
#[derive(Clone, Debug)]
pub(super) struct UsedFile {
    /// Name within the data set, with `/` between folders.
    pub name: String,
    /// Blake3 of its content.
    pub hash: Hash,
}

impl UsedFile {
    pub(super) fn new(name: &str, content: &[u8]) -> UsedFile {
        UsedFile { name: name.to_owned(), hash: blake3::hash(content) }
    }
}

/// Hex digest of `rules`, which says how clips follow from files, and of `files` in any order.
pub(super) fn digest(rules: &str, files: &[UsedFile]) -> String {
    let mut sorted: Vec<&UsedFile> = files.iter().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    let mut hasher = Hasher::new();
    hasher.update(blake3::hash(rules.as_bytes()).as_bytes());
    for file in sorted {
        // A hash of the name has a fixed length, so that no two lists of files read the same.
        hasher.update(blake3::hash(file.name.as_bytes()).as_bytes());
        hasher.update(file.hash.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_plays_no_part_and_names_contents_and_rules_do() {
        let [a, b] = [UsedFile::new("a", b"1"), UsedFile::new("b", b"2")];
        let base = digest("rules", &[a.clone(), b.clone()]);
        assert_eq!(digest("rules", &[b.clone(), a.clone()]), base);
        let others = [
            digest("other rules", &[a.clone(), b.clone()]),
            digest("rules", std::slice::from_ref(&a)),
            digest("rules", &[a, UsedFile::new("c", b"2")]),
            digest("rules", &[UsedFile::new("a", b"3"), b]),
        ];
        assert!(others.iter().all(|other| *other != base));
    }
}
