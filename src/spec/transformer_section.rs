//! The keys of a transformer in the `tokenizer` section.

use super::text::TextSpec;
use super::tokenizer_training::TokenizerSection;
use super::transformer::TransformerSpec;

impl TokenizerSection {
    /// The sizes of its transformer, over captions as `text` has them.
    pub(super) fn transformer(&self, window: usize, text: &TextSpec) -> TransformerSpec {
        let default = TransformerSpec::default();
        TransformerSpec {
            width: self.width.unwrap_or(default.width),
            layers: self.layers.unwrap_or(default.layers),
            heads: self.heads.unwrap_or(default.heads),
            frames: self.frames.unwrap_or(default.frames),
            latent: self.latent.unwrap_or(default.latent),
            span: window,
            norm: self.norm.unwrap_or_default(),
            positions: self.positions.unwrap_or_default(),
            detokenizer: self.detokenizer.unwrap_or_default(),
            dropout: self.dropout.unwrap_or(default.dropout),
            language: self.language.as_ref().and_then(|language| language.over(text)),
        }
    }

    /// The keys of transformers alone, and whether each is written.
    pub(super) fn of_transformers(&self) -> [(&'static str, bool); 7] {
        [
            ("layers", self.layers.is_some()),
            ("heads", self.heads.is_some()),
            ("norm", self.norm.is_some()),
            ("positions", self.positions.is_some()),
            ("detokenizer", self.detokenizer.is_some()),
            ("dropout", self.dropout.is_some()),
            ("language", self.language.is_some()),
        ]
    }
}
