//! [`PerQuantity`]: one value for each of N, N_nv, N_v, V and D.

use super::point::Parameters;
use serde::{Deserialize, Serialize};

/// A value for each quantity of a configuration; absent where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PerQuantity<T> {
    /// Of N, where N_nv and N_v are not told apart; then the next three are absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params: Option<T>,
    /// Of N_nv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params_nonvocab: Option<T>,
    /// Of N_v.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params_vocab: Option<T>,
    /// Of V, the number of codes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_vocab: Option<T>,
    /// Of D, in tokens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokens: Option<T>,
}

impl<T> Default for PerQuantity<T> {
    fn default() -> Self {
        let none = || None;
        Self {
            params: none(),
            params_nonvocab: none(),
            params_vocab: none(),
            n_vocab: none(),
            tokens: none(),
        }
    }
}

impl<T> PerQuantity<T> {
    /// What there is, with its symbol, in the order of a table.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &T)> {
        let all = [
            ("N", &self.params),
            ("N_nv", &self.params_nonvocab),
            ("N_v", &self.params_vocab),
            ("V", &self.n_vocab),
            ("D", &self.tokens),
        ];
        all.into_iter().filter_map(|(symbol, value)| Some((symbol, value.as_ref()?)))
    }

    /// The value of a symbol.
    pub fn of(&self, symbol: &str) -> Option<&T> {
        self.named().find_map(|(own, value)| (own == symbol).then_some(value))
    }

    /// Of the size: N_nv, or N.
    pub fn size(&self) -> Option<&T> {
        self.params_nonvocab.as_ref().or(self.params.as_ref())
    }

    /// Another value in place of each.
    pub fn map<U>(&self, mut of: impl FnMut(&T) -> U) -> PerQuantity<U> {
        PerQuantity {
            params: self.params.as_ref().map(&mut of),
            params_nonvocab: self.params_nonvocab.as_ref().map(&mut of),
            params_vocab: self.params_vocab.as_ref().map(&mut of),
            n_vocab: self.n_vocab.as_ref().map(&mut of),
            tokens: self.tokens.as_ref().map(of),
        }
    }

    /// With the size under the name that the laws have for it: N_nv, or N and no vocabulary.
    pub fn under(self, parameters: Parameters) -> Self {
        match parameters {
            Parameters::Split => self,
            Parameters::Total => {
                Self { params: self.params_nonvocab, tokens: self.tokens, ..Self::default() }
            }
        }
    }
}
