//! Sweeps whose laws are known, for the tests.
//!
//! L(N_nv, N_v, D) = −E + A1/N_nv^α1 + A2/N_v^α2 + B/D^β with C = 6(N_nv + N_v)D: the form of
//! approach 3 with a vocabulary. The true optimum of a budget is found by minimising it directly.

use crate::laws::input::metric::Metric;
use crate::laws::input::point::{IsoFlopPoint, RunFacts};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::sync::Mutex;

/// A row on the 1e12 budget with width 64; its run id is made of its values.
pub fn point(params_nonvocab: f64, params_vocab: f64, loss: f64, seed: u64) -> IsoFlopPoint {
    let budget_flops = 1e12;
    IsoFlopPoint {
        run_id: format!("n{params_nonvocab}-v{params_vocab}-s{seed}"),
        seed,
        budget_flops,
        flops: budget_flops,
        params_nonvocab,
        params_vocab,
        n_vocab: params_vocab / 64.0,
        tokens: budget_flops / (6.0 * (params_nonvocab + params_vocab)),
        metric: Metric::default(),
        loss,
        weight: 1.0,
        about: RunFacts::default(),
    }
}

/// The coefficients of the loss.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub floor: f64,
    pub a1: f64,
    pub alpha1: f64,
    pub a2: f64,
    pub alpha2: f64,
    pub b: f64,
    pub beta: f64,
}

pub const SURFACE: Surface =
    Surface { floor: -6.0, a1: 200.0, alpha1: 0.35, a2: 8.0, alpha2: 0.22, b: 400.0, beta: 0.38 };

impl Surface {
    pub fn loss(&self, nonvocab: f64, vocab: f64, tokens: f64) -> f64 {
        self.floor
            + self.a1 * nonvocab.powf(-self.alpha1)
            + self.a2 * vocab.powf(-self.alpha2)
            + self.b * tokens.powf(-self.beta)
    }

    fn on_budget(&self, ln_nonvocab: f64, ln_vocab: f64, budget: f64) -> f64 {
        let (n, v) = (ln_nonvocab.exp(), ln_vocab.exp());
        self.loss(n, v, budget / (6.0 * (n + v)))
    }

    /// ln N_nv and ln N_v of the budget's optimum, by golden section inside golden section.
    pub fn optimum(&self, budget: f64) -> (f64, f64) {
        let vocab_at = |n: f64| golden(2.0, 35.0, |v| self.on_budget(n, v, budget));
        let n = golden(5.0, 35.0, |n| self.on_budget(n, vocab_at(n), budget));
        (n, vocab_at(n))
    }
}

fn golden(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    for _ in 0..70 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if f(a) < f(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

/// A sweep to simulate.
#[derive(Clone, Copy, Debug)]
pub struct Simulated<'a> {
    pub budgets: &'a [f64],
    /// Sizes of each budget, a factor of 1.8 apart around its optimum.
    pub n_sizes: usize,
    /// ln of the factor by which the middle size misses the optimum.
    pub off_centre: f64,
    pub vocabularies: &'a [f64],
    pub n_seeds: u64,
    /// Standard deviation of the loss.
    pub noise: f64,
    pub seed: u64,
}

/// Five budgets of seven sizes and five vocabularies around their optima, one seed, little noise.
pub const SWEEP: Simulated = Simulated {
    budgets: &[1e15, 3e15, 1e16, 3e16, 1e17],
    n_sizes: 7,
    off_centre: 0.1,
    vocabularies: &[2500.0, 7500.0, 22500.0, 67500.0, 202500.0],
    n_seeds: 1,
    noise: 0.003,
    seed: 2,
};

impl Simulated<'_> {
    pub fn points(&self) -> Vec<IsoFlopPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut points = Vec::new();
        for budget in self.budgets {
            let (optimum, _) = known_optimum(*budget);
            let middle = optimum + self.off_centre;
            for size in 0..self.n_sizes {
                let steps = size as f64 - (self.n_sizes as f64 - 1.0) / 2.0;
                let nonvocab = (middle + steps * 1.8f64.ln()).exp();
                for n_vocab in self.vocabularies {
                    for seed in 0..self.n_seeds {
                        let noise = self.noise * normal(&mut rng);
                        points.push(simulated_point(*budget, nonvocab, *n_vocab, seed, noise));
                    }
                }
            }
        }
        points
    }
}

/// The same runs on a split of `unique_tokens`.
pub fn of_split(unique_tokens: f64, points: Vec<IsoFlopPoint>) -> Vec<IsoFlopPoint> {
    let about = RunFacts { unique_tokens: Some(unique_tokens), ..RunFacts::default() };
    points.into_iter().map(|point| IsoFlopPoint { about: about.clone(), ..point }).collect()
}

/// [`Surface::optimum`] of [`SURFACE`], found once for each budget.
pub fn known_optimum(budget: f64) -> (f64, f64) {
    static KNOWN: Mutex<BTreeMap<u64, (f64, f64)>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().expect("no test panics while it finds an optimum");
    *known.entry(budget.to_bits()).or_insert_with(|| SURFACE.optimum(budget))
}

fn simulated_point(budget: f64, nonvocab: f64, v: f64, seed: u64, noise: f64) -> IsoFlopPoint {
    // Layers grow with width, N_nv = 12 L d² and d = 64 L.
    let width = (nonvocab * 64.0 / 12.0).cbrt();
    let vocab = v * width;
    let tokens = budget / (6.0 * (nonvocab + vocab));
    IsoFlopPoint {
        run_id: format!("c{budget:e}-n{nonvocab:.0}-v{v}-s{seed}"),
        seed,
        budget_flops: budget,
        flops: budget,
        params_nonvocab: nonvocab,
        params_vocab: vocab,
        n_vocab: v,
        tokens,
        metric: Metric::default(),
        loss: SURFACE.loss(nonvocab, vocab, tokens) + noise,
        weight: 1.0,
        about: RunFacts::default(),
    }
}

/// A standard normal by Box and Muller.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let uniform = |rng: &mut ChaCha8Rng| (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let radius = (-2.0 * (1.0 - uniform(rng)).ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform(rng)).cos()
}
