//! [`TextSpec`]: how captions become vectors.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::KeyProblem;
use crate::units::number;

/// How captions become vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TextEncoderKind {
    /// Signed hashes of a word's character n-grams; deterministic, knows nothing of meaning.
    #[default]
    HashedNgrams,
    /// Vectors that another program made, looked up in a file by the caption.
    File,
}

/// The `text` section: how captions become vectors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TextSpec {
    pub encoder: TextEncoderKind,
    /// The file of `file`, from the working folder. Ids hold its content instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Width of a vector; that of the file, where there is one.
    #[serde(deserialize_with = "number::count")]
    pub dim: usize,
    /// Longer captions are cut here; part of n_ctx in the FLOP rule.
    #[serde(deserialize_with = "number::count")]
    pub max_tokens: usize,
}

impl Default for TextSpec {
    fn default() -> Self {
        Self { encoder: TextEncoderKind::default(), path: None, dim: 64, max_tokens: 32 }
    }
}

impl TextSpec {
    /// What no encoder can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let sizes = (self.max_tokens == 0 || self.dim == 0).then_some(KeyProblem {
            field: "",
            problem: "`dim` and `max_tokens` must be at least 1",
            help: None,
        });
        let path = match (self.encoder, &self.path) {
            (TextEncoderKind::File, None) => Some(KeyProblem {
                field: "",
                problem: "`encoder: file` needs a `path`",
                help: Some("path: a file that experiments/embed_captions.py made"),
            }),
            (TextEncoderKind::HashedNgrams, Some(_)) => Some(KeyProblem {
                field: "path",
                problem: "`encoder: hashed-ngrams` reads no file",
                help: Some("take `path` out, or set `encoder: file`"),
            }),
            (TextEncoderKind::File, Some(_)) | (TextEncoderKind::HashedNgrams, None) => None,
        };
        sizes.into_iter().chain(path).collect()
    }
}
