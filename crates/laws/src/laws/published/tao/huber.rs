//! Exact minima of the Huber loss with a fixed δ.
//!
//! ρ(r) = r²/2 up to δ and δ(|r| − δ/2) beyond is convex, so the slope of the objective in each
//! coefficient never falls, and bisection down to neighbouring numbers finds its zero. With δ far
//! below the residuals the loss is nearly |r|, where descent by gradients stops early. Where the
//! minimum is a stretch, as that of an even number of far residuals is, the answer is its middle.

use crate::laws::maths::line::Line;

/// The s of least Σ ρ(y − s x); none where no x differs from 0.
pub(super) fn ratio(x: &[f64], y: &[f64], delta: f64) -> Option<f64> {
    let ratios = x.iter().zip(y).filter(|(x, _)| **x != 0.0).map(|(x, y)| y / x);
    let [low, high] = range(ratios)?;
    Some(middle_zero(low, high, |s| {
        -x.iter().zip(y).map(|(x, y)| x * pull(y - s * x, delta)).sum::<f64>()
    }))
}

/// The K of least Σ ρ(y − K); none for no values.
pub(super) fn location(y: &[f64], delta: f64) -> Option<f64> {
    ratio(&vec![1.0; y.len()], y, delta)
}

/// The line of least Σ ρ(y − line); none where x does not vary.
///
/// For each slope the best level is found exactly, and what the objective then does in the slope
/// is again convex. Its minimum lies between the flattest and the steepest line through two points.
pub(super) fn line(x: &[f64], y: &[f64], delta: f64) -> Option<Line> {
    let pairs = (0..x.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let slopes = pairs.filter(|(i, j)| x[*i] != x[*j]).map(|(i, j)| (y[i] - y[j]) / (x[i] - x[j]));
    let [low, high] = range(slopes)?;
    let centre = x.iter().sum::<f64>() / x.len() as f64;
    let offsets: Vec<f64> = x.iter().map(|x| x - centre).collect();
    let level = |slope: f64| {
        let rest: Vec<f64> = offsets.iter().zip(y).map(|(x, y)| y - slope * x).collect();
        location(&rest, delta).map(|level| (level, rest))
    };
    let slope = middle_zero(low, high, |slope| {
        let (level, rest) = level(slope).unwrap_or_default();
        -offsets.iter().zip(rest).map(|(x, r)| x * pull(r - level, delta)).sum::<f64>()
    });
    Some(Line { centre, level: level(slope)?.0, slope })
}

/// Σ ρ over the residuals.
pub(super) fn objective(residuals: impl Iterator<Item = f64>, delta: f64) -> f64 {
    residuals
        .map(|r| if r.abs() <= delta { r * r / 2.0 } else { delta * (r.abs() - delta / 2.0) })
        .sum()
}

/// ρ'(r)/δ: ±1 beyond δ, so that far residuals cancel without rounding.
fn pull(r: f64, delta: f64) -> f64 {
    (r / delta).clamp(-1.0, 1.0)
}

/// The middle of the stretch where a function that never falls is 0.
fn middle_zero(low: f64, high: f64, rising: impl Fn(f64) -> f64) -> f64 {
    let first = zero(low, high, &rising);
    let last = -zero(-high, -low, |s| -rising(-s));
    first + (last - first) / 2.0
}

/// Where a function that rises from below 0 first is not below it, between `low` and `high`; the
/// end nearer to that where there is no such place.
pub(super) fn zero(mut low: f64, mut high: f64, rising: impl Fn(f64) -> f64) -> f64 {
    loop {
        let middle = low + (high - low) / 2.0;
        if !(low < middle && middle < high) {
            return if rising(low) < 0.0 { high } else { low };
        }
        if rising(middle) < 0.0 { low = middle } else { high = middle }
    }
}

/// The least and the greatest value; none for no values.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |range, v| {
        let [low, high] = range.unwrap_or([v, v]);
        Some([low.min(v), high.max(v)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_line_nearby_is_better(
            y in proptest::collection::vec(-1.0..1.0f64, 5..12),
            delta in 1e-3..0.5f64,
        ) {
            let x: Vec<f64> = (0..y.len()).map(|i| i as f64).collect();
            let best = line(&x, &y, delta).unwrap();
            let cost = |level: f64, slope: f64| objective(
                x.iter().zip(&y).map(|(x, y)| y - level - slope * (x - best.centre)), delta,
            );
            let least = cost(best.level, best.slope);
            for (a, b) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)] {
                for step in [1e-6, 1e-3, 0.1, -1e-6, -1e-3, -0.1] {
                    let other = cost(best.level + a * step, best.slope + b * step);
                    prop_assert!(other >= least - 1e-15, "{other} < {least}");
                }
            }
        }
    }

    #[test]
    fn a_wide_delta_gives_the_mean_and_a_narrow_one_the_median() {
        let y = [1.0, 2.0, 9.0];
        assert!((location(&y, 1e3).unwrap() - 4.0).abs() < 1e-12);
        assert!((location(&y, 1e-9).unwrap() - 2.0).abs() < 1e-8);
        assert_eq!(location(&[], 1.0), None);
    }

    #[test]
    fn an_even_number_of_far_values_gives_their_middle() {
        let y = [0.1, 0.3, 0.7, 5.0, -2.0, 0.9];
        assert!((location(&y, 1e-3).unwrap() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn one_abscissa_gives_no_line() {
        assert_eq!(line(&[1.0, 1.0], &[1.0, 2.0], 1e-3), None);
        assert_eq!(ratio(&[0.0], &[1.0], 1e-3), None);
    }
}
