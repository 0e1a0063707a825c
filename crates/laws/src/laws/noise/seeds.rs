//! The noise of a run by the seeds of its cell.

use crate::laws::input::cell::Cell;
use crate::laws::maths::stats::chi_square_tail;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::{NoiseSource, RunNoise};

/// Seeds are preferred to the surface from this many degrees of freedom on; with fewer, whichever
/// has more. So many are asked of several tokenizers too.
pub(super) const ENOUGH: usize = 10;
/// The chance below which cells far from the minimum count as noisier than those near it.
const MORE_NOISE: f64 = 0.01;

/// All cells where they scatter alike, the better half of each budget's where the others scatter more.
pub(super) fn of_seeds(grids: &[Grid]) -> RunNoise {
    let halves = grids.iter().map(halves);
    let (better, worse): (Vec<AroundMeans>, Vec<AroundMeans>) = halves.unzip();
    let (better, worse) = (sum(&better), sum(&worse));
    if better.dof >= ENOUGH && worse.exceeds(better) {
        better.noise()
    } else {
        sum(&[better, worse]).noise()
    }
}

/// The better and the worse half of a budget's cells.
fn halves(grid: &Grid) -> (AroundMeans, AroundMeans) {
    let mut cells: Vec<&Cell> = grid.cells.iter().collect();
    cells.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    let (better, worse) = cells.split_at(cells.len().div_ceil(2));
    (AroundMeans::of(better), AroundMeans::of(worse))
}

fn sum(parts: &[AroundMeans]) -> AroundMeans {
    AroundMeans {
        squares: parts.iter().map(|part| part.squares).sum(),
        dof: parts.iter().map(|part| part.dof).sum(),
    }
}

/// How runs lie around the means of their cells.
#[derive(Clone, Copy)]
struct AroundMeans {
    squares: f64,
    dof: usize,
}

impl AroundMeans {
    fn of(cells: &[&Cell]) -> Self {
        let squares = cells.iter().map(|cell| cell.spread).sum();
        Self { squares, dof: cells.iter().map(|cell| cell.dof).sum() }
    }

    fn variance(self) -> f64 {
        self.squares / (self.dof as f64).max(1.0)
    }

    /// Whether it is larger than chance lets two scatters of the same noise be.
    fn exceeds(self, other: Self) -> bool {
        let chi2 = self.squares / other.variance();
        self.dof > 0 && chi_square_tail(chi2, self.dof, other.dof) < MORE_NOISE
    }

    fn noise(self) -> RunNoise {
        RunNoise { sd: self.variance().sqrt(), dof: self.dof, source: NoiseSource::Seeds }
    }
}
