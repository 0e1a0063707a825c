//! [`ImportError`].

use std::path::PathBuf;

use crate::data::DataError;
use crate::failure::FailureKind;
use crate::files::FileError;

/// Why nothing is imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error("{} holds no .{ending} file", path.display())]
    NoFiles { path: PathBuf, ending: &'static str },
    #[error("{} is there already; give another --out, or --overwrite", path.display())]
    Exists { path: PathBuf },
    #[error("{} is no data set that was imported, and is not written over", path.display())]
    NotImported { path: PathBuf },
    #[error("{}: {problem}", path.display())]
    Map { path: PathBuf, problem: String },
    #[error("no file can be used:\n  {}", first(problems))]
    NothingUsable { problems: Vec<String>, draft: Option<String> },
    #[error(
        "{found} cannot be parted into train, val and test; add motions, or give another --group: folder, \
         name, prefix or file"
    )]
    TooFewGroups { found: String },
    #[error(".npy files do not say how many frames a second they have; give --fps")]
    Fps,
    #[error(
        "there are motions of {first} and of {other} frames a second, and a data set has one rate: give \
         --rate, as --rate {first}"
    )]
    Rates { first: f64, other: f64 },
    #[error(transparent)]
    Data(#[from] DataError),
    #[error(transparent)]
    File(#[from] FileError),
}

impl ImportError {
    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::Data(error) => error.failure_kind(),
            Self::File(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        }
    }
}

/// Problems that are told, at most.
const TOLD: usize = 12;

fn first(problems: &[String]) -> String {
    let mut told: Vec<String> = problems.iter().take(TOLD).cloned().collect();
    if problems.len() > TOLD {
        told.push(format!("and {} more", problems.len() - TOLD));
    }
    told.join("\n  ")
}
