//! [`Gates`]: tests of an evaluator on true motions, before any score is computed.

use std::collections::HashMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::EvaluatorError;
use super::codec::Evaluator;
use super::corruption::{Corruption, Motion};
use super::truth::{Embedded, Truth, orders};
use crate::data::MotionSource;
use crate::draws::swapped;
use crate::progress::moved;
use crate::scores::{Embeddings, Gaussian, POOL, Repeated, distance, frechet_distance, retrieval};

/// Number of draws of pools and halves.
const REPEATS: usize = 20;

/// Shares of the pairs that have another pair's caption.
const SWAPPED: [f64; 3] = [0.1, 0.3, 1.0];

/// The seed of every draw.
const SEED: u64 = 0;

/// Embeddings of true motions, and of corrupted ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gates {
    /// Test clips, each with one of its captions.
    pub n_clips: usize,
    /// R@1, R@2 and R@3 of true motions, in pools of 32.
    pub truth: [Repeated; 3],
    /// FID of one half of the true motions from the other.
    pub halves_fid: Repeated,
    pub corrupted: Vec<Corrupted>,
    pub swapped: Vec<Swapped>,
    /// `None` if no two clips have the same caption.
    pub same_caption: Option<SameCaption>,
    /// Captions of a pool of 32 that another of the pool is equal to.
    pub duplicates: Repeated,
    /// FID of as many true motions from as many others.
    pub fid_by_n: Vec<(usize, Repeated)>,
}

/// True motions made worse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Corrupted {
    pub corruption: Corruption,
    pub strength: f64,
    /// FID from the same motions as they were.
    pub fid: f64,
    /// FID of one half, made worse, from the other half as it was.
    pub halves_fid: Repeated,
    /// R@1.
    pub precision: Repeated,
}

/// True motions with captions of one another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Swapped {
    pub share: f64,
    /// R@1.
    pub precision: Repeated,
}

/// Distance between motions of one caption.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SameCaption {
    /// Pairs of clips that have a caption in common.
    pub n_pairs: usize,
    /// Mean distance of such pairs.
    pub distance: f64,
    /// Mean distance of all pairs.
    pub any_distance: f64,
}

/// Measures an evaluator on the test split.
///
/// # Errors
/// The split holds fewer clips than two pools of 32, or one cannot be read.
pub fn measure(evaluator: &Evaluator, source: &dyn MotionSource) -> Result<Gates, EvaluatorError> {
    let truth = Truth::load(evaluator, source)?;
    let Embedded { motions, .. } = &truth.embedded;
    Ok(Gates {
        n_clips: truth.n_clips(),
        truth: precision(&truth.embedded)?,
        halves_fid: halves_fid(motions)?,
        corrupted: corrupted(&truth, evaluator)?,
        swapped: swapped_captions(&truth.embedded)?,
        same_caption: same_caption(&truth),
        duplicates: duplicates(&truth)?,
        fid_by_n: fid_by_n(motions)?,
    })
}

/// R@1, R@2 and R@3 over draws of the pools.
fn precision(pairs: &Embedded) -> Result<[Repeated; 3], EvaluatorError> {
    let mut drawn = [const { Vec::new() }; 3];
    for order in orders(pairs.motions.len(), REPEATS) {
        let Embedded { motions, captions } = pairs.select(&order);
        let found = retrieval(&captions, &motions, POOL)?;
        drawn.iter_mut().zip(found.precision).for_each(|(all, one)| all.push(one));
    }
    let [first, second, third] = drawn.map(|precision| Repeated::of(&precision));
    Ok([first?, second?, third?])
}

/// FID between two halves of the true motions: the resolution of the score.
///
/// # Errors
/// There are fewer than four motions.
pub fn halves_fid(truth: &Embeddings) -> Result<Repeated, EvaluatorError> {
    fid_of_others(truth, truth, truth.len() / 2)
}

/// FID of `n` true motions from `n` others, which may be worse than true.
fn fid_of_others(
    truth: &Embeddings,
    others: &Embeddings,
    n: usize,
) -> Result<Repeated, EvaluatorError> {
    let of = |order: Vec<usize>| {
        moved();
        frechet_distance(&truth.select(&order[..n]), &others.select(&order[n..2 * n]))
    };
    let drawn = orders(truth.len(), REPEATS).map(of).collect::<Result<Vec<f64>, _>>()?;
    Ok(Repeated::of(&drawn)?)
}

