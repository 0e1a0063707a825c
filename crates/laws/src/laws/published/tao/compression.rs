//! How many tokens a character needs, and how wide a model of a size is.

/// f(V) = `square` ln²V + `linear` ln V + `constant`: tokens per character of text at a vocabulary
/// of V (Tao et al. 2024), constant for V above `largest_vocab`.
///
/// The parabola is a fit: it turns up again where ln V = −`linear` / 2`square`, while a real
/// tokeniser's f only ever falls, so the cap must lie below that V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TokensPerCharacter {
    pub square: f64,
    pub linear: f64,
    pub constant: f64,
    /// The V from which f counts as constant.
    pub largest_vocab: f64,
}

impl TokensPerCharacter {
    /// The f of Tao et al.; its parabola turns at V = 235000, above its cap.
    pub const TAO: Self = Self {
        square: 0.00639222,
        linear: -0.15811069,
        constant: 1.20470122,
        largest_vocab: 200_000.0,
    };

    /// f(V).
    pub fn at(&self, n_vocab: f64) -> f64 {
        let ln = n_vocab.min(self.largest_vocab).ln();
        (self.square * ln + self.linear) * ln + self.constant
    }

    /// df/dV below the cap.
    pub(super) fn slope(&self, n_vocab: f64) -> f64 {
        (2.0 * self.square * n_vocab.ln() + self.linear) / n_vocab
    }
}

/// Largest N_nv, and the width of a model up to it.
const WIDTHS: [(f64, f64); 6] =
    [(50e6, 512.0), (200e6, 768.0), (500e6, 1024.0), (1e9, 1536.0), (2e9, 2048.0), (5e9, 3200.0)];

/// d of a model of N_nv parameters by the table of Tao et al. (`Nnv_to_d` in their code); none
/// above 5e9, where the table ends.
pub fn published_width(params_nonvocab: f64) -> Option<f64> {
    WIDTHS.iter().find(|(largest, _)| params_nonvocab <= *largest).map(|(_, d)| *d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_vocabulary_needs_fewer_tokens_up_to_the_cap() {
        let f = TokensPerCharacter::TAO;
        let vocabularies = [1e3, 4096.0, 96256.0, 2e5];
        assert!(vocabularies.windows(2).all(|v| f.at(v[0]) > f.at(v[1])));
        assert_eq!(f.at(2e5), f.at(1e9));
        assert!((f.at(4096.0) - 60_000_000.0 / 180820540.85207617).abs() < 1e-15);
    }

    #[test]
    fn the_slope_is_the_difference_quotient() {
        let f = TokensPerCharacter::TAO;
        let quotient = (f.at(30001.0) - f.at(29999.0)) / 2.0;
        assert!((quotient / f.slope(30000.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn widths_step_up_with_the_size_and_end() {
        assert_eq!(published_width(33222784.0), Some(512.0));
        assert_eq!(published_width(50e6), Some(512.0));
        assert_eq!(published_width(1_129_891_136.0), Some(2048.0));
        assert_eq!(published_width(7e9), None);
    }
}
