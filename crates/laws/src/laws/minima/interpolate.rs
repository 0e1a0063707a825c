//! N_v, V, D and FLOPs at a minimum that lies between the sizes tried.
//!
//! The best vocabulary of each size is a staircase in ln N_nv, since only some vocabularies were
//! tried. Two things smooth it: each size's optimum is refined between its neighbouring
//! vocabularies ([`Size::ln_vocab`](crate::laws::input::cell::Size::ln_vocab)), and a straight line in
//! ln N_nv is laid through the sizes, weighted towards the minimum by a Gaussian of a third of
//! their range. D follows from the budget: ln D(N_nv + N_v), which a budget leaves nearly constant,
//! is interpolated in the same way, and D solved from it, so that the minimum spends what its
//! neighbours spent.

use super::grid::Grid;
use super::types::Minimum;
use crate::laws::input::cell::Size;
use crate::laws::input::method::MinimumMethod;
use crate::laws::maths::stats::extent;

/// Width of the weights, as a share of the range of ln N_nv.
const BANDWIDTH: f64 = 1.0 / 3.0;

/// The minimum at `ln_nonvocab` with its loss, and the rest read off the sizes of its valley.
pub(super) fn along_sizes(
    method: MinimumMethod,
    grid: &Grid,
    sizes: &[Size],
    (ln_nonvocab, loss_normalised): (f64, f64),
) -> Minimum {
    let local = LocalLine::at(sizes, ln_nonvocab);
    let line = |value: &dyn Fn(&Size) -> f64| local.value(sizes, value);
    let params_nonvocab = ln_nonvocab.exp();
    let (params_vocab, n_vocab) = if grid.best().has_vocabulary() {
        let known = with_known_vocabulary(sizes);
        let ln_vocab = LocalLine::at(&known, ln_nonvocab).value(&known, |size| size.ln_vocab);
        (ln_vocab.exp(), (ln_vocab - line(&|size| size.best.ln_width())).exp())
    } else {
        (0.0, 0.0)
    };
    Minimum {
        method,
        budget_flops: grid.budget_flops,
        flops: line(&|size| size.best.flops.ln()).exp(),
        params_nonvocab,
        params_vocab,
        n_vocab,
        tokens: line(&|size| size.best.ln_work()).exp() / (params_nonvocab + params_vocab),
        loss_normalised,
        ci95: None,
        flags: grid.vocab_edge().into_iter().chain(grid.doubts_at(ln_nonvocab)).collect(),
        trusted: false,
    }
}

/// The sizes whose best vocabulary is known: the others only bound theirs. All, where that leaves
/// fewer than two.
fn with_known_vocabulary(sizes: &[Size]) -> Vec<Size> {
    let known: Vec<Size> = sizes.iter().filter(|size| !size.at_edge).cloned().collect();
    if known.len() < 2 { sizes.to_vec() } else { known }
}

/// A weighted line over ln N_nv, read at one place: the value there is the sum of each size's value
/// times its share, which depends on the sizes alone.
struct LocalLine {
    shares: Vec<f64>,
}

impl LocalLine {
    fn at(sizes: &[Size], at: f64) -> Self {
        let x: Vec<f64> = sizes.iter().map(|size| size.best.params_nonvocab.ln()).collect();
        let [low, high] = extent(x.iter().copied());
        let bandwidth = BANDWIDTH * (high - low);
        let weights: Vec<f64> =
            x.iter().map(|x| (-0.5 * ((x - at) / bandwidth).powi(2)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(f64) -> f64| {
            weights.iter().zip(&x).map(|(w, x)| w * of(*x)).sum::<f64>() / total
        };
        let centre = mean(&|x| x);
        let variance = mean(&|x| (x - centre).powi(2));
        let share = |w: f64, x: f64| w / total * (1.0 + (x - centre) * (at - centre) / variance);
        Self { shares: weights.iter().zip(&x).map(|(w, x)| share(*w, *x)).collect() }
    }

    fn value(&self, sizes: &[Size], of: impl Fn(&Size) -> f64) -> f64 {
        self.shares.iter().zip(sizes).map(|(share, size)| share * of(size)).sum()
    }
}
