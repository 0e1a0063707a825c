//! Joint laws of simulated cells, whose truth is known.

use super::*;
use crate::laws::input::{IsoFlopPoint, Parameters, RunFacts, group_checked};
use crate::laws::maths::stats::interval95;
use crate::laws::minima::NoiseSource;
use crate::laws::simulated::{of_split, point};

const BUDGETS: [f64; 4] = [1e10, 3e10, 1e11, 3e11];
const WIDTHS: [f64; 7] = [8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0];
const VOCABULARIES: [f64; 6] = [32.0, 128.0, 256.0, 512.0, 1024.0, 4096.0];

/// A loss of the fitted form, near what is measured on procedural motion.
fn truth(n: f64, v: f64, d: f64) -> f64 {
    let (v, kappa) = (v.ln(), 0.15);
    18.0 * (-0.05 * v).exp() - 20.0
        + 20.0 * (kappa * v).exp() * n.powf(-0.5)
        + 60.0 * (0.5 * v).exp() * d.powf(-0.5)
}

fn points(noise: f64, stream: u64) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(5, stream);
    let mut points = Vec::new();
    for budget in BUDGETS {
        for width in WIDTHS {
            for vocab in VOCABULARIES {
                let (n, nv) = (24.0 * width * width, vocab * width);
                // Attention over 83 positions in two layers.
                let tokens = budget / (6.0 * (n + nv) + 996.0 * width);
                points.push(IsoFlopPoint {
                    budget_flops: budget,
                    flops: budget,
                    n_vocab: vocab,
                    tokens,
                    loss: truth(n, vocab, tokens) + noise * normals.draw(),
                    ..point(n, nv, 0.0, 0)
                });
            }
        }
    }
    points
}

fn grids(points: &[IsoFlopPoint]) -> Vec<Grid> {
    let total = points[0].params_vocab == 0.0;
    let parameters = if total { Parameters::Total } else { Parameters::Split };
    group_checked(points, parameters).unwrap().iter().filter_map(Grid::new).collect()
}

fn noise(sd: f64) -> Option<RunNoise> {
    Some(RunNoise { sd, dof: 100, source: NoiseSource::Seeds })
}

/// The true optimum by a fine search.
fn best(budget: f64) -> (f64, f64, f64) {
    let mut least = (f64::INFINITY, 0.0, 0.0);
    for i in 0..400 {
        for j in 0..300 {
            let width = 4.0 * 1.012f64.powi(i);
            let vocab = 16.0 * 1.03f64.powi(j);
            let n = 24.0 * width * width;
            let tokens = budget / (6.0 * (n + vocab * width) + 996.0 * width);
            let loss = truth(n, vocab, tokens);
            if loss < least.0 {
                least = (loss, n, vocab);
            }
        }
    }
    least
}

#[test]
fn the_slopes_are_the_derivatives_of_the_loss() {
    let repeated = of_split(1e5, points(0.02, 0));
    let law = fit_joint(&grids(&repeated), noise(0.02), true).unwrap().loss;
    assert_eq!(law.values.len(), law.terms.names().len());
    let cells = grids(&repeated);
    for cell in cells.iter().flat_map(|grid| &grid.cells).step_by(17) {
        let place = Place::of(cell);
        for (i, slope) in law.gradient(&place).into_iter().enumerate() {
            let moved = |step: f64| {
                let mut moved = law.clone();
                moved.values[i] += step;
                moved.value(&place)
            };
            let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((slope - numeric).abs() < 1e-5 * (1.0 + slope.abs()), "{i}: {slope} {numeric}");
        }
    }
}

#[test]
fn an_optimum_far_beyond_the_cells_is_predicted() {
    let law = fit_joint(&grids(&points(0.01, 1)), noise(0.01), false).unwrap();
    assert!((law.residual_sd / 0.01 - 1.0).abs() < 0.35, "{}", law.residual_sd);
    for (factor, nats, ratio) in [(1.0, 0.01, 1.2), (10.0, 0.06, 1.6), (100.0, 0.15, 2.5)] {
        let budget = 3e11 * factor;
        let (loss, n, vocab) = best(budget);
        let found = law.optimum(budget).unwrap();
        assert!((found.loss - loss).abs() < nats, "{factor}: {found:?}, {loss}");
        let near = |a: f64, b: f64| (a / b).ln().abs() < f64::ln(ratio);
        assert!(
            near(found.params_nonvocab, n) && near(found.n_vocab.unwrap(), vocab),
            "{found:?} {n} {vocab}"
        );
        let spent = 6.0 * (found.params_nonvocab + found.params_vocab) * found.tokens
            + 996.0 * (found.params_nonvocab / 24.0).sqrt() * found.tokens;
        assert!((spent / budget - 1.0).abs() < 1e-6, "{spent}");
    }
}

#[test]
fn intervals_of_replicates_hold_the_truth() {
    let mut held = 0;
    let budget = 1e12;
    let (loss, ..) = best(budget);
    for stream in 0..20 {
        let grids = grids(&points(0.02, 100 + stream));
        let mut law = fit_joint(&grids, noise(0.02), false).unwrap();
        let scatter = Scatter { noise: None, tokenizers: None, test: None };
        law.bootstrap = replicates(&law, &grids, (scatter, stream), 60);
        let losses: Vec<f64> = law.optima(budget).iter().map(|best| best.loss).collect();
        let [low, high] = interval95(&losses).unwrap();
        held += usize::from(low <= loss && loss <= high);
    }
    assert!(held >= 17, "{held} of 20");
}

