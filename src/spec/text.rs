//! [`TextSpec`]: how captions become vectors.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
