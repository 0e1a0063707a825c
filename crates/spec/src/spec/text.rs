//! [`TextSpec`]: how captions become vectors.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::KeyProblem;
use crate::units::section;

/// How captions become vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TextEncoderKind {
    /// Signed hashes of a word's character n-grams; deterministic, knows nothing of meaning.
    #[default]
    HashedNgrams,
    /// Vectors that another program made, looked up in a file by the caption.
    File,
    /// States of T5's encoder, as ScaMo has them, from a folder with its weights. This and what follows
    /// is built with `--features encoders`.
    T5,
    /// States of CLIP's text tower, from a folder.
    Clip,
    /// States of the BERT family, as MiniLM, from a folder.
    Bert,
    /// States of LLaMA, as LG-Tok has them, from a folder.
    Llama,
}

impl TextEncoderKind {
    /// Whether it computes with weights from a folder.
    pub fn has_weights(self) -> bool {
        matches!(self, Self::T5 | Self::Clip | Self::Bert | Self::Llama)
    }
}

/// What of an encoder's states is a caption's vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TextStates {
    /// One vector a token.
    #[default]
    Words,
    /// One vector: of CLIP the projected state of its end token, of others the mean of all.
    Sentence,
}

section! {
    /// The `text` section: how captions become vectors.
    pub struct TextSpec {
        encoder: TextEncoderKind = TextEncoderKind::default();
        /// The file of `file`, or the folder with `config.json`, `tokenizer.json` and `model.safetensors` of an
        /// encoder with weights, from the working folder. Ids hold their content instead.
        path: Option<PathBuf> = None, unless "Option::is_none";
        /// One vector a word, or one a caption, as the baseline without a word-level prefix has it (ScaMo, Table
        /// 2); of encoders with weights.
        states: TextStates = TextStates::default(), unless "crate::units::is_default";
        /// Width of a vector; that of the file or of the model, where there is one.
        dim: usize = 64;
        /// Longer captions are cut here; part of n_ctx in the FLOP rule.
        max_tokens: usize = 32;
    }
}

/// Columns of a caption's vectors, and tokens of a caption, at most.
const WIDEST: usize = 65_536;
const MOST_TOKENS: usize = 16_384;

impl TextSpec {
    /// What no encoder can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let Self { encoder, path, dim, max_tokens, .. } = self;
        let (file, has_weights) = (*encoder == TextEncoderKind::File, encoder.has_weights());
        let hashed = *encoder == TextEncoderKind::HashedNgrams;
        let built = cfg!(feature = "encoders") || !has_weights;
        let in_file = "path: a file that experiments/embed_captions.py made";
        let in_folder = "path: a folder with config.json, tokenizer.json, model.safetensors";
        let no_path = "take `path` out, or set `encoder: file`";
        let other = "build it with `--features encoders`, or make a file for `encoder: file`";
        let small = "`dim` and `max_tokens` must be at least 1";
        let large = "`dim` is at most 65536 and `max_tokens` at most 16384";
        let unbuilt = "this isoflop was built without encoders that have weights";
        let sentence = "`states: sentence` is of encoders with weights";
        let needs_path = "an encoder with weights needs a `path`";
        KeyProblem::failed([
            (*max_tokens > 0 && *dim > 0, "", small, None),
            (*max_tokens <= MOST_TOKENS && *dim <= WIDEST, "", large, None),
            (!file || path.is_some(), "", "`encoder: file` needs a `path`", Some(in_file)),
            (
                !hashed || path.is_none(),
                "path",
                "`encoder: hashed-ngrams` reads no file",
                Some(no_path),
            ),
            (!has_weights || path.is_some(), "", needs_path, Some(in_folder)),
            (built, "encoder", unbuilt, Some(other)),
            (
                self.states == TextStates::Words || has_weights,
                "states",
                sentence,
                Some("a file may hold one vector a caption"),
            ),
        ])
    }
}
