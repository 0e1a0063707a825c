//! [`Sums`] and [`SplitSums`]: what is summed over codes while a split is measured.

use std::ops::Add;

use serde::{Deserialize, Serialize};

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

/// Sums over a split while it is measured: of each scale, pass after pass, and of each clip.
///
/// Both are of the same codes. That of a scale is taken in the order of the passes, so that a loss has the
/// same bits whether clips are told apart or not.
pub struct SplitSums {
    pub scales: Vec<Sums>,
    pub clips: Vec<Sums>,
}

impl SplitSums {
    /// Before anything is measured.
    pub fn new(n_scales: usize, n_clips: usize) -> Self {
        Self { scales: vec![Sums::default(); n_scales], clips: vec![Sums::default(); n_clips] }
    }

    /// Takes in the codes of a scale of a pass: −ln p of each, ln p_uni of each, and how many each of the
    /// clips has.
    pub fn add(
        &mut self,
        scale: usize,
        (nats, ln_p): (&[f64], &[f64]),
        clips: impl IntoIterator<Item = (usize, usize)>,
    ) {
        let of = |from: usize, to: usize| {
            Sums::of(nats[from..to].iter().copied(), ln_p[from..to].iter().copied())
        };
        self.scales[scale] = self.scales[scale] + of(0, nats.len());
        let mut at = 0;
        for (clip, n) in clips {
            self.clips[clip] = self.clips[clip] + of(at, at + n);
            at += n;
        }
    }
}
