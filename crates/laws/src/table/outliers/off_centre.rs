//! Budgets whose minimum the sizes tried do not bracket.

use super::group::{Verdicts, budgets, by, params};
use crate::laws::IsoFlopPoint;

/// The share of the range of ln N, around its middle, that the vertex must lie in.
const MIDDLE: f64 = 0.8;

/// Drops the runs of a budget whose parabola of loss in ln N does not open upwards, or has its
/// vertex outside the middle 80 % of the range of ln N. Fewer than three sizes are not judged.
pub(super) fn verdicts(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    for budget in budgets(points) {
        if by(points, &budget, params).len() < 3 {
            continue;
        }
        if let Some(reason) = reason(points, &budget) {
            budget.iter().for_each(|run| verdicts[*run] = Some(reason.clone()));
        }
    }
    verdicts
}

fn reason(points: &[IsoFlopPoint], runs: &[usize]) -> Option<String> {
    let ln_params: Vec<f64> = runs.iter().map(|run| params(&points[*run]).ln()).collect();
    let loss: Vec<f64> = runs.iter().map(|run| points[*run].loss).collect();
    let low = ln_params.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ln_params.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let z: Vec<f64> = ln_params.iter().map(|x| (x - middle) / half).collect();
    let flops = points[runs[0]].budget_flops;
    let Some(vertex) = vertex(&z, &loss) else {
        return Some(format!("the parabola of budget {flops:e} does not open upwards"));
    };
    (vertex.abs() > MIDDLE).then(|| {
        let share = 50.0 * (vertex + 1.0);
        let n = (middle + half * vertex).exp();
        format!(
            "the vertex of budget {flops:e} lies at N = {n:.3e}, {share:.0} % of the way from the \
             smallest ln N tried to the largest"
        )
    })
}

/// Where the least-squares parabola through the points has its minimum; none where it has none.
///
/// It is laid in polynomials orthogonal over the points: 1, z − m, and z² less its projections, so
/// that no system has to be solved.
fn vertex(z: &[f64], y: &[f64]) -> Option<f64> {
    let n = z.len() as f64;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mean = z.iter().sum::<f64>() / n;
    let linear: Vec<f64> = z.iter().map(|z| z - mean).collect();
    let squares: Vec<f64> = linear.iter().map(|x| x * x).collect();
    let (level, variance) = (squares.iter().sum::<f64>() / n, dot(&linear, &linear));
    let tilt = dot(&squares, &linear) / variance;
    let quadratic: Vec<f64> =
        squares.iter().zip(&linear).map(|(s, x)| s - level - tilt * x).collect();
    let curvature = dot(y, &quadratic) / dot(&quadratic, &quadratic);
    let slope = dot(y, &linear) / variance - curvature * tilt;
    let spread = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    (curvature > 1e-12 * spread).then(|| mean - slope / (2.0 * curvature))
}

#[cfg(test)]
mod tests {
    use super::super::OutlierStage::OffCentre;
    use super::super::group::testing::{parabola, point};
    use super::vertex;

    #[test]
    fn the_vertex_of_an_exact_parabola_is_found() {
        let z = [-1.0, -0.7, 0.1, 0.3, 1.0];
        let y = z.map(|z: f64| 2.0 + 0.3 * (z - 0.45).powi(2));
        assert!((vertex(&z, &y).unwrap() - 0.45).abs() < 1e-13);
        assert_eq!(vertex(&z, &z), None);
        assert_eq!(vertex(&z, &y.map(|y| -y)), None);
    }

    #[test]
    fn a_vertex_near_the_edge_drops_its_budget_and_the_reason_says_where() {
        let centred = parabola(1e18, 11, 5.0);
        let (kept, dropped) = OffCentre.split([centred.clone(), parabola(1e19, 11, 9.5)].concat());
        assert_eq!(kept, centred);
        assert_eq!(dropped.len(), 11);
        assert!(dropped[0].1.contains("N = 7.241e8, 95 % of the way"), "{}", dropped[0].1);
    }

    #[test]
    fn a_budget_that_bends_downwards_is_dropped_and_two_sizes_are_not_judged() {
        let down = [1e6, 2e6, 4e6].map(|n| point(1e18, n, -(n / 2e6f64).ln().powi(2)));
        let two = [1e6, 2e6].map(|n| point(1e19, n, 1.0));
        let (kept, dropped) = OffCentre.split([&down[..], &two].concat());
        assert_eq!((kept.len(), dropped.len()), (2, 3));
        assert!(dropped[0].1.contains("does not open upwards"));
    }
}
