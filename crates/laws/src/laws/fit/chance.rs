//! Whether the losses of a table tell a law at all, or are equal, or noise.

use crate::laws::input::{Cell, FitError, IsoFlopPoint, Metric, compare, is_same_budget};
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::{chi_square_tail, distinct, dot, extent};
use crate::laws::minima::Grid;
use crate::laws::say::warnings::of_rise;

/// Losses below which chance alone explains much, and is not tested for.
const LEAST_ROWS: usize = 12;
/// Probability under chance above which a surface in N and D explains nothing.
const CHANCE: f64 = 0.01;
/// Exponents of D between which those of losses lie.
const EXPONENTS: [f64; 3] = [0.15, 0.35, 0.6];
/// Losses that differ by less than this share of themselves are equal.
const EQUAL: f64 = 1e-12;
/// Losses rise with the budget if their rank correlation is higher.
const RISE: f64 = 0.5;
/// Least ratio of the largest to the smallest budget for such a warning.
const BUDGETS_APART: f64 = 2.0;

/// A loss and where it was measured.
pub(super) struct Place {
    budget: f64,
    params_nonvocab: f64,
    ln_size: f64,
    ln_tokens: f64,
    ln_vocab: f64,
    loss: f64,
}

impl Place {
    pub fn of_runs(points: &[IsoFlopPoint]) -> Vec<Self> {
        let place = |run: &IsoFlopPoint| Self {
            budget: run.budget_flops,
            params_nonvocab: run.params_nonvocab,
            ln_size: (run.params_nonvocab + run.params_vocab).ln(),
            ln_tokens: run.tokens.ln(),
            ln_vocab: if run.n_vocab > 0.0 { run.n_vocab } else { run.params_vocab }.ln(),
            loss: run.loss,
        };
        points.iter().map(place).collect()
    }

    /// The cells of all budgets. Their tokens are those of its FLOPs, so that rounded steps count as no difference.
    pub fn of_cells(grids: &[Grid]) -> Vec<Self> {
        let cells = grids.iter().flat_map(|grid| grid.cells.iter().map(move |cell| (grid, cell)));
        let place = |(grid, cell): (&Grid, &Cell)| {
            let ln_size = (cell.params_nonvocab + cell.params_vocab).ln();
            Self {
                budget: grid.budget_flops,
                params_nonvocab: cell.params_nonvocab,
                ln_size,
                ln_tokens: grid.budget_flops.ln() - ln_size,
                ln_vocab: cell.n_vocab.ln(),
                loss: cell.loss,
            }
        };
        cells.map(place).collect()
    }
}

fn no_law(why: String) -> Result<(), FitError> {
    Err(FitError::NotIdentified(format!("{why}: the table holds no law")))
}

/// Refuses losses of runs that are equal, equal at each budget, or explained by N, D and V no better than by chance.
///
/// # Errors
/// [`FitError::NotIdentified`].
pub(super) fn losses_tell(places: &[Place]) -> Result<(), FitError> {
    let all: Group = places.iter().collect();
    if all.len() > 1 && are_equal(&all) {
        return no_law(format!("all {} losses are {}", all.len(), all[0].loss));
    }
    budgets_differ(&of_several_sizes(places))?;
    explained(&[all], &format!("N and D explain the {} losses", places.len()))
}

/// Refuses losses that are equal at each budget, or explained by N and V within the budgets no better than by chance:
/// they have no minima. A loss in N and D may still go through such runs.
///
/// # Errors
/// [`FitError::NotIdentified`].
pub(super) fn sizes_tell(places: &[Place]) -> Result<(), FitError> {
    let budgets = of_several_sizes(places);
    budgets_differ(&budgets)?;
    explained(&budgets, "sizes explain how the losses of a budget differ")
}

/// Refuses losses that a surface explains no better than by chance; `what` says what it is to explain.
fn explained(groups: &[Group], what: &str) -> Result<(), FitError> {
    match chance(groups, |_| Vec::new(), surface) {
        Some(p) if p > CHANCE => no_law(format!("{what} no better than chance would (p = {p:.2})")),
        _ => Ok(()),
    }
}

/// The budgets at which runs of several sizes were measured.
fn of_several_sizes(places: &[Place]) -> Vec<Group<'_>> {
    let mut budgets = groups(places, |place| [place.budget, 0.0]);
    budgets.retain(|budget| distinct(budget.iter().map(|place| place.ln_size)).len() > 1);
    budgets
}

