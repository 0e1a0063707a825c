//! The kinds of files that are read, each as its command reads it.

pub mod laws;
pub mod models;
pub mod motion;
pub mod runs;
pub mod sweeps;
pub mod tables;

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

/// An error's words.
fn words(error: impl Display) -> String {
    error.to_string()
}

/// A path from the root of the repository.
fn of_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The bytes of a file of the repository.
fn bytes_of(path: &str) -> Vec<u8> {
    fs::read(of_repository(path)).expect("a file of the repository")
}

/// The first lines of a file of the repository.
fn first_lines(path: &str, n: usize) -> Vec<u8> {
    let text = fs::read_to_string(of_repository(path)).expect("a file of the repository");
    text.split_inclusive('\n').take(n).collect::<String>().into_bytes()
}

// Several files in one, so that one input changes all of them.

/// A line before each file of a bundle, with its name.
const MARK: &str = "=== ";

/// Several texts as one.
fn bundle(files: &[(&str, &str)]) -> Vec<u8> {
    let one = |(name, text): &(&str, &str)| format!("{MARK}{name}\n{text}\n");
    files.iter().map(one).collect::<String>().into_bytes()
}

/// The text of a name in a bundle; empty where it has none.
fn part(bundle: &[u8], name: &str) -> Vec<u8> {
    let mark = format!("{MARK}{name}\n").into_bytes();
    let Some(at) = bundle.windows(mark.len()).position(|window| window == mark) else {
        return Vec::new();
    };
    let rest = &bundle[at + mark.len()..];
    let next = format!("\n{MARK}").into_bytes();
    let end = rest.windows(next.len()).position(|window| window == next);
    rest[..end.unwrap_or(rest.len())].to_vec()
}
