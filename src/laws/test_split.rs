//! How far laws hang on which clips were held out.
//!
//! All runs of a sweep are measured on the same clips, so a test split that happens to be hard moves all
//! losses together, and no seed tells. What tells is the split itself, in B blocks that have no
//! recording in common: a mean over blocks whose losses lie d_b from it has the variance
//! Σ d_b²/B(B − 1). What a block is harder by is a smooth function of the cell,
//!
//! d_b = a_b + s_b · (ln N_nv, ln V, ln C),
//!
//! with the logarithms from those of the best cell of the largest budget; what a cell's own runs scatter
//! about it is the noise of the runs. Another split has Σ z_b a_b/√(B(B − 1)) with standard normal z_b, and
//! the same of s_b. The first moves all losses, those of the runs that would test a forecast too. The second
//! moves the place of an optimum.

use super::RunNoise;
use super::cell::Cell;
use super::joint::{noise_of, valley};
use super::least_squares::least_squares;
use super::minima::Grid;
use super::random::Normals;
use super::test_noise::{TestNoise, student};

/// Fewer blocks say nothing about a standard deviation.
const FEWEST: usize = 5;
/// What the blocks of a test split are harder by.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// Where the level is that of.
    centre: [f64; 3],
    /// a_b and s_b of each block.
    effects: Vec<[f64; 4]>,
}

impl Blocks {
    /// Of some budgets, ascending; none where a cell does not know its blocks, there are few, or the cells do
    /// not tell how blocks differ over them.
    pub fn of(grids: &[&Grid], noise: Option<RunNoise>) -> Option<Self> {
        let largest = grids.last()?;
        let (best, n_blocks) = (largest.best(), largest.best().by_block.len());
        let centre = place(best, largest.budget_flops);
        let mut rows = Rows::default();
        for grid in grids {
            for cells in grid.of_all_shares() {
                let least = cells.iter().map(|cell| cell.loss).fold(f64::INFINITY, f64::min);
                for cell in cells {
                    let count = cell.runs * valley(cell.loss - least, noise_of(noise));
                    rows.add(cell, away(cell, grid.budget_flops, &centre), count.sqrt());
                }
            }
        }
        let is_known = n_blocks >= FEWEST && rows.cells.iter().all(|own| own.len() == n_blocks);
        let effects = is_known.then(|| (0..n_blocks).map(|block| rows.effect(block)).collect());
        Some(Self { centre, effects: effects.flatten()? })
    }

    /// What moves all losses together.
    pub fn noise(&self) -> TestNoise {
        let squares: f64 = self.effects.iter().map(|[level, ..]| level.powi(2)).sum();
        TestNoise { sd: squares.sqrt() * self.of_mean(), blocks: self.effects.len() }
    }

    /// What moves an optimum on another test split.
    pub fn draw(&self, normals: &mut Normals) -> OtherClips<'_> {
        let scale = student(self.effects.len() - 1, normals) * self.of_mean();
        let mut slopes = [0.0; 3];
        for [_, own @ ..] in &self.effects {
            let weight = scale * normals.next();
            slopes.iter_mut().zip(own).for_each(|(sum, own)| *sum += weight * own);
        }
        OtherClips { centre: &self.centre, slopes }
    }

    /// 1/√(B(B − 1)).
    fn of_mean(&self) -> f64 {
        let blocks = self.effects.len();
        1.0 / ((blocks * (blocks - 1)) as f64).sqrt()
    }
}

/// How cells find one test split harder than another, beside what they have in common.
pub(super) struct OtherClips<'a> {
    centre: &'a [f64; 3],
    slopes: [f64; 3],
}

impl OtherClips<'_> {
    /// What the loss of a cell of a budget moves by.
    pub fn shift(&self, cell: &Cell, budget_flops: f64) -> f64 {
        let away = away(cell, budget_flops, self.centre);
        self.slopes.iter().zip(away).map(|(slope, x)| slope * x).sum()
    }
}

fn place(cell: &Cell, budget_flops: f64) -> [f64; 3] {
    [cell.params_nonvocab.ln(), cell.n_vocab.max(1.0).ln(), budget_flops.ln()]
}

fn away(cell: &Cell, budget_flops: f64, centre: &[f64; 3]) -> [f64; 3] {
    let place = place(cell, budget_flops);
    std::array::from_fn(|i| place[i] - centre[i])
}

/// Cells with what each counts.
#[derive(Default)]
struct Rows<'a> {
    places: Vec<[f64; 3]>,
    weights: Vec<f64>,
    cells: Vec<&'a [f64]>,
}

impl<'a> Rows<'a> {
    fn add(&mut self, cell: &'a Cell, place: [f64; 3], weight: f64) {
        self.places.push(place);
        self.weights.push(weight);
        self.cells.push(&cell.by_block);
    }

