//! [`SplitLoss`]: the loss of a model on a split, from [`Sums`] over codes; and its scatter.

use std::collections::BTreeMap;
use std::ops::{Add, Range};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::stack::Supervised;
use crate::codes::{CodeHistogram, TokenStore};
use crate::data::Split;
use crate::draws::distinct;
use crate::ops::RowLosses;
use crate::spec::TARGETS_PER_PASS;

/// Ranges of clips with at most the targets of a pass, or one clip.
pub fn passes(tokens: &TokenStore, split: Split) -> Vec<Range<usize>> {
    let mut passes: Vec<Range<usize>> = Vec::new();
    let mut targets = 0;
    for clip in 0..tokens.n_clips(split) {
        targets += tokens.n_targets_of_clip(split, clip);
        match passes.last_mut() {
            Some(pass) if targets <= TARGETS_PER_PASS => pass.end = clip + 1,
            _ => {
                passes.push(clip..clip + 1);
                targets = tokens.n_targets_of_clip(split, clip);
            }
        }
    }
    passes
}

/// Sums over codes of one clip, or of many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    /// −ln p, or a bound on it, in nats.
    pub nats: f64,
    /// −ln p_uni, in nats.
    pub unigram_nats: f64,
    /// Codes.
    pub targets: usize,
}

impl Sums {
    /// The loss of some codes, from −ln p and ln p_uni of each.
    pub fn of(nats: impl IntoIterator<Item = f64>, unigram: impl IntoIterator<Item = f64>) -> Self {
        let mut sums = Self { nats: nats.into_iter().sum(), ..Self::default() };
        for ln_p in unigram {
            sums.unigram_nats -= ln_p;
            sums.targets += 1;
        }
        sums
    }

    /// L_u of these codes.
    pub fn normalised(&self) -> f64 {
        (self.nats - self.unigram_nats) / self.targets as f64
    }

    /// Over all codes.
    pub fn all<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Self {
        parts.into_iter().fold(Self::default(), |all, own| all + *own)
    }
}

impl Add for Sums {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            nats: self.nats + other.nats,
            unigram_nats: self.unigram_nats + other.unigram_nats,
            targets: self.targets + other.targets,
        }
    }
}

/// Losses of a model on a split, in nats.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitLoss {
    /// Mean −ln p over targets, end tokens included where clips have them.
    pub loss_nats: f64,
    /// L_u: mean of −ln p + ln p_uni over the same targets (ScaMo §4.4); p_uni is for the target's own scale.
    ///
    /// Computed from log-probabilities: a ratio of probabilities would underflow.
    pub loss_normalised: f64,
    /// Cross-entropy per frame of motion.
    pub nats_per_frame: f64,
    /// L_u of the codes of each scale; empty if there is one.
    pub normalised_by_scale: Vec<f64>,
    /// exp(−Σ q ln q) of each scale, where q is the frequency of a code among the likeliest codes in the places of the
    /// split's codes, each given the true codes that the model is shown there. End tokens' places are left out.
    ///
    /// LG-Tok's §4.3 calls it perplexity; it tells how many codes a model uses, right or wrong.
    pub likeliest_exponential_entropy: Vec<f64>,
    pub targets: usize,
    /// Per clip, in the split's order.
    pub clips: Vec<Sums>,
}

/// Running sums over a split: per scale, pass by pass, and per clip.
///
/// Both cover the same codes. The sum of a scale is in the order of the passes, so a loss has the same bits with or
/// without sums per clip.
pub struct SplitSums<'a> {
    pub tokens: &'a TokenStore,
    pub split: Split,
    /// ln p_uni of the codes of each scale.
    unigrams: Vec<Vec<f64>>,
    scales: Vec<Sums>,
    clips: Vec<Sums>,
    /// The likeliest ids in the places of each scale of the grid.
    likeliest: Vec<CodeHistogram>,
}

