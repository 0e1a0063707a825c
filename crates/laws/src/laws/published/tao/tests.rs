use super::runs::{self, run};
use super::*;
use crate::laws::input::point::IsoFlopPoint;

fn laws(interpolation: Interpolation, criterion: Criterion) -> Option<FrontierLaws> {
    let frontier = frontier(&runs::published()?, interpolation).unwrap();
    Some(frontier_laws(&frontier, criterion).unwrap())
}

fn near(found: f64, expected: f64, within: f64) {
    assert!((found - expected).abs() <= within, "{found}, expected {expected}");
}

#[test]
fn the_published_frontier_has_125_points_and_its_huber_laws() {
    let Some(laws) = laws(Interpolation::Published, Criterion::Huber) else { return };
    assert_eq!(laws.n, 125);
    near(laws.ln_nonvocab, -2.48382464, 5e-9);
    near(laws.exponent_vocab, 0.43558986, 5e-9);
    near(laws.ln_vocab, -2.41118707, 1e-8);
    near(laws.objective_vocab, 0.040156247614, 5e-13);
}

#[test]
fn the_published_frontier_gives_its_least_squares_laws() {
    let Some(laws) = laws(Interpolation::Published, Criterion::LeastSquares) else { return };
    near(laws.ln_nonvocab, -2.41138, 5e-6);
    near(laws.exponent_vocab, 0.41696372, 5e-9);
    near(laws.ln_vocab, -1.57950066, 5e-9);
}

#[test]
fn the_runs_alone_leave_111_points_and_their_laws() {
    let Some(huber) = laws(Interpolation::None, Criterion::Huber) else { return };
    let Some(squares) = laws(Interpolation::None, Criterion::LeastSquares) else { return };
    assert_eq!(huber.n, 111);
    near(huber.ln_nonvocab, -2.46449322, 5e-9);
    near(huber.exponent_vocab, 0.44861097, 5e-9);
    near(squares.exponent_vocab, 0.43649834, 5e-9);
}

#[test]
fn settled_gradients_give_another_frontier() {
    // scipy with tol=1e-16, maxiter=4000.
    let Some(huber) = laws(Interpolation::Converged, Criterion::Huber) else { return };
    let Some(squares) = laws(Interpolation::Converged, Criterion::LeastSquares) else { return };
    assert_eq!(huber.n, 122);
    // An even number of points: any K in a stretch is as good, and its middle is the median.
    near(huber.ln_nonvocab, -2.4757264963, 5e-8);
    near(huber.exponent_vocab, 0.43070524, 5e-8);
    near(squares.exponent_vocab, 0.40595965, 5e-8);
}

#[test]
fn the_order_of_the_rows_does_not_matter() {
    let Some(mut runs) = runs::published() else { return };
    let before = frontier(&runs, Interpolation::Published).unwrap();
    runs.reverse();
    assert_eq!(frontier(&runs, Interpolation::Published).unwrap(), before);
}

#[test]
fn the_frontier_falls_with_compute() {
    let Some(runs) = runs::published() else { return };
    let frontier = frontier(&runs, Interpolation::Published).unwrap();
    assert!(frontier.windows(2).all(|p| p[0].flops < p[1].flops));
    assert!(frontier.windows(2).all(|p| p[0].loss_normalised > p[1].loss_normalised));
}

/// Two models, three vocabularies, two checkpoints.
fn small() -> Vec<IsoFlopPoint> {
    let cell = |n: f64, v: f64| [1.0, 2.0].map(|k| run(n, v, 512.0, k * 20.0 * n, -v.ln() * k));
    [33e6, 40e6]
        .iter()
        .flat_map(|n| [4096.0, 8192.0, 16384.0].map(|v| cell(*n, v)))
        .flatten()
        .collect()
}

#[test]
fn a_missing_row_is_named_and_the_runs_alone_still_have_a_frontier() {
    let mut runs = small();
    assert!(frontier(&runs, Interpolation::Published).is_ok());
    runs.remove(3);
    let error = frontier(&runs, Interpolation::Published).unwrap_err().to_string();
    let expected = "the model of 33000000 at V = 8192 has 1 checkpoint(s) where others have 2";
    assert!(error.contains(expected), "{error}");
    assert!(frontier(&runs, Interpolation::None).is_ok());
}

#[test]
fn a_row_in_the_wrong_cell_is_named() {
    let mut runs = small();
    runs[1].n_vocab = 16384.0;
    runs[1].tokens *= 1.1;
    let error = frontier(&runs, Interpolation::Published).unwrap_err().to_string();
    assert!(
        error.contains("the model of 33000000 at V = 4096 has 1 checkpoint(s) where others have 3"),
        "{error}"
    );
}

#[test]
fn checkpoints_that_end_apart_are_named() {
    let mut runs = small();
    runs[3].tokens *= 1.5;
    let error = frontier(&runs, Interpolation::Published).unwrap_err().to_string();
    assert!(error.contains("the model of 33000000 at V = 8192 ends at"), "{error}");
}

#[test]
fn bad_values_and_small_tables_are_refused() {
    let mut runs = small();
    let too_small = frontier(&runs[..2], Interpolation::Published).unwrap_err();
    assert_eq!(too_small, FrontierError::TooSmall { models: 1, vocabularies: 1, checkpoints: 2 });
    assert!(frontier(&[], Interpolation::Published).is_err());
    assert_eq!(frontier(&[], Interpolation::None), Ok(Vec::new()));
    runs[4].tokens = 0.0;
    assert!(matches!(frontier(&runs, Interpolation::None), Err(FrontierError::BadValue { .. })));
    runs[4] = small().remove(4);
    runs[4].loss = f64::NAN;
    assert!(matches!(frontier(&runs, Interpolation::None), Err(FrontierError::BadLoss { .. })));
}

#[test]
fn a_model_beyond_the_table_of_widths_is_refused() {
    let mut runs = small();
    runs.iter_mut().filter(|run| run.params_nonvocab == 40e6).for_each(|run| {
        run.params_nonvocab = 7e9;
    });
    let error = frontier(&runs, Interpolation::Published).unwrap_err();
    assert!(matches!(error, FrontierError::NoWidth { .. }), "{error}");
}

#[test]
fn fewer_than_two_points_give_no_laws() {
    let one = frontier(&small()[..1], Interpolation::None).unwrap();
    assert_eq!(frontier_laws(&one, Criterion::Huber), None);
    assert_eq!(frontier_laws(&[], Criterion::LeastSquares), None);
}
