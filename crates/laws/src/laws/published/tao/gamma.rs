//! Their derivative approach: how fast the vocabulary's parameters should grow with the others.

use super::{DELTA, TokensPerCharacter, huber};

/// N_nv and d of the seven models that Tao et al. take γ from; the first anchors the ratios.
pub const DERIVATIVE_SIZES: [(f64, f64); 7] = [
    (33e6, 512.0),
    (85e6, 768.0),
    (151e6, 768.0),
    (302e6, 1024.0),
    (631e6, 1536.0),
    (1130e6, 2048.0),
    (2870e6, 3200.0),
];

/// N_v ∝ N_nv^γ, and the vocabularies that γ was fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivativeGamma {
    /// γ; .83540 for the sizes and the f of Tao et al.
    pub gamma: f64,
    /// V of least compute for each size.
    pub n_vocab: Vec<f64>,
}

/// γ of N_v ∝ N_nv^γ by the derivative of the compute (Tao et al. 2024, approach 2).
///
/// For each (N_nv, d) of `sizes` the V that makes the same text cheapest solves
///
/// d/dV \[6 (N_nv + V d) H f(V)\] = 0,
///
/// whatever H. γ then minimises Σ ρ(γ ln(N_nv / N_nv,1) − ln(N_v / N_v,1)) over the sizes after the
/// first, with N_v = V d and ρ the Huber loss of δ = 1e-3. The optimum is exact, and 5 digits agree
/// with the .8353974 they publish. A V that would lie above f's cap is the cap. None for fewer than
/// two sizes, where all are alike, or where one is not positive.
pub fn derivative_gamma(f: &TokensPerCharacter, sizes: &[(f64, f64)]) -> Option<DerivativeGamma> {
    let positive = |value: &f64| *value > 0.0 && value.is_finite();
    if !sizes.iter().all(|(n, d)| positive(n) && positive(d)) {
        return None;
    }
    let n_vocab: Vec<f64> = sizes.iter().map(|(n, d)| cheapest_vocab(f, *n, *d)).collect();
    let params_vocab: Vec<f64> = sizes.iter().zip(&n_vocab).map(|((_, d), v)| v * d).collect();
    let params_nonvocab: Vec<f64> = sizes.iter().map(|(n, _)| *n).collect();
    let gamma = huber::ratio(&ln_to_first(&params_nonvocab)?, &ln_to_first(&params_vocab)?, DELTA)?;
    Some(DerivativeGamma { gamma, n_vocab })
}

/// The V at which (N_nv + V d) f(V) stops falling.
fn cheapest_vocab(f: &TokensPerCharacter, params_nonvocab: f64, d: f64) -> f64 {
    let slope = |v: f64| d * f.at(v) + (params_nonvocab + v * d) * f.slope(v);
    huber::zero(1.0, f.largest_vocab, slope)
}

fn ln_to_first(values: &[f64]) -> Option<Vec<f64>> {
    let (first, rest) = values.split_first()?;
    Some(rest.iter().map(|v| (v / first).ln()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_is_the_published_one() {
        let law = derivative_gamma(&TokensPerCharacter::TAO, &DERIVATIVE_SIZES).unwrap();
        assert!((law.gamma - 0.83540).abs() < 5e-6, "{}", law.gamma);
        assert!((law.gamma - 0.8353974035228025).abs() < 5e-6, "{}", law.gamma);
    }

    #[test]
    fn the_chosen_vocabulary_is_the_cheapest() {
        let f = TokensPerCharacter::TAO;
        let law = derivative_gamma(&f, &DERIVATIVE_SIZES).unwrap();
        for ((n, d), best) in DERIVATIVE_SIZES.iter().zip(&law.n_vocab) {
            let cost = |v: f64| (n + v * d) * f.at(v);
            assert!([0.5, 0.99, 1.01, 2.0].iter().all(|by| cost(best * by) > cost(*best)));
        }
    }

    #[test]
    fn the_vocabulary_stops_at_the_cap() {
        let f = TokensPerCharacter { largest_vocab: 5e3, ..TokensPerCharacter::TAO };
        let law = derivative_gamma(&f, &DERIVATIVE_SIZES).unwrap();
        assert_eq!(law.n_vocab[6], 5e3);
    }

    #[test]
    fn one_size_has_no_gamma() {
        assert_eq!(derivative_gamma(&TokensPerCharacter::TAO, &DERIVATIVE_SIZES[..1]), None);
        assert_eq!(derivative_gamma(&TokensPerCharacter::TAO, &[]), None);
        assert_eq!(
            derivative_gamma(&TokensPerCharacter::TAO, &[(33e6, 512.0), (-1.0, 768.0)]),
            None
        );
    }
}
