use super::*;
use crate::laws::fit::parametric_laws::fit_parametric;
use crate::laws::parametric::form::{Coefficients, Form};
use crate::laws::parametric::options::ParametricOptions;
use rayon::prelude::*;

const SIMULATIONS: u64 = 500;
const NAMES: [&str; 4] = ["alpha", "beta", "N exponent", "N at ten times C"];

/// The quantities whose intervals are tested.
fn quantities(c: &Coefficients) -> [f64; 4] {
    let (alpha, beta) = (c.exponent(0), c.exponent(1));
    let far = optimum::optimum(c, 1e22).map_or(f64::NAN, |o| o.params_nonvocab.ln());
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
        let [low, high] = crate::laws::maths::stats::interval95(&column).unwrap();
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
