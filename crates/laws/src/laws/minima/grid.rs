//! One budget's grid, ready for every method.

use super::minimum::{Minimum, MinimumFlag, RunNoise, raised};
use crate::laws::input::budget::Budget;
use crate::laws::input::{Cell, MinimumMethod, Size, best_index, cells, sizes};
use crate::laws::maths::stats::{distinct, extent};

/// The cells of one budget, their sizes and the best of them.
#[derive(Clone)]
pub(in crate::laws) struct Grid {
    pub budget_flops: f64,
    pub n_runs: usize,
    pub cells: Vec<Cell>,
    /// The grids of smaller shares of the data, the smallest first; only a joint law uses them.
    pub smaller: Vec<Vec<Cell>>,
    pub sizes: Vec<Size>,
    best: usize,
}

impl Grid {
    /// None for a budget without points.
    pub fn new(budget: &Budget) -> Option<Self> {
        if budget.points.is_empty() {
            return None;
        }
        let whole = Self::of_cells(budget.budget_flops, budget.points.len(), cells(&budget.points));
        let mut smaller = budget.smaller.clone();
        smaller.sort_by(|a, b| a.share().total_cmp(&b.share()));
        let of_share = smaller.chunk_by(|a, b| a.share() == b.share());
        Some(Self { smaller: of_share.map(cells).collect(), ..whole })
    }

    /// At least one cell, sorted by N_nv and then N_v.
    pub fn of_cells(budget_flops: f64, n_runs: usize, cells: Vec<Cell>) -> Self {
        let (sizes, best) = (sizes(&cells), best_index(&cells));
        Self { budget_flops, n_runs, cells, smaller: Vec::new(), sizes, best }
    }

    /// The grid with other losses, given cell by cell.
    pub fn with_losses(&self, mut loss: impl FnMut(&Cell) -> f64) -> Self {
        let (mut cells, mut smaller) = (self.cells.clone(), self.smaller.clone());
        for cell in cells.iter_mut().chain(smaller.iter_mut().flatten()) {
            cell.loss = loss(cell);
        }
        Self { smaller, ..Self::of_cells(self.budget_flops, self.n_runs, cells) }
    }

    /// The grid of a smaller share of the data; `None` without runs.
    pub fn of_share(&self, share: f64) -> Option<Self> {
        let cells = self.smaller.iter().find(|cells| cells[0].share == share)?;
        let n_runs = cells.iter().map(|cell| cell.runs).sum::<f64>().round() as usize;
        Some(Self::of_cells(self.budget_flops, n_runs, cells.clone()))
    }

    /// The cells of every share of the data, the largest share first.
    pub fn of_all_shares(&self) -> impl Iterator<Item = &[Cell]> {
        [&self.cells].into_iter().chain(&self.smaller).map(Vec::as_slice)
    }

    /// The best vocabulary of each size with N_nv + N_v as its one number of parameters; none if
    /// N_v is not known.
    pub fn with_total_size(&self) -> Option<Self> {
        let total = |size: &Size| Cell {
            params_nonvocab: size.best.params_nonvocab + size.best.params_vocab,
            params_vocab: 0.0,
            n_vocab: 0.0,
            ..size.best.clone()
        };
        let mut cells: Vec<Cell> = self.sizes.iter().map(total).collect();
        cells.sort_by(|a, b| a.params_nonvocab.total_cmp(&b.params_nonvocab));
        let grid = || Self::of_cells(self.budget_flops, self.n_runs, cells);
        self.best().has_vocabulary().then(grid)
    }

    /// Mean effective number of runs per cell.
    pub fn runs_of_a_cell(&self) -> f64 {
        self.cells.iter().map(|cell| cell.runs).sum::<f64>() / self.cells.len() as f64
    }

    pub fn best(&self) -> &Cell {
        &self.cells[self.best]
    }

    /// The flags of a minimum at `ln_nonvocab`, by the sizes on either side.
    pub fn doubts_at(&self, ln_nonvocab: f64) -> Vec<MinimumFlag> {
        let below = |size: &Size| size.best.params_nonvocab.ln() <= ln_nonvocab;
        let above = self.sizes.partition_point(below);
        match (above.checked_sub(1).map(|i| &self.sizes[i]), self.sizes.get(above)) {
            (Some(left), Some(right)) => doubts_between(left, right),
            _ => Vec::new(),
        }
    }

    /// The flags of the best run, by the neighbouring sizes.
    pub fn doubts_of_best(&self) -> Vec<MinimumFlag> {
        let own = self.best().params_nonvocab;
        let around = |pair: &&[Size]| pair.iter().any(|size| size.best.params_nonvocab == own);
        self.sizes.windows(2).filter(around).flat_map(|p| doubts_between(&p[0], &p[1])).collect()
    }

