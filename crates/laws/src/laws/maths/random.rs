//! Draws from ChaCha8, the same on every machine.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Above this many degrees of freedom χ² is drawn by Wilson and Hilferty's approximation, whose
/// quantiles are then right to three digits; up to it, as a sum of squares.
const EXACT_DOF: usize = 30;

/// A stream of normal numbers.
pub struct Normals {
    rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normals {
    /// Stream `stream` of `seed`: streams do not overlap, so what a replicate draws does not depend
    /// on the order or the thread it is drawn in.
    pub fn of_stream(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self { rng, spare: None }
    }

    /// A standard normal by Box and Muller, both of whose numbers are used.
    pub fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }

    /// A χ² of `dof` degrees of freedom.
    pub fn chi_square(&mut self, dof: usize) -> f64 {
        if dof <= EXACT_DOF {
            return (0..dof).map(|_| self.draw().powi(2)).sum();
        }
        let variance = 2.0 / (9.0 * dof as f64);
        dof as f64 * (1.0 - variance + variance.sqrt() * self.draw()).powi(3)
    }

    /// A uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A uniform index below `n` by Lemire's multiplication; its bias, n/2⁶⁴, is below any rounding.
pub(in crate::laws) fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_and_chi_squares_have_their_moments() {
        let mut normals = Normals::of_stream(0, 0);
        let moments = |draws: &[f64]| {
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
            (mean, variance / draws.len() as f64)
        };
        let draws: Vec<f64> = (0..40_000).map(|_| normals.draw()).collect();
        let (mean, variance) = moments(&draws);
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
        for dof in [4, 60] {
            let draws: Vec<f64> = (0..40_000).map(|_| normals.chi_square(dof)).collect();
            let (mean, variance) = moments(&draws);
            assert!((mean / dof as f64 - 1.0).abs() < 0.02, "{dof}: {mean}");
            assert!((variance / (2.0 * dof as f64) - 1.0).abs() < 0.05, "{dof}: {variance}");
        }
    }

    #[test]
    fn a_stream_is_the_same_every_time_and_unlike_its_neighbour() {
        let first = |seed, stream| Normals::of_stream(seed, stream).draw();
        assert_eq!(first(1, 2), first(1, 2));
        assert_ne!(first(1, 2), first(1, 3));
        assert_ne!(first(1, 2), first(2, 2));
    }
}
