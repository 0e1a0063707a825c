//! Fits to single runs, approaches 1 and 3: whether the losses of a table tell a law at all, and the frontier of least
//! losses.

use crate::laws::input::{FitError, IsoFlopPoint, compare, is_same_budget};
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::{chi_square_tail, distinct, extent};

/// Rows below which chance alone explains much, and is not tested for.
const LEAST_ROWS: usize = 12;
/// Probability under chance above which a surface in N and D explains nothing.
const CHANCE: f64 = 0.01;
/// Losses that differ by less than this share of themselves are equal.
const EQUAL: f64 = 1e-12;

/// Refuses losses that are equal, equal at each budget, or explained by N, D and V no better than by chance.
///
/// The test is Snedecor's F of a plane and of a quadratic surface in ln N and ln D, through the losses and, against
/// wild rows, through their ranks; one that explains them is enough.
///
/// # Errors
/// [`FitError::NotIdentified`].
pub(super) fn losses_tell(points: &[IsoFlopPoint]) -> Result<(), FitError> {
    let no_law =
        |why: String| Err(FitError::NotIdentified(format!("{why}: the table holds no law")));
    let losses: Vec<f64> = points.iter().map(|point| point.loss).collect();
    if points.len() > 1 && are_equal(&losses) {
        return no_law(format!("all {} losses are {}", losses.len(), losses[0]));
    }
    if are_equal_at_each_budget(points) {
        return no_law("at each budget the losses of all sizes are equal".to_string());
    }
    match chance(points, &losses) {
        Some(p) if p > CHANCE => no_law(format!(
            "N and D explain the {} losses no better than chance would (p = {p:.2})",
            losses.len()
        )),
        _ => Ok(()),
    }
}

fn are_equal(losses: &[f64]) -> bool {
    let [least, most] = extent(losses.iter().copied());
    most - least <= EQUAL * least.abs().max(most.abs())
}

/// Whether runs of several sizes share a budget, and all that do have the loss of their budget.
fn are_equal_at_each_budget(points: &[IsoFlopPoint]) -> bool {
    let mut runs: Vec<&IsoFlopPoint> = points.iter().collect();
    runs.sort_by(|a, b| a.flops.total_cmp(&b.flops));
    let budgets = runs.chunk_by(|a, b| is_same_budget(a.flops, b.flops));
    let sizes = |runs: &&[&IsoFlopPoint]| distinct(runs.iter().map(|run| size(run))).len();
    let mut shared = budgets.filter(|runs| sizes(runs) > 1).peekable();
    let losses = |runs: &[&IsoFlopPoint]| runs.iter().map(|run| run.loss).collect::<Vec<f64>>();
    shared.peek().is_some() && shared.all(|runs| are_equal(&losses(runs)))
}

fn size(run: &IsoFlopPoint) -> f64 {
    run.params_nonvocab + run.params_vocab
}

/// The least probability, over four surfaces, that chance explains as much; `None` if no surface can be fitted, or
/// rows are few.
fn chance(points: &[IsoFlopPoint], losses: &[f64]) -> Option<f64> {
    if points.len() < LEAST_ROWS {
        return None;
    }
    let centred = |of: fn(&IsoFlopPoint) -> f64| {
        let all: Vec<f64> = points.iter().map(|point| of(point).ln()).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        all.into_iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let times = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let (n, d, v) = (centred(size), centred(|run| run.tokens), centred(|run| run.n_vocab));
    let curved = [times(&n, &n), times(&n, &d), times(&d, &d)];
    let plane = independent(vec![vec![1.0; points.len()]], [n, d, v]);
    let surface = independent(plane.clone(), curved);
    let ranks = ranks(losses);
    let tests = [&plane, &surface].into_iter().flat_map(|x| [(x, losses), (x, &ranks)]);
    tests.filter_map(|(columns, y)| by_chance(&rows_of(columns), y)).reduce(f64::min)
}

/// `columns` and those of `more` that do not follow from the columns before them: of one budget, ln D does from ln N.
fn independent(mut columns: Vec<Vec<f64>>, more: [Vec<f64>; 3]) -> Vec<Vec<f64>> {
    for column in more {
        columns.push(column);
        let last = &columns[columns.len() - 1];
        if last.iter().any(|x| !x.is_finite()) || least_squares(&rows_of(&columns), last).is_none()
        {
            columns.pop();
        }
    }
    columns
}

fn rows_of(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..columns[0].len()).map(|i| columns.iter().map(|column| column[i]).collect()).collect()
}

