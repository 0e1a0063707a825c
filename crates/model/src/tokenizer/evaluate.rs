//! Measures a tokenizer on the whole test split, and the baseline: k-means of patches, without context and without
//! training.

mod continuity;

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use serde::Serialize;

use super::TokenizerError;
use super::codec::Tokenizer;
use super::corpus::{ClipBatch, Corpus, equal_length_batches};
use super::halves::Captions;
use super::module::TokenizerModule;
use super::pool::WindowPool;
use super::quantizer::by_scale;
use crate::codes::{
    Baseline, CodeHistogram, Continuity, Length, Scale, ScaleUse, TokenizerMetrics,
};
use crate::data::{DataError, MotionSource, Split};
use crate::motion::{Pose, ROOT_YAW, mpjpe_mm, recover_joints};
use crate::progress::moved;
use crate::spec::{CodebookSpec, TokenizerSpec};
use continuity::{Course, continuity};

/// Reconstruction, and use of the codebook, over every clip of the test split.
///
/// `wall_s` is the time that training took; it is passed on. Frames after a clip's last whole
/// token are left out.
///
/// # Errors
/// If the test split is empty or a clip cannot be read.
pub fn evaluate(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    tokenizer_id: &str,
    wall_s: f64,
) -> Result<TokenizerMetrics, TokenizerError> {
    let test = scores(tokenizer, corpus, Split::Test, 0.0)?;
    let made = Reconstruction::of(&test);
    let has_val = corpus.source.n_clips(Split::Val) > 0;
    let val = has_val.then(|| reconstruct(tokenizer, corpus, Split::Val, 0.0)).transpose()?;
    let (spec, grid) = (tokenizer.spec(), tokenizer.spec().grid());
    let histogram = |(i, scale): (usize, &Scale)| {
        CodeHistogram::new(scale.n_vocab, test.iter().flat_map(move |score| &score.scales[i]))
    };
    let scales: Vec<_> = grid.scales.iter().enumerate().map(histogram).collect();
    let used = CodeHistogram::together(&scales);
    let mut lengths = grid.scales.iter().map(|scale| scale.length);
    let has_frames = lengths.all(|length| matches!(length, Length::FramesPerCode(_)));
    Ok(TokenizerMetrics {
        tokenizer_id: tokenizer_id.to_string(),
        architecture: Some(spec.architecture.name().to_string()),
        kind: spec.quantizer.name().to_string(),
        n_vocab: tokenizer.n_vocab(),
        levels: spec.quantizer.levels().map(<[usize]>::to_vec),
        reconstruction_l1: made.reconstruction_l1,
        mpjpe_mm: made.mpjpe_mm,
        mpjpe_heading_mm: Some(made.mpjpe_heading_mm),
        val_mpjpe_mm: val.map(|val| val.mpjpe_mm),
        val_mpjpe_heading_mm: val.map(|val| val.mpjpe_heading_mm),
        utilisation: used.utilisation(),
        exponential_entropy: used.exponential_entropy(),
        parameters: tokenizer.n_parameters(),
        train_steps: spec.training.steps,
        wall_s,
        scales: Some(scales.iter().map(ScaleUse::of).collect()),
        frames_per_code: has_frames.then(|| spec.stride()),
        seed: Some(spec.training.seed),
        continuity: Some(made.continuity),
        continuity_by_source: by_source(corpus.source, Split::Test, &test),
        k_means: None,
    })
}

/// The continuity of each member of a union, by its name; `None` for a single data set.
fn by_source(
    source: &dyn MotionSource,
    split: Split,
    scores: &[Score],
) -> Option<BTreeMap<String, Continuity>> {
    let mut courses: Vec<_> = scores.iter().flat_map(|score| &score.courses).collect();
    courses.sort_unstable_by_key(|(clip, _)| *clip);
    let mut rest = &courses[..];
    let of_members = source.members().iter().map(|member| {
        let own;
        (own, rest) = rest.split_at(member.source.n_clips(split));
        (member.name.clone(), continuity(own.iter().map(|(_, course)| course)))
    });
    let found: BTreeMap<_, _> = of_members.collect();
    (!found.is_empty()).then_some(found)
}

