//! The few distributions that the generator draws from.

use rand_chacha::rand_core::Rng;

/// Draws from simple distributions, for every generator of random words.
pub trait Draw: Rng {
    /// Uniform in `[0, 1)`, 24 bits.
    fn unit(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in `[low, high)`.
    fn uniform(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform with mean 0 and deviation 1.
    fn white(&mut self) -> f32 {
        (self.unit() - 0.5) * 3.464_101_6
    }

    /// Normal by Box and Muller, cut at 2.5 deviations: no body is ten deviations from the mean.
    fn around(&mut self, mean: f32, deviation: f32) -> f32 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let angle = std::f32::consts::TAU * self.unit();
        mean + deviation * (radius * angle.cos()).clamp(-2.5, 2.5)
    }

    /// True with the given probability.
    fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// Uniform over `low..=high`.
    fn int(&mut self, low: u32, high: u32) -> u32 {
        let n = u64::from(high - low) + 1;
        low + ((u64::from(self.next_u32()) * n) >> 32) as u32
    }

    /// One of `items`, each as likely.
    fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.int(0, items.len() as u32 - 1) as usize]
    }

    /// One of a table of items, each as likely as its weight is of their sum.
    fn weighted<T: Copy>(&mut self, table: &[(T, f32)]) -> T {
        let mut left = self.unit() * table.iter().map(|(_, weight)| weight).sum::<f32>();
        for &(item, weight) in table {
            left -= weight;
            if left < 0.0 {
                return item;
            }
        }
        table[table.len() - 1].0
    }
}

impl<R: Rng + ?Sized> Draw for R {}
