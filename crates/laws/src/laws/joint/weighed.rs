//! The cells that a joint law is fitted to, and what each counts.

use super::loss::{Place, Terms};
use crate::laws::input::cell::{Cell, best_index};
use crate::laws::maths::stats::distinct;
use crate::laws::minima::grid::Grid;

/// Cells beyond the coefficients, at least.
const SPARE: usize = 4;
/// Sizes, and losses, that tell a term of the size.
const FEWEST_SIZES: usize = 3;
/// Vocabularies that κe, κa and κb need.
const SATURATING_LEVELS: usize = 4;
/// Passes over the data from which a run repeats it.
const REPEATED: f64 = 1.5;

/// Whether runs repeat their data, so that a joint law has a term of repetition.
pub(in crate::laws) fn repeat(grids: &[Grid]) -> bool {
    let cells = grids.iter().flat_map(Grid::of_all_shares).flatten();
    cells.filter_map(Cell::epochs).any(|epochs| epochs > REPEATED)
}

/// How far above its budget's best a cell counts a half, in units of the noise of a run.
const VALLEY: f64 = 5.0;

/// How much a cell counts that lies `above` the best of its budget: no smooth form holds everywhere,
/// and a law is asked of the valley.
pub(in crate::laws) fn valley(above: f64, noise: f64) -> f64 {
    1.0 / (1.0 + (above / (VALLEY * noise)).powi(2))
}

/// The cells of all budgets and shares.
pub(super) struct Cells<'a> {
    pub all: Vec<&'a Cell>,
    /// How far each lies above the best of its budget and share, in nats.
    above: Vec<f64>,
}

impl<'a> Cells<'a> {
    pub fn new(grids: &'a [Grid]) -> Self {
        let slices = || grids.iter().flat_map(Grid::of_all_shares);
        let above = |cells: &'a [Cell]| {
            let best = cells[best_index(cells)].loss;
            cells.iter().map(move |cell| cell.loss - best)
        };
        Self { all: slices().flatten().collect(), above: slices().flat_map(above).collect() }
    }

    /// The terms that the cells can tell; none where even the fewest are too many, and where a term of
    /// repetition is asked for and no cell knows its distinct tokens.
    ///
    /// Cells that do not repeat their data leave R at what is expected of it.
    pub fn terms(&self, repeats: bool) -> Option<Terms> {
        let levels = distinct(self.all.iter().map(|cell| cell.n_vocab)).len();
        let sizes = distinct(self.all.iter().map(|cell| cell.params_nonvocab)).len();
        let losses = distinct(self.all.iter().map(|cell| cell.loss)).len();
        if sizes < FEWEST_SIZES || losses < FEWEST_SIZES {
            return None;
        }
        if repeats && self.all.iter().all(|cell| cell.unique_tokens.is_none()) {
            return None;
        }
        let wanted = [levels >= SATURATING_LEVELS, false].map(|saturating| Terms {
            vocab: levels > 1,
            saturating,
            crossed: saturating,
            repeats,
        });
        wanted.into_iter().find(|terms| self.all.len() >= terms.count() + SPARE)
    }

    /// The root of what each cell counts, one cell on average.
    pub fn weights(&self, noise: f64) -> Vec<f64> {
        let pairs = self.all.iter().zip(&self.above);
        let counts: Vec<f64> =
            pairs.map(|(cell, above)| cell.runs * valley(*above, noise)).collect();
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        counts.iter().map(|count| (count / mean).sqrt()).collect()
    }

    pub fn centre(&self) -> [f64; 3] {
        let mean = |of: &dyn Fn(&Cell) -> f64| {
            self.all.iter().map(|cell| of(cell)).sum::<f64>() / self.all.len() as f64
        };
        let of = |cell: &Cell| place(cell);
        [mean(&|c| of(c).ln_size), mean(&|c| of(c).ln_vocab), mean(&|c| of(c).ln_tokens)]
    }
}

pub(super) fn place(cell: &Cell) -> Place {
    Place::new([cell.params_nonvocab, cell.n_vocab, cell.tokens], cell.unique_tokens)
}
