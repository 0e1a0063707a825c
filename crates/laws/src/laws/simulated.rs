//! Simulated sweeps with known laws, for tests.
//!
//! L(N_nv, N_v, D) = −E + A1/N_nv^α1 + A2/N_v^α2 + B/D^β with C = 6(N_nv + N_v)D: the form of
//! approach 3 with a vocabulary. The true optimum of a budget is found by minimising it directly.

use crate::laws::input::{IsoFlopPoint, Metric, RunFacts};
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

/// The same runs with `unique_tokens` distinct tokens.
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

/// Do intervals of nominally 95 % hold the truth in 95 % of sweeps? `docs/coverage.md` explains the table that
/// this prints.
mod coverage {
    use super::*;
    use crate::laws::{FitOptions, HoldOut, Laws, MinimumMethod, fit, log_law, power_law};
    use rayon::prelude::*;

    const BUDGETS: [f64; 5] = [1e15, 3e15, 1e16, 3e16, 1e17];
    /// Around the true optima, which grow from 7600 to 51000.
    const VOCABULARIES: [f64; 5] = [2500.0, 7500.0, 22500.0, 67500.0, 202500.0];
    const SWEEPS: u64 = 1000;
    const REPLICATES: usize = 200;
    const NAMES: [&str; 4] = ["N_nv", "N_v", "D", "L_u per decade"];
    /// Shares of sweeps that count as 95 %.
    const NOMINAL: std::ops::RangeInclusive<f64> = 0.92..=0.98;
    /// If the runs are so precise that parabolas misfit the surface, the intervals include the misfit: it counts as noise,
    /// but is similar at all budgets, and moves exponents less than noise would.
    const MISFITTING: std::ops::RangeInclusive<f64> = 0.92..=1.0;
    /// From this noise down, in nats.
    const PRECISE: f64 = 0.005;
    /// A bias of this many standard deviations alone takes the coverage of an exact 95 % interval down
    /// to 92 %, so beyond it no interval that holds noise alone can cover the truth.
    const SMALL_BIAS: f64 = 0.5;

    /// The exponents of N_nv, N_v and D and the slope of the loss.
    type Quantities = [f64; 4];

    fn sweep(n_seeds: u64, noise: f64, seed: u64) -> Laws {
        let sweep = Simulated {
            budgets: &BUDGETS,
            n_sizes: 7,
            off_centre: 0.1,
            vocabularies: &VOCABULARIES,
            n_seeds,
            noise,
            seed,
        };
        let options = FitOptions {
            methods: vec![MinimumMethod::Parabola],
            law_method: Some(MinimumMethod::Parabola),
            bootstrap: if noise > 0.0 { REPLICATES } else { 0 },
            hold_out: HoldOut::None,
            seed,
            recommend: false,
            ..FitOptions::default()
        };
        fit(&sweep.points(), &options).unwrap()
    }

    /// The exponents of the true optima.
    fn truth(budgets: &[f64]) -> Quantities {
        let optima: Vec<(f64, f64)> = budgets.iter().map(|c| known_optimum(*c)).collect();
        let sizes: Vec<f64> = optima.iter().map(|(n, _)| n.exp()).collect();
        let vocab: Vec<f64> = optima.iter().map(|(_, v)| v.exp()).collect();
        let both = || budgets.iter().zip(sizes.iter().zip(&vocab));
        let tokens: Vec<f64> = both().map(|(c, (n, v))| c / (6.0 * (n + v))).collect();
        let losses: Vec<f64> =
            both().zip(&tokens).map(|((_, (n, v)), d)| SURFACE.loss(*n, *v, *d)).collect();
        let weights = vec![1.0; budgets.len()];
        let exponent = |y: &[f64]| power_law(budgets, y, 1e16, &weights, None).unwrap().exponent;
        let slope = log_law(budgets, &losses).unwrap().slope_per_decade;
        [exponent(&sizes), exponent(&vocab), exponent(&tokens), slope]
    }

    fn estimates(laws: &Laws) -> Quantities {
        let of = &laws.power_laws;
        let [n, v, d] = [&of.params_nonvocab, &of.params_vocab, &of.tokens]
            .map(|law| law.as_ref().unwrap().exponent);
        [n, v, d, laws.loss.log.as_ref().unwrap().slope_per_decade]
    }

    fn intervals(laws: &Laws) -> [[f64; 2]; 4] {
        let of = &laws.power_laws;
        let [n, v, d] = [&of.params_nonvocab, &of.params_vocab, &of.tokens]
            .map(|law| law.as_ref().unwrap().exponent_ci95.unwrap());
        [n, v, d, laws.loss.log.as_ref().unwrap().slope_ci95.unwrap()]
    }

    /// One line of the table.
    struct Coverage {
        of_truth: f64,
        /// Coverage of the estimate from the same grid without noise.
        of_noiseless: f64,
        /// The noiseless value less the truth, in standard deviations of the estimate.
        bias: f64,
        /// Mean width of the intervals over that of 2 · 1.96 standard deviations of the estimate.
        width: f64,
    }

    fn coverage(quantity: usize, sweeps: &[Laws], noiseless: &Quantities) -> Coverage {
        let n = sweeps.len() as f64;
        let mean = |of: &dyn Fn(&Laws) -> f64| sweeps.iter().map(of).sum::<f64>() / n;
        let interval = |laws: &Laws| intervals(laws)[quantity];
        let holds = |laws: &Laws, value: f64| {
            let [low, high] = interval(laws);
            f64::from(u8::from(low <= value && value <= high))
        };
        let truth_of = |laws: &Laws| truth(&laws.fitted_budgets)[quantity];
        let centre = mean(&|laws| estimates(laws)[quantity]);
        let sd = mean(&|laws| (estimates(laws)[quantity] - centre).powi(2)).sqrt();
        Coverage {
            of_truth: mean(&|laws| holds(laws, truth_of(laws))),
            of_noiseless: mean(&|laws| holds(laws, noiseless[quantity])),
            bias: (noiseless[quantity] - truth(&BUDGETS)[quantity]) / sd,
            width: mean(&|laws| interval(laws)[1] - interval(laws)[0]) / (2.0 * 1.96 * sd),
        }
    }

    #[test]
    fn intervals_of_95_percent_hold_the_truth_in_95_percent_of_simulated_sweeps() {
        let noiseless = estimates(&sweep(1, 0.0, 0));
        let mut wrong = Vec::new();
        println!("| seeds | noise | quantity | truth held | noiseless held | bias/sd | width |");
        println!("| --- | --- | --- | --- | --- | --- | --- |");
        for (n_seeds, noise) in [(1, 0.003), (3, 0.003), (1, 0.01), (3, 0.01)] {
            let sweeps: Vec<Laws> =
                (1..=SWEEPS).into_par_iter().map(|seed| sweep(n_seeds, noise, seed)).collect();
            for (quantity, name) in NAMES.iter().enumerate() {
                let c = coverage(quantity, &sweeps, &noiseless);
                println!(
                    "| {n_seeds} | {noise} | {name} | {:.3} | {:.3} | {:+.2} | {:.2} |",
                    c.of_truth, c.of_noiseless, c.bias, c.width
                );
                let is_biased = c.bias.abs() > SMALL_BIAS;
                let held = if is_biased { c.of_noiseless } else { c.of_truth };
                let asked = if noise < PRECISE { MISFITTING } else { NOMINAL };
                if !asked.contains(&held) {
                    wrong.push(format!("{n_seeds} seeds, noise {noise}, {name}: {held}"));
                }
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
}