#[test]
fn a_file_with_other_coefficients_than_its_terms_is_refused() {
    let law = fit_joint(&grids(&points(0.02, 3)), noise(0.02), false).unwrap();
    let mut file = serde_json::to_value(&law).unwrap();
    assert_eq!(serde_json::from_value::<JointLaw>(file.clone()).unwrap(), law);
    file["loss"]["values"].as_array_mut().unwrap().pop();
    let told = serde_json::from_value::<JointLaw>(file).unwrap_err().to_string();
    assert!(told.contains("9 coefficients") && told.contains("ask for 10"), "{told}");
}

#[test]
fn what_repetition_is_worth_stays_as_expected_where_no_run_repeats() {
    let grids = grids(&of_split(1e12, points(0.02, 3)));
    assert!(!repeat(&grids));
    let law = fit_joint(&grids, noise(0.02), true).unwrap().loss;
    let [ln_r, rho] = law.values[law.terms.ln_r()..] else { panic!("{:?}", law.values) };
    assert!((ln_r - 2.7).abs() < 1e-6 && rho.abs() < 1e-6, "{:?}", law.values);
}

/// The points on a split of `unique` tokens, a share of the data, whose repetition is worth R (n/10⁴)^−ρ.
fn repeated(unique: f64, share: f64, [r, rho]: [f64; 2]) -> Vec<IsoFlopPoint> {
    let plain = points(0.0, 0).into_iter().zip(points(0.01, 7 + (8.0 * share) as u64));
    let of_share = plain.map(|(exact, noisy)| {
        let (n, v, d) = (exact.params_nonvocab, exact.n_vocab, exact.tokens);
        let r = r * (n / 1e4).powf(-rho);
        let fresh = (unique * share).min(d);
        let worth = fresh * (1.0 - r * (-(d / fresh - 1.0) / r).exp_m1());
        let loss = truth(n, v, worth) + noisy.loss - exact.loss;
        let about =
            RunFacts { share: Some(share), unique_tokens: Some(unique * share), ..exact.about };
        IsoFlopPoint { loss, about, ..exact }
    });
    of_share.collect()
}

#[test]
fn shares_of_the_data_tell_what_repetition_is_worth() {
    const TRUE: [f64; 2] = [8.0, 0.6];
    let shares = |shares: &[f64]| -> Vec<IsoFlopPoint> {
        shares.iter().flat_map(|share| repeated(2e5, *share, TRUE)).collect()
    };
    let off = |points: &[IsoFlopPoint]| {
        let law = fit_joint(&grids(points), noise(0.01), true).unwrap();
        let Repetition { r, rho, params_nonvocab, .. } = law.repetition().unwrap();
        let at = TRUE[0] * (params_nonvocab / 1e4).powf(-TRUE[1]);
        [(r / at).ln().abs(), (rho - TRUE[1]).abs()]
    };
    let (one, three) = (off(&shares(&[1.0])), off(&shares(&[0.25, 0.5, 1.0])));
    assert!(three[0] < 0.2 && three[1] < 0.1, "{three:?}");
    assert!(one[0] > three[0] && one[1] > three[1], "{one:?} {three:?}");
}

#[test]
fn curves_are_those_of_the_largest_share() {
    let [all, half] = [1.0, 0.5].map(|share| repeated(1e5, share, [8.0, 0.0]));
    let both = grids(&[half.clone(), all.clone()].concat());
    let plain = |grids: &[Grid]| grids.iter().map(|grid| grid.cells.clone()).collect::<Vec<_>>();
    assert_eq!(plain(&both), plain(&grids(&all)));
    assert_eq!(both[0].smaller, [grids(&half)[0].cells.clone()]);
    let joint = |grids: &[Grid]| fit_joint(grids, noise(0.01), true).unwrap().n;
    assert_eq!(joint(&both), 2 * joint(&grids(&all)));
}

#[test]
fn the_limit_falls_less_and_less_with_the_vocabulary() {
    let law = fit_joint(&grids(&points(0.0, 4)), noise(1e-3), false).unwrap().loss;
    let kappa_e = law.values[law.terms.kappa_e()];
    assert!((kappa_e / 0.05 - 1.0).abs() < 0.2, "{kappa_e}");
    let far = |vocab: f64| law.at(1e12, vocab, 1e15);
    let steps = [64.0, 256.0, 1024.0, 4096.0].map(|vocab| far(vocab) - far(4.0 * vocab));
    assert!(steps.is_sorted_by(|a, b| a > b) && steps[3] > 0.0, "{steps:?}");
}

#[test]
fn without_a_vocabulary_it_is_the_law_of_hoffmann() {
    let total: Vec<IsoFlopPoint> = points(0.0, 2)
        .into_iter()
        .filter(|point| point.n_vocab == 256.0)
        .map(|point| {
            let tokens = point.budget_flops / 6.0 / point.params_nonvocab;
            let loss = 2.0 + 30.0 * point.params_nonvocab.powf(-0.4) + 50.0 * tokens.powf(-0.35);
            IsoFlopPoint { params_vocab: 0.0, n_vocab: 0.0, tokens, loss, ..point }
        })
        .collect();
    let law = fit_joint(&grids(&total), noise(1e-4), false).unwrap();
    assert!(!law.loss.terms.vocab);
    assert!((law.loss.values[2] - 0.4).abs() < 0.01 && (law.loss.values[4] - 0.35).abs() < 0.01);
    assert!((law.loss.values[0] - 2.0).abs() < 0.02, "{:?}", law.loss.values);
}
