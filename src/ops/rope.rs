//! [`Rope`]: the angles of rotary position embedding.

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
    /// `[max_len, head_dim / 2]`.
    cos: Vec<f32>,
    /// `[max_len, head_dim / 2]`.
    sin: Vec<f32>,
    /// (cos, cos) of each pair, `[max_len, head_dim]`.
    along: Vec<f32>,
    /// (−sin, sin) of each pair, `[max_len, head_dim]`.
    across: Vec<f32>,
    max_len: usize,
    head_dim: usize,
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

    /// Angles for positions that do not follow one another: row t has those of `positions[t]`.
    ///
    /// # Panics
    ///
    /// As [`Rope::new`].
    pub fn at_positions(positions: &[f64], head_dim: usize, base: f64) -> Self {
        assert!(
            head_dim > 0 && head_dim.is_multiple_of(2),
            "rotary embedding turns pairs of features: head_dim must be even, not {head_dim}"
        );
        let max_len = positions.len();
        let angles = || {
            positions.iter().flat_map(move |t| {
                (0..head_dim / 2).map(move |i| t * base.powf(-2.0 * i as f64 / head_dim as f64))
            })
        };
        let cos: Vec<f32> = angles().map(|angle| angle.cos() as f32).collect();
        let sin: Vec<f32> = angles().map(|angle| angle.sin() as f32).collect();
        let along = cos.iter().flat_map(|&cos| [cos, cos]).collect();
        let across = sin.iter().flat_map(|&sin| [-sin, sin]).collect();
        Self { cos, sin, along, across, max_len, head_dim }
    }

    /// Positions there are angles for.
    pub fn max_len(&self) -> usize {
        self.max_len
    }

    /// Features of a head.
    pub fn head_dim(&self) -> usize {
        self.head_dim
    }

    /// What a vector at position `t` and the same with its pairs changed over are multiplied by,
    /// (cos, cos) and (−sin, sin) of each pair, each `[head_dim]`.
    #[inline(always)]
    pub fn at(&self, t: usize) -> (&[f32], &[f32]) {
        let row = t * self.head_dim..(t + 1) * self.head_dim;
        (&self.along[row.clone()], &self.across[row])
    }

    /// Cosines and sines of position `t`, each `[head_dim / 2]`.
    pub fn turn(&self, t: usize) -> (&[f32], &[f32]) {
        let row = t * self.head_dim / 2..(t + 1) * self.head_dim / 2;
        (&self.cos[row.clone()], &self.sin[row])
    }

    /// Cosines and sines of the first `len` positions, each `[len, head_dim / 2]`.
    pub fn first(&self, len: usize) -> (&[f32], &[f32]) {
        let n = len * self.head_dim / 2;
        (&self.cos[..n], &self.sin[..n])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_definition() {
        let rope = Rope::new(4, 4, 10_000.0);
        let ([cos, sin], (along, across)) = ([rope.first(4).0, rope.first(4).1], rope.at(3));
        let (cos, sin) = (&cos[6..], &sin[6..]);
        let close = |a: &[f32], b: [f64; 2]| {
            a.iter().zip(b).all(|(&a, b)| (f64::from(a) - b).abs() < 1e-7) && a.len() == 2
        };
        assert!(close(cos, [3f64.cos(), 0.03f64.cos()]), "{cos:?}");
        assert!(close(sin, [3f64.sin(), 0.03f64.sin()]), "{sin:?}");
        assert_eq!(along, [cos[0], cos[0], cos[1], cos[1]]);
        assert_eq!(across, [-sin[0], sin[0], -sin[1], sin[1]]);
    }

    #[test]
    fn positions_may_lie_between_others() {
        let (each, some) = (Rope::new(9, 6, 100.0), Rope::at_positions(&[2.0, 8.0, 0.5], 6, 100.0));
        assert_eq!([some.at(0), some.at(1)], [each.at(2), each.at(8)]);
        assert!((f64::from(some.turn(2).0[0]) - 0.5f64.cos()).abs() < 1e-7);
    }

    #[test]
    fn the_first_position_is_left_as_it_is() {
        let rope = Rope::new(2, 8, 10_000.0);
        assert_eq!(rope.at(0), (&[1.0; 8][..], &[0.0; 8][..]));
    }

    #[test]
    #[should_panic(expected = "head_dim must be even, not 3")]
    fn an_odd_head_is_refused() {
        Rope::new(4, 3, 10_000.0);
    }
}
