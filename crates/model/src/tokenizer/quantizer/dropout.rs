//! [`Dropout`] of the last layers of a residual quantizer.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

use crate::learn::params::{below, unit};

/// Draws how many layers a training step uses, so that the first of them carry what they can alone.
#[derive(Clone, Debug)]
pub struct Dropout {
    /// How often layers are dropped.
    share: f64,
    rng: ChaCha8Rng,
}

impl Dropout {
    /// One with its own stream of numbers.
    pub fn new(share: f64, rng: &mut ChaCha8Rng) -> Self {
        Self { share, rng: ChaCha8Rng::seed_from_u64(rng.next_u64()) }
    }

    /// All `n` layers, or with the share's probability a number from 1 to `n`, each as likely.
    pub fn layers(&mut self, n: usize) -> usize {
        if unit(&mut self.rng) < self.share { 1 + below(&mut self.rng, n) } else { n }
    }

    /// How far its generator has come: as text, since that has 68 bits.
    pub fn keep(&self) -> Value {
        json!(self.rng.get_word_pos().to_string())
    }

    /// Takes up what [`Dropout::keep`] gave; `None` where it is not that.
    pub fn resume(&mut self, saved: &Value) -> Option<()> {
        self.rng.set_word_pos(saved.as_str()?.parse().ok()?);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_layers_is_drawn_and_all_of_them_most_often() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut dropout = Dropout::new(0.2, &mut rng);
        let mut drawn = [0; 7];
        (0..6000).for_each(|_| drawn[dropout.layers(6)] += 1);
        assert!(drawn[0] == 0 && drawn[1..6].iter().all(|n| (120..280).contains(n)), "{drawn:?}");
        let mut never = Dropout::new(0.0, &mut rng);
        assert!((0..100).all(|_| never.layers(3) == 3));
    }
}
