//! Random numbers on the host: streams of a seed, and draws from them.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The numbers of one of a seed's independent streams.
pub fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// Uniform in [0, 1) with 53 random bits.
pub fn unit(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Uniform in 0..n; the bias of at most n / 2^64 is negligible.
pub fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

/// An index, as likely as its weight among all; there is at least one.
pub fn weighted(
    mut weights: impl ExactSizeIterator<Item = f64> + Clone,
    rng: &mut ChaCha8Rng,
) -> usize {
    let mut left = unit(rng) * weights.clone().sum::<f64>();
    let last = weights.len() - 1;
    let drawn = weights.position(|weight| {
        left -= weight;
        left < 0.0
    });
    drawn.unwrap_or(last)
}

/// `k` distinct numbers below `n`, in the order drawn; all of them if there are fewer.
pub fn distinct(n: usize, k: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..n).collect();
    let k = k.min(n);
    for i in 0..k {
        let j = i + below(rng, n - i);
        numbers.swap(i, j);
    }
    numbers.truncate(k);
    numbers
}

/// Two independent standard normal values (Box and Muller).
pub fn normal_pair(rng: &mut ChaCha8Rng) -> (f64, f64) {
    let radius = (-2.0 * (1.0 - unit(rng)).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * unit(rng)).sin_cos();
    (radius * cos, radius * sin)
}

/// A permutation of `n` items in which a random `share` of them is swapped.
pub fn swapped(n: usize, share: f64, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let drawn = distinct(n, (share * n as f64).round() as usize, rng);
    let mut of: Vec<usize> = (0..n).collect();
    for (to, from) in drawn.iter().zip(drawn.iter().cycle().skip(1)) {
        of[*to] = *from;
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_swapped_as_asked_for_and_none_is_lost() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (share, moved) in [(0.0, 0), (0.3, 30), (1.0, 100)] {
            let mut of = swapped(100, share, &mut rng);
            assert_eq!(of.iter().enumerate().filter(|(to, from)| to != *from).count(), moved);
            of.sort_unstable();
            assert_eq!(of, Vec::from_iter(0..100));
        }
    }
}
