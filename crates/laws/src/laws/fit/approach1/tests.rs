use super::*;
use crate::laws::fit::approach1::frontier::frontier;
use crate::laws::simulated::point;

/// Training curves of five sizes, whose envelope is N = C^½ and L = 2 + C^−0.1.
fn curves() -> Vec<IsoFlopPoint> {
    let mut runs = Vec::new();
    for size in 0..12 {
        let n = 1e6 * 2f64.powi(size);
        for step in 0..40 {
            let c = 1e12 * 1.5f64.powi(step);
            let off = (n / c.sqrt()).ln();
            let loss = 2.0 + c.powf(-0.1) * (1.0 + 0.2 * off * off);
            runs.push(IsoFlopPoint {
                budget_flops: c,
                flops: c,
                params_vocab: 0.0,
                n_vocab: 0.0,
                tokens: c / 6.0 / n,
                ..point(n, 1.0, loss, 0)
            });
        }
    }
    runs
}

fn options() -> FitOptions {
    FitOptions {
        name: "curves".into(),
        flops_rule: "6nd".into(),
        parameters: Parameters::Total,
        bootstrap: 60,
        ..FitOptions::default()
    }
}

#[test]
fn the_envelope_of_training_curves_is_recovered() {
    let inside = |p: &IsoFlopPoint| (4e12..4e18).contains(&p.flops);
    let runs: Vec<IsoFlopPoint> = curves().into_iter().filter(inside).collect();
    let laws = approach1(&runs, &options()).unwrap();
    let size = laws.power_laws.params.unwrap();
    assert!((size.exponent - 0.5).abs() < 0.02, "{size:?}");
    let [low, high] = size.exponent_ci95.unwrap();
    assert!(low <= size.exponent && size.exponent <= high, "{low} {high}");
    assert!((laws.power_laws.tokens.unwrap().exponent - 0.5).abs() < 0.02);
}

#[test]
fn the_frontier_falls_and_holds_the_lowest_loss_up_to_each_compute() {
    let runs = curves();
    for interpolate in [false, true] {
        let front = frontier(&runs, interpolate);
        assert!(front.is_sorted_by(|a, b| a.flops <= b.flops && a.loss > b.loss));
        for run in &runs {
            let seen = front.iter().filter(|p| p.flops <= run.flops);
            let least = seen.map(|p| p.loss).fold(f64::INFINITY, f64::min);
            assert!(least <= run.loss);
        }
    }
    assert!(frontier(&runs, true).len() > frontier(&runs, false).len());
}

#[test]
fn a_frontier_of_one_size_is_refused_with_the_reason() {
    let error = approach1(&curves()[..20], &options()).err().unwrap();
    assert!(error.is_unidentifiable());
    assert!(error.to_string().contains("1 size(s)"), "{error}");
    assert_eq!(approach1(&[], &options()).unwrap_err(), FitError::NoPoints);
}
