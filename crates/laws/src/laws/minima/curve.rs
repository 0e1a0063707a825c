//! Curves in ln N_nv: the parabola, the cubic and Akima's spline.
//!
//! Each size is represented by its best vocabulary (Hoffmann et al. 2022, approach 2, as ScaMo's
//! figures draw it). N_v, V and D at the minimum are read off the sizes beside it.

use super::grid::{Grid, Scale, apart};
use super::minimum::{Curvature, Located, Minimum, MinimumFlag};
use crate::laws::input::{MinimumMethod, Size};
use crate::laws::maths::stats::extent;
use crate::laws::maths::{LeastSquares, least_squares};

/// Most times that a valley is recentred on its curve's minimum.
const MOVES: usize = 4;

/// The minimum of the polynomial of `degree` 2 or 3 through the valley of a grid, which is moved until the
/// minimum lies at its middle.
pub(super) fn by_polynomial(method: MinimumMethod, degree: usize, grid: &Grid) -> Located {
    let mut centre = grid.best_size();
    let mut located = through(method, degree, grid, centre);
    for _ in 0..MOVES {
        let next = located.1.map_or(centre, |ln_size| nearest(grid, ln_size));
        if next == centre {
            break;
        }
        centre = next;
        located = through(method, degree, grid, centre);
    }
    located.0
}