fn budgets_differ(budgets: &[Group]) -> Result<(), FitError> {
    if !budgets.is_empty() && budgets.iter().all(|budget| are_equal(budget)) {
        return no_law("at each budget the losses of all sizes are equal".to_string());
    }
    Ok(())
}

/// Whether, at each N_nv of each budget, V explains the losses beyond D no better than chance would; false if no V, or
/// few, share an N_nv.
pub(super) fn vocab_is_chance(places: &[Place]) -> bool {
    let mut sizes = groups(places, |place| [place.budget, place.params_nonvocab]);
    sizes.retain(|size| distinct(size.iter().map(|place| place.ln_vocab)).len() > 1);
    // Between them the powers are near any power of D.
    let data = |[n, d, _]: &Columns| {
        let power = |beta: f64| d.iter().map(|d| (-beta * d).exp()).collect::<Vec<f64>>();
        let powers = EXPONENTS.map(power);
        [times(n, d), times(n, &powers[0])].into_iter().chain(powers).collect()
    };
    let vocab = |[_, _, v]: &Columns| vec![v.clone(), times(v, v)];
    chance(&sizes, data, vocab).is_some_and(|p| p > CHANCE)
}

/// A warning if the losses rise with the budget, as a score does where higher is better.
pub(super) fn rises(places: &[Place], metric: &Metric) -> Option<String> {
    let [least, most] = extent(places.iter().map(|place| place.budget));
    let by_loss = centred(ranks(places.iter().map(|place| place.loss).collect()));
    let by_budget = centred(ranks(places.iter().map(|place| place.budget).collect()));
    let squares = dot(&by_loss, &by_loss) * dot(&by_budget, &by_budget);
    let correlation = dot(&by_loss, &by_budget) / squares.sqrt();
    (most >= BUDGETS_APART * least && correlation > RISE).then(|| of_rise(correlation, metric))
}

/// Losses that are compared with each other alone.
type Group<'a> = Vec<&'a Place>;

/// The places whose `key` is the same but for rounding.
fn groups(places: &[Place], key: fn(&Place) -> [f64; 2]) -> Vec<Group<'_>> {
    let mut all: Group = places.iter().collect();
    all.sort_by(|a, b| compare(&key(a), &key(b)));
    let is_one = |a: &&Place, b: &&Place| (0..2).all(|i| is_same_budget(key(a)[i], key(b)[i]));
    all.chunk_by(is_one).map(<[_]>::to_vec).collect()
}

fn are_equal(group: &Group) -> bool {
    let [least, most] = extent(group.iter().map(|place| place.loss));
    most - least <= EQUAL * least.abs().max(most.abs())
}

// Snedecor's F.

/// ln N, ln D and ln V of all places, each less its mean.
type Columns = [Vec<f64>; 3];

/// A plane, and the terms that make it a quadratic surface.
fn surface([n, d, v]: &Columns) -> Vec<Vec<f64>> {
    let plane = [n, d, v].map(Vec::clone);
    plane.into_iter().chain([times(n, n), times(n, d), times(d, d), times(v, v)]).collect()
}

fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// The least probability, over up to four tests, that chance lets the columns of `own` explain as much of how the losses
/// of a group differ, beyond the columns of `base`; `None` if nothing can be fitted, or losses are few.
///
/// A test is Snedecor's F of the linear columns of `own` or of all of them. It goes through the losses or, without a
/// `base`, through their ranks, which wild rows hardly move; each is taken less its mean over the group.
fn chance(
    groups: &[Group],
    base: impl Fn(&Columns) -> Vec<Vec<f64>>,
    own: impl Fn(&Columns) -> Vec<Vec<f64>>,
) -> Option<f64> {
    let all = || groups.iter().flatten();
    if all().count() < LEAST_ROWS {
        return None;
    }
    let quantities: [fn(&Place) -> f64; 3] = [|p| p.ln_size, |p| p.ln_tokens, |p| p.ln_vocab];
    let columns = quantities.map(|of| centred(all().map(|place| of(place)).collect()));
    let within = |column: Vec<f64>| {
        let mut rest = column.into_iter();
        let own = groups.iter().map(|group| rest.by_ref().take(group.len()).collect());
        own.flat_map(centred).collect::<Vec<f64>>()
    };
    let base = independent(Vec::new(), base(&columns).into_iter().map(within));
    let own: Vec<_> = own(&columns).into_iter().map(within).collect();
    let linear = own.len() / 2;
    let plane = independent(base.clone(), own[..linear].iter().cloned());
    let surface = independent(plane.clone(), own[linear..].iter().cloned());
    let mut measured = vec![within(all().map(|place| place.loss).collect())];
    if base.is_empty() {
        // Ranks of losses that follow `base` do not follow it.
        let losses = |group: &Group| group.iter().map(|place| place.loss).collect();
        measured.push(within(groups.iter().flat_map(|group| ranks(losses(group))).collect()));
    }
    let tests = measured.iter().flat_map(|y| [(&plane, y), (&surface, y)]);
    let by_chance =
        |(columns, y): (&Vec<_>, &Vec<f64>)| by_chance(columns, base.len(), y, groups.len());
    tests.filter_map(by_chance).reduce(f64::min)
}

