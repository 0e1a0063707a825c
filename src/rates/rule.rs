//! Fits the best rate of each cell, and the rule of rate, batch and schedule.

use serde::{Deserialize, Serialize};

use super::search::{Cell, Place, Trial, best_batch, other, rate_factor};
use crate::laws::{LeastSquares, least_squares};
use crate::sweep::{BatchRule, LrRule, RateParams, ScheduleKind, TrainSection};

/// The best rate of a cell by its trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRate {
    #[serde(flatten)]
    pub place: Place,
    /// The best rate that was tried, and L_u there.
    pub best_lr: f64,
    pub best_loss: f64,
    /// The rate at the bottom of the parabola in ln lr through it and the rates on both sides.
    pub optimal_lr: f64,
    /// Nats lost by a factor e from it; `None` if a neighbouring rate diverged.
    pub nats_per_ln2: Option<f64>,
    /// L_u at the sweep's own rate.
    pub own_loss: Option<f64>,
    /// Trials at the sweep's own batch and schedule.
    pub trials: usize,
}

impl CellRate {
    /// The rates tried, as ascending factors of √2, with their losses; `None` if all diverged.
    fn of(place: Place, rates: &[(i32, f64)]) -> Option<Self> {
        let lr = |rate: i32| place.lr * rate_factor(rate);
        let tried: Vec<(f64, f64)> = rates.iter().map(|(rate, loss)| (lr(*rate), *loss)).collect();
        let best = (0..tried.len()).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))?;
        let (best_lr, best_loss) = tried[best];
        let beside = |i: Option<usize>| i.and_then(|i| tried.get(i)).copied();
        let (optimal_lr, nats_per_ln2) =
            vertex(beside(best.checked_sub(1)), tried[best], beside(best.checked_add(1)));
        let own = rates.iter().find(|(rate, _)| *rate == 0).map(|(_, loss)| *loss);
        best_loss.is_finite().then_some(Self {
            place,
            best_lr,
            best_loss,
            optimal_lr,
            nats_per_ln2,
            own_loss: own.filter(|loss| loss.is_finite()),
            trials: tried.len(),
        })
    }

    /// The loss above the cell's best at another rate, in nats, by its parabola.
    pub fn regret(&self, lr: f64) -> Option<f64> {
        Some(self.nats_per_ln2? * (lr / self.optimal_lr).ln().powi(2))
    }
}

/// The rate at the bottom of a parabola in ln rate, and its leading coefficient.
///
/// Beside a rate that diverged, or was not tried, the bottom is put half a step towards the other side.
fn vertex(
    below: Option<(f64, f64)>,
    best: (f64, f64),
    above: Option<(f64, f64)>,
) -> (f64, Option<f64>) {
    let finite = |point: Option<(f64, f64)>| point.filter(|(_, loss)| loss.is_finite());
    let ln = |lr: f64| (lr / best.0).ln();
    match (finite(below), finite(above)) {
        (Some((low, left)), Some((high, right))) => {
            let (a, b) = (ln(low), ln(high));
            let (rise_a, rise_b) = ((left - best.1) / a, (right - best.1) / b);
            let curvature = (rise_b - rise_a) / (b - a);
            if curvature <= 0.0 {
                return (best.0, None);
            }
            let slope = rise_a - curvature * a;
            let at = (-slope / (2.0 * curvature)).clamp(a, b);
            (best.0 * at.exp(), Some(curvature))
        }
        (Some((low, _)), None) if above.is_some() => (best.0 * (ln(low) / 4.0).exp(), None),
        _ => (best.0, None),
    }
}

/// The priors of the exponents of N_nv, D and V, with standard deviations (`experiments/LOG.md`).
const EXPECTED: [[f64; 2]; 3] = [[-0.4, 0.2], [0.0, 0.1], [0.0, 0.2]];
/// The error of a cell's best rate, in ln: half a step of the search.
const RATE_SD: f64 = 0.35;
/// A rule's `max` over the largest rate that it asks for in the cells tried.
const HEADROOM: f64 = 2.0;
/// Standard errors from which a mean gain counts.
const CLEAR: f64 = 2.0;

/// A rule, and its evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rule {
    pub lr: LrRule,
    pub batch: BatchRule,
    pub schedule: ScheduleKind,
    pub cells: Vec<CellRate>,
    /// How the best rate goes with V at one N_nv and D, and the standard error: the rule has no such
    /// term.
    pub vocab_exponent: [f64; 2],
    /// Mean nats above each cell's own best: of the rule, of the rule of the other cells, and of the
    /// sweep's own rule.
    pub regret: Option<f64>,
    pub regret_left_out: Option<f64>,
    pub regret_own: Option<f64>,
    /// The best batch as factors of 2 of the sweep's own, and its mean gain with the standard error.
    pub batch_doublings: i32,
    pub batch_gain: Option<[f64; 2]>,
    /// The effect of the other schedule, with its standard error.
    pub schedule_gain: Option<[f64; 2]>,
}

