//! [`Sums`]: what is summed over the codes of a scale while a split is measured.

use super::trained::SplitLoss;

/// Sums over the codes of a scale.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// −ln p, or a bound on it, in nats.
    pub nll: f64,
    /// −ln p_uni, in nats.
    pub unigram: f64,
    /// Codes.
    pub n: usize,
}

impl Sums {
    /// The loss of a split of so many frames, from the sums of each scale.
    pub fn split_loss(scales: &[Self], n_frames: usize) -> SplitLoss {
        let all = scales.iter().fold(Self::default(), |all, own| all.plus(own));
        let by_scale = || scales.iter().map(Self::normalised).collect();
        SplitLoss {
            loss_nats: all.nll / all.n as f64,
            loss_normalised: all.normalised(),
            nats_per_frame: all.nll / n_frames as f64,
            normalised_by_scale: if scales.len() > 1 { by_scale() } else { Vec::new() },
            targets: all.n,
        }
    }

    fn plus(self, other: &Self) -> Self {
        let Self { nll, unigram, n } = *other;
        Self { nll: self.nll + nll, unigram: self.unigram + unigram, n: self.n + n }
    }

    fn normalised(&self) -> f64 {
        (self.nll - self.unigram) / self.n as f64
    }
}
