//! Do intervals of nominally 95 % hold the truth in 95 % of sweeps? `docs/coverage.md` explains the
//! table that this prints.

use super::*;
use crate::laws::simulated::{SURFACE, Simulated, known_optimum};
use rayon::prelude::*;

const BUDGETS: [f64; 5] = [1e15, 3e15, 1e16, 3e16, 1e17];
/// Around the true optima, which grow from 7600 to 51000.
const VOCABULARIES: [f64; 5] = [2500.0, 7500.0, 22500.0, 67500.0, 202500.0];
const SWEEPS: u64 = 1000;
const REPLICATES: usize = 200;
const NAMES: [&str; 4] = ["N_nv", "N_v", "D", "L_u per decade"];
/// Shares of sweeps that count as 95 %.
const NOMINAL: std::ops::RangeInclusive<f64> = 0.92..=0.98;
/// Where the runs are so precise that parabolas misfit the surface, the misfit is in the intervals: it
/// counts as noise, but is alike at all budgets, and moves exponents less than noise would.
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

/// What the true optima of these budgets have.
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
    /// Of what the estimator gives from the same grid without noise.
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