/// The probability that noise alone lets `rows`, whose first column is constant, explain as much of `y`.
fn by_chance(rows: &[Vec<f64>], y: &[f64]) -> Option<f64> {
    let fit = least_squares(rows, y).filter(|fit| fit.dof > 0 && rows[0].len() > 1)?;
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let all: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
    // Of an exact fit, what rounding may leave.
    let left = fit.rss.max(EQUAL * EQUAL * all) / fit.dof as f64;
    let explained = (all - fit.rss) / left;
    let p = chi_square_tail(explained, rows[0].len() - 1, fit.dof);
    p.is_finite().then_some(p)
}

/// The mean place of each value among all in ascending order.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let below = |x: f64| sorted.partition_point(|y| *y < x);
    let up_to = |x: f64| sorted.partition_point(|y| *y <= x);
    values.iter().map(|x| (below(*x) + up_to(*x)) as f64 / 2.0).collect()
}

// The frontier of approach 1: the running minimum of the loss over C, of runs and of the curves between them.

/// Fewest sizes on a frontier: with one or two, the grid alone would set the law.
pub(super) const LEAST_SIZES: usize = 3;

/// Values of C at which training curves are read.
const GRID: usize = 256;

/// The configuration that holds the lowest loss seen up to some C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontierPoint {
    pub flops: f64,
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    pub loss: f64,
}

/// The running minimum of the loss over C, ascending in C.
pub fn frontier(points: &[IsoFlopPoint], interpolate: bool) -> Vec<FrontierPoint> {
    let candidates = Candidates::new(points, interpolate);
    candidates.lowest(&vec![true; candidates.n_curves])
}

/// Every point that may be on a frontier, ascending in C, and by loss where C is the same but for rounding, with
/// the curve it belongs to: sorted once, so that a frontier of some of the curves is one pass.
pub(super) struct Candidates {
    points: Vec<(usize, FrontierPoint)>,
    pub n_curves: usize,
}

impl Candidates {
    /// Every run, and between the runs of a training curve its loss interpolated in ln C.
    pub fn new(points: &[IsoFlopPoint], interpolate: bool) -> Self {
        let curves = curves(points);
        let range = extent(points.iter().map(|p| p.flops.ln()));
        let mut all = Vec::new();
        for (index, curve) in curves.iter().enumerate() {
            all.extend(curve.iter().map(|p| (index, measured(p))));
            if interpolate && curve.len() > 1 {
                all.extend(between(curve, range).map(|p| (index, p)));
            }
        }
        all.sort_by(|(_, a), (_, b)| a.flops.total_cmp(&b.flops));
        let of_one_budget = all.chunk_by_mut(|(_, a), (_, b)| is_same_budget(a.flops, b.flops));
        of_one_budget.for_each(|runs| runs.sort_by(|a, b| a.1.loss.total_cmp(&b.1.loss)));
        Self { points: all, n_curves: curves.len() }
    }

    /// The end of the sizes, and the sizes beyond it, where a frontier has nothing but that end: at three values of C or
    /// more, counting those at which three sizes or more were measured.
    pub fn edge(&self, front: &[FrontierPoint]) -> Option<(usize, &'static str, &'static str)> {
        let size = |p: &FrontierPoint| p.params_nonvocab;
        let all = self.points.chunk_by(|(_, a), (_, b)| is_same_budget(a.flops, b.flops));
        let ends = all.filter_map(|there| {
            let own = there.iter().find_map(|(_, p)| front.contains(p).then_some(size(p)))?;
            let sizes = distinct(there.iter().map(|(_, p)| size(p)));
            (sizes.len() >= LEAST_SIZES).then(|| [own == sizes[0], Some(&own) == sizes.last()])
        });
        let ends: Vec<[bool; 2]> = ends.collect();
        let words = [("smallest", "smaller"), ("largest", "larger")];
        let enough = ends.len() >= LEAST_SIZES;
        let at = (0..2).find(|end| enough && ends.iter().all(|there| there[*end]))?;
        Some((ends.len(), words[at].0, words[at].1))
    }

    /// The points of the chosen curves with a lower loss than every point at less C.
    pub fn lowest(&self, chosen: &[bool]) -> Vec<FrontierPoint> {
        let mut least = f64::INFINITY;
        let mut lowest = Vec::new();
        for (curve, point) in &self.points {
            if chosen[*curve] && point.loss < least {
                least = point.loss;
                lowest.push(*point);
            }
        }
        lowest
    }
}

