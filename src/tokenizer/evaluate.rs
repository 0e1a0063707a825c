//! Measuring a tokenizer on the whole test split.

use rayon::prelude::*;

use super::batches::{ClipBatch, equal_length_batches};
use super::codec::Tokenizer;
use super::error::TokenizerError;
use super::metrics::TokenizerMetrics;
use super::normalise::denormalise;
use crate::codes::CodeHistogram;
use crate::data::{DataError, MotionSource, Split};
use crate::motion::{mpjpe_mm, recover_joints};
use crate::progress::moved;

/// Reconstruction, and use of the codebook, over every clip of the test split.
///
/// `wall_s` is the time that training took; it is passed on. Frames after a clip's last whole
/// token are left out.
///
/// # Errors
/// If the test split is empty or a clip cannot be read.
pub fn evaluate(
    tokenizer: &Tokenizer,
    source: &dyn MotionSource,
    tokenizer_id: &str,
    wall_s: f64,
) -> Result<TokenizerMetrics, TokenizerError> {
    let batches =
        equal_length_batches(source, Split::Test, tokenizer.spec().grid().fewest_frames())?;
    if batches.is_empty() {
        let path = format!("data set {}", source.digest());
        return Err(DataError::EmptySplit { path, split: Split::Test.name() }.into());
    }
    let scores = batches.par_iter().map(|batch| score(tokenizer, source, batch));
    let scores = scores.collect::<Result<Vec<_>, _>>()?;
    let sum = |value: fn(&Score) -> f64| scores.iter().map(value).sum::<f64>();
    let used = CodeHistogram::new(tokenizer.n_vocab(), scores.iter().flat_map(|s| &s.ids));
    let spec = tokenizer.spec();
    Ok(TokenizerMetrics {
        tokenizer_id: tokenizer_id.to_string(),
        kind: spec.quantizer.name().to_string(),
        n_vocab: tokenizer.n_vocab(),
        levels: spec.quantizer.levels().map(<[usize]>::to_vec),
        reconstruction_l1: sum(|score| score.l1) / sum(|score| score.n_values),
        mpjpe_mm: sum(|score| score.mpjpe_mm) / sum(|score| score.n_frames),
        utilisation: used.utilisation(),
        exponential_entropy: used.exponential_entropy(),
        parameters: tokenizer.n_parameters(),
        train_steps: spec.training.steps,
        wall_s,
    })
}

/// Sums over one batch.
struct Score {
    l1: f64,
    n_values: f64,
    mpjpe_mm: f64,
    n_frames: f64,
    ids: Vec<u32>,
}

fn score(
    tokenizer: &Tokenizer,
    source: &dyn MotionSource,
    batch: &ClipBatch,
) -> Result<Score, TokenizerError> {
    let stats = tokenizer.stats();
    let mut truth = batch.features(source, Split::Test, stats)?;
    let ids = tokenizer.encode_stack(truth.clone(), batch.indices.len());
    let mut made = tokenizer.decode_stack(&ids, batch.indices.len());
    let l1 = truth.iter().zip(&made).map(|(a, b)| f64::from((a - b).abs())).sum();
    denormalise(&mut truth, stats);
    denormalise(&mut made, stats);
    let size = batch.n_frames * stats.mean.len();
    let clips = truth.chunks_exact(size).zip(made.chunks_exact(size));
    let mpjpe = clips.map(|(truth, made)| mpjpe_mm(&recover_joints(truth), &recover_joints(made)));
    let n_frames = (batch.n_frames * batch.indices.len()) as f64;
    let mpjpe_mm = mpjpe.sum::<f64>() * batch.n_frames as f64;
    moved();
    Ok(Score { l1, n_values: truth.len() as f64, mpjpe_mm, n_frames, ids })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use crate::spec::TokenizerSpec;
    use crate::tokenizer::testing::{Waves, small_spec, spec_of};
    use crate::tokenizer::train;
    use burn::tensor::Device;
    use std::ops::ControlFlow;

    fn metrics(spec: &TokenizerSpec) -> TokenizerMetrics {
        let source = Waves::new(&[32, 40, 32], N_FEATURES);
        let keep_on = &mut |_| ControlFlow::Continue(());
        let tokenizer = train(spec, &source, &Device::flex(), None, keep_on).unwrap();
        evaluate(&tokenizer, &source, "t", 1.5).unwrap()
    }

    #[test]
    fn training_improves_what_is_measured() {
        let short = metrics(&spec_of(small_spec().quantizer, 1));
        let long = metrics(&spec_of(small_spec().quantizer, 60));
        assert!(long.reconstruction_l1 < 0.9 * short.reconstruction_l1, "{short:?} {long:?}");
        assert!(long.mpjpe_mm < short.mpjpe_mm, "{short:?} {long:?}");
        assert_eq!((long.n_vocab, long.train_steps, long.wall_s), (15, 60, 1.5));
        assert!(long.exponential_entropy <= 15.0 * long.utilisation + 1e-9, "{long:?}");
    }
}
