//! [`Sums`]: what is summed over codes while a split is measured.

use serde::{Deserialize, Serialize};

use super::trained::SplitLoss;

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
        parts.into_iter().fold(Self::default(), |all, own| Self {
            nats: all.nats + own.nats,
            unigram_nats: all.unigram_nats + own.unigram_nats,
            targets: all.targets + own.targets,
        })
    }

    /// The loss of a split of so many frames, from the sums of each scale of each clip.
    pub fn split_loss(clips: &[Vec<Self>], n_frames: usize) -> SplitLoss {
        let n_scales = clips.first().map_or(0, Vec::len);
        let of_scale = |scale: usize| Self::all(clips.iter().map(|clip| &clip[scale]));
        let by_scale = || (0..n_scales).map(|scale| of_scale(scale).normalised()).collect();
        let clips: Vec<Self> = clips.iter().map(Self::all).collect();
        let all = Self::all(&clips);
        SplitLoss {
            loss_nats: all.nats / all.targets as f64,
            loss_normalised: all.normalised(),
            nats_per_frame: all.nats / n_frames as f64,
            normalised_by_scale: if n_scales > 1 { by_scale() } else { Vec::new() },
            targets: all.targets,
            clips,
        }
    }
}
