//! Which rows a bootstrap replicate draws.
//!
//! The draws are those of `numpy.random.choice(n, n)` after `numpy.random.seed(S)`, one replicate
//! after the other, so that an analysis in Python can draw the same rows; with S = 42 they are those
//! of Besiroglu et al. 2024. Where they would fill much memory, each replicate has instead a stream
//! of ChaCha8 of its own.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_mt::Mt;

use crate::laws::maths::random::below;

/// Numbers that are kept at once, 4 bytes each.
const MOST_LISTED: usize = 20_000_000;

/// The draws of every replicate, made now or when they are asked for.
pub(super) enum Draws {
    Listed { all: Vec<u32>, size: usize },
    Streams { seed: u64, size: usize, n: usize },
}

impl Draws {
    /// For each of `replicates` replicates, `size` numbers below `n`.
    pub fn new(seed: u64, replicates: usize, size: usize, n: usize) -> Self {
        if replicates * size > MOST_LISTED {
            return Self::Streams { seed, size, n };
        }
        let mut numpy = Numpy::new(seed as u32);
        let all = (0..replicates * size).map(|_| numpy.below(n as u32)).collect();
        Self::Listed { all, size }
    }

    /// Those of one replicate.
    pub fn of(&self, replicate: usize) -> Vec<usize> {
        match self {
            Self::Listed { all, size } => {
                all[replicate * size..][..*size].iter().map(|row| *row as usize).collect()
            }
            Self::Streams { seed, size, n } => {
                let mut rng = ChaCha8Rng::seed_from_u64(*seed);
                rng.set_stream(replicate as u64);
                (0..*size).map(|_| below(&mut rng, *n)).collect()
            }
        }
    }
}

/// numpy's legacy generator: the Mersenne twister, and bounded numbers by masking and rejection.
struct Numpy(Mt);

impl Numpy {
    fn new(seed: u32) -> Self {
        Self(Mt::new(seed))
    }

    fn below(&mut self, n: u32) -> u32 {
        let mask = n.next_power_of_two().wrapping_sub(1);
        loop {
            let value = self.0.next_u32() & mask;
            if value < n {
                return value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `np.random.seed(42); np.random.choice(240, 240)`, 4000 times, by numpy 2.
    #[test]
    fn numpys_draws_are_numpys() {
        let draws = Draws::new(42, 4000, 240, 240);
        assert_eq!(draws.of(0)[..12], [102, 179, 92, 14, 106, 71, 188, 20, 102, 121, 210, 214]);
        assert_eq!(draws.of(3999)[235..], [183, 49, 20, 142, 164]);
    }

    #[test]
    fn draws_too_many_to_keep_are_made_when_asked_for() {
        let draws = Draws::new(1, 1001, 20_000, 50_000);
        assert!(matches!(draws, Draws::Streams { .. }));
        assert_eq!(draws.of(3), draws.of(3));
        assert_ne!(draws.of(3), draws.of(4));
        assert!(draws.of(3).len() == 20_000 && draws.of(3).iter().all(|row| *row < 50_000));
    }
}
