//! What any tokenizer has to beat: k-means of patches, without context and without learning.

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::begin::begun;
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::error::TokenizerError;
use super::evaluate::{Reconstruction, reconstruct};
use super::metrics::Baseline;
use super::pool::WindowPool;
use crate::data::{MotionSource, Split};
use crate::spec::{CodebookSpec, TokenizerSpec};

/// Codes are placed by so many patches each, or more.
const FEWEST_PER_CODE: usize = 4;

/// k-means with the codebooks and the frames a code of `beside`, as [`Baseline`] has it; `None` for a
/// multi-scale quantizer, and where the training split has too few frames to place the codes.
///
/// # Errors
/// A clip cannot be read.
pub fn k_means_baseline(
    beside: &TokenizerSpec,
    source: &dyn MotionSource,
    device: &Device,
) -> Result<Option<Baseline>, TokenizerError> {
    let Some(spec) = beside.k_means_beside() else { return Ok(None) };
    let pool = WindowPool::load(source, &spec, &mut ChaCha8Rng::seed_from_u64(0))?;
    let n_features = source.stats().mean.len();
    let n_patches = pool.n_patches(spec.frames_per_latent());
    let n_codes = spec.quantizer.codebooks().first().map_or(0, CodebookSpec::n_vocab);
    if n_patches < FEWEST_PER_CODE * n_codes {
        return Ok(None);
    }
    let module = begun(&spec, &pool, n_features, device).valid();
    let tokenizer = Tokenizer::of_clips(module, &spec, source, device);
    let made = reconstruct(&tokenizer, &Corpus::wordless(source), Split::Test, 0.0)?;
    let Reconstruction { mpjpe_mm, mpjpe_heading_mm, .. } = made;
    Ok(Some(Baseline { mpjpe_mm, mpjpe_heading_mm }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Procedural, ProceduralOptions};
    use crate::spec::{ArchitectureSpec, PatchSpec, QuantizerKind, QuantizerSpec};

    fn baseline(frames: usize, quantizer: QuantizerSpec) -> Option<Baseline> {
        let options = ProceduralOptions { seed: 3, train_clips: 24, val_clips: 2, test_clips: 6 };
        let architecture = ArchitectureSpec::Patch(PatchSpec { frames, ..PatchSpec::default() });
        let beside = TokenizerSpec { architecture, quantizer, ..TokenizerSpec::default() };
        k_means_baseline(&beside, &Procedural::new(options), &Device::flex()).unwrap()
    }

    fn of(n_vocab: usize) -> Option<Baseline> {
        baseline(4, QuantizerSpec::Vq { n_vocab })
    }

    fn given(baseline: &Baseline) -> f64 {
        baseline.mpjpe_heading_mm
    }

    #[test]
    fn more_centres_are_nearer_and_too_many_have_no_baseline() {
        let (few, many) = (of(4).unwrap(), of(64).unwrap());
        assert!(given(&many) < 0.8 * given(&few), "{few:?} {many:?}");
        assert!(given(&many) <= many.mpjpe_mm, "{many:?}");
        assert_eq!(of(1 << 14), None);
    }

    #[test]
    fn several_codebooks_are_nearer_and_scales_have_no_baseline() {
        let several = |kind: QuantizerKind| baseline(4, kind.section().of_size(16).unwrap());
        let residual = several(QuantizerKind::Residual).unwrap();
        assert!(given(&residual) < given(&of(16).unwrap()), "{residual:?}");
        assert_eq!(several(QuantizerKind::Multiscale), None);
    }

    #[test]
    fn codes_are_measured_beside_centres_of_as_many_frames_up_to_four() {
        let two = baseline(2, QuantizerSpec::Vq { n_vocab: 64 }).unwrap();
        let eight = baseline(8, QuantizerSpec::Vq { n_vocab: 64 }).unwrap();
        let four = of(64).unwrap();
        assert!(given(&two) < given(&four), "{two:?} {four:?}");
        assert_eq!(four, eight);
    }
}