/// The size nearest to a place.
fn nearest(grid: &Grid, ln_size: f64) -> usize {
    let off = |i: &usize| (grid.sizes[*i].best.params_nonvocab.ln() - ln_size).abs();
    (0..grid.sizes.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default()
}

/// The minimum of the polynomial through the valley around one size, and whether it lies inside.
fn through(
    method: MinimumMethod,
    degree: usize,
    grid: &Grid,
    centre: usize,
) -> (Located, Option<f64>) {
    let unfit =
        |reason, curvature| Located { minimum: grid.best_run(method, Some(reason)), curvature };
    let sizes = grid.valley(centre);
    if apart(sizes).count() <= degree {
        return (unfit(MinimumFlag::FewLevels, None), None);
    }
    let scale = Scale::over(sizes.iter().map(|size| size.best.params_nonvocab.ln()));
    let Some(fit) = polynomial(degree, sizes, scale) else {
        return (unfit(MinimumFlag::FewLevels, None), None);
    };
    let Some(z) = stationary(&fit.coefficients) else {
        return (unfit(MinimumFlag::NotConvex, None), None);
    };
    let at = Some(scale.value_at(z));
    let curvature = Some(curvature(&fit, z, grid.runs_of_a_cell()));
    if z.abs() >= 1.0 {
        return (unfit(MinimumFlag::NotBracketed, curvature), at);
    }
    let loss = powers(z, degree).iter().zip(&fit.coefficients).map(|(z, c)| z * c).sum();
    let minimum = along_sizes(method, grid, sizes, (scale.value_at(z), loss));
    (Located { minimum, curvature }, at)
}

fn polynomial(degree: usize, sizes: &[Size], scale: Scale) -> Option<LeastSquares> {
    let unit = |size: &Size| scale.to_unit(size.best.params_nonvocab.ln());
    let rows: Vec<_> = sizes.iter().map(|size| powers(unit(size), degree)).collect();
    let losses: Vec<_> = sizes.iter().map(|size| size.best.loss).collect();
    least_squares(&rows, &losses)
}

fn powers(z: f64, degree: usize) -> Vec<f64> {
    (0..=degree).map(|power| z.powi(power as i32)).collect()
}

/// The local minimum of the polynomial; `None` if it has none.
///
/// For the cubic it is the root of c1 + 2 c2 z + 3 c3 z² with a positive second derivative, written
/// so that it neither cancels nor breaks down as c3 → 0.
fn stationary(c: &[f64]) -> Option<f64> {
    let (c1, c2) = (c[1], c[2]);
    let c3 = c.get(3).copied().unwrap_or(0.0);
    let discriminant = 4.0 * c2 * c2 - 12.0 * c1 * c3;
    if discriminant <= 0.0 || (c3 == 0.0 && c2 <= 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    Some(if c2 > 0.0 { -2.0 * c1 / (2.0 * c2 + root) } else { (root - 2.0 * c2) / (6.0 * c3) })
}

fn curvature(fit: &LeastSquares, z: f64, runs: f64) -> Curvature {
    let gradient = [0.0, 0.0, 2.0, 6.0 * z];
    let gradient = &gradient[..fit.coefficients.len()];
    let value = gradient.iter().zip(&fit.coefficients).map(|(g, c)| g * c).sum();
    Curvature { value, unit_error: fit.unit_error(gradient), rss: fit.rss, runs, dof: fit.dof }
}

// Akima's spline.
//
// H. Akima, "A new method of interpolation and smooth curve fitting based on local procedures",
// J. ACM 17 (1970): a cubic between each two sizes, whose slopes at the sizes depend on the two
// neighbours on either side alone. It passes through every size, so it smooths no noise; but it has no
// fixed shape, so it shows if the shape of a parabola or a cubic moves a minimum.

/// Each slope looks at two sizes on either side.
const FEWEST_SIZES: usize = 5;

/// The lowest stationary point of the spline through the sizes of a grid.
///
/// It interpolates, so there are no residuals and its curvature is not tested against noise.
pub(super) fn by_spline(grid: &Grid) -> Located {
    let method = MinimumMethod::Akima;
    let unfit = |reason| Located { minimum: grid.best_run(method, Some(reason)), curvature: None };
    let sizes = grid.valley(grid.best_size());
    let knots: Vec<(f64, f64)> = apart(sizes).map(knot).collect();
    if knots.len() < FEWEST_SIZES {
        return unfit(MinimumFlag::FewLevels);
    }
    let (x, y): (Vec<f64>, Vec<f64>) = knots.into_iter().unzip();
    let Some(place) = lowest_inside(&x, &y) else {
        return unfit(MinimumFlag::NotBracketed);
    };
    let minimum = along_sizes(method, grid, sizes, place);
    Located { minimum, curvature: None }
}

/// ln N and the loss of sizes that differ by next to nothing: their means.
fn knot(same: &[Size]) -> (f64, f64) {
    let mean = |of: fn(&Size) -> f64| same.iter().map(of).sum::<f64>() / same.len() as f64;
    (mean(|size| size.best.params_nonvocab.ln()), mean(|size| size.best.loss))
}

/// x and y of the spline's lowest point; `None` if an end of the range is as low.
fn lowest_inside(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let slopes = knot_slopes(x, y);
    let pieces = 0..x.len() - 1;
    let stationary = pieces.flat_map(|i| {
        let piece = Piece::between(i, x, y, &slopes);
        piece.stationary().map(move |t| (piece.start + t, piece.at(t)))
    });
    let (at, lowest) = stationary.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let last = x.len() - 1;
    let inside = x[0] < at && at < x[last] && lowest < y[0].min(y[last]);
    inside.then_some((at, lowest))
}

/// Akima's slope at every knot: the mean of the slopes of the pieces before and after it, each
/// weighted by the bend on the other side; two further pieces at each end continue the last bend.
fn knot_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let piece = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    let inner: Vec<f64> = (0..n - 1).map(piece).collect();
    let (first, last) = (inner[0] - inner[1.min(n - 2)], inner[n - 2] - inner[n.saturating_sub(3)]);
    let before = [inner[0] + 2.0 * first, inner[0] + first];
    let after = [inner[n - 2] + last, inner[n - 2] + 2.0 * last];
    let m: Vec<f64> = before.into_iter().chain(inner).chain(after).collect();
    m.windows(4).map(|m| knot_slope(m[0], m[1], m[2], m[3])).collect()
}

fn knot_slope(m1: f64, m2: f64, m3: f64, m4: f64) -> f64 {
    let (left, right) = ((m4 - m3).abs(), (m2 - m1).abs());
    if left + right == 0.0 { 0.5 * (m2 + m3) } else { (left * m2 + right * m3) / (left + right) }
}

/// y = c0 + c1 t + c2 t² + c3 t³ for t in 0..=`length`.
#[derive(Clone, Copy)]
struct Piece {
    start: f64,
    length: f64,
    c: [f64; 4],
}

impl Piece {
    fn between(i: usize, x: &[f64], y: &[f64], slopes: &[f64]) -> Self {
        let length = x[i + 1] - x[i];
        let (mean, s0, s1) = ((y[i + 1] - y[i]) / length, slopes[i], slopes[i + 1]);
        let c2 = (3.0 * mean - 2.0 * s0 - s1) / length;
        let c3 = (s0 + s1 - 2.0 * mean) / length.powi(2);
        Self { start: x[i], length, c: [y[i], s0, c2, c3] }
    }

    fn at(&self, t: f64) -> f64 {
        self.c.iter().rev().fold(0.0, |sum, c| sum * t + c)
    }

    /// The root of c1 + 2 c2 t + 3 c3 t², by the formula without cancellation.
    fn stationary(&self) -> impl Iterator<Item = f64> + use<> {
        let [_, c1, c2, c3] = self.c;
        let (a, b, c) = (3.0 * c3, 2.0 * c2, c1);
        let q = -0.5 * (b + (b * b - 4.0 * a * c).sqrt().copysign(b));
        let length = self.length;
        // Without a root q is NaN, and no comparison holds.
        [q / a, c / q].into_iter().filter(move |t| (0.0..=length).contains(t))
    }
}

// N_v, V, D and FLOPs at a minimum that lies between the sizes tried.
//
// The best vocabulary of each size is a staircase in ln N_nv, since only some vocabularies were
// tried. Two things smooth it: each size's optimum is refined between its neighbouring
// vocabularies (`Size::ln_vocab`), and a straight line in ln N_nv is laid through the sizes, weighted
// towards the minimum by a Gaussian of a third of their range. D follows from the budget:
// ln D(N_nv + N_v), which a budget leaves nearly constant, is interpolated in the same way, and D
// solved from it, so that the minimum spends what its neighbours spent.

/// Width of the weights, as a share of the range of ln N_nv.
const BANDWIDTH: f64 = 1.0 / 3.0;

/// The minimum at `ln_nonvocab` with its loss, and the rest read off the sizes of its valley.
fn along_sizes(
    method: MinimumMethod,
    grid: &Grid,
    sizes: &[Size],
    (ln_nonvocab, loss_normalised): (f64, f64),
) -> Minimum {
    let local = LocalLine::at(sizes, ln_nonvocab);
    let line = |value: &dyn Fn(&Size) -> f64| local.value(sizes, value);
    let params_nonvocab = ln_nonvocab.exp();
    let (params_vocab, n_vocab) = if grid.best().has_vocabulary() {
        let known = with_known_vocabulary(sizes);
        let ln_vocab = LocalLine::at(&known, ln_nonvocab).value(&known, |size| size.ln_vocab);
        (ln_vocab.exp(), (ln_vocab - line(&|size| size.best.ln_width())).exp())
    } else {
        (0.0, 0.0)
    };
    Minimum {
        method,
        budget_flops: grid.budget_flops,
        flops: line(&|size| size.best.flops.ln()).exp(),
        params_nonvocab,
        params_vocab,
        n_vocab,
        tokens: line(&|size| size.best.ln_work()).exp() / (params_nonvocab + params_vocab),
        loss_normalised,
        ci95: None,
        flags: grid.vocab_edge().into_iter().chain(grid.doubts_at(ln_nonvocab)).collect(),
        trusted: false,
    }
}

/// The sizes whose best vocabulary lies inside the range; all sizes if these are fewer than two.
fn with_known_vocabulary(sizes: &[Size]) -> Vec<Size> {
    let known: Vec<Size> = sizes.iter().filter(|size| !size.at_edge).cloned().collect();
    if known.len() < 2 { sizes.to_vec() } else { known }
}

/// A weighted line over ln N_nv, read at one place: the value there is the sum of each size's value
/// times its share, which depends on the sizes alone.
struct LocalLine {
    shares: Vec<f64>,
}

impl LocalLine {
    fn at(sizes: &[Size], at: f64) -> Self {
        let x: Vec<f64> = sizes.iter().map(|size| size.best.params_nonvocab.ln()).collect();
        let [low, high] = extent(x.iter().copied());
        let bandwidth = BANDWIDTH * (high - low);
        let weights: Vec<f64> =
            x.iter().map(|x| (-0.5 * ((x - at) / bandwidth).powi(2)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(f64) -> f64| {
            weights.iter().zip(&x).map(|(w, x)| w * of(*x)).sum::<f64>() / total
        };
        let centre = mean(&|x| x);
        let variance = mean(&|x| (x - centre).powi(2));
        let share = |w: f64, x: f64| w / total * (1.0 + (x - centre) * (at - centre) / variance);
        Self { shares: weights.iter().zip(&x).map(|(w, x)| share(*w, *x)).collect() }
    }

    fn value(&self, sizes: &[Size], of: impl Fn(&Size) -> f64) -> f64 {
        self.shares.iter().zip(sizes).map(|(share, size)| share * of(size)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(knots: &[(f64, f64)], place: f64) -> f64 {
        let (x, y): (Vec<f64>, Vec<f64>) = knots.iter().copied().unzip();
        let i = x.iter().rposition(|x| *x <= place).unwrap_or(0).min(x.len() - 2);
        let piece = Piece::between(i, &x, &y, &knot_slopes(&x, &y));
        piece.at(place - piece.start)
    }

    #[test]
    fn the_spline_passes_its_knots_and_is_exact_on_a_line() {
        let knots = [(0.0, 1.0), (1.0, 3.0), (2.5, 2.0), (3.0, 2.5), (4.0, 7.0)];
        for (x, y) in knots {
            assert!((at(&knots, x) - y).abs() < 1e-14);
        }
        let line = [0.0, 1.0, 2.5, 4.0].map(|x| (x, 3.0 - 2.0 * x));
        assert!((at(&line, 3.3) + 3.6).abs() < 1e-14);
        assert!((at(&line[..2], 0.5) - 2.0).abs() < 1e-14);
    }

    #[test]
    fn the_spline_agrees_with_scipys() {
        // scipy.interpolate.Akima1DInterpolator([0, 1, 2.5, 3, 4, 6], [1, 3, 2, 2.5, 7, 7.2])
        let knots = [(0.0, 1.0), (1.0, 3.0), (2.5, 2.0), (3.0, 2.5), (4.0, 7.0), (6.0, 7.2)];
        let expected = [
            (0.3, 1.899_384_615_384_615_2),
            (1.7, 2.611_984_291_984_292),
            (2.8, 2.185_363_825_363_825),
            (3.3, 3.599_656_280_428_431_6),
            (5.0, 8.262_658_227_848_101),
        ];
        for (x, y) in expected {
            assert!((at(&knots, x) - y).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn the_spline_has_the_slopes_of_akimas_formula() {
        // Piece slopes 1, 1, -1, 3, continued by 1, 1 before and 7, 11 after: the fourth slope weighs
        // -1 by 7 - 3 and 3 by 1 + 1.
        let slopes = knot_slopes(&[0.0, 1.0, 2.0, 3.0, 4.0], &[0.0, 1.0, 2.0, 1.0, 4.0]);
        let expected = [1.0, 1.0, 1.0, (2.0 * 3.0 - 4.0) / 6.0];
        slopes.iter().zip(expected).for_each(|(s, e)| assert!((s - e).abs() < 1e-15, "{slopes:?}"));
    }

    #[test]
    fn a_parabola_on_even_knots_is_reproduced_to_its_vertex() {
        let x: Vec<f64> = (0..6).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|x| 0.3 * (x - 2.3).powi(2) - 4.0).collect();
        let (at, lowest) = lowest_inside(&x, &y).unwrap();
        assert!((at - 2.3).abs() < 1e-12 && (lowest + 4.0).abs() < 1e-12, "{at} {lowest}");
    }

    #[test]
    fn the_lowest_of_two_valleys_is_taken_and_a_low_end_is_not_inside() {
        let x: Vec<f64> = (0..8).map(f64::from).collect();
        let valleys = [3.0, 1.0, 2.0, 3.0, 2.0, 0.5, 1.5, 3.0];
        let (at, lowest) = lowest_inside(&x, &valleys).unwrap();
        assert!((4.5..5.5).contains(&at) && lowest <= 0.5, "{at} {lowest}");
        assert_eq!(lowest_inside(&x, &[0.1, 1.0, 2.0, 3.0, 2.0, 0.5, 1.5, 3.0]), None);
        assert_eq!(lowest_inside(&x, &[1.0; 8]), None);
    }

    #[test]
    fn a_far_off_size_does_not_move_the_minimum() {
        let x: Vec<f64> = (0..8).map(f64::from).collect();
        let mut y: Vec<f64> = x.iter().map(|x| (x - 2.2).powi(2)).collect();
        let (before, _) = lowest_inside(&x, &y).unwrap();
        y[7] += 40.0;
        assert_eq!(lowest_inside(&x, &y).unwrap().0, before);
    }
}
