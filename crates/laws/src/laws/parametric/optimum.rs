//! The compute-optimal allocation of a parametric law, under C = 6 N D.

use super::form::Coefficients;
use crate::laws::input::point::Parameters;
use crate::laws::minima::types::Optimum;

/// FLOPs for a parameter and a token.
const FLOPS_PER_PARAM_TOKEN: f64 = 6.0;

/// The allocation of least loss that spends `budget` FLOPs; none where the coefficients have none.
///
/// For approach 3 it is N = G (C/6)^a with a = β/(α + β) and G = (αA/βB)^(1/(α+β)) (Hoffmann et al.
/// 2022, Eq. 4). With a vocabulary the gradient vanishes where α1 A1 N_nv^(−α1−1) =
/// α2 A2 N_v^(−α2−1), so that N_v is a power of N_nv with the exponent (1 + α1)/(1 + α2), and one
/// equation in ln N_nv is left, whose left side grows.
pub fn optimum(coefficients: &Coefficients, budget: f64) -> Option<Optimum> {
    let terms = coefficients.form.n_terms();
    let sound =
        (0..terms).all(|k| coefficients.coefficient(k) > 0.0 && coefficients.exponent(k) > 0.0);
    if !sound {
        return None;
    }
    let found = match coefficients.form.parameters() {
        Parameters::Total => of_total(coefficients, budget),
        Parameters::Split => of_split(coefficients, budget)?,
    };
    let finite = [found.params_nonvocab, found.tokens, found.loss].iter().all(|x| x.is_finite());
    finite.then_some(found)
}

fn of_total(c: &Coefficients, budget: f64) -> Optimum {
    let (alpha, beta) = (c.exponent(0), c.exponent(1));
    let ln_g = ((alpha * c.coefficient(0)).ln() - (beta * c.coefficient(1)).ln()) / (alpha + beta);
    let ln_work = (budget / FLOPS_PER_PARAM_TOKEN).ln();
    let params = (ln_g + beta / (alpha + beta) * ln_work).exp();
    let tokens = (alpha / (alpha + beta) * ln_work - ln_g).exp();
    let loss = c.loss(&[params, tokens]);
    Optimum { params_nonvocab: params, params_vocab: 0.0, n_vocab: None, tokens, loss }
}

/// The exponent of N_v in N_nv at the optima of a law with a vocabulary, (1 + α1)/(1 + α2).
pub fn vocab_exponent(c: &Coefficients) -> f64 {
    (1.0 + c.exponent(0)) / (1.0 + c.exponent(1))
}

/// ln N_v at an optimum whose N_nv is e^`ln_nonvocab`.
fn ln_vocab(c: &Coefficients, ln_nonvocab: f64) -> f64 {
    let steepness = |k: usize| (c.exponent(k) * c.coefficient(k)).ln();
    (steepness(1) - steepness(0)) / (1.0 + c.exponent(1)) + vocab_exponent(c) * ln_nonvocab
}

fn of_split(c: &Coefficients, budget: f64) -> Option<Optimum> {
    let work = budget / FLOPS_PER_PARAM_TOKEN;
    let at = |ln_nonvocab: f64| {
        let (n, v) = (ln_nonvocab.exp(), ln_vocab(c, ln_nonvocab).exp());
        (n, v, work / (n + v))
    };
    // ln of what more data would gain over what a larger model would.
    let imbalance = |ln_nonvocab: f64| {
        let (n, v, d) = at(ln_nonvocab);
        let data = (c.exponent(2) * c.coefficient(2)).ln() - c.exponent(2) * d.ln();
        let model = (c.exponent(0) * c.coefficient(0)).ln() - c.exponent(0) * n.ln();
        data + (n / (n + v)).ln() - model
    };
    let (n, v, d) = at(rising_zero(imbalance)?);
    let loss = c.loss(&[n, v, d]);
    Some(Optimum { params_nonvocab: n, params_vocab: v, n_vocab: None, tokens: d, loss })
}

/// The zero of a growing function of ln N, by bisection to the last bit; none without a change of
/// sign between e^−50 and e^100.
fn rising_zero(f: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut low, mut high) = (-50.0, 100.0);
    if !(f(low) < 0.0 && f(high) > 0.0) {
        return None;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::parametric::form::Form;

    #[test]
    fn the_optimum_of_epochs_chinchilla_is_the_published_one() {
        let values = [1.81721809, 477.82584, 2143.41736, 0.34731050, 0.36717243];
        let best = optimum(&Coefficients::new(Form::Approach3, &values).unwrap(), 5.76e23).unwrap();
        assert!((best.params_nonvocab / 73.19e9 - 1.0).abs() < 1e-3, "{best:?}");
        assert!((best.tokens / 1.3116e12 - 1.0).abs() < 1e-3, "{best:?}");
    }

    #[test]
    fn no_neighbour_of_an_optimum_on_the_budget_is_better() {
        let values = [6.0, 200.0, 8.0, 400.0, 0.35, 0.22, 0.38];
        let c = Coefficients::new(Form::Approach3Vocab, &values).unwrap();
        let best = optimum(&c, 1e17).unwrap();
        let loss = |n: f64, v: f64| c.loss(&[n, v, 1e17 / 6.0 / (n + v)]);
        let (n, v) = (best.params_nonvocab, best.params_vocab);
        assert!((6.0 * (n + v) * best.tokens / 1e17 - 1.0).abs() < 1e-12);
        for (f, g) in [(1.001, 1.0), (0.999, 1.0), (1.0, 1.001), (1.0, 0.999), (1.001, 0.999)] {
            assert!(loss(f * n, g * v) > best.loss, "{f} {g}");
        }
    }
}
