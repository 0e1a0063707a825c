//! What any tokenizer has to beat: k-means of patches, without context and without learning.

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::begin::begun;
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::error::TokenizerError;
use super::evaluate::{Score, scores};
use super::metrics::Baseline;
use super::pool::WindowPool;
use crate::data::{MotionSource, Split};
use crate::spec::{CodebookSpec, QuantizerSpec, TokenizerSpec};

/// Codes are placed by so many patches each, or more.
const FEWEST_PER_CODE: usize = 4;

/// k-means with the codebooks of a quantizer, as [`Baseline`] has it; `None` for a multi-scale one, and
/// where the training split has too few frames to place the codes.
///
/// # Errors
/// A clip cannot be read.
pub fn k_means_baseline(
    quantizer: &QuantizerSpec,
    source: &dyn MotionSource,
    device: &Device,
) -> Result<Option<Baseline>, TokenizerError> {
    let Some(spec) = TokenizerSpec::k_means_beside(quantizer) else { return Ok(None) };
    let pool = WindowPool::load(source, &spec, &mut ChaCha8Rng::seed_from_u64(0))?;
    let n_features = source.stats().mean.len();
    let n_patches = pool.n_patches(spec.frames_per_latent());
    let n_codes = quantizer.codebooks().first().map_or(0, CodebookSpec::n_vocab);
    if n_patches < FEWEST_PER_CODE * n_codes {
        return Ok(None);
    }
    let module = begun(&spec, &pool, n_features, device).valid();
    let tokenizer =
        Tokenizer::new(module, spec, source.stats().clone(), source.fps().into(), device.clone());
    let scores = scores(&tokenizer, &Corpus::wordless(source), Split::Test, 0.0)?;
    Ok(Some(Baseline {
        mpjpe_mm: Score::per_frame(&scores, |score| score.mpjpe_mm),
        mpjpe_heading_mm: Score::per_frame(&scores, |score| score.given_heading_mm),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Procedural, ProceduralOptions};
    use crate::spec::QuantizerKind;

    #[test]
    fn more_centres_are_nearer_and_too_many_have_no_baseline() {
        let options = ProceduralOptions { seed: 3, train_clips: 24, val_clips: 2, test_clips: 6 };
        let source = Procedural::new(options);
        let baseline = |quantizer| k_means_baseline(&quantizer, &source, &Device::flex()).unwrap();
        let of = |n_vocab| baseline(QuantizerSpec::Vq { n_vocab });
        let (few, many) = (of(4).unwrap(), of(64).unwrap());
        let given = |baseline: &Baseline| baseline.mpjpe_heading_mm;
        assert!(given(&many) < 0.8 * given(&few), "{few:?} {many:?}");
        assert!(given(&many) <= many.mpjpe_mm, "{many:?}");
        assert_eq!(of(1 << 14), None);
        let several = |kind: QuantizerKind| baseline(kind.section().of_size(16).unwrap());
        let residual = several(QuantizerKind::Residual).unwrap();
        assert!(given(&residual) < given(&of(16).unwrap()), "{residual:?}");
        assert_eq!(several(QuantizerKind::Multiscale), None);
    }
}
