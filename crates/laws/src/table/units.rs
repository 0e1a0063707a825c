//! Whole tables in several units of the loss: nothing but the loss depends on them.

use std::path::Path;

use super::{TableRequest, load, read};
use crate::laws::{
    DesignGoal, FitOptions, Form, IsoFlopPoint, Laws, Metric, MinimumMethod, OpenRun, Parameters,
    ParametricOptions, Space, fit, fit_parametric, interval95, next_runs, simulated,
};

/// Nats as bits, as bits a byte of 4.2 bytes a token, and in thousandths.
const UNITS: [f64; 3] = [std::f64::consts::LOG2_E, std::f64::consts::LOG2_E / 4.2, 1000.0];
/// Two numbers of as many digits are one.
const FOUR_DIGITS: f64 = 5e-5;

fn assert_alike(what: &str, a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len(), "{what}");
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let apart = (a - b).abs() / a.abs().max(1e-6);
        assert!(apart < FOUR_DIGITS, "{what}, {i}: {a} is not {b}");
    }
}

/// A simulated sweep, and where they are present, two published tables.
fn tables() -> Vec<(&'static str, Parameters, Vec<IsoFlopPoint>)> {
    let shift = |mut point: IsoFlopPoint| {
        point.loss += 9.0;
        point
    };
    let simulated = simulated::SWEEP.points().into_iter().map(shift).collect();
    let mut all = vec![("simulated", Parameters::Split, simulated)];
    let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/runs");
    let path = runs.join("isoflop_collection/isoflops.csv");
    if !path.exists() {
        eprintln!("skipped: {} is absent", path.display());
        return all;
    }
    let table = read(&path).unwrap();
    for source in ["ml_scalefit", "marin_202603"] {
        let request = TableRequest {
            columns: Some("budget_flops=budget".to_string()),
            filters: vec![format!("source == \"{source}\" and not outlier")],
            ..TableRequest::default()
        };
        all.push((source, Parameters::Total, load(&table, &request).unwrap().points));
    }
    all
}

fn in_unit(points: &[IsoFlopPoint], unit: f64) -> Vec<IsoFlopPoint> {
    let metric = Metric::new("loss");
    let one = |p: &IsoFlopPoint| IsoFlopPoint {
        loss: unit * p.loss,
        metric: metric.clone(),
        ..p.clone()
    };
    points.iter().map(one).collect()
}

fn laws(points: &[IsoFlopPoint], parameters: Parameters) -> Laws {
    let methods = vec![MinimumMethod::Parabola];
    fit(points, &FitOptions { parameters, methods, bootstrap: 60, ..FitOptions::default() })
        .unwrap()
}

/// Every number of the answer, the advice and the joint law, with the loss in units of `unit`.
fn numbers(laws: &Laws, unit: f64) -> Vec<(String, Vec<f64>)> {
    let answer = laws.answer();
    let mut all: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, own) in answer.exponents.named() {
        let interval = own.ci95.into_iter().flatten();
        all.push((format!("exponent of {name}"), own.value.into_iter().chain(interval).collect()));
    }
    for at in &answer.path {
        let loss = at
            .loss
            .iter()
            .flat_map(|loss| [loss.value].into_iter().chain(loss.ci95.into_iter().flatten()));
        all.push(("loss".into(), loss.map(|loss| loss / unit).collect()));
        for (name, own) in at.at.named() {
            let interval = own.ci95.into_iter().flatten();
            all.push((
                format!("{name} at the optimum"),
                [own.value].into_iter().chain(interval).collect(),
            ));
        }
    }
    for advice in &laws.advice {
        let sizes = [&advice.params_nonvocab[..], &advice.n_vocab, &[advice.runs as f64]].concat();
        all.push((format!("{:?} at {:e}", advice.kind, advice.budget_flops), sizes));
    }
    let joint = laws.judgement.joint.as_ref().unwrap();
    for (i, name) in joint.loss.terms.names().iter().enumerate() {
        let own = |values: &Vec<f64>| match *name {
            "e0" | "e1" => values[i] / unit,
            "ln A" | "ln B" => values[i] - unit.ln(),
            _ => values[i],
        };
        let interval = interval95(joint.bootstrap.iter().map(own)).unwrap();
        all.push((
            format!("{name} of the joint law"),
            [&[own(&joint.loss.values)][..], &interval].concat(),
        ));
    }
    all
}

#[test]
fn laws_intervals_and_what_to_run_next_do_not_depend_on_the_unit_of_the_loss() {
    for (name, parameters, points) in tables() {
        let own = laws(&in_unit(&points, 1.0), parameters);
        for unit in UNITS {
            let other = laws(&in_unit(&points, unit), parameters);
            let whys = [&own, &other].map(|laws| laws.judgement.recommended.as_ref().unwrap().law);
            assert_eq!(whys[0], whys[1], "{name}, {unit}");
            let pairs = numbers(&own, 1.0).into_iter().zip(numbers(&other, unit));
            for ((what, a), (of, b)) in pairs {
                assert_eq!(what, of, "{name}, {unit}");
                assert_alike(&format!("{name}, {unit}: {what}"), &a, &b);
            }
        }
    }
}

#[test]
fn a_round_chooses_the_same_runs_in_any_unit_of_the_loss() {
    for (name, _, points) in tables() {
        let odd = |odd: usize| points.iter().skip(odd).step_by(2);
        let open: Vec<OpenRun> = odd(1).map(OpenRun::of).collect();
        let largest = points.iter().map(|point| point.budget_flops).fold(0.0, f64::max);
        let goal = DesignGoal { budget_flops: 10.0 * largest, spend_flops: 20.0 * largest };
        let trained: Vec<IsoFlopPoint> = odd(0).cloned().collect();
        let of = |unit: f64| next_runs(&in_unit(&trained, unit), &open, goal);
        let own = of(1.0);
        assert!(!own.is_empty(), "{name}");
        UNITS.iter().for_each(|unit| assert_eq!(of(*unit), own, "{name}, {unit}"));
    }
}

#[test]
fn approach3_is_the_same_law_in_any_unit_of_the_loss() {
    for (name, _, points) in tables() {
        for space in [Space::Log, Space::Raw] {
            let of = |unit: f64| {
                let options = ParametricOptions {
                    space,
                    bootstrap: 60,
                    ..ParametricOptions::of(Form::Approach3)
                };
                let law = fit_parametric(&in_unit(&points, unit), &options).unwrap();
                let scales = [unit, unit, unit, 1.0, 1.0];
                let ends = |end: usize| {
                    law.ci95.iter().zip(scales).map(move |(ci, scale)| ci[end] / scale)
                };
                let own = law
                    .coefficients
                    .values()
                    .iter()
                    .zip(scales)
                    .map(|(value, scale)| value / scale);
                own.chain(ends(0)).chain(ends(1)).collect::<Vec<f64>>()
            };
            let own = of(1.0);
            UNITS.iter().for_each(|unit| {
                assert_alike(&format!("{name}, {unit}, {space:?}"), &own, &of(*unit));
            });
        }
    }
}
