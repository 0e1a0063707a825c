//! Fits to simulated tables with a known law.

use super::form::{Constant, Vector};
use super::objective::{Columns, Curvature, Objective};
use super::*;
use crate::laws::fit::{fit_parametric, parametric_laws};
use crate::laws::input::{Metric, RunFacts};
use crate::laws::maths::stats::Normals;
use proptest::prelude::*;
use rayon::prelude::*;

/// A run of N_nv, N_v and D with the loss of `truth` times or plus `noise`.
pub fn run(truth: &Coefficients, [n, v, d]: [f64; 3], noise: f64) -> IsoFlopPoint {
    let exact = match truth.form {
        Form::Approach3 => truth.loss(&[n + v, d]),
        Form::Approach3Vocab => truth.loss(&[n, v, d]),
    };
    let flops = 6.0 * (n + v) * d;
    IsoFlopPoint {
        run_id: format!("n{n:e}-v{v:e}-d{d:e}"),
        seed: 0,
        budget_flops: flops,
        flops,
        params_nonvocab: n,
        params_vocab: v,
        n_vocab: v,
        tokens: d,
        metric: Metric::default(),
        loss: match truth.form {
            Form::Approach3 => exact * noise.exp(),
            Form::Approach3Vocab => exact + noise,
        },
        weight: 1.0,
        about: RunFacts::default(),
    }
}

/// Chinchilla's law, rounded.
pub fn chinchilla() -> Coefficients {
    Coefficients::new(Form::Approach3, &[1.8, 480.0, 2100.0, 0.35, 0.37]).unwrap()
}

/// A law of the normalised loss with a vocabulary.
pub fn motion() -> Coefficients {
    Coefficients::new(Form::Approach3Vocab, &[6.0, 200.0, 8.0, 400.0, 0.35, 0.22, 0.38]).unwrap()
}

/// Eight budgets of `sizes` models each, a factor of 1.5 apart around sqrt(C/6)/4.
pub fn chinchilla_runs(sizes: usize, noise: f64, stream: u64) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(7, stream);
    let truth = chinchilla();
    let mut runs = Vec::new();
    for budget in [6e18, 1e19, 3e19, 6e19, 1e20, 3e20, 6e20, 1e21f64] {
        for size in 0..sizes {
            let step = size as f64 - (sizes as f64 - 1.0) / 2.0;
            let n = (budget / 6.0).sqrt() / 4.0 * 1.5f64.powf(step);
            runs.push(run(&truth, [n, 0.0, budget / 6.0 / n], noise * normals.draw()));
        }
    }
    runs
}

/// Five budgets of 7 models and 6 vocabularies each.
pub fn motion_runs(noise: f64, stream: u64) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(8, stream);
    let truth = motion();
    let mut runs = Vec::new();
    for budget in [1e15, 3e15, 1e16, 3e16, 1e17f64] {
        let best = optimum(&truth, budget).unwrap();
        for size in -3..=3 {
            for vocab in -3..=2 {
                let n = best.params_nonvocab * 1.8f64.powi(size);
                let v = best.params_vocab * 2.5f64.powi(vocab);
                let d = budget / 6.0 / (n + v);
                runs.push(run(&truth, [n, v, d], noise * normals.draw()));
            }
        }
    }
    runs
}

pub fn without_intervals(form: Form) -> ParametricOptions {
    ParametricOptions { bootstrap: 0, ..ParametricOptions::of(form) }
}

// The objective.

/// Twelve rows of three quantities, for losses around 2.
fn columns(terms: usize, space: Space) -> Columns {
    let x = |k: usize| (0..12).map(|i| ((i * (k + 2) * 7 % 13) as f64 - 6.0) / 3.0).collect();
    let y = (0..12).map(|i| 1.5 + 0.1 * (i % 5) as f64);
    let y = y.map(|y| if space == Space::Log { y.ln() } else { y }).collect();
    Columns::new((0..terms).map(x).collect(), y)
}

fn check(space: Space, constant: Constant, terms: usize, delta: f64, theta: Vector) {
    let columns = columns(terms, space);
    let weights = columns.weights((0..12).map(|i| 0.5 + 0.1 * i as f64).collect());
    let curvature = Curvature::Exact;
    let o = Objective { columns: &columns, weights: &weights, space, constant, delta, curvature };
    let here = o.evaluate(&theta);
    let step = 1e-5;
    for p in 0..=2 * terms {
        let at = |by: f64| {
            let mut moved = theta;
            moved[p] += by;
            o.evaluate(&moved)
        };
        let (above, below) = (at(step), at(-step));
        let slope = (above.value - below.value) / (2.0 * step);
        assert!((here.gradient[p] - slope).abs() < 1e-7 * (1.0 + slope.abs()), "{p}: {slope}");
        for q in 0..=2 * terms {
            let bend = (above.gradient[q] - below.gradient[q]) / (2.0 * step);
            let off = (here.hessian[p][q] - bend).abs();
            assert!(off < 1e-6 * (1.0 + bend.abs()), "{p} {q}: {} {bend}", here.hessian[p][q]);
        }
    }
}

