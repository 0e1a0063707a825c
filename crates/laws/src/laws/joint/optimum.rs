//! The best allocation of a budget by a joint loss.

use super::{Cost, JointLoss};
use crate::laws::minima::types::Optimum;

/// How far beyond the sizes and vocabularies tried an optimum is looked for, as factors.
const BELOW: f64 = 8.0;
const SIZES_ABOVE: f64 = 1e4;
const VOCABULARIES_ABOVE: f64 = 64.0;
/// Halvings of a golden section: a logarithm to a thousandth.
const STEPS: usize = 28;
/// The share of all that is looked at, in logarithms, within which an optimum lies at an end.
const AT_AN_END: f64 = 1e-3;

impl Cost {
    /// Of `loss` at `budget` FLOPs; none where it is not finite.
    pub fn optimum(&self, loss: &JointLoss, budget: f64) -> Option<Optimum> {
        let sizes = self.sizes_looked_at();
        let best_of = |ln_vocab: f64| {
            let at = |ln_size: f64| self.at(loss, budget, ln_size, ln_vocab);
            golden(sizes, |ln_size| at(ln_size).loss)
                .map_or(f64::INFINITY, |ln_size| at(ln_size).loss)
        };
        let ln_vocab = match self.vocabularies_looked_at(loss) {
            Some(range) => golden(range, best_of)?,
            None => self.vocabularies[0].max(f64::MIN_POSITIVE).ln(),
        };
        let ln_size = golden(sizes, |ln_size| self.at(loss, budget, ln_size, ln_vocab).loss)?;
        let best = self.at(loss, budget, ln_size, ln_vocab);
        (best.loss.is_finite() && best.tokens.is_finite()).then_some(best)
    }

    /// What an optimum has at an end of all that is looked at, the size or the vocabulary, and those ends.
    pub fn at_an_end(
        &self,
        loss: &JointLoss,
        optimum: &Optimum,
    ) -> Option<(&'static str, [f64; 2])> {
        let is_end = |x: f64, [low, high]: [f64; 2]| {
            (x.ln() - low).min(high - x.ln()) < AT_AN_END * (high - low)
        };
        let size = ("size", optimum.params_nonvocab, Some(self.sizes_looked_at()));
        let vocab =
            ("vocabulary", optimum.n_vocab.unwrap_or_default(), self.vocabularies_looked_at(loss));
        [size, vocab].into_iter().find_map(|(what, x, range)| {
            range.filter(|range| is_end(x, *range)).map(|range| (what, range.map(f64::exp)))
        })
    }

    /// ln N_nv.
    fn sizes_looked_at(&self) -> [f64; 2] {
        let [low, high] = self.sizes.map(f64::ln);
        [low - BELOW.ln(), high + SIZES_ABOVE.ln()]
    }

    /// ln V, where several vocabularies were tried.
    fn vocabularies_looked_at(&self, loss: &JointLoss) -> Option<[f64; 2]> {
        let [low, high] = self.vocabularies.map(f64::ln);
        loss.terms.vocab.then_some([low - BELOW.ln(), high + VOCABULARIES_ABOVE.ln()])
    }

    fn at(&self, loss: &JointLoss, budget: f64, ln_size: f64, ln_vocab: f64) -> Optimum {
        let (params_nonvocab, n_vocab) = (ln_size.exp(), ln_vocab.exp());
        let params_vocab = self.params_vocab(params_nonvocab, n_vocab);
        let tokens = self.tokens(budget, params_nonvocab, params_vocab);
        Optimum {
            params_nonvocab,
            params_vocab,
            n_vocab: (params_vocab > 0.0).then_some(n_vocab),
            tokens,
            loss: loss.at(params_nonvocab, n_vocab, tokens),
        }
    }
}

/// Where a function of one valley is least; none where it is not finite there.
fn golden([mut low, mut high]: [f64; 2], f: impl Fn(f64) -> f64) -> Option<f64> {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    for _ in 0..STEPS {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = f(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = f(b);
        }
    }
    at_a.min(at_b).is_finite().then_some(0.5 * (low + high))
}
