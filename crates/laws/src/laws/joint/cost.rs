//! What a token costs a model, and how wide a model is, read off the cells.

use serde::{Deserialize, Serialize};

use crate::laws::input::cell::Cell;
use crate::laws::maths::least_squares::least_squares;
use crate::laws::maths::stats::extent;

/// FLOPs of a trained token and the width, as functions of N_nv.
///
/// C/D = `per_param` N_nv + `per_root` √N_nv + `per_vocab` N_v. Under `6nd` it is exact; under the
/// other rules it is where all models have one depth, whose attention costs a multiple of the width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::laws) struct Cost {
    per_param: f64,
    per_root: f64,
    per_vocab: f64,
    /// ln d = `ln_width` + `width_exponent` ln N_nv; none where V is not known.
    width: Option<[f64; 2]>,
    /// The sizes and the vocabularies that were tried.
    pub sizes: [f64; 2],
    pub vocabularies: [f64; 2],
}

impl Cost {
    /// Through some cells; none where they do not tell the cost.
    pub fn of(cells: &[&Cell]) -> Option<Self> {
        let has_vocab = cells.iter().all(|cell| cell.has_vocabulary());
        let [per_param, per_root, per_vocab] = per_token(cells, has_vocab)?;
        let range = |of: fn(&Cell) -> f64| extent(cells.iter().map(|cell| of(cell)));
        Some(Self {
            per_param,
            per_root,
            per_vocab,
            width: if has_vocab { Some(width(cells)?) } else { None },
            sizes: range(|cell| cell.params_nonvocab),
            vocabularies: range(|cell| cell.n_vocab),
        })
    }

    /// N_v of a model of N_nv parameters with V codes.
    pub fn params_vocab(&self, params_nonvocab: f64, n_vocab: f64) -> f64 {
        let width = |[a, b]: [f64; 2]| (a + b * params_nonvocab.ln()).exp();
        self.width.map_or(0.0, |line| n_vocab * width(line))
    }

    /// D that `budget` buys.
    pub fn tokens(&self, budget: f64, params_nonvocab: f64, params_vocab: f64) -> f64 {
        let of_model = self.per_param * params_nonvocab + self.per_root * params_nonvocab.sqrt();
        budget / (of_model + self.per_vocab * params_vocab)
    }
}

/// The three prices of least relative error, none of them below zero.
fn per_token(cells: &[&Cell], has_vocab: bool) -> Option<[f64; 3]> {
    let columns =
        |cell: &Cell| [cell.params_nonvocab, cell.params_nonvocab.sqrt(), cell.params_vocab];
    let sets: &[&[usize]] =
        if has_vocab { &[&[0, 1, 2], &[0, 2], &[1, 2], &[0]] } else { &[&[0, 1], &[0], &[1]] };
    sets.iter().find_map(|set| {
        let price = |cell: &Cell| cell.flops / cell.tokens;
        let row = |cell: &&Cell| set.iter().map(|i| columns(cell)[*i] / price(cell)).collect();
        let rows: Vec<Vec<f64>> = cells.iter().map(row).collect();
        let fit = least_squares(&rows, &vec![1.0; rows.len()])?;
        let mut prices = [0.0; 3];
        set.iter().zip(&fit.coefficients).for_each(|(i, price)| prices[*i] = *price);
        prices.iter().all(|price| *price >= 0.0).then_some(prices)
    })
}

/// The line of ln d in ln N_nv; a level line where one size was tried.
fn width(cells: &[&Cell]) -> Option<[f64; 2]> {
    let widths: Vec<f64> = cells.iter().map(|cell| cell.ln_width()).collect();
    let rows: Vec<Vec<f64>> =
        cells.iter().map(|cell| vec![1.0, cell.params_nonvocab.ln()]).collect();
    let level = || least_squares(&vec![vec![1.0]; widths.len()], &widths);
    let line = least_squares(&rows, &widths).or_else(level)?.coefficients;
    Some([line[0], line.get(1).copied().unwrap_or(0.0)])
}