    /// a_b and s_b of a block; a slope is 0 where all cells lie at one place.
    fn effect(&self, block: usize) -> Option<[f64; 4]> {
        let varies =
            |axis: &usize| self.places.iter().any(|own| own[*axis] != self.places[0][*axis]);
        let axes: Vec<usize> = (0..3).filter(varies).collect();
        let row = |(place, weight): (&[f64; 3], &f64)| {
            let terms = axes.iter().map(|axis| place[*axis]);
            [1.0].into_iter().chain(terms).map(|term| weight * term).collect()
        };
        let rows: Vec<Vec<f64>> = self.places.iter().zip(&self.weights).map(row).collect();
        let losses = self.cells.iter().zip(&self.weights).map(|(own, weight)| weight * own[block]);
        let found = least_squares(&rows, &losses.collect::<Vec<_>>())?.coefficients;
        let mut effect = [found[0], 0.0, 0.0, 0.0];
        axes.iter().zip(&found[1..]).for_each(|(axis, slope)| effect[axis + 1] = *slope);
        Some(effect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::simulated::SWEEP;
    use crate::laws::{IsoFlopPoint, RunFacts, group_budgets};

    /// A sweep whose blocks differ by what `of` says of a run, a block's draw, and a draw of its own.
    fn grids(of: impl Fn(&IsoFlopPoint, f64, f64) -> f64) -> Vec<Grid> {
        let mut normals = Normals::of_stream(3, 0);
        let blocks: Vec<f64> = (0..20).map(|_| normals.next()).collect();
        let mut known = |point: IsoFlopPoint| {
            let by_block = blocks.iter().map(|draw| of(&point, *draw, normals.next())).collect();
            IsoFlopPoint { about: RunFacts { by_block, ..RunFacts::default() }, ..point }
        };
        let points: Vec<IsoFlopPoint> = SWEEP.points().into_iter().map(&mut known).collect();
        group_budgets(&points).unwrap().iter().filter_map(Grid::new).collect()
    }

    fn blocks(grids: &[Grid]) -> Option<Blocks> {
        Blocks::of(&grids.iter().collect::<Vec<_>>(), None)
    }

    /// The deviation of what the smallest model of the smallest budget moves by on other splits.
    fn scatter(grids: &[Grid]) -> f64 {
        let (grid, blocks) = (&grids[0], blocks(grids).unwrap());
        let cell = &grid.cells[0];
        let shift = |i| blocks.draw(&mut Normals::of_stream(1, i)).shift(cell, grid.budget_flops);
        ((0..2000).map(|i| shift(i).powi(2)).sum::<f64>() / 2000.0).sqrt()
    }

    #[test]
    fn what_all_losses_have_in_common_moves_no_optimum() {
        let grids = grids(|_, draw, _| 0.4 * draw);
        let noise = blocks(&grids).unwrap().noise();
        assert!((noise.sd / (0.4 / 20f64.sqrt()) - 1.0).abs() < 0.35, "{noise:?}");
        assert!(scatter(&grids) < 1e-9);
        let moved = noise.moved(&[-3.0; 4000]);
        let squares: f64 = moved.iter().map(|loss| (loss + 3.0).powi(2)).sum();
        // Student's t of 19 degrees of freedom has a variance of 19/17.
        let expected = noise.sd * (19f64 / 17.0).sqrt();
        assert!(((squares / 4000.0).sqrt() / expected - 1.0).abs() < 0.05);
    }

    #[test]
    fn blocks_that_large_models_find_harder_move_an_optimum_and_noise_of_runs_does_not() {
        let slope = |point: &IsoFlopPoint| 0.1 * (point.params_nonvocab / 1e4).ln();
        let smooth = scatter(&grids(|point, draw, _| slope(point) * draw));
        let noisy = scatter(&grids(|point, draw, own| slope(point) * draw + 0.1 * own));
        assert!(smooth > 0.05 && (noisy / smooth - 1.0).abs() < 0.3, "{smooth}, {noisy}");
        let noise = scatter(&grids(|_, _, own| 0.1 * own));
        assert!(noise < 0.2 * smooth, "{noise}, {smooth}");
    }

    #[test]
    fn few_blocks_or_a_run_without_them_tell_nothing() {
        let points = SWEEP.points();
        let plain = group_budgets(&points).unwrap();
        assert!(blocks(&plain.iter().filter_map(Grid::new).collect::<Vec<_>>()).is_none());
        let mut known = grids(|_, draw, _| draw);
        known[0].cells[0].by_block.clear();
        assert!(blocks(&known).is_none());
    }
}
