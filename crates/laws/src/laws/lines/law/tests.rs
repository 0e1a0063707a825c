//! Lines of known points.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn exact_points_give_back_the_law(
        exponent in -2.0..2.0f64,
        log10_coefficient in -6.0..6.0f64,
        start in 8.0..20.0f64,
        steps in proptest::collection::vec(0.1..1.5f64, 1..6),
        huber in proptest::option::of(0.1..3.0f64),
    ) {
        let log10_x: Vec<f64> = steps.iter().scan(start, |x, step| { *x += step; Some(*x) })
            .chain([start]).collect();
        let x: Vec<f64> = log10_x.iter().map(|x| 10f64.powf(*x)).collect();
        let y: Vec<f64> =
            log10_x.iter().map(|x| 10f64.powf(log10_coefficient + exponent * x)).collect();
        let law = power_law(&x, &y, 1e15, &vec![1.0; x.len()], huber).unwrap();
        prop_assert!((law.exponent - exponent).abs() < 1e-10);
        prop_assert!((law.log10_coefficient - log10_coefficient).abs() < 1e-9);
        let at_reference = (log10_coefficient + 15.0 * exponent) * LN_10;
        prop_assert!((law.ln_at_reference - at_reference).abs() < 1e-9);
        prop_assert!((law.value_at(x[0]) / y[0] - 1.0).abs() < 1e-9);
    }
}

#[test]
fn one_abscissa_gives_no_law() {
    assert_eq!(power_law(&[1e18, 1e18], &[1.0, 2.0], 1e18, &[1.0, 1.0], None), None);
    assert_eq!(power_law(&[1e18], &[1.0], 1e18, &[1.0], None), None);
    assert_eq!(power_law(&[], &[], 1e18, &[], Some(1.0)), None);
}

#[test]
fn a_point_of_double_weight_counts_as_two() {
    let (x, y) = ([1e10, 1e11, 1e12], [2.0, 5.0, 9.0]);
    let weighted = power_law(&x, &y, 1e11, &[1.0, 1.0, 2.0], None).unwrap();
    let repeated =
        power_law(&[x[0], x[1], x[2], x[2]], &[y[0], y[1], y[2], y[2]], 1e11, &[1.0; 4], None)
            .unwrap();
    assert!((weighted.exponent - repeated.exponent).abs() < 1e-14);
    assert!((weighted.r2 - repeated.r2).abs() < 1e-14);
}

const X: [f64; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
const NOISE: [f64; 8] = [0.01, -0.02, 0.015, 0.0, -0.01, 0.02, -0.015, 0.005];

fn points(outlier: f64) -> Vec<f64> {
    let mut y: Vec<f64> = X.iter().zip(NOISE).map(|(x, e)| 3.0 + 0.5 * x + e).collect();
    y[7] += outlier;
    y
}

#[test]
fn one_wild_point_hardly_moves_the_line() {
    let robust = huber_line(&X, &points(5.0), &[1.0; 8], 1.345).unwrap();
    let plain = least_squares_line(&X, &points(5.0), &[1.0; 8]).unwrap();
    assert!((robust.slope - 0.5).abs() < 0.01, "{}", robust.slope);
    assert!((plain.slope - 0.5).abs() > 0.3, "{}", plain.slope);
}

#[test]
fn the_gradient_of_the_objective_vanishes_at_the_line() {
    let (y, delta) = (points(5.0), 1.345);
    let line = huber_line(&X, &y, &[1.0; 8], delta).unwrap();
    let scale = SD_PER_MAD * median_residual(&theil_sen(&X, &y).unwrap(), &X, &y);
    let psi = |i: usize| ((y[i] - line.at(X[i])) / scale).clamp(-delta, delta);
    let along: [f64; 2] = [(0..8).map(psi).sum(), (0..8).map(|i| psi(i) * X[i]).sum()];
    assert!(along.iter().all(|g| g.abs() < 1e-9), "{along:?}");
}

#[test]
fn a_wide_delta_is_least_squares() {
    let robust = huber_line(&X, &points(0.3), &[1.0; 8], 1e6).unwrap();
    let plain = least_squares_line(&X, &points(0.3), &[1.0; 8]).unwrap();
    assert!((robust.slope - plain.slope).abs() < 1e-12);
}

#[test]
fn the_published_line_is_recovered_from_its_own_points() {
    let c = [1e14, 1e15, 1e16, 1e18];
    let law = log_law(&c, &c.map(|c: f64| -1.062 * c.log10() + 13.839)).unwrap();
    assert!((law.slope_per_decade + 1.062).abs() < 1e-12);
    assert!((law.intercept - 13.839).abs() < 1e-11);
    assert!((law.loss_at(1e18) + 5.277).abs() < 1e-12);
    assert!(law.r2 > 1.0 - 1e-12 && law.aic.is_finite());
}

const C: [f64; 6] = [1e14, 3e14, 1e15, 3e15, 1e16, 1e17];

proptest! {
    #[test]
    fn a_law_with_a_floor_is_recovered_from_its_own_points(
        floor in -8.0..-3.0f64,
        coefficient in 0.3..3.0f64,
        exponent in 0.03..0.8f64,
    ) {
        let loss = C.map(|c| floor + coefficient * (c / 1e15).powf(-exponent));
        let law = floor_law(&C, &loss, 1e15).unwrap();
        prop_assert!((law.exponent / exponent - 1.0).abs() < 1e-7, "{law:?}");
        prop_assert!((law.floor - floor).abs() < 1e-6);
        prop_assert!((law.coefficient - coefficient).abs() < 1e-6);
        prop_assert!((law.loss_at(1e18, 1e15)
            - (floor + coefficient * 1e3f64.powf(-exponent))).abs() < 1e-6);
    }
}

#[test]
fn a_straight_line_in_log_compute_drives_the_exponent_to_its_bound() {
    let law = floor_law(&C, &C.map(|c: f64| 13.0 - c.log10()), 1e15).unwrap();
    assert!(law.is_at_bound());
    assert!(law.r2 > 0.9999, "{}", law.r2);
}

#[test]
fn a_loss_that_rises_with_compute_has_no_floor_law() {
    assert_eq!(floor_law(&C, &C.map(f64::log10), 1e15), None);
    assert_eq!(floor_law(&C, &[-2.0; 6], 1e15), None);
    assert_eq!(floor_law(&C[..2], &[-1.0, -2.0], 1e15), None);
}