impl<'a> SplitSums<'a> {
    /// Before anything is measured; `unigrams` holds ln p_uni of the codes of each scale.
    pub fn new(tokens: &'a TokenStore, split: Split, unigrams: Vec<Vec<f64>>) -> Self {
        let scales = vec![Sums::default(); unigrams.len()];
        let of_scale = CodeHistogram::new(tokens.n_vocab() + 1, []);
        Self {
            tokens,
            split,
            unigrams,
            scales,
            clips: vec![Sums::default(); tokens.n_clips(split)],
            likeliest: vec![of_scale; tokens.grid().scales.len()],
        }
    }

    /// The same for all scales, each with its own codes.
    pub fn by_scale(tokens: &'a TokenStore, split: Split) -> Self {
        let scales = 0..tokens.grid().scales.len();
        Self::new(tokens, split, scales.map(|scale| tokens.unigram_log_probs(scale)).collect())
    }

    /// Takes in the codes of a scale of a pass: −ln p of each, and how many each of the clips has.
    pub fn add(
        &mut self,
        scale: usize,
        (nats, codes): (&[f64], &[u32]),
        clips: impl IntoIterator<Item = (usize, usize)>,
    ) {
        let unigram = &self.unigrams[scale];
        let of = |span: Range<usize>| {
            let ln_p = codes[span.clone()].iter().map(|&code| unigram[code as usize]);
            Sums::of(nats[span].iter().copied(), ln_p)
        };
        self.scales[scale] = self.scales[scale] + of(0..nats.len());
        let mut at = 0;
        for (clip, n) in clips {
            self.clips[clip] = self.clips[clip] + of(at..at + n);
            at += n;
        }
    }

    /// Takes in the supervised codes of a pass, of the scales from `first` on.
    pub fn add_scales(
        &mut self,
        first: usize,
        (losses, targets): (&[RowLosses], &[Supervised]),
        clips: &Range<usize>,
    ) {
        let (tokens, split) = (self.tokens, self.split);
        for (scale, (losses, own)) in (first..).zip(losses.iter().zip(targets)) {
            let n_codes = |clip| (clip, tokens.scale(split, clip, scale).len());
            self.add(scale, (&losses.nats, &own.codes), clips.clone().map(n_codes));
            self.count(scale, &losses.likeliest);
        }
    }

    /// Counts the likeliest ids in places of a scale.
    pub fn count(&mut self, scale: usize, likeliest: &[u32]) {
        self.likeliest[scale].add(likeliest);
    }

    /// Takes in nats of a clip, which are of its first scale.
    pub fn add_nats(&mut self, clip: usize, nats: f64) {
        self.add_to_first(clip, Sums { nats, ..Sums::default() });
    }

    /// Takes in ln p_uni of the codes of a clip's first scale.
    pub fn add_unigrams(&mut self, clip: usize) {
        let codes = self.tokens.scale(self.split, clip, 0);
        let ln_p = codes.iter().map(|&code| self.unigrams[0][code as usize]);
        self.add_to_first(clip, Sums::of([], ln_p));
    }

    fn add_to_first(&mut self, clip: usize, own: Sums) {
        self.scales[0] = self.scales[0] + own;
        self.clips[clip] = self.clips[clip] + own;
    }

    /// The losses on the split.
    pub fn loss(self) -> SplitLoss {
        let Self { scales, clips, likeliest, .. } = self;
        let all = Sums::all(&scales);
        let by_scale = || scales.iter().map(Sums::normalised).collect();
        SplitLoss {
            loss_nats: all.nats / all.targets as f64,
            loss_normalised: all.normalised(),
            nats_per_frame: all.nats / self.tokens.n_frames(self.split) as f64,
            normalised_by_scale: if scales.len() > 1 { by_scale() } else { Vec::new() },
            likeliest_exponential_entropy: likeliest
                .iter()
                .map(CodeHistogram::exponential_entropy)
                .collect(),
            targets: all.targets,
            clips,
        }
    }
}

