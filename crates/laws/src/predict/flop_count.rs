//! The count of FLOPs that a prediction is projected with.
//!
//! Under `6nd` the count depends on N_nv, N_v and D alone. The others also depend on a model's
//! shape, which this module knows nothing of: a caller hands their count in as a closure.

/// Training FLOPs of an allocation under one rule.
pub trait FlopCount: Sync {
    /// `openai`, `6nd` or `exact`.
    fn rule(&self) -> &str;
    /// Training FLOPs of N_nv, N_v and D; must grow with each.
    fn flops(&self, params_nonvocab: f64, params_vocab: f64, tokens: f64) -> f64;
}

/// 6(N_nv + N_v)D (ScaMo Eq. 7).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SixNd;

impl FlopCount for SixNd {
    fn rule(&self) -> &str {
        "6nd"
    }

    fn flops(&self, params_nonvocab: f64, params_vocab: f64, tokens: f64) -> f64 {
        6.0 * (params_nonvocab + params_vocab) * tokens
    }
}

/// A count by a closure over (N_nv, N_v, D), with the name of its rule.
#[derive(Clone, Debug)]
pub struct CountedBy<F> {
    pub rule: String,
    pub count: F,
}

impl<F: Fn(f64, f64, f64) -> f64 + Sync> FlopCount for CountedBy<F> {
    fn rule(&self) -> &str {
        &self.rule
    }

    fn flops(&self, params_nonvocab: f64, params_vocab: f64, tokens: f64) -> f64 {
        (self.count)(params_nonvocab, params_vocab, tokens)
    }
}
