//! Simulated tables whose law is known, and what is asked of a fit to them.

mod coverage;
mod degenerate;
mod derivatives;
mod recovery;

use super::*;
use crate::laws::input::metric::Metric;
use crate::laws::input::point::{IsoFlopPoint, RunFacts};
use crate::laws::maths::random::Normals;
use crate::laws::parametric::form::{Coefficients, Form};
use crate::laws::parametric::options::ParametricOptions;

/// A run of N_nv, N_v and D with the loss of `truth` times or plus `noise`.
fn run(truth: &Coefficients, [n, v, d]: [f64; 3], noise: f64) -> IsoFlopPoint {
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
fn chinchilla() -> Coefficients {
    Coefficients::new(Form::Approach3, &[1.8, 480.0, 2100.0, 0.35, 0.37]).unwrap()
}

/// A law of the normalised loss with a vocabulary.
fn motion() -> Coefficients {
    Coefficients::new(Form::Approach3Vocab, &[6.0, 200.0, 8.0, 400.0, 0.35, 0.22, 0.38]).unwrap()
}

/// Eight budgets of `sizes` models each, a factor of 1.5 apart around sqrt(C/6)/4.
fn chinchilla_runs(sizes: usize, noise: f64, stream: u64) -> Vec<IsoFlopPoint> {
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
fn motion_runs(noise: f64, stream: u64) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(8, stream);
    let truth = motion();
    let mut runs = Vec::new();
    for budget in [1e15, 3e15, 1e16, 3e16, 1e17f64] {
        let best = optimum::optimum(&truth, budget).unwrap();
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

fn without_intervals(form: Form) -> ParametricOptions {
    ParametricOptions { bootstrap: 0, ..ParametricOptions::of(form) }
}
