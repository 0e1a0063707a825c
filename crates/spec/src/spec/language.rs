//! [`LanguageSpec`]: which halves of a tokenizer see a caption.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{SpecError, require};
use super::text::TextSpec;
use crate::units::section;

/// A half of a tokenizer that may see a caption.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum LanguagePlace {
    /// The half that turns motion into codes.
    Tokenizer,
    /// The half that turns codes into motion.
    Detokenizer,
}

section! {
    /// The `tokenizer.language` section: the clip's caption beside its motion (LG-Tok).
    pub struct LanguageSection {
        /// The halves that see it: both, one, or none.
        at: Vec<LanguagePlace> = vec![LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
        /// How often a training step leaves a clip's caption out.
        drop: f64 = 0.1;
    }
}

/// Which halves see a caption, and how wide it is: what is hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LanguageSpec {
    /// At least one, in the order of [`LanguagePlace`].
    pub at: Vec<LanguagePlace>,
    pub drop: f64,
    /// Width of a word's vector.
    pub dim: usize,
    /// Words of the longest caption.
    pub max_tokens: usize,
}

impl LanguageSection {
    /// The same over the vectors of a text encoder; `None` where no half sees them.
    pub(super) fn over(&self, text: &TextSpec) -> Option<LanguageSpec> {
        let mut at = self.at.clone();
        at.sort_unstable();
        let TextSpec { dim, max_tokens, .. } = *text;
        (!at.is_empty()).then_some(LanguageSpec { at, drop: self.drop, dim, max_tokens })
    }
}

impl LanguageSpec {
    /// Whether the tokenizer and the detokenizer see a caption.
    pub fn places(&self) -> [bool; 2] {
        [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer].map(|place| self.at.contains(&place))
    }

    pub(super) fn check(&self) -> Result<(), SpecError> {
        let twice = self.at.windows(2).any(|pair| pair[0] == pair[1]);
        require(!twice, "language", "a half stands in `at` twice")?;
        require((0.0..1.0).contains(&self.drop), "language", "`drop` lies in [0, 1)")
    }
}