/// The values less their mean; zero, without rounding, if they are equal.
fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let first = values[0];
    values.iter_mut().for_each(|x| *x -= first);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| x - mean).collect()
}

/// `columns` and those of `more` that do not follow from the columns before them: of one budget, ln D does from ln N.
fn independent(
    mut columns: Vec<Vec<f64>>,
    more: impl IntoIterator<Item = Vec<f64>>,
) -> Vec<Vec<f64>> {
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

/// The probability that noise alone lets the `columns` after the first `base` explain as much of `y`; of all of them
/// so many `means` were taken.
fn by_chance(columns: &[Vec<f64>], base: usize, y: &[f64], means: usize) -> Option<f64> {
    let own = columns.len().checked_sub(base).filter(|own| *own > 0)?;
    let fit = least_squares(&rows_of(columns), y)?;
    let dof = fit.dof.checked_sub(means).filter(|dof| *dof > 0)?;
    let all: f64 = y.iter().map(|y| y.powi(2)).sum();
    let before = if base == 0 { all } else { least_squares(&rows_of(&columns[..base]), y)?.rss };
    // Of an exact fit, what rounding may leave.
    let left = fit.rss.max(EQUAL * EQUAL * all) / dof as f64;
    let p = chi_square_tail((before - fit.rss).max(0.0) / left, own, dof);
    p.is_finite().then_some(p)
}

/// The share of the values below each, and half of those equal to it.
fn ranks(values: Vec<f64>) -> Vec<f64> {
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    let below = |x: f64| sorted.partition_point(|y| *y < x);
    let up_to = |x: f64| sorted.partition_point(|y| *y <= x);
    let rank = |x: f64| (below(x) + up_to(x)) as f64 / (2 * sorted.len()) as f64;
    values.into_iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::{Parameters, group_checked};
    use crate::laws::maths::stats::Normals;
    use crate::laws::parametric::tests::{chinchilla_runs, motion_runs};

    fn refusal(points: &[IsoFlopPoint]) -> String {
        losses_tell(&Place::of_runs(points))
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default()
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
    fn losses_that_rise_with_the_budget_are_doubted() {
        let runs = chinchilla_runs(5, 0.02, 4);
        let told = |runs: &[IsoFlopPoint]| rises(&Place::of_runs(runs), &Metric::new("score"));
        let scores = with(&runs, |run| 1.0 / run.loss);
        assert!(told(&scores).is_some_and(|told| told.contains("loss=1-score")));
        assert_eq!(told(&runs), None);
        assert_eq!(told(&scores[..5]), None, "one budget");
    }

    #[test]
    fn losses_of_the_budget_alone_and_noise_have_no_minima() {
        for sizes in [3, 5, 9] {
            let runs = chinchilla_runs(sizes, 0.0, 0);
            let refused = |stream: &u64| {
                let mut normals = Normals::of_stream(4, *stream);
                let of_budget = |run: &IsoFlopPoint| run.budget_flops.powf(-0.05);
                let noise = with(&runs, |run| of_budget(run) + 0.002 * normals.draw());
                let budgets = group_checked(&noise, Parameters::Total).unwrap();
                let grids: Vec<Grid> = budgets.iter().filter_map(Grid::new).collect();
                let told =
                    sizes_tell(&Place::of_cells(&grids)).err().map(|error| error.to_string());
                told.is_some_and(|told| told.contains("the losses of a budget differ"))
            };
            let refused = (0..50).filter(refused).count();
            assert!(refused >= 46, "{refused} of 50 at {sizes} sizes");
        }
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
