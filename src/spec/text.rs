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

impl TextStates {
    /// Whether it is what every encoder gives.
    pub fn is_words(&self) -> bool {
        *self == Self::Words
    }
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
        states: TextStates = TextStates::default(), unless "TextStates::is_words";
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
        let sizes = (self.max_tokens == 0 || self.dim == 0).then_some(KeyProblem {
            field: "",
            problem: "`dim` and `max_tokens` must be at least 1",
            help: None,
        });
        let large = (self.max_tokens > MOST_TOKENS || self.dim > WIDEST).then_some(KeyProblem {
            field: "",
            problem: "`dim` is at most 65536 and `max_tokens` at most 16384",
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
            (encoder, None) if encoder.has_weights() => Some(KeyProblem {
                field: "",
                problem: "an encoder with weights needs a `path`",
                help: Some("path: a folder with config.json, tokenizer.json, model.safetensors"),
            }),
            _ => None,
        };
        let built = cfg!(feature = "encoders") || !self.encoder.has_weights();
        let built = (!built).then_some(KeyProblem {
            field: "encoder",
            problem: "this isoflop was built without encoders that have weights",
            help: Some("build it with `--features encoders`, or make a file for `encoder: file`"),
        });
        let states = self.states == TextStates::Sentence && !self.encoder.has_weights();
        let states = states.then_some(KeyProblem {
            field: "states",
            problem: "`states: sentence` is of encoders with weights",
            help: Some("a file may hold one vector a caption"),
        });
        sizes.into_iter().chain(large).chain(path).chain(built).chain(states).collect()
    }
}