fn fid_by_n(motions: &Embeddings) -> Result<Vec<(usize, Repeated)>, EvaluatorError> {
    let sizes = (4..).map(|power| 1 << power).take_while(|n| 2 * n <= motions.len());
    sizes.map(|n| Ok((n, fid_of_others(motions, motions, n)?))).collect()
}

fn corrupted(truth: &Truth, evaluator: &Evaluator) -> Result<Vec<Corrupted>, EvaluatorError> {
    let (stats, fps, least) = (evaluator.stats(), evaluator.fps(), evaluator.spec().frames());
    let (before, n) = (&truth.embedded.motions, truth.n_clips());
    let gaussian = Gaussian::of(before)?;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut found = Vec::new();
    for corruption in Corruption::ALL {
        for &strength in corruption.strengths() {
            let worse = |features: &Vec<f32>| {
                moved();
                corruption.of(&Motion { features, stats, fps, least }, strength, &mut rng)
            };
            let worse: Vec<Vec<f32>> = truth.features.iter().map(worse).collect();
            let motions = evaluator.motions(worse.iter().map(Vec::as_slice))?;
            let fid = gaussian.distance(&Gaussian::of(&motions)?)?;
            let halves_fid = fid_of_others(before, &motions, n / 2)?;
            let [precision, ..] = precision(&truth.embedded.with_motions(motions))?;
            found.push(Corrupted { corruption, strength, fid, halves_fid, precision });
        }
    }
    Ok(found)
}

/// R@1 where shares of the clips have one another's captions.
fn swapped_captions(truth: &Embedded) -> Result<Vec<Swapped>, EvaluatorError> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let of = |share: f64| {
        let captions = swapped(truth.motions.len(), share, &mut rng);
        let [precision, ..] = precision(&truth.recaptioned(&captions))?;
        Ok(Swapped { share, precision })
    };
    SWAPPED.into_iter().map(of).collect()
}

fn same_caption(truth: &Truth) -> Option<SameCaption> {
    let mut clips: HashMap<&str, Vec<usize>> = HashMap::new();
    for (clip, captions) in truth.all_captions.iter().enumerate() {
        let mut own: Vec<&str> = captions.iter().map(String::as_str).collect();
        own.sort_unstable();
        own.dedup();
        own.into_iter().for_each(|caption| clips.entry(caption).or_default().push(clip));
    }
    let mut alike: Vec<(usize, usize)> = clips.values().flat_map(|own| pairs(own)).collect();
    alike.sort_unstable();
    alike.dedup();
    let all: Vec<usize> = (0..truth.n_clips()).collect();
    let motions = &truth.embedded.motions;
    (!alike.is_empty()).then(|| SameCaption {
        n_pairs: alike.len(),
        distance: mean_distance(motions, alike.iter().copied()),
        any_distance: mean_distance(motions, pairs(&all)),
    })
}

/// Every two of some clips.
fn pairs(clips: &[usize]) -> impl Iterator<Item = (usize, usize)> {
    let behind = move |at: usize| clips[at + 1..].iter().map(move |other| (clips[at], *other));
    (0..clips.len()).flat_map(behind)
}

fn mean_distance(motions: &Embeddings, pairs: impl Iterator<Item = (usize, usize)>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (a, b) in pairs {
        sum += distance(motions.row(a), motions.row(b));
        n += 1.0;
    }
    sum / n
}

fn duplicates(truth: &Truth) -> Result<Repeated, EvaluatorError> {
    let of = |order: Vec<usize>| {
        let pools = order.chunks_exact(POOL);
        let n = pools.len() as f64;
        pools.map(|pool| repeated_in(truth, pool)).sum::<usize>() as f64 / n
    };
    let drawn: Vec<f64> = orders(truth.n_clips(), REPEATS).map(of).collect();
    Ok(Repeated::of(&drawn)?)
}

/// Clips of a pool whose caption another has too.
fn repeated_in(truth: &Truth, pool: &[usize]) -> usize {
    let mut times: HashMap<&str, usize> = HashMap::new();
    pool.iter().for_each(|&clip| *times.entry(&truth.captions[clip]).or_default() += 1);
    times.into_values().filter(|times| *times > 1).sum()
}