/// Runs of one configuration and seed, each ascending in C.
fn curves(points: &[IsoFlopPoint]) -> Vec<Vec<&IsoFlopPoint>> {
    let key = |p: &IsoFlopPoint| [p.params_nonvocab, p.params_vocab, p.n_vocab, p.seed as f64];
    let mut rows: Vec<&IsoFlopPoint> = points.iter().collect();
    rows.sort_by(|a, b| compare(&key(a), &key(b)).then(a.flops.total_cmp(&b.flops)));
    rows.chunk_by(|a, b| key(a) == key(b)).map(<[_]>::to_vec).collect()
}

fn measured(p: &IsoFlopPoint) -> FrontierPoint {
    FrontierPoint {
        flops: p.flops,
        params_nonvocab: p.params_nonvocab,
        params_vocab: p.params_vocab,
        n_vocab: p.n_vocab,
        tokens: p.tokens,
        loss: p.loss,
    }
}

/// A curve at the values of C that lie strictly between two of its runs.
fn between(curve: &[&IsoFlopPoint], [low, high]: [f64; 2]) -> impl Iterator<Item = FrontierPoint> {
    let step = (high - low) / GRID as f64;
    (1..GRID).filter_map(move |i| at(curve, low + step * i as f64))
}

/// A curve's point at e^`ln_flops`, linear in ln C between two runs; none outside them.
fn at(curve: &[&IsoFlopPoint], ln_flops: f64) -> Option<FrontierPoint> {
    let right = curve.partition_point(|p| p.flops.ln() < ln_flops);
    let (a, b) = (curve.get(right.checked_sub(1)?)?, curve.get(right)?);
    let share = (ln_flops - a.flops.ln()) / (b.flops.ln() - a.flops.ln());
    let mix = |a: f64, b: f64| a + share * (b - a);
    Some(FrontierPoint {
        flops: ln_flops.exp(),
        tokens: mix(a.tokens.ln(), b.tokens.ln()).exp(),
        loss: mix(a.loss, b.loss),
        ..measured(a)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::maths::stats::Normals;
    use crate::laws::parametric::tests::{chinchilla_runs, motion_runs};

    fn refusal(points: &[IsoFlopPoint]) -> String {
        losses_tell(points).err().map(|error| error.to_string()).unwrap_or_default()
    }

    /// The same runs with other losses.
    fn with(
        runs: &[IsoFlopPoint],
        mut loss: impl FnMut(&IsoFlopPoint) -> f64,
    ) -> Vec<IsoFlopPoint> {
        runs.iter().map(|run| IsoFlopPoint { loss: loss(run), ..run.clone() }).collect()
    }

    #[test]
    fn pure_noise_holds_no_law() {
        for sizes in [2, 5, 9] {
            let runs = chinchilla_runs(sizes, 0.0, 0);
            let refused = (0..50).filter(|stream| {
                let mut normals = Normals::of_stream(3, *stream);
                let noise = with(&runs, |_| 3.0 + 0.1 * normals.draw());
                refusal(&noise).contains("no better than chance")
            });
            let refused = refused.count();
            assert!(refused >= 46, "{refused} of 50 at {sizes} sizes");
        }
    }

    #[test]
    fn equal_losses_hold_no_law_whether_over_all_runs_or_at_each_budget() {
        let runs = chinchilla_runs(5, 0.0, 0);
        assert!(refusal(&with(&runs, |_| 2.5)).contains("all 40 losses are 2.5"));
        assert!(refusal(&with(&runs[..2], |_| 2.5)).contains("all 2 losses are 2.5"));
        let of_budget = with(&runs, |run| run.budget_flops.powf(-0.05));
        assert!(refusal(&of_budget).contains("at each budget"), "{}", refusal(&of_budget));
    }

    #[test]
    fn a_law_under_noise_or_with_wild_rows_or_few_of_them_is_told() {
        for noise in [0.0, 0.01, 0.03] {
            assert_eq!(refusal(&chinchilla_runs(5, noise, 1)), "", "{noise}");
            assert_eq!(refusal(&motion_runs(noise, 1)), "", "{noise}");
        }
        let mut wild = chinchilla_runs(5, 0.01, 2);
        wild[7].loss *= 1000.0;
        assert_eq!(refusal(&wild), "");
        assert_eq!(refusal(&chinchilla_runs(2, 0.01, 3)[..11]), "");
        // Valleys of one budget and of two, whose ends are equally high.
        let valley = |run: &IsoFlopPoint| {
            let off = (run.params_nonvocab / (run.budget_flops / 6.0).sqrt() * 4.0).ln();
            2.0 + 0.01 * off * off
        };
        let valleys = with(&chinchilla_runs(15, 0.0, 0), valley);
        assert_eq!(refusal(&valleys[..15]), "");
        assert_eq!(refusal(&valleys[..30]), "");
    }
}