/// How far what a tokenizer makes of its codes is from the truth, a frame's mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Mean absolute error of normalised features.
    pub reconstruction_l1: f64,
    /// Mean per-joint position error, pelvis-aligned, in millimetres.
    pub mpjpe_mm: f64,
    /// The same with the true heading in place of the tokenizer's own.
    pub mpjpe_heading_mm: f64,
    pub continuity: Continuity,
}

/// Reconstruction over every clip of a split, with language-free guidance where a tokenizer has language:
/// see [`Tokenizer::decode`].
///
/// # Errors
/// If the split is empty or a clip cannot be read.
pub fn reconstruct(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    split: Split,
    guidance: f64,
) -> Result<Reconstruction, TokenizerError> {
    Ok(Reconstruction::of(&scores(tokenizer, corpus, split, guidance)?))
}

impl Reconstruction {
    fn of(scores: &[Score]) -> Self {
        let sum = |of: fn(&Score) -> f64| scores.iter().map(of).sum::<f64>();
        let n_frames = sum(|score| score.n_frames);
        let courses = scores.iter().flat_map(|score| &score.courses);
        Self {
            reconstruction_l1: sum(|score| score.l1) / n_frames,
            mpjpe_mm: sum(|score| score.mpjpe_mm) / n_frames,
            mpjpe_heading_mm: sum(|score| score.given_heading_mm) / n_frames,
            continuity: continuity(courses.map(|(_, course)| course)),
        }
    }
}

/// Sums over one batch.
struct Score {
    /// |x − x̂| / std, mean per frame.
    l1: f64,
    mpjpe_mm: f64,
    given_heading_mm: f64,
    n_frames: f64,
    /// Each clip by its index in the split.
    courses: Vec<(usize, Course)>,
    /// The codes of each scale.
    scales: Vec<Vec<u32>>,
}

fn scores(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    split: Split,
    guidance: f64,
) -> Result<Vec<Score>, TokenizerError> {
    let (source, captions) = (corpus.source, corpus.read_by(tokenizer.spec())?);
    let batches = equal_length_batches(source, split, tokenizer.spec().stride())?;
    if batches.is_empty() {
        return Err(empty_split(corpus, split));
    }
    let of = |batch: &ClipBatch| {
        let captions = captions.as_ref().map(|read| read.of(split, &batch.indices));
        let truth = batch.features(source, split)?;
        Ok(score(tokenizer, batch, truth, captions.as_ref(), guidance))
    };
    batches.par_iter().map(of).collect()
}

/// Why nothing can be measured on a split.
pub(super) fn empty_split(corpus: &Corpus, split: Split) -> TokenizerError {
    let path = format!("data set {}", corpus.source.digest());
    DataError::EmptySplit { path, split: split.name() }.into()
}

fn score(
    tokenizer: &Tokenizer,
    batch: &ClipBatch,
    truth: Vec<f32>,
    captions: Option<&Captions>,
    guidance: f64,
) -> Score {
    let n_clips = batch.indices.len();
    let ids = tokenizer.encode_stack(truth.clone(), n_clips, captions);
    let mut made = tokenizer.decode_stack(&ids, [n_clips, batch.n_frames], captions, guidance);
    let std = &tokenizer.stats().std;
    let values = truth.iter().zip(&made).zip(std.iter().cycle());
    let l1: f64 = values.map(|((a, b), std)| f64::from((a - b).abs() / std)).sum();
    let l1 = l1 / std.len() as f64;
    let size = batch.n_frames * std.len();
    let joints = |values: &[f32]| -> Vec<Vec<Pose>> {
        values.chunks_exact(size).map(recover_joints).collect()
    };
    let (true_joints, own_joints) = (joints(&truth), joints(&made));
    let mpjpe_mm = mpjpe(&true_joints, &own_joints);
    let latents = tokenizer.spec().architecture.latents_of_frames(batch.n_frames);
    let clips = batch.indices.iter().zip(own_joints.iter().zip(&true_joints));
    let course = |(&clip, (made, truth)): (&usize, (&Vec<Pose>, &Vec<Pose>))| {
        (clip, Course::of([made, truth], &latents, tokenizer.fps()))
    };
    let courses = clips.map(course).collect();
    let turns = truth.chunks_exact(std.len()).map(|frame| frame[ROOT_YAW]);
    made.chunks_exact_mut(std.len()).zip(turns).for_each(|(made, turn)| made[ROOT_YAW] = turn);
    let given_heading_mm = mpjpe(&true_joints, &joints(&made));
    moved();
    let lengths: Vec<usize> = tokenizer.spec().grid().lengths(batch.n_frames).collect();
    let scales = by_scale(&ids, &lengths, n_clips);
    let n_frames = (batch.n_frames * n_clips) as f64;
    Score { l1, mpjpe_mm, given_heading_mm, n_frames, courses, scales }
}

