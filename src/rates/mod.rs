//! Finds the rule of learning rate and batch by trials at a few cells of a grid.
//!
//! `cells → trials → the next trials → … → a rule`: each step is a function of finished trials, so an interrupted
//! search resumes from its records.
//!
//! | step | file |
//! | --- | --- |
//! | the choice of cells | this one |
//! | settings of rate, batch and schedule, their results, and the next settings | `search` |
//! | the best rate of each cell, and the rule | `rule` |
//!
//! # Example
//!
//! ```
//! use isoflop::rates::{Place, choose};
//!
//! // The cells that determine best how the rate depends on N, V and D.
//! let cells: Vec<Place> = [1e3, 2e3, 4e3, 8e3, 1.6e4]
//!     .into_iter()
//!     .flat_map(|params_nonvocab| [1e9, 4e9, 1.6e10].map(|budget_flops| (params_nonvocab, budget_flops)))
//!     .map(|(params_nonvocab, budget_flops)| Place {
//!         budget_flops,
//!         params_nonvocab,
//!         n_vocab: 256.0,
//!         tokens: budget_flops / (6.0 * params_nonvocab),
//!         lr: 1e-3,
//!     })
//!     .collect();
//! assert!(choose(&cells, 4).len() <= 4);
//! ```

mod rule;
mod search;

pub use rule::{CellRate, Rule, fit_rule};
pub use search::{Place, Setting, Trial, next};

/// The middle fraction of a budget's sizes, and of its vocabularies: the optimum is expected there, and rates far from
/// it do not matter.
const MIDDLE: [f64; 2] = [0.15, 0.85];
/// Added to the diagonal of the information, so that the first cells are chosen by it too.
const RIDGE: f64 = 0.1;

