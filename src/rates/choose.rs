//! The cells of a grid that tell most of a rule.

use super::Place;

/// The share of a budget's sizes, and of its vocabularies, in the middle: an optimum is expected there,
/// and the rate of a cell far from it is nobody's concern.
const MIDDLE: [f64; 2] = [0.15, 0.85];
/// Added to the diagonal of the information, so that the first cells are chosen by it too.
const RIDGE: f64 = 0.1;

/// At most `count` of some cells, by their indices: those that together tell most of how a rate goes
/// with N_nv, V and D (the largest determinant of the information, cell by cell).
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

/// Of a positive definite matrix, by elimination.
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