proptest! {
    #[test]
    fn gradient_and_hessian_are_those_of_the_value(
        c in -1.0..0.5f64, e in -0.5..0.5f64, a in 0.1..0.6f64, b in 0.1..0.6f64,
    ) {
        // Least squares: Huber's kinks would spoil the differences.
        let squares = f64::INFINITY;
        let two = [c, -0.3, e, a, b, 0.0, 0.0];
        check(Space::Log, Constant::Positive, 2, squares, two);
        check(Space::Raw, Constant::Positive, 2, squares, two);
        let three = [c, -0.3, -0.8, e, a, b, 0.4];
        check(Space::Raw, Constant::Free, 3, squares, three);
        check(Space::Log, Constant::Positive, 3, squares, three);
    }
}

#[test]
fn hubers_function_is_quadratic_within_delta_and_linear_beyond() {
    let columns = columns(2, Space::Raw);
    let weights = columns.weights(vec![1.0; 12]);
    let (space, constant) = (Space::Raw, Constant::Positive);
    let theta = [-0.5, -0.3, 0.1, 0.3, 0.4, 0.0, 0.0];
    let value = |delta| {
        let curvature = Curvature::Exact;
        let o =
            Objective { columns: &columns, weights: &weights, space, constant, delta, curvature };
        o.evaluate(&theta).value
    };
    let residual = |i: usize| {
        let term = |k: usize| (theta[k] - theta[3 + k] * columns.x[k][i]).exp();
        columns.y[i] - theta[2].exp() - term(0) - term(1)
    };
    for delta in [0.05, 0.3, f64::INFINITY] {
        let huber = |r: f64| match r.abs() <= delta {
            true => 0.5 * r * r,
            false => delta * (r.abs() - 0.5 * delta),
        };
        let plain: f64 = (0..12).map(|i| huber(residual(i))).sum();
        assert!((value(delta) / plain - 1.0).abs() < 1e-13, "{delta}");
    }
}

// Tables that tell little.

fn fit(runs: &[IsoFlopPoint]) -> Result<Parametric, FitError> {
    fit_parametric(
        runs,
        &ParametricOptions { bootstrap: 50, ..ParametricOptions::of(Form::Approach3) },
    )
}

fn not_identified(runs: &[IsoFlopPoint], word: &str) {
    let error = fit(runs).unwrap_err();
    assert!(error.is_unidentifiable(), "{error}");
    assert!(error.to_string().contains(word), "{error}");
}

#[test]
fn tables_that_tell_too_little_are_refused_with_the_reason() {
    let runs = chinchilla_runs(5, 0.01, 0);
    assert_eq!(fit(&[]).unwrap_err(), FitError::NoPoints);
    not_identified(&runs[..5], "5 rows");
    not_identified(&vec![runs[0].clone(); 10], "the same in every row");
    let one_size = |p: &IsoFlopPoint| IsoFlopPoint { params_nonvocab: 1e9, ..p.clone() };
    not_identified(&runs.iter().map(one_size).collect::<Vec<_>>(), "N is the same");
    let two_sizes = |p: &IsoFlopPoint| IsoFlopPoint {
        params_nonvocab: if p.params_nonvocab > 1e9 { 2e9 } else { 1e9 },
        ..p.clone()
    };
    not_identified(&runs.iter().map(two_sizes).collect::<Vec<_>>(), "N has 2 different values");
    let one_diet =
        |p: &IsoFlopPoint| IsoFlopPoint { tokens: 20.0 * p.params_nonvocab, ..p.clone() };
    not_identified(&runs.iter().map(one_diet).collect::<Vec<_>>(), "rise and fall together");
}

