//! Which halves see captions, and how weights begin.

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::params::normal;
use crate::spec::{LanguageSpec, TransformerSpec};

/// The language of the tokenizer and that of the detokenizer.
pub fn languages(sizes: &TransformerSpec) -> [Option<&LanguageSpec>; 2] {
    let language = sizes.language.as_ref();
    let places = language.map_or([false; 2], LanguageSpec::places);
    places.map(|sees| language.filter(|_| sees))
}

/// The deviation of a layer's weights at the beginning: LG-Tok's 0.02 at its width of 256, with
/// which rows stay of one size at any other.
pub fn deviation(width: usize) -> f64 {
    0.02 * (256.0 / width as f64).sqrt()
}

/// Learned rows, as large as those of LG-Tok at the beginning: N(0, 1/d).
pub fn learned_rows(
    [n, width]: [usize; 2],
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> Param<Tensor<2>> {
    normal([n, width], (width as f64).sqrt().recip(), rng, device)
}
