//! [`JobKind`]: all that engines and commands need to know of a kind of job.

use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::sweep::Stage;

/// A kind of job, in the order in which they are needed: each needs only what stands before it, or its own kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// Embeds every caption of the data once.
    Text,
    /// Trains a tokenizer and measures it.
    Tokenizer,
    /// Turns every clip of the data into codes.
    Tokens,
    /// Trains a trunk, from the one that it goes on from, up to where runs branch off.
    Trunk,
    /// Trains a run: what a sweep is for. What follows is done beside it or after it.
    Run,
    /// Trains an evaluator and measures its gates.
    Evaluator,
    /// Makes motions of a run and scores them.
    Score,
}

/// What is known of a kind.
struct Facts {
    word: &'static str,
    plural: &'static str,
    role: &'static str,
    product: &'static str,
}

static FACTS: [Facts; 7] = [
    facts("text", "text", "the embedding of captions", "vectors.safetensors"),
    facts("tokenizer", "tokenizers", "its tokenizer", "metrics.json"),
    facts("tokens", "tokens", "tokenising", "codes.safetensors"),
    facts("trunk", "trunks", "its trunk", "state.safetensors"),
    facts("run", "runs", "the run", "record.json"),
    facts("evaluator", "evaluators", "its evaluator", "gates.json"),
    facts("score", "scores", "its score", "scores.json"),
];

const fn facts(
    word: &'static str,
    plural: &'static str,
    role: &'static str,
    product: &'static str,
) -> Facts {
    Facts { word, plural, role, product }
}

impl JobKind {
    /// Every kind, in its order.
    pub const ALL: [Self; 7] = [
        Self::Text,
        Self::Tokenizer,
        Self::Tokens,
        Self::Trunk,
        Self::Run,
        Self::Evaluator,
        Self::Score,
    ];

    /// The word in files and on a worker's command line.
    pub fn word(self) -> &'static str {
        FACTS[self as usize].word
    }

    /// The name of many of them, for tables and folders.
    pub fn plural(self) -> &'static str {
        FACTS[self as usize].plural
    }

    /// What a failure of one such job means for a run: `its tokenizer`.
    pub fn role(self) -> &'static str {
        FACTS[self as usize].role
    }

    /// The file in a job's folder that is written when all else is there.
    pub fn product(self) -> &'static str {
        FACTS[self as usize].product
    }

    /// The folder of the job of an id, in a sweep's folder.
    pub fn folder(self, id: &str) -> PathBuf {
        match self {
            Self::Tokens => Self::Tokenizer.folder(id).join(self.plural()),
            _ => PathBuf::from(self.plural()).join(id),
        }
    }

    /// The file in a sweep's folder that says what the job of an id is to make.
    pub fn spec(self, id: &str) -> PathBuf {
        match self {
            Self::Text => PathBuf::from("sweep.yaml"),
            Self::Tokens => Self::Tokenizer.spec(id),
            Self::Run => self.folder(id).join("spec.json"),
            _ => self.folder(id).join("job.json"),
        }
    }

    /// The part of a sweep that it belongs to.
    pub fn stage(self) -> Stage {
        match self {
            Self::Trunk | Self::Run | Self::Score => Stage::Train,
            _ => Stage::Inputs,
        }
    }

    /// Whether its product is shown by itself, so that it is made again where it is gone although
    /// nothing that needs it is missing.
    pub fn is_result(self) -> bool {
        matches!(self, Self::Tokenizer | Self::Evaluator | Self::Score)
    }
}

impl FromStr for JobKind {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let kind = Self::ALL.into_iter().find(|kind| kind.word() == word);
        kind.ok_or_else(|| format!("no kind of job is named `{word}`"))
    }
}
