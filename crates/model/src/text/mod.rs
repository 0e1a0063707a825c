//! Frozen text embeddings: made once for a data set, shared by every run.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::spec::TextSpec;
//! use isoflop_model::text;
//!
//! let encoder = text::encoder(&TextSpec::default())?;
//! let vectors = encoder.encode("a person walks")?; // one vector a token
//! assert_eq!(vectors.len() % encoder.dim(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod embedding_file;
mod lengths;
#[cfg(feature = "encoders")]
mod models;
mod store;

use crate::spec::{TextEncoderKind, TextSpec};

pub use embedding_file::{EmbeddingFile, caption_key};
pub use lengths::LengthEstimator;
pub use store::{TextEncoder, TextError, TextStore, embed, unseen_words};

/// The encoder of a sweep.
///
/// # Errors
/// Its file cannot be used.
pub fn encoder(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let TextSpec { dim, max_tokens, .. } = *spec;
    Ok(match spec.encoder {
        TextEncoderKind::HashedNgrams => Box::new(HashedNgrams::new(dim, max_tokens)),
        TextEncoderKind::File => {
            let path = spec.path.as_deref().expect("checked when the sweep was read");
            Box::new(EmbeddingFile::open(path, dim, max_tokens)?)
        }
        TextEncoderKind::T5
        | TextEncoderKind::Clip
        | TextEncoderKind::Bert
        | TextEncoderKind::Llama => return with_weights(spec),
    })
}

/// An encoder from a folder with its weights.
#[cfg(feature = "encoders")]
fn with_weights(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let path = spec.path.as_deref().expect("checked when the sweep was read");
    Ok(Box::new(models::LocalModel::open(path, spec)?))
}

/// Such encoders are not built in.
#[cfg(not(feature = "encoders"))]
fn with_weights(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let folder = spec.path.clone().unwrap_or_default();
    let reason = "this isoflop was built without `--features encoders`".to_string();
    Err(TextError::Model { folder, reason })
}

/// A caption as captions of data are read: lower-case, with single spaces.
pub fn as_in_data(caption: &str) -> String {
    let words: Vec<String> = caption.split_whitespace().map(str::to_lowercase).collect();
    words.join(" ")
}

// Word vectors from hashed character n-grams: deterministic, without weights, without meaning.

/// Lengths of the n-grams of a word, its boundary marks counted.
const LENGTHS: std::ops::RangeInclusive<usize> = 3..=5;

/// Closes every caption, as T5's end token does; an empty caption is this alone.
const END: &str = "</s>";

/// Word-level embeddings by the hashing trick (Weinberger et al. 2009) on fastText's subwords.
///
/// Each n-gram of `<word>` adds ±1 to one coordinate, both given by its hash; the sum is scaled to
/// unit mean square. Words with a common stem are close, synonyms are not: the model learns only which words a caption
/// contains.
#[derive(Clone, Debug)]
pub struct HashedNgrams {
    dim: usize,
    max_tokens: usize,
}

impl HashedNgrams {
    /// Vectors of width `dim`, at most `max_tokens` a caption, both at least 1.
    pub fn new(dim: usize, max_tokens: usize) -> Self {
        assert!(dim > 0 && max_tokens > 0, "checked when the sweep was read");
        Self { dim, max_tokens }
    }

    /// The words of a caption, cut to the limit, and the end.
    fn words<'a>(&self, caption: &'a str) -> impl Iterator<Item = &'a str> {
        let words = caption.split(|c: char| !c.is_alphanumeric() && c != '\'');
        words.filter(|word| !word.is_empty()).take(self.max_tokens - 1).chain([END])
    }

    fn word(&self, word: &str) -> Vec<f32> {
        let marked: Vec<char> = format!("<{word}>").chars().collect();
        let mut vector = vec![0f32; self.dim];
        let grams = LENGTHS.flat_map(|n| marked.windows(n)).chain([&marked[..]]);
        for gram in grams {
            let hash = fnv1a(gram);
            let sign = if hash >> 63 == 0 { 1.0 } else { -1.0 };
            vector[(hash % self.dim as u64) as usize] += sign;
        }
        let square: f32 = vector.iter().map(|x| x * x).sum();
        // Signs may cancel to nothing; such a word stays the zero vector.
        if square > 0.0 {
            let scale = (vector.len() as f32 / square).sqrt();
            vector.iter_mut().for_each(|x| *x *= scale);
        }
        vector
    }
}

impl TextEncoder for HashedNgrams {
    fn dim(&self) -> usize {
        self.dim
    }

    fn encode(&self, caption: &str) -> Result<Vec<f32>, TextError> {
        Ok(self.words(caption).flat_map(|word| self.word(&word.to_lowercase())).collect())
    }

    fn n_tokens(&self, caption: &str) -> Result<usize, TextError> {
        Ok(self.words(caption).count())
    }
}

/// FNV-1a over the characters: small, stable for ever, spread well enough for a few hundred words.
fn fnv1a(text: &[char]) -> u64 {
    text.iter().fold(0xcbf2_9ce4_8422_2325, |hash, c| {
        (hash ^ u64::from(*c as u32)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn similarity(a: &str, b: &str) -> f32 {
        let encoder = HashedNgrams::new(128, 8);
        let [a, b] = [a, b].map(|word| encoder.word(word));
        a.iter().zip(&b).map(|(x, y)| x * y).sum::<f32>() / 128.0
    }

    #[test]
    fn words_of_one_stem_are_nearer_than_strangers() {
        assert!(similarity("walking", "walks") > 0.3);
        assert!(similarity("walking", "kick").abs() < 0.3);
        assert!((similarity("jump", "jump") - 1.0).abs() < 1e-5);
    }

    #[test]
    fn captions_are_words_and_an_end_cut_to_the_limit() {
        let encoder = HashedNgrams::new(16, 4);
        let encode = |caption| encoder.encode(caption).expect("it has vectors for every caption");
        assert_eq!(encode("").len(), 16);
        assert_eq!(
            ["", "a man", "a man walks and"].map(|text| encoder.n_tokens(text).unwrap()),
            [1, 3, 4]
        );
        assert_eq!(encode("a man, walks.").len(), 4 * 16);
        let long = encode("a man walks and then runs");
        assert_eq!(long.len(), 4 * 16);
        assert_eq!(long[48..], encode("")[..], "the end token stays");
    }
}