// [`losses_by_block`]: the loss on parts of a split without common recordings.
//
// Parts of the split show how a loss depends on the held-out clips: with B parts of about equal size, the mean over the
// parts has the variance of the parts' losses divided by B (random groups; Wolter 2007, "Introduction to Variance
// Estimation"). Clips recorded together stay in one part.

/// Parts of a split. Twenty estimate a standard deviation to within a sixth.
const MOST_BLOCKS: usize = 20;

/// Seeds which groups go together: the same for all runs of a data set.
const SEED: u64 = 0;

/// L_u of each block of a split, by the sums of each clip, and the group and the frames of each.
///
/// Groups are assigned in random order, each to the block with the fewest frames; so blocks do not depend on the codes.
/// There are 20, or fewer if there are fewer groups.
pub fn losses_by_block(clips: &[Sums], groups: &[u32], frames: &[usize]) -> Vec<f64> {
    let mut of_groups: BTreeMap<u32, (usize, Vec<usize>)> = BTreeMap::new();
    for (clip, group) in groups.iter().enumerate() {
        let (total, own) = of_groups.entry(*group).or_default();
        *total += frames[clip];
        own.push(clip);
    }
    let groups: Vec<(usize, Vec<usize>)> = of_groups.into_values().collect();
    let order = distinct(groups.len(), groups.len(), &mut ChaCha8Rng::seed_from_u64(SEED));
    let mut blocks = vec![(0, Sums::default()); groups.len().min(MOST_BLOCKS)];
    for (frames, own) in order.into_iter().map(|group| &groups[group]) {
        let lightest = blocks.iter_mut().min_by_key(|(total, _)| *total).expect("a block a group");
        lightest.0 += frames;
        lightest.1 =
            Sums::all([&lightest.1].into_iter().chain(own.iter().map(|&clip| &clips[clip])));
    }
    blocks.iter().map(|(_, sums)| sums.normalised()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::below;

    /// A clip of `targets` codes with L_u = `loss`.
    fn clip(loss: f64, targets: usize) -> Sums {
        Sums { nats: loss * targets as f64, unigram_nats: 0.0, targets }
    }

    #[test]
    fn clips_that_were_recorded_together_stay_in_one_block() {
        let clips: Vec<Sums> = (0..60).map(|i| clip(-f64::from(i / 20), 5)).collect();
        let groups: Vec<u32> = (0..60).map(|i| i / 20).collect();
        let mut losses = losses_by_block(&clips, &groups, &[20; 60]);
        losses.sort_by(f64::total_cmp);
        assert_eq!(losses, [-2.0, -1.0, 0.0]);
    }

    #[test]
    fn blocks_are_of_like_size_and_their_mean_is_the_loss() {
        let clips: Vec<Sums> = (0..400).map(|i| clip(-f64::from(i % 7), 10)).collect();
        let groups: Vec<u32> = (0..400).collect();
        let losses = losses_by_block(&clips, &groups, &[40; 400]);
        assert_eq!(losses.len(), MOST_BLOCKS);
        let mean = losses.iter().sum::<f64>() / losses.len() as f64;
        assert!((mean - Sums::all(&clips).normalised()).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn the_scatter_of_blocks_tells_how_far_the_loss_hangs_on_the_clips() {
        // L_u of a clip scatters by 2, so that of the mean of 400 clips does by 0.1.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let clips = (0..400).map(|_| clip([-2.0, 2.0][below(&mut rng, 2)], 10));
        let clips: Vec<Sums> = clips.collect();
        let losses = losses_by_block(&clips, &(0..400).collect::<Vec<_>>(), &[40; 400]);
        let mean = losses.iter().sum::<f64>() / 20.0;
        let variance = losses.iter().map(|loss| (loss - mean).powi(2)).sum::<f64>() / (20.0 * 19.0);
        assert!((variance.sqrt() / 0.1 - 1.0).abs() < 0.35, "{}", variance.sqrt());
    }
}