/// The indices of at most `count` cells that together determine best how the rate depends on N_nv, V and D (the
/// largest determinant of the information, cell by cell).
pub fn choose(cells: &[Place], count: usize) -> Vec<usize> {
    let mut open: Vec<usize> = (0..cells.len()).filter(|i| is_central(cells, *i)).collect();
    let rows = standardised(cells);
    let mut information = [[0.0; 4]; 4];
    (0..4).for_each(|i| information[i][i] = RIDGE);
    let mut chosen = Vec::new();
    while chosen.len() < count && !open.is_empty() {
        let gain = |i: usize| determinant(with(&information, &rows[i]));
        let best = (0..open.len()).max_by(|a, b| gain(open[*a]).total_cmp(&gain(open[*b])));
        let next = open.swap_remove(best.unwrap_or(0));
        information = with(&information, &rows[next]);
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}

/// Whether a cell lies in the middle of its budget's sizes and vocabularies.
fn is_central(cells: &[Place], index: usize) -> bool {
    let cell = &cells[index];
    let beside = || cells.iter().filter(|other| other.budget_flops == cell.budget_flops);
    let within = |of: fn(&Place) -> f64| {
        let mut levels: Vec<f64> = beside().map(of).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let at = levels.iter().position(|level| *level == of(cell)).unwrap_or(0);
        let last = levels.len().saturating_sub(1).max(1);
        let share = at as f64 / last as f64;
        levels.len() < 3 || (MIDDLE[0]..=MIDDLE[1]).contains(&share)
    };
    within(|place| place.params_nonvocab) && within(|place| place.n_vocab)
}

/// 1, ln N_nv, ln V and ln D of each cell, the last three of mean 0 and deviation 1.
fn standardised(cells: &[Place]) -> Vec<[f64; 4]> {
    let columns: [fn(&Place) -> f64; 3] =
        [|p| p.params_nonvocab.ln(), |p| p.n_vocab.max(1.0).ln(), |p| p.tokens.ln()];
    let n = cells.len().max(1) as f64;
    let scales = columns.map(|of| {
        let mean = cells.iter().map(of).sum::<f64>() / n;
        let variance = cells.iter().map(|cell| (of(cell) - mean).powi(2)).sum::<f64>() / n;
        (mean, variance.sqrt().max(1e-9))
    });
    let row = |cell: &Place| {
        let at = |j: usize| (columns[j](cell) - scales[j].0) / scales[j].1;
        [1.0, at(0), at(1), at(2)]
    };
    cells.iter().map(row).collect()
}

fn with(information: &[[f64; 4]; 4], row: &[f64; 4]) -> [[f64; 4]; 4] {
    let mut sum = *information;
    for (i, x) in row.iter().enumerate() {
        row.iter().enumerate().for_each(|(j, y)| sum[i][j] += x * y);
    }
    sum
}

/// The determinant of a positive definite matrix, by elimination.
fn determinant(mut m: [[f64; 4]; 4]) -> f64 {
    let mut product = 1.0;
    for i in 0..4 {
        product *= m[i][i];
        let pivot = m[i];
        for row in m.iter_mut().skip(i + 1) {
            let share = row[i] / pivot[i];
            row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= share * p);
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::{ScheduleKind, ScheduleSection, TrainSection};

    fn cosine() -> TrainSection {
        let schedule = ScheduleSection { kind: ScheduleKind::Cosine, ..ScheduleSection::default() };
        TrainSection { schedule, ..TrainSection::default() }
    }

    /// Losses with a known best rate: 3 N^−0.5 D^0, and a best batch of half the sweep's own.
    fn truth(place: &Place, setting: Setting) -> f64 {
        let lr = place.lr * 2f64.powf(f64::from(setting.rate) / 2.0);
        let batch = 2f64.powi(setting.batch);
        let best = 3.0 * place.params_nonvocab.powf(-0.5) * batch.sqrt();
        let schedule = if setting.schedule == ScheduleKind::Wsd { -0.1 } else { 0.0 };
        let off_batch = (batch / 0.5).ln();
        -3.0 + 0.2 * (lr / best).ln().powi(2) + 0.02 * off_batch.powi(2) + schedule
    }

    fn places() -> Vec<Place> {
        let sizes = [2e3, 8e3, 3.2e4];
        let of = |(i, size): (usize, f64)| {
            [64.0, 1024.0].map(|n_vocab| Place {
                budget_flops: 1e10,
                params_nonvocab: size,
                n_vocab,
                tokens: 1e5 * (1.0 + i as f64),
                lr: 0.5 * size.powf(-0.4),
            })
        };
        sizes.into_iter().enumerate().flat_map(of).collect()
    }

    /// Every trial until the search is over; `at` gives the loss.
    fn searched(places: &[Place], at: impl Fn(&Place, Setting) -> Option<f64>) -> Vec<Trial> {
        let mut trials = Vec::new();
        for _ in 0..30 {
            let asked = next(places.len(), ScheduleKind::Cosine, &trials);
            if asked.is_empty() {
                return trials;
            }
            trials.extend(asked.into_iter().map(|(cell, setting)| Trial {
                cell,
                setting,
                loss: at(&places[cell], setting),
            }));
        }
        panic!("the search does not end");
    }

    #[test]
    fn a_known_rule_is_found() {
        let (places, train) = (places(), cosine());
        let trials = searched(&places, |place, setting| Some(truth(place, setting)));
        let rule = fit_rule(&places, &train, &trials).unwrap();
        assert_eq!((rule.batch_doublings, rule.schedule), (-1, ScheduleKind::Wsd));
        assert!((rule.batch.coefficient / train.batch.coefficient - 0.5).abs() < 1e-12);
        for place in &places {
            let by_rule = rule.lr.coefficient
                * place.params_nonvocab.powf(rule.lr.params_exponent)
                * place.tokens.powf(rule.lr.tokens_exponent);
            let best = 3.0 * place.params_nonvocab.powf(-0.5) * 0.5f64.sqrt();
            assert!((by_rule / best).ln().abs() < 0.12, "{by_rule} for {best}");
        }
        let [exponent, error] = rule.vocab_exponent;
        assert!(exponent.abs() < 0.01 && error > 0.0 && error < 0.2, "{exponent} ± {error}");
        assert!(rule.regret.unwrap() < 0.003 && rule.regret_own.unwrap() > 0.01, "{rule:?}");
    }

    #[test]
    fn every_best_rate_lies_between_worse_ones() {
        let places = places();
        let trials = searched(&places, |place, setting| Some(truth(place, setting)));
        for cell in 0..places.len() {
            let own = |t: &&Trial| {
                t.cell == cell && t.setting.batch == 0 && t.setting.schedule == ScheduleKind::Cosine
            };
            let rates: Vec<&Trial> = trials.iter().filter(own).collect();
            let best = rates.iter().min_by(|a, b| a.height().total_cmp(&b.height())).unwrap();
            let has = |rate: i32| rates.iter().any(|trial| trial.setting.rate == rate);
            assert!(has(best.setting.rate - 2) && has(best.setting.rate + 2), "{rates:?}");
        }
    }

    #[test]
    fn rates_that_diverge_are_kept_away_from() {
        let places = places();
        let at = |place: &Place, setting: Setting| {
            let lr = place.lr * 2f64.powf(f64::from(setting.rate) / 2.0);
            // The loss falls up to the rate at which a run diverges.
            (lr < 1.2 * place.lr).then(|| -3.0 - 0.1 * lr.ln())
        };
        let trials = searched(&places, at);
        let rule = fit_rule(&places, &cosine(), &trials).unwrap();
        assert!(rule.cells.iter().all(|cell| cell.optimal_lr < cell.best_lr), "{:?}", rule.cells);
        assert_eq!(rule.regret, None, "no parabola has a bottom there");
        let nowhere = searched(&places, |_, _| None);
        assert_eq!(fit_rule(&places, &cosine(), &nowhere), None);
    }

    #[test]
    fn cells_in_the_middle_that_differ_are_chosen() {
        let sizes = (0..7).map(|i| 1e3 * 2f64.powi(i));
        let of = |size: f64| {
            [16.0, 64.0, 256.0, 1024.0, 4096.0].map(|n_vocab| Place {
                budget_flops: 1e10,
                params_nonvocab: size,
                n_vocab,
                tokens: 1e10 / (size + 8.0 * n_vocab),
                lr: 0.01,
            })
        };
        let places: Vec<Place> = sizes.flat_map(of).collect();
        let chosen = choose(&places, 5);
        assert_eq!(chosen.len(), 5);
        for place in chosen.iter().map(|i| places[*i]) {
            assert!(place.n_vocab > 16.0 && place.n_vocab < 4096.0, "{place:?}");
            assert!(place.params_nonvocab > 1e3 && place.params_nonvocab < 6.4e4, "{place:?}");
        }
        let spread = |of: fn(&Place) -> f64| {
            let values = || chosen.iter().map(|i| of(&places[*i]));
            values().fold(0.0, f64::max) / values().fold(f64::MAX, f64::min)
        };
        assert!(spread(|p| p.n_vocab) >= 16.0 && spread(|p| p.params_nonvocab) >= 8.0);
        assert_eq!(choose(&places[..1], 5), [0]);
    }
}
