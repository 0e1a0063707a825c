//! Captions as an evaluator reads them: hashed n-grams, whatever the text encoder of the runs.

use crate::spec::EvaluatorSpec;
use crate::text::{HashedNgrams, TextEncoder};

/// Vectors of the words of a caption, `[n_words, word_dim]` row-major, at least one.
pub fn words(caption: &str, spec: &EvaluatorSpec) -> Vec<f32> {
    let encoder = HashedNgrams::new(spec.word_dim, spec.max_words);
    encoder.encode(caption).expect("hashed n-grams have vectors of every caption")
}