#[test]
fn a_value_that_no_law_can_use_names_its_run() {
    type Spoil = fn(&mut IsoFlopPoint);
    let spoils: [(Spoil, &str); 5] = [
        (|p| p.loss = f64::NAN, "loss"),
        (|p| p.loss = -1.0, "loss"),
        (|p| p.tokens = 0.0, "D"),
        (|p| p.params_nonvocab = f64::INFINITY, "N"),
        (|p| p.weight = -1.0, "weight"),
    ];
    for (spoil, field) in spoils {
        let mut runs = chinchilla_runs(5, 0.01, 0);
        spoil(&mut runs[7]);
        let error = fit(&runs).unwrap_err();
        assert!(!error.is_unidentifiable());
        let message = error.to_string();
        assert!(message.contains(&runs[7].run_id) && message.contains(field), "{message}");
    }
}

#[test]
fn a_negative_loss_is_fitted_as_it_is_but_not_in_logarithms() {
    let runs = motion_runs(0.01, 0);
    let options = without_intervals(Form::Approach3Vocab);
    assert!(runs.iter().any(|p| p.loss < 0.0));
    assert!(fit_parametric(&runs, &options).is_ok());
    let log = ParametricOptions { space: Space::Log, ..options };
    assert!(fit_parametric(&runs, &log).unwrap_err().to_string().contains("above 0"));
}

#[test]
fn a_loss_that_does_not_fall_with_a_quantity_says_so() {
    let mut runs = chinchilla_runs(7, 0.0, 0);
    for run in &mut runs {
        run.loss = 2.0 + 300.0 * run.tokens.powf(-0.3);
    }
    let fit = fit(&runs).unwrap();
    assert!(fit.warnings.iter().any(|w| w.contains("of N is not identified")), "{fit:?}");
    let laws = parametric_laws(&runs, fit, "flat", "6nd");
    let doubts = laws.answer().doubts;
    assert!(doubts.iter().any(|doubt| doubt.what.contains("of N is not identified")));
    // No optimum is made of a term that the fit does without.
    assert!(laws.power_laws.tokens.is_none() && laws.answer().exponents.is_undetermined());
    // No loss at all to explain.
    runs.iter_mut().for_each(|run| run.loss = 2.0);
    let flat = fit_parametric(&runs, &without_intervals(Form::Approach3)).unwrap_err();
    assert!(flat.to_string().contains("all 56 losses are 2"), "{flat}");
}

#[test]
fn hubers_delta_must_be_a_positive_number() {
    for huber in [Huber::Delta(0.0), Huber::Delta(f64::NAN), Huber::Mad(-1.0)] {
        let options = ParametricOptions { huber, ..ParametricOptions::of(Form::Approach3) };
        let error = fit_parametric(&chinchilla_runs(5, 0.01, 0), &options).unwrap_err();
        assert!(matches!(error, FitError::BadOption { option: "huber", .. }));
    }
}

