//! How far losses hang on which clips were held out.
//!
//! All runs of a sweep are measured on the same clips, so a test split that happens to be hard moves all
//! losses together, and no seed tells. What tells is the split itself, in B blocks that have no
//! recording in common: a mean over blocks whose losses differ by d_b from it has the variance
//! Σ d_b²/B(B − 1). A replicate moves every cell by Σ d_b z_b/√(B(B − 1)) of its own d_b, with one standard
//! normal z_b for each block: cells that find the same blocks hard move together.

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use super::minima::Grid;
use super::random::Normals;

/// Fewer blocks say nothing about a standard deviation.
const FEWEST: usize = 5;

/// The scatter of a loss over test splits like the one that runs were measured on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestNoise {
    /// Standard deviation of the loss of the best cell of the largest budget, in nats.
    pub sd: f64,
    /// Parts of the test split that have no recording in common.
    pub blocks: usize,
}

impl TestNoise {
    /// Of some budgets, ascending; none where a cell does not know its blocks, or there are few.
    pub(super) fn of(grids: &[&Grid]) -> Option<Self> {
        let best = grids.last()?.best();
        let blocks = best.by_block.len();
        let cells = grids.iter().flat_map(|grid| grid.of_all_shares()).flatten();
        let is_known = cells.into_iter().all(|cell| cell.by_block.len() == blocks);
        let squares: f64 = best.by_block.iter().map(|own| own.powi(2)).sum();
        let known = is_known && blocks >= FEWEST;
        known.then(|| Self { sd: squares.sqrt() * of_mean(blocks), blocks })
    }

    /// Another test split of this kind.
    pub(super) fn draw(&self, normals: &mut Normals) -> OtherClips {
        let dof = self.blocks - 1;
        let scale = (dof as f64 / normals.chi_square(dof)).sqrt() * of_mean(self.blocks);
        OtherClips((0..self.blocks).map(|_| scale * normals.next()).collect())
    }
}

/// 1/√(B(B − 1)).
fn of_mean(blocks: usize) -> f64 {
    1.0 / ((blocks * (blocks - 1)) as f64).sqrt()
}

/// By how much each block counts more than in the test split that runs were measured on.
pub(super) struct OtherClips(Vec<f64>);

impl OtherClips {
    /// What a cell's loss moves by.
    pub fn shift(&self, cell: &Cell) -> f64 {
        self.0.iter().zip(&cell.by_block).map(|(weight, own)| weight * own).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::simulated::SWEEP;
    use crate::laws::{IsoFlopPoint, RunFacts, group_budgets};

    /// A sweep whose blocks differ by what `of` says of a run, a block and a draw.
    fn grids(of: impl Fn(&IsoFlopPoint, f64) -> f64) -> Vec<Grid> {
        let mut normals = Normals::of_stream(3, 0);
        let blocks: Vec<f64> = (0..20).map(|_| normals.next()).collect();
        let points: Vec<IsoFlopPoint> = SWEEP
            .points()
            .into_iter()
            .map(|point| {
                let by_block = blocks.iter().map(|draw| of(&point, *draw)).collect();
                IsoFlopPoint { about: RunFacts { by_block, ..RunFacts::default() }, ..point }
            })
            .collect();
        group_budgets(&points).unwrap().iter().filter_map(Grid::new).collect()
    }

    fn noise(grids: &[Grid]) -> Option<TestNoise> {
        TestNoise::of(&grids.iter().collect::<Vec<_>>())
    }

    #[test]
    fn replicates_scatter_as_the_mean_of_the_blocks_does() {
        let grids = grids(|_, draw| 0.4 * draw);
        let noise = noise(&grids).unwrap();
        assert!((noise.sd / (0.4 / 20f64.sqrt()) - 1.0).abs() < 0.35, "{noise:?}");
        let cell = grids[0].best();
        let shift = |i| noise.draw(&mut Normals::of_stream(1, i)).shift(cell);
        let squares: f64 = (0..4000).map(|i| shift(i).powi(2)).sum();
        // Student's t of 19 degrees of freedom has a variance of 19/17.
        let expected = noise.sd * (19f64 / 17.0).sqrt();
        assert!(((squares / 4000.0).sqrt() / expected - 1.0).abs() < 0.05);
    }

    #[test]
    fn cells_that_find_the_same_blocks_hard_move_together() {
        let grids =
            grids(|point, draw| 0.4 * draw + if point.n_vocab > 2e3 { 0.1 * draw } else { 0.0 });
        let clips = noise(&grids).unwrap().draw(&mut Normals::of_stream(1, 0));
        let shifts: Vec<f64> = grids[0].cells.iter().map(|cell| clips.shift(cell)).collect();
        let least = shifts.iter().copied().map(f64::abs).fold(f64::INFINITY, f64::min);
        assert!(shifts.iter().all(|own| (own.abs() / least - 1.0).abs() < 0.3), "{shifts:?}");
    }

    #[test]
    fn few_blocks_or_a_run_without_them_tell_nothing() {
        assert_eq!(
            noise(
                &group_budgets(&SWEEP.points())
                    .unwrap()
                    .iter()
                    .filter_map(Grid::new)
                    .collect::<Vec<_>>()
            ),
            None
        );
        let mut known = grids(|_, draw| draw);
        known[0].cells[0].by_block.clear();
        assert_eq!(noise(&known), None);
    }
}
