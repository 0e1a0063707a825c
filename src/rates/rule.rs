//! Trials into a rule of rate, batch and schedule.

use serde::{Deserialize, Serialize};

use super::search::{Cell, best_batch, other};
use super::{CellRate, Place, Trial};
use crate::laws::least_squares;
use crate::sweep::{BatchRule, LrRule, RateParams, ScheduleKind, TrainSection};

/// What the exponents of N_nv, D and V are expected to be, with deviations (`experiments/LOG.md`).
const EXPECTED: [[f64; 2]; 3] = [[-0.4, 0.2], [0.0, 0.1], [0.0, 0.2]];
/// How far the best rate of one cell is off, in ln: half a step of the search.
const RATE_SD: f64 = 0.35;
/// A rule's `max` over the largest rate that it asks for in the cells tried.
const HEADROOM: f64 = 2.0;
/// A mean gain counts from this many of its own standard errors.
const CLEAR: f64 = 2.0;

/// A rule, and what it rests on.
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
    /// What the other schedule changes, with the standard error.
    pub schedule_gain: Option<[f64; 2]>,
}

/// The rule that the trials at some cells tell; none where fewer than two cells have a best rate.
///
/// The rate is a power of N_nv and D through the cells' best rates, drawn towards what is expected by as
/// much as few cells leave open. Another batch, or schedule, is taken where it is clearly better over all
/// cells; a rate goes with the root of the batch (Malladi et al. 2022).
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

/// How ln lr goes with ln V beside the other two, and the standard error.
fn vocab_exponent(cells: &[CellRate]) -> Option<[f64; 2]> {
    let row = |place: &Place| {
        let [n, d] = [place.params_nonvocab.ln(), place.tokens.ln()];
        vec![1.0, n, d, place.n_vocab.max(1.0).ln()]
    };
    let fit = expected_fit(cells, row)?;
    Some([fit.coefficients[3], fit.unit_error(&[0.0, 0.0, 0.0, 1.0])])
}

/// Least squares of ln lr in units of its deviation, with a row for what is expected of each exponent.
fn expected_fit(
    cells: &[CellRate],
    row: impl Fn(&Place) -> Vec<f64>,
) -> Option<crate::laws::LeastSquares> {
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
