//! [`Rope`]: the angles of rotary position embedding.

use burn::tensor::{Device, Tensor, TensorData};

use super::own::LANES;

/// Cosines and sines of rotary position embedding (Su et al. 2021), on interleaved pairs.
///
/// Position t turns the pair (x₂ᵢ, x₂ᵢ₊₁) of each head by the angle t θᵢ, where
/// θᵢ = base^(−2i / head_dim):
///
/// x₂ᵢ ← x₂ᵢ cos − x₂ᵢ₊₁ sin, x₂ᵢ₊₁ ← x₂ᵢ sin + x₂ᵢ₊₁ cos
///
/// This is the order of ScaMo and llama2.c, not the half-split one of GPT-NeoX. Positions count
/// from 0 in each sequence, text included.
#[derive(Debug, Clone, PartialEq)]
pub struct Rope {
    /// (cos, cos) of each pair, `[max_len, width]`.
    along: Vec<f32>,
    /// (−sin, sin) of each pair, `[max_len, width]`.
    across: Vec<f32>,
    max_len: usize,
    head_dim: usize,
    /// head_dim, rounded up to whole vectors.
    width: usize,
}

impl Rope {
    /// Angles for positions `0..max_len`, computed in double precision.
    ///
    /// # Panics
    ///
    /// If `head_dim` is zero or odd: pairs need an even number of features.
    pub fn new(max_len: usize, head_dim: usize, base: f64) -> Self {
        let positions: Vec<f64> = (0..max_len).map(|t| t as f64).collect();
        Self::at_positions(&positions, head_dim, base)
    }

    /// Angles for arbitrary positions: row t has those of `positions[t]`.
    ///
    /// # Panics
    ///
    /// As [`Rope::new`].
    pub fn at_positions(positions: &[f64], head_dim: usize, base: f64) -> Self {
        assert!(
            head_dim > 0 && head_dim.is_multiple_of(2),
            "rotary embedding turns pairs of features: head_dim must be even, not {head_dim}"
        );
        let (max_len, width) = (positions.len(), head_dim.next_multiple_of(LANES));
        let angles = || {
            positions.iter().flat_map(move |t| {
                (0..width / 2).map(move |i| t * base.powf(-2.0 * i as f64 / head_dim as f64))
            })
        };
        let along = angles().flat_map(|angle| [angle.cos() as f32; 2]).collect();
        let sines = angles().map(|angle| angle.sin() as f32);
        let across = sines.flat_map(|sin| [-sin, sin]).collect();
        Self { along, across, max_len, head_dim, width }
    }

    /// Positions there are angles for.
    pub fn max_len(&self) -> usize {
        self.max_len
    }

    /// Features of a head.
    pub fn head_dim(&self) -> usize {
        self.head_dim
    }

    /// The factors of a vector at position `t` and of the same with swapped pairs: (cos, cos) and (−sin, sin) of each pair,
    /// each `[head_dim]` and more, to the end of a vector.
    #[inline(always)]
    pub fn at(&self, t: usize) -> (&[f32], &[f32]) {
        let row = t * self.width..(t + 1) * self.width;
        (&self.along[row.clone()], &self.across[row])
    }

    /// Cosines and sines of the positions `places`, the same number for each of `b` sequences,
    /// `[b, 1, places of each, head_dim / 2, 1]`.
    pub fn turns(&self, b: usize, places: &[usize], device: &Device) -> [Tensor<5>; 2] {
        let shape = [b, 1, places.len() / b, self.head_dim / 2, 1];
        [&self.along, &self.across].map(|of_features| {
            let row = |place: &usize| &of_features[place * self.width..][..self.head_dim];
            let values = places.iter().flat_map(|place| row(place).iter().skip(1).step_by(2));
            let values: Vec<f32> = values.copied().collect();
            Tensor::from_data(TensorData::new(values, shape), device)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cosines and sines of one position.
    fn turns(rope: &Rope, place: usize) -> [Vec<f32>; 2] {
        let turns = rope.turns(1, &[place], &Device::flex());
        turns.map(|values| values.into_data().try_into_vec().unwrap())
    }

    #[test]
    fn angles_are_those_of_the_definition() {
        let rope = Rope::new(4, 4, 10_000.0);
        let [cos, sin] = turns(&rope, 3);
        let (along, across) = rope.at(3);
        let close = |a: &[f32], b: [f64; 2]| {
            a.iter().zip(b).all(|(&a, b)| (f64::from(a) - b).abs() < 1e-7) && a.len() == 2
        };
        assert!(close(&cos, [3f64.cos(), 0.03f64.cos()]), "{cos:?}");
        assert!(close(&sin, [3f64.sin(), 0.03f64.sin()]), "{sin:?}");
        assert_eq!(along[..4], [cos[0], cos[0], cos[1], cos[1]]);
        assert_eq!(across[..4], [-sin[0], sin[0], -sin[1], sin[1]]);
    }

    #[test]
    fn positions_may_lie_between_others() {
        let (each, some) = (Rope::new(9, 6, 100.0), Rope::at_positions(&[2.0, 8.0, 0.5], 6, 100.0));
        assert_eq!([some.at(0), some.at(1)], [each.at(2), each.at(8)]);
        assert!((f64::from(turns(&some, 2)[0][0]) - 0.5f64.cos()).abs() < 1e-7);
    }

    #[test]
    fn the_first_position_is_left_as_it_is() {
        let rope = Rope::new(2, 8, 10_000.0);
        assert_eq!(rope.at(0), (&[1.0; LANES][..], &[0.0; LANES][..]));
    }

    #[test]
    #[should_panic(expected = "head_dim must be even, not 3")]
    fn an_odd_head_is_refused() {
        Rope::new(4, 3, 10_000.0);
    }
}