    /// The values of the best run, flagged with `reason` and with the vocabulary's edge.
    pub fn best_run(&self, method: MinimumMethod, reason: Option<MinimumFlag>) -> Minimum {
        let best = self.best();
        Minimum {
            method,
            budget_flops: self.budget_flops,
            flops: best.flops,
            params_nonvocab: best.params_nonvocab,
            params_vocab: best.params_vocab,
            n_vocab: best.n_vocab,
            tokens: best.tokens,
            loss_normalised: best.loss,
            ci95: None,
            flags: reason.into_iter().chain(self.vocab_edge()).collect(),
            trusted: false,
        }
    }

    /// The index of the best run's size.
    pub fn best_size(&self) -> usize {
        let own = self.best().params_nonvocab;
        self.sizes.partition_point(|size| size.best.params_nonvocab < own)
    }

    /// The sizes round one of them that a curve goes through: those within a factor of four of it, and
    /// as many of the next nearest as make five that differ.
    ///
    /// A loss is no parabola over decades of size: far sizes, which say nothing of the minimum, would
    /// bend the curve there.
    pub fn valley(&self, centre: usize) -> &[Size] {
        let ln = |i: usize| self.sizes[i].best.params_nonvocab.ln();
        let (mut first, mut last) = (centre, centre);
        loop {
            let below = first.checked_sub(1).map(|i| (ln(centre) - ln(i), i));
            let above =
                (last + 1 < self.sizes.len()).then(|| (ln(last + 1) - ln(centre), last + 1));
            let nearest = [below, above].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((distance, next)) = nearest else { break };
            if distance > VALLEY && apart(&self.sizes[first..=last]).count() >= FEWEST_APART {
                break;
            }
            (first, last) = (first.min(next), last.max(next));
        }
        &self.sizes[first..=last]
    }

    /// The cells of the valley round the best run, in size and in vocabulary.
    pub fn cells_of_valley(&self) -> Vec<Cell> {
        let valley = self.valley(self.best_size());
        let ends = [&valley[0], &valley[valley.len() - 1]].map(|size| size.best.params_nonvocab);
        let mut vocabularies = distinct(self.cells.iter().map(|cell| cell.n_vocab));
        let from_best = |v: &f64| (v / self.best().n_vocab).ln().abs();
        vocabularies.sort_by(|a, b| from_best(a).total_cmp(&from_best(b)));
        let near = &vocabularies[..vocabularies.len().min(FEWEST_APART)];
        let within = |cell: &&Cell| {
            (ends[0]..=ends[1]).contains(&cell.params_nonvocab) && near.contains(&cell.n_vocab)
        };
        self.cells.iter().filter(within).cloned().collect()
    }

    /// The largest depth of a minimum below the best run: three times the `noise` of a run, plus a quarter of the rise
    /// to the cells two steps away. A parabola through equal steps lies below its best cell by at most an eighth of
    /// that.
    pub fn most_below_best(&self, noise: f64) -> f64 {
        let best = self.best_size();
        let beside = best.saturating_sub(2)..(best + 3).min(self.sizes.len());
        let of_sizes = self.sizes[beside].iter().map(|size| &size.best);
        let same_size = |cell: &&Cell| cell.params_nonvocab == self.best().params_nonvocab;
        let of_vocabularies = self.cells.iter().filter(same_size);
        let rises = of_sizes.chain(of_vocabularies).map(|cell| cell.loss - self.best().loss);
        3.0 * noise / self.best().runs.sqrt() + 0.25 * rises.fold(0.0, f64::max)
    }

    pub fn best_is_outermost_size(&self) -> bool {
        [0, self.sizes.len() - 1].contains(&self.best_size())
    }

    /// The flag if the best run has the smallest or the largest of several vocabularies tried at its size. A single
    /// vocabulary has no edge.
    pub fn vocab_edge(&self) -> Vec<MinimumFlag> {
        if self.n_vocabularies() < 2 {
            return Vec::new();
        }
        let best = self.best();
        let same_size = self.cells.iter().filter(|c| c.params_nonvocab == best.params_nonvocab);
        let [low, high] = extent(same_size.map(|c| c.n_vocab));
        let at_edge = best.n_vocab <= low || best.n_vocab >= high;
        raised([(at_edge, MinimumFlag::VocabNotBracketed), (at_edge, MinimumFlag::EdgeVocab)])
    }

    pub fn n_vocabularies(&self) -> usize {
        n_vocabularies(std::slice::from_ref(self))
    }
}

