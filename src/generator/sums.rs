//! [`Sums`] and [`SplitSums`]: what is summed over codes while a split is measured.

use std::ops::{Add, Range};

use serde::{Deserialize, Serialize};

use super::stack::Supervised;
use crate::codes::TokenStore;
use crate::data::Split;

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
    /// Of some codes, by −ln p of each and by ln p_uni of each.
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

    /// Of all codes together.
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
    /// L_u: mean of −ln p + ln p_uni over the same targets (ScaMo §4.4); p_uni is that of the target's
    /// own scale.
    ///
    /// From log-probabilities throughout: a ratio of probabilities would underflow first.
    pub loss_normalised: f64,
    /// Cross-entropy per frame of motion.
    pub nats_per_frame: f64,
    /// L_u of the codes of each scale; empty where there is one.
    pub normalised_by_scale: Vec<f64>,
    pub targets: usize,
    /// Of each clip by itself, in the split's order.
    pub clips: Vec<Sums>,
}

/// Sums over a split while it is measured: of each scale, pass after pass, and of each clip.
///
/// Both are of the same codes. That of a scale is taken in the order of the passes, so that a loss has the
/// same bits whether clips are told apart or not.
pub struct SplitSums<'a> {
    pub tokens: &'a TokenStore,
    pub split: Split,
    /// ln p_uni of the codes of each scale.
    unigrams: Vec<Vec<f64>>,
    scales: Vec<Sums>,
    clips: Vec<Sums>,
}

impl<'a> SplitSums<'a> {
    /// Before anything is measured; `unigrams` holds ln p_uni of the codes of each scale.
    pub fn new(tokens: &'a TokenStore, split: Split, unigrams: Vec<Vec<f64>>) -> Self {
        let scales = vec![Sums::default(); unigrams.len()];
        Self {
            tokens,
            split,
            unigrams,
            scales,
            clips: vec![Sums::default(); tokens.n_clips(split)],
        }
    }

    /// The same for all scales of the codes, each with codes of its own.
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
        (nats, targets): (&[Vec<f64>], &[Supervised]),
        clips: &Range<usize>,
    ) {
        let (tokens, split) = (self.tokens, self.split);
        for (scale, (nats, own)) in (first..).zip(nats.iter().zip(targets)) {
            let n_codes = |clip| (clip, tokens.scale(split, clip, scale).len());
            self.add(scale, (nats, &own.codes), clips.clone().map(n_codes));
        }
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
        let Self { scales, clips, .. } = self;
        let all = Sums::all(&scales);
        let by_scale = || scales.iter().map(Sums::normalised).collect();
        SplitLoss {
            loss_nats: all.nats / all.targets as f64,
            loss_normalised: all.normalised(),
            nats_per_frame: all.nats / self.tokens.n_frames(self.split) as f64,
            normalised_by_scale: if scales.len() > 1 { by_scale() } else { Vec::new() },
            targets: all.targets,
            clips,
        }
    }
}
