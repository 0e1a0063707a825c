use super::super::objective::{Columns, Constant, Curvature, Objective};
use super::super::vector::Vector;
use crate::laws::parametric::objective::Space;
use proptest::prelude::*;

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
