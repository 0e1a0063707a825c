//! [`TextSpec`]: how captions become vectors.

use serde::{Deserialize, Serialize};

use crate::units::number;

/// How captions become vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TextEncoderKind {
    /// Signed hashes of a word's character n-grams; deterministic, knows nothing of meaning.
    #[default]
    HashedNgrams,
}

/// The `text` section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TextSpec {
    pub encoder: TextEncoderKind,
    /// Width of a word's embedding.
    #[serde(deserialize_with = "number::count")]
    pub dim: usize,
    /// Longer captions are cut here; part of n_ctx in the FLOP rule.
    #[serde(deserialize_with = "number::count")]
    pub max_tokens: usize,
}

impl Default for TextSpec {
    fn default() -> Self {
        Self { encoder: TextEncoderKind::default(), dim: 64, max_tokens: 32 }
    }
}