/// The rule from the trials at some cells; `None` if fewer than two cells have a best rate.
///
/// The rate is a power law of N_nv and D through the cells' best rates, shrunk towards the priors. Another batch, or
/// schedule, is chosen if it is clearly better over all cells; a rate scales with the root of the batch (Malladi et
/// al. 2022).
pub fn fit_rule(places: &[Place], train: &TrainSection, trials: &[Trial]) -> Option<Rule> {
    let own = train.schedule.kind;
    let searched = Cell::all(places.len(), own, trials);
    let of = |(place, cell): (&Place, &Cell)| CellRate::of(*place, &cell.rates());
    let cells: Vec<CellRate> = places.iter().zip(&searched).filter_map(of).collect();
    let line = Line::through(&cells)?;
    let best = best_batch(&searched);
    let gains = |of: &dyn Fn(&Cell) -> Option<f64>| mean_of(searched.iter().filter_map(of));
    let batch_gain = gains(&|cell| cell.gain_of_batch(best)).filter(|_| best != 0);
    let schedule_gain = gains(&|cell| cell.gain_of_schedule(best));
    let batch_doublings = if is_clear(batch_gain) { best } else { 0 };
    let regret = |of: &dyn Fn(&CellRate) -> Option<f64>| {
        let regrets = cells.iter().filter_map(|cell| cell.regret(of(cell)?));
        mean_of(regrets).map(|[mean, _]| mean)
    };
    let coefficient = train.batch.coefficient * 2f64.powi(batch_doublings);
    Some(Rule {
        lr: line.rule(&cells, 2f64.powf(f64::from(batch_doublings) / 2.0)),
        batch: BatchRule { coefficient, ..train.batch.clone() },
        schedule: if is_clear(schedule_gain) { other(own) } else { own },
        vocab_exponent: vocab_exponent(&cells)?,
        regret: regret(&|cell| Some(line.at(&cell.place))),
        regret_left_out: regret(&|cell| Some(Line::without(&cells, cell)?.at(&cell.place))),
        regret_own: regret(&|cell| Some(cell.place.lr)),
        batch_doublings: best,
        batch_gain,
        schedule_gain,
        cells,
    })
}

/// Mean and standard error; none of fewer than two.
fn mean_of(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (values.len() > 1).then(|| [mean, (variance / n).sqrt()])
}

fn is_clear(gain: Option<[f64; 2]>) -> bool {
    gain.is_some_and(|[mean, error]| mean < -CLEAR * error)
}

/// ln lr = `ln_coefficient` + `params` ln N_nv + `tokens` ln D.
struct Line {
    ln_coefficient: f64,
    params: f64,
    tokens: f64,
}

impl Line {
    fn through(cells: &[CellRate]) -> Option<Self> {
        let row = |place: &Place| vec![1.0, place.params_nonvocab.ln(), place.tokens.ln()];
        let c = expected_fit(cells, row)?.coefficients;
        Some(Self { ln_coefficient: c[0], params: c[1], tokens: c[2] })
    }

    fn without(cells: &[CellRate], left_out: &CellRate) -> Option<Self> {
        let others: Vec<CellRate> =
            cells.iter().filter(|cell| *cell != left_out).copied().collect();
        Self::through(&others)
    }

    fn at(&self, place: &Place) -> f64 {
        let Self { ln_coefficient, params, tokens } = *self;
        (ln_coefficient + params * place.params_nonvocab.ln() + tokens * place.tokens.ln()).exp()
    }

    /// The rule of a sweep, its rates multiplied by `scale`.
    fn rule(&self, cells: &[CellRate], scale: f64) -> LrRule {
        let largest = cells.iter().map(|cell| self.at(&cell.place)).fold(0.0, f64::max);
        LrRule {
            coefficient: rounded(scale * self.ln_coefficient.exp()),
            params: RateParams::Nonvocab,
            params_exponent: rounded(self.params),
            tokens_exponent: rounded(self.tokens),
            max: rounded(HEADROOM * scale * largest),
        }
    }
}

/// To three digits, as a person would write it.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().expect("a number that was printed")
}

/// The slope of ln lr in ln V, with the other two, and its standard error.
fn vocab_exponent(cells: &[CellRate]) -> Option<[f64; 2]> {
    let row = |place: &Place| {
        let [n, d] = [place.params_nonvocab.ln(), place.tokens.ln()];
        vec![1.0, n, d, place.n_vocab.max(1.0).ln()]
    };
    let fit = expected_fit(cells, row)?;
    Some([fit.coefficients[3], fit.unit_error(&[0.0, 0.0, 0.0, 1.0])])
}

/// Least squares of ln lr in units of its standard deviation, with a row for the prior of each exponent.
fn expected_fit(cells: &[CellRate], row: impl Fn(&Place) -> Vec<f64>) -> Option<LeastSquares> {
    if cells.len() < 2 {
        return None;
    }
    let scaled = |cell: &CellRate| row(&cell.place).iter().map(|x| x / RATE_SD).collect();
    let mut rows: Vec<Vec<f64>> = cells.iter().map(scaled).collect();
    let mut y: Vec<f64> = cells.iter().map(|cell| cell.optimal_lr.ln() / RATE_SD).collect();
    let p = rows[0].len();
    for (j, [mean, sd]) in (1..p).zip(EXPECTED) {
        let mut row = vec![0.0; p];
        row[j] = 1.0 / sd;
        rows.push(row);
        y.push(mean / sd);
    }
    least_squares(&rows, &y)
}