/// Least half-width of a valley, in ln N.
const VALLEY: f64 = 1.386;
/// Least number of sizes, or vocabularies, in a valley, if available.
const FEWEST_APART: usize = 5;
/// Sizes closer than this in ln N count as one.
const SAME: f64 = 0.05;

/// Sizes in groups that differ by next to nothing.
pub(super) fn apart(sizes: &[Size]) -> impl Iterator<Item = &[Size]> {
    sizes.chunk_by(|a, b| (b.best.params_nonvocab / a.best.params_nonvocab).ln() < SAME)
}

/// Factor in N_nv: neighbouring sizes further apart leave a gap.
pub const WIDEST_STEP: f64 = 2.5;

fn doubts_between(left: &Size, right: &Size) -> Vec<MinimumFlag> {
    let step = right.best.params_nonvocab / left.best.params_nonvocab;
    let depths = left.best.n_layer.zip(right.best.n_layer);
    raised([
        (left.at_edge || right.at_edge, MinimumFlag::EdgeVocab),
        (step > WIDEST_STEP, MinimumFlag::Gap),
        (depths.is_some_and(|(left, right)| left != right), MinimumFlag::DepthChange),
    ])
}

/// The loss above its budget's best at which a cell has half the weight, in units of run noise.
const HALF_COUNTED: f64 = 5.0;

/// The weight of a cell that lies `above` the best of its budget: no smooth form holds everywhere, and predictions
/// need the valley.
pub(in crate::laws) fn valley(above: f64, noise: f64) -> f64 {
    1.0 / (1.0 + (above / (HALF_COUNTED * noise)).powi(2))
}

/// x in units of half its range, from −1 to 1: a polynomial's columns are then well conditioned.
#[derive(Clone, Copy)]
pub(in crate::laws) struct Scale {
    centre: f64,
    half_range: f64,
}

impl Scale {
    /// The values must not all be equal.
    pub fn over(values: impl Iterator<Item = f64>) -> Self {
        let [low, high] = extent(values);
        Self { centre: 0.5 * (low + high), half_range: 0.5 * (high - low) }
    }

    pub fn to_unit(self, x: f64) -> f64 {
        (x - self.centre) / self.half_range
    }

    pub fn value_at(self, z: f64) -> f64 {
        self.centre + self.half_range * z
    }
}

/// The number of vocabularies tried.
pub(in crate::laws) fn n_vocabularies(grids: &[Grid]) -> usize {
    distinct(grids.iter().flat_map(|grid| &grid.cells).map(|cell| cell.n_vocab)).len()
}

/// The cells that are the best of their size and have fewer runs than is usual at their budget, with it.
pub(in crate::laws) fn lost_runs<'a>(
    grids: impl Iterator<Item = &'a Grid>,
) -> Vec<(f64, &'a Cell)> {
    grids.flat_map(|grid| lost(grid).map(|cell| (grid.budget_flops, cell))).collect()
}

fn lost(grid: &Grid) -> impl Iterator<Item = &Cell> {
    let mut runs: Vec<f64> = grid.cells.iter().map(|cell| cell.runs).collect();
    runs.sort_by(f64::total_cmp);
    let usual = runs[runs.len() / 2];
    grid.sizes.iter().map(|size| &size.best).filter(move |cell| cell.runs < usual - 0.5)
}

// The unit of a loss.

/// Typical fall of the best loss of language models per factor e of the budget, in nats.
const FALL: f64 = 0.1;

/// How much of the loss is worth a nat. L_u is in nats; any other loss may be in bits, or in bits a byte, and its
/// own fall for each factor e of the budget stands for [`FALL`]. With one budget, or if the loss does not fall, the range
/// of all losses stands for two factors e.
pub(in crate::laws) fn loss_unit(grids: &[Grid]) -> f64 {
    let (Some(first), Some(last)) = (grids.first(), grids.last()) else { return 1.0 };
    if first.best().in_nats {
        return 1.0;
    }
    let distance = (last.budget_flops / first.budget_flops).ln();
    let fall = (first.best().loss - last.best().loss) / distance;
    let [low, high] = extent(grids.iter().flat_map(|grid| &grid.cells).map(|cell| cell.loss));
    let falls = [fall, (high - low) / 2.0].into_iter().find(|fall| fall.is_finite() && *fall > 0.0);
    falls.map_or(1.0, |fall| fall / FALL)
}

impl RunNoise {
    /// The standard deviation of a run of some grids; a guess if unknown.
    pub(in crate::laws) fn sd_or_guess(noise: Option<Self>, grids: &[Grid]) -> f64 {
        let known = noise.map(|noise| noise.sd).filter(|sd| *sd > 0.0);
        known.unwrap_or_else(|| Self::GUESS * loss_unit(grids))
    }
}
