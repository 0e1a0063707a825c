//! [`JobKind`]: all that engines and commands need to know of a kind of job.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use anyhow::Result;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::KINDS;
use super::assignment::{Assignment, Outcome};
use super::exit::GRACE;
use super::folder::ResultsFolder;
use super::job::Job;
use crate::files::FileError;
use crate::plan::Plan;
use crate::sweep::Stage;

/// What a kind of job makes, where, from what, and how.
pub trait Kind: Sync {
    /// The word in files and on a worker's command line.
    fn word(&self) -> &'static str;

    /// The name of many of them, for tables.
    fn plural(&self) -> &'static str;

    /// The folder of the job of an id, in a sweep's folder.
    fn folder(&self, id: &str) -> PathBuf;

    /// The file in it that is written when all else is there.
    fn product(&self) -> &'static str;

    /// The file in a sweep's folder that says what the job of an id is to make.
    fn spec(&self, id: &str) -> PathBuf;

    /// The part of a sweep that it belongs to.
    fn stage(&self) -> Stage;

    /// The jobs of a plan, finished ones too; one that needs another of its kind after that one.
    fn jobs(&self, plan: &Plan) -> Vec<Job>;

    /// Writes the specs of a plan's jobs into its folder; `warn` is told of each that was not as
    /// planned.
    ///
    /// # Errors
    /// The folder cannot be written to.
    fn prepare(
        &self,
        _: &Plan,
        _: &ResultsFolder,
        _warn: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        Ok(())
    }

    /// Whether the product of a finished job can be read, where that is quickly seen.
    ///
    /// # Errors
    /// [`FileError::Damaged`].
    fn inspect(&self, _: &ResultsFolder, _id: &str) -> Result<(), FileError> {
        Ok(())
    }

    /// The share of its steps that its checkpoint holds; 0 where that cannot be told.
    fn share_done(&self, _: &ResultsFolder, _id: &str) -> f64 {
        0.0
    }

    /// Whether its product is shown by itself, so that it is made again where it is gone although
    /// nothing that needs it is missing.
    fn is_result(&self) -> bool {
        false
    }

    /// What else a failure of one such job means for a run: `its tokenizer`.
    fn role(&self) -> &'static str;

    /// Does the job.
    ///
    /// # Errors
    /// Why it has no result.
    fn work(&self, assignment: &Assignment) -> Result<Outcome>;

    /// How long the worker in `place` takes for an orderly end, once a stop is asked for.
    fn grace(&self, _place: &Path) -> Duration {
        GRACE
    }
}

/// A kind of job: one of [`KINDS`].
#[derive(Clone, Copy)]
pub struct JobKind(&'static dyn Kind);

impl JobKind {
    /// The handle of a kind.
    pub const fn from_static(kind: &'static dyn Kind) -> Self {
        Self(kind)
    }

    /// Every kind, in the order in which they are needed.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> {
        KINDS.into_iter()
    }

    /// What a sweep is for: a run. What follows it in [`KINDS`] is done beside it or
    /// after it.
    pub fn goal() -> Self {
        super::run::KIND
    }

    /// The kind of a word.
    pub fn of(word: &str) -> Option<Self> {
        Self::all().find(|kind| kind.word() == word)
    }

    fn position(self) -> usize {
        Self::all().position(|kind| kind.word() == self.word()).expect("every kind stands in KINDS")
    }
}

impl std::ops::Deref for JobKind {
    type Target = dyn Kind;

    fn deref(&self) -> &Self::Target {
        self.0
    }
}

impl PartialEq for JobKind {
    fn eq(&self, other: &Self) -> bool {
        self.word() == other.word()
    }
}

impl Eq for JobKind {}

impl PartialOrd for JobKind {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for JobKind {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.position().cmp(&other.position())
    }
}

impl Hash for JobKind {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.word().hash(state);
    }
}

impl fmt::Debug for JobKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for JobKind {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        Self::of(word).ok_or_else(|| format!("no kind of job is named `{word}`"))
    }
}

impl Serialize for JobKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl<'de> Deserialize<'de> for JobKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        word.parse().map_err(serde::de::Error::custom)
    }
}
