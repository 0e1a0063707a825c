//! Exponents of one sweep by every way that is compared.

use isoflop_laws::laws::{
    FitOptions, Form, HoldOut, IsoFlopPoint, MinimumMethod, Parameters, ParametricOptions, fit,
    fit_parametric, least_squares, optimum,
};

use crate::sweeps::{ASKED, BUDGETS, Sweep};

pub const WAYS: &str =
    "parabola, all sizes | parabola | cubic | Akima | best run | joint | approach 3";

/// An exponent, and ln N at the budget that is asked for.
type Told = (f64, f64);

/// What an exponent, and ln N at the budget that is asked for, are off by.
#[derive(Clone, Copy)]
pub struct Off {
    pub exponent: f64,
    pub ln_asked: f64,
}

/// Errors of each way on one sweep, in the order of [`WAYS`]; `None` if it tells no law.
pub fn errors(sweep: Sweep, noise: f64, seed: u64) -> [Option<Off>; 7] {
    let points = sweep.points(noise, seed);
    let off = |(exponent, ln_asked): (f64, f64)| Off {
        exponent: exponent - sweep.truth.exponent(),
        ln_asked: ln_asked - sweep.truth.ln_optimum(ASKED),
    };
    let curve = |method| through_minima(&points, method);
    let (parabola, joint) = curve(MinimumMethod::Parabola);
    let others = [MinimumMethod::Cubic, MinimumMethod::Akima, MinimumMethod::Argmin];
    let [cubic, akima, argmin] = others.map(|method| curve(method).0);
    [through_all(&points), parabola, cubic, akima, argmin, joint, approach3(&points)]
        .map(|told| told.map(off))
}

/// The usual approach 2: a parabola in ln N through every size, minima outside the sizes left out.
fn through_all(points: &[IsoFlopPoint]) -> Option<Told> {
    let minimum = |of: &[IsoFlopPoint]| {
        let ln: Vec<f64> = of.iter().map(|p| p.params_nonvocab.ln()).collect();
        let (low, high) = (ln[0], ln[ln.len() - 1]);
        let unit = |x: f64| 2.0 * (x - low) / (high - low) - 1.0;
        let rows: Vec<_> = ln.iter().map(|x| vec![1.0, unit(*x), unit(*x).powi(2)]).collect();
        let c = least_squares(&rows, &of.iter().map(|p| p.loss).collect::<Vec<_>>())?.coefficients;
        let z = -c[1] / (2.0 * c[2]);
        let inside = c[2] > 0.0 && z.abs() < 1.0;
        inside.then_some((of[0].budget_flops.ln(), low + 0.5 * (z + 1.0) * (high - low)))
    };
    let budgets = points.chunk_by(|a, b| a.budget_flops == b.budget_flops);
    let (x, y): (Vec<f64>, Vec<f64>) = budgets.filter_map(minimum).unzip();
    let rows: Vec<_> = x.iter().map(|x| vec![1.0, *x]).collect();
    let line = least_squares(&rows, &y).filter(|_| x.len() >= 3)?.coefficients;
    Some((line[1], line[0] + line[1] * ASKED.ln()))
}

/// The power law through the minima of a kind, and the joint law.
fn through_minima(points: &[IsoFlopPoint], method: MinimumMethod) -> (Option<Told>, Option<Told>) {
    let options = FitOptions {
        parameters: Parameters::Total,
        methods: vec![method],
        law_method: Some(method),
        hold_out: HoldOut::None,
        bootstrap: 0,
        recommend: method == MinimumMethod::Parabola,
        ..FitOptions::default()
    };
    let Ok(laws) = fit(points, &options) else { return (None, None) };
    let law = laws.power_laws.params.as_ref();
    let joint = laws.judgement.joint.as_ref();
    let ln_size = |budget| Some(joint?.optimum(budget)?.params_nonvocab.ln());
    let of_joint = || {
        let (low, high) = (ln_size(BUDGETS[0])?, ln_size(BUDGETS[5])?);
        Some(((high - low) / (BUDGETS[5] / BUDGETS[0]).ln(), ln_size(ASKED)?))
    };
    (law.map(|law| (law.exponent, law.value_at(ASKED).ln())), of_joint())
}

fn approach3(points: &[IsoFlopPoint]) -> Option<Told> {
    let options = ParametricOptions { bootstrap: 0, ..ParametricOptions::of(Form::Approach3) };
    let law = fit_parametric(points, &options).ok()?.coefficients;
    let at = |budget| Some(optimum(&law, budget)?.params_nonvocab.ln());
    let exponent = (at(BUDGETS[5])? - at(BUDGETS[0])?) / (BUDGETS[5] / BUDGETS[0]).ln();
    Some((exponent, at(ASKED)?))
}
