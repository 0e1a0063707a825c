//! [`TextError`]: why captions have no vectors.

use std::path::PathBuf;

use crate::failure::FailureKind;
use crate::files::FileError;

/// Captions that a message names.
const NAMED: usize = 3;

/// Why captions have no vectors.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// The file knows nothing of captions that the data has.
    #[error("{} has no vectors for {}; make it again from this data", file.display(), named(captions))]
    Missing { captions: Vec<String>, file: PathBuf },
    /// The file's vectors are not as wide as the models expect.
    #[error(
        "{} holds vectors of width {found}, and text.dim is {wanted}: set text.dim to {found}",
        file.display()
    )]
    Width { found: usize, wanted: usize, file: PathBuf },
    /// A model whose weights cannot be used.
    #[error("the text encoder in {} cannot be used: {reason}", folder.display())]
    Model { folder: PathBuf, reason: String },
    /// What would be made is not what the sweep was planned with.
    #[error(
        "{}, or the data, has changed since the sweep was planned; `isoflop run` plans it again",
        file.display()
    )]
    Changed { file: PathBuf },
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TextError {
    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::File(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        }
    }
}

/// The first few captions, and how many there are.
fn named(captions: &[String]) -> String {
    let quoted: Vec<String> = captions.iter().take(NAMED).map(|c| format!("`{c}`")).collect();
    let first = quoted.join(", ");
    match captions.len() {
        1 => format!("the caption {first}"),
        n if n <= NAMED => format!("{n} captions: {first}"),
        n => format!("{n} captions, among them {first}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missing(n: usize) -> String {
        let captions = (0..n).map(|i| format!("he sits {i}")).collect();
        TextError::Missing { captions, file: "a/b".into() }.to_string()
    }

    #[test]
    fn missing_captions_are_counted_and_the_first_are_named() {
        assert!(missing(1).starts_with("a/b has no vectors for the caption `he sits 0`;"));
        assert!(missing(2).contains("for 2 captions: `he sits 0`, `he sits 1`;"));
        assert!(missing(9).contains("for 9 captions, among them `he sits 0`, `he sits 1`, `he"));
        assert!(!missing(9).contains("he sits 3"));
    }

    #[test]
    fn what_is_wrong_with_the_data_is_told_from_what_is_wrong_with_a_file() {
        let width = TextError::Width { found: 384, wanted: 64, file: "a".into() };
        assert_eq!(width.failure_kind(), FailureKind::BadData);
        let full = FileError::write("a".as_ref())(std::io::Error::from_raw_os_error(28));
        assert_eq!(TextError::from(full).failure_kind(), FailureKind::DiskFull);
    }
}