/// The sum over all frames of clips of one length.
fn mpjpe(truth: &[Vec<Pose>], made: &[Vec<Pose>]) -> f64 {
    let each = truth.iter().zip(made).map(|(truth, made)| mpjpe_mm(truth, made));
    each.sum::<f64>() * truth[0].len() as f64
}

// k-means of patches.

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
    let n_patches = pool.n_patches(spec.stride());
    let n_codes = spec.quantizer.codebooks().first().map_or(0, CodebookSpec::n_vocab);
    if n_patches < FEWEST_PER_CODE * n_codes {
        return Ok(None);
    }
    let module = TokenizerModule::begun(&spec, &pool, n_features, device).valid();
    let tokenizer = Tokenizer::of_clips(module, &spec, source, device);
    let made = reconstruct(&tokenizer, &Corpus::wordless(source), Split::Test, 0.0)?;
    let Reconstruction { mpjpe_mm, mpjpe_heading_mm, .. } = made;
    Ok(Some(Baseline { mpjpe_mm, mpjpe_heading_mm }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Procedural, ProceduralOptions};
    use crate::motion::{N_FEATURES, ROOT_VELOCITY};
    use crate::spec::{ArchitectureSpec, PatchSpec, QuantizerKind, QuantizerSpec};
    use crate::tokenizer::testing::{Waves, patch_spec, small_spec, spec_of};
    use crate::tokenizer::train;
    use std::ops::ControlFlow;

    fn metrics(spec: &TokenizerSpec) -> TokenizerMetrics {
        let source = Waves::new(&[32, 40, 32], N_FEATURES);
        let keep_on = &mut |_| ControlFlow::Continue(());
        let tokenizer =
            train(spec, &Corpus::wordless(&source), &Device::flex(), None, keep_on).unwrap();
        evaluate(&tokenizer, &Corpus::wordless(&source), "t", 1.5).unwrap()
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

    /// The share of the squared sideways travel of half seconds that the codes of a barely trained tokenizer lose.
    fn sideways_lost(sideways_scale: f64) -> f64 {
        let options = ProceduralOptions { seed: 3, train_clips: 64, val_clips: 1, test_clips: 1 };
        let source = Procedural::new(options);
        let mut spec = patch_spec(QuantizerSpec::Vq { n_vocab: 64 }, 1);
        spec.architecture = ArchitectureSpec::Patch(PatchSpec::default());
        spec.training.sideways_scale = sideways_scale;
        let keep_on = &mut |_| ControlFlow::Continue(());
        let tokenizer =
            train(&spec, &Corpus::wordless(&source), &Device::flex(), None, keep_on).unwrap();
        let travel = |features: &[f32]| -> Vec<f64> {
            let steps = features.chunks_exact(N_FEATURES).map(|frame| frame[ROOT_VELOCITY.start]);
            let steps: Vec<f64> = steps.map(f64::from).collect();
            steps.chunks_exact(10).map(|steps| steps.iter().sum()).collect()
        };
        let (mut lost, mut all) = (0.0, 0.0);
        for clip in 0..source.n_clips(Split::Train) {
            let truth = source.features(Split::Train, clip).unwrap();
            let codes = tokenizer.encode(&truth, None).unwrap();
            let n_frames = truth.len() / N_FEATURES;
            let made = tokenizer.decode(&codes, n_frames, None, 0.0).unwrap();
            for (truth, made) in travel(&truth).into_iter().zip(travel(&made)) {
                lost += (truth - made).powi(2);
                all += truth.powi(2);
            }
        }
        lost / all
    }

    #[test]
    fn sidesteps_survive_the_codes_where_they_have_a_factor() {
        let (plain, scaled) = (sideways_lost(1.0), sideways_lost(10.0));
        assert!(scaled < 0.6 * plain, "{plain} {scaled}");
    }

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