#[test]
fn the_fit_does_not_depend_on_the_number_of_threads() {
    let runs = chinchilla_runs(5, 0.01, 0);
    let with = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| fit(&runs).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn rows_that_move_the_optimum_are_named_with_the_optimum_of_the_others() {
    let mut runs = chinchilla_runs(7, 0.003, 3);
    let fitted = |runs: &[IsoFlopPoint]| {
        let options =
            ParametricOptions { influence_at: Some(1e24), ..without_intervals(Form::Approach3) };
        fit_parametric(runs, &ParametricOptions { huber: Huber::None, ..options }).unwrap()
    };
    assert_eq!(fitted(&runs).influence, None);
    for row in [0, 1, 7] {
        runs[row].loss *= 1.25;
    }
    let fit = fitted(&runs);
    let found = fit.influence.as_ref().expect("wrong rows make the optimum hang on a few");
    assert!(found.rows.len() <= 5, "{found:?}");
    let at = |fit: &Parametric| optimum(&fit.coefficients, 1e24).unwrap().params_nonvocab;
    let rest: Vec<IsoFlopPoint> =
        runs.iter().filter(|run| !found.rows.contains(&run.run_id)).cloned().collect();
    let near = |found: f64, wanted: f64| (found / wanted).ln().abs() < 1e-3;
    assert!(near(found.params, at(&fit)) && near(found.params_without, at(&fitted(&rest))));
    assert!((found.params / found.params_without).ln().abs() > 1.2f64.ln(), "{found:?}");
    assert!(fit.warnings.iter().any(|warning| warning.contains(&found.rows[0])));
}

#[test]
fn fewer_rows_than_three_a_coefficient_are_a_warning() {
    let runs: Vec<IsoFlopPoint> = chinchilla_runs(7, 0.003, 3).into_iter().step_by(4).collect();
    let said = |runs: &[IsoFlopPoint]| {
        let fit = fit_parametric(runs, &without_intervals(Form::Approach3)).unwrap();
        fit.warnings.iter().any(|warning| warning.contains("fewer than 3 times the 5"))
    };
    assert!(said(&runs), "{} rows", runs.len());
    assert!(!said(&chinchilla_runs(7, 0.003, 3)));
}

#[test]
fn repeats_of_a_configuration_are_drawn_together_with_or_without_a_seed() {
    let once = chinchilla_runs(15, 0.01, 3);
    let ten = |seed: fn(usize) -> u64| -> Vec<IsoFlopPoint> {
        let copy = |i: usize| {
            once.iter().map(move |p| IsoFlopPoint {
                run_id: format!("{} {i}", p.run_id),
                seed: seed(i),
                ..p.clone()
            })
        };
        (0..10).flat_map(copy).collect()
    };
    let options = ParametricOptions { bootstrap: 200, ..ParametricOptions::of(Form::Approach3) };
    let intervals = |points: &[IsoFlopPoint]| fit_parametric(points, &options).unwrap().ci95;
    let own = intervals(&once);
    for copies in [ten(|_| 0), ten(|i| i as u64)] {
        for (own, copied) in own.iter().zip(intervals(&copies)) {
            let near = |i: usize| (own[i] / copied[i] - 1.0).abs() < 1e-6;
            assert!(near(0) && near(1), "{own:?} {copied:?}");
        }
    }
}

#[test]
fn starts_on_rows_without_noise_all_reach_the_optimum() {
    let found = fit_parametric(
        &chinchilla_runs(15, 0.0, 3),
        &ParametricOptions { bootstrap: 0, ..ParametricOptions::of(Form::Approach3) },
    );
    let found = found.unwrap();
    assert!(found.starts_at_optimum > found.starts / 2, "{found:?}");
    assert!(!found.warnings.iter().any(|s| s.contains("starts")), "{:?}", found.warnings);
}

/// A loss that falls with ln N_nv faster and faster, as no power law does: its exponent tends to zero.
#[test]
fn every_start_and_replicate_ends_at_the_bound_of_an_exponent_that_tends_to_zero() {
    let mut runs = motion_runs(0.01, 0);
    for run in &mut runs {
        let z = run.params_nonvocab.ln() - 12.0;
        run.loss -= 200.0 * run.params_nonvocab.powf(-0.35) + 0.1 * z + 0.01 * z * z;
    }
    let options =
        ParametricOptions { bootstrap: 50, ..ParametricOptions::of(Form::Approach3Vocab) };
    let found = fit_parametric(&runs, &options).unwrap();
    let at_bound = |c: &Coefficients| (c.exponent(0) - 0.02).abs() < 1e-12;
    assert!(at_bound(&found.coefficients) && found.bootstrap.iter().all(at_bound), "{found:?}");
    assert_eq!((found.starts_at_optimum, found.replicates_converged), (16, 50));
}

// Intervals.

const SIMULATIONS: u64 = 500;
const NAMES: [&str; 4] = ["alpha", "beta", "N exponent", "N at ten times C"];

/// The quantities whose intervals are tested.
fn quantities(c: &Coefficients) -> [f64; 4] {
    let (alpha, beta) = (c.exponent(0), c.exponent(1));
    let far = optimum(c, 1e22).map_or(f64::NAN, |o| o.params_nonvocab.ln());
    [alpha, beta, beta / (alpha + beta), far]
}

fn covered(stream: u64) -> [bool; 4] {
    let options = ParametricOptions {
        bootstrap: 400,
        seed: stream,
        ..ParametricOptions::of(Form::Approach3)
    };
    let fit = fit_parametric(&chinchilla_runs(15, 0.01, stream), &options).unwrap();
    let truth = quantities(&chinchilla());
    let replicates: Vec<[f64; 4]> = fit.bootstrap.iter().map(quantities).collect();
    std::array::from_fn(|i| {
        let column: Vec<f64> = replicates.iter().map(|r| r[i]).filter(|x| x.is_finite()).collect();
        let [low, high] = stats::interval95(&column).unwrap();
        low < truth[i] && truth[i] < high
    })
}

#[test]
fn nominal_95_percent_intervals_cover_92_to_98_percent() {
    let all: Vec<[bool; 4]> = (0..SIMULATIONS).into_par_iter().map(covered).collect();
    for (i, name) in NAMES.iter().enumerate() {
        let share = all.iter().filter(|c| c[i]).count() as f64 / SIMULATIONS as f64;
        println!("{name:<18}{share:.3}");
        assert!((0.92..=0.98).contains(&share), "{name}: {share}");
    }
}
