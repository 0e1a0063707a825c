//! How much one run's loss scatters, from the runs themselves.

pub(in crate::laws) mod seeds;
pub(in crate::laws) mod surface;
pub(in crate::laws) mod test_noise;
pub(in crate::laws) mod tokenizer_noise;

use self::seeds::{ENOUGH, of_seeds};
use self::surface::{FEWEST_DOF, of_surface};
use self::test_noise::TestNoise;
use self::tokenizer_noise::TokenizerNoise;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::{NoiseSource, RunNoise};

/// Share of a loss that rounding in means and fits may leave.
const ROUNDING: f64 = 1e-13;

/// The standard deviation of one run, pooled over the budgets; none where fewer than two degrees of
/// freedom know it.
///
/// A run of weight w counts as w runs in a mean, and every run scatters alike.
///
/// Where cells hold several runs it is that of the runs around their cell's mean; in the better half of
/// each budget's cells where the others scatter more: runs of few steps, far above the minimum, do, and
/// one that diverged tells nothing of those beside it. Else it is that of the cells around a smooth
/// surface over each budget's grid ([`of_surface`]), unless the runs of several tokenizers tell it:
/// `beside`.
pub(super) fn run_noise(grids: &[Grid], beside: Option<RunNoise>) -> Option<RunNoise> {
    let seeds = of_seeds(grids);
    if seeds.dof >= ENOUGH {
        return Some(seeds);
    }
    let known = [Some(seeds), of_surface(grids)].into_iter().flatten();
    let own = known.filter(|noise| noise.dof >= FEWEST_DOF).max_by_key(|noise| noise.dof);
    let by_seeds = own.is_some_and(|noise| noise.source == NoiseSource::Seeds);
    if by_seeds { own } else { beside.filter(|noise| noise.dof >= ENOUGH).or(own) }
}

/// How runs, tokenizers and test splits scatter.
#[derive(Clone, Copy)]
pub(super) struct Scatter<'a> {
    pub noise: Option<RunNoise>,
    pub tokenizers: Option<&'a TokenizerNoise>,
    pub test: Option<&'a TestNoise>,
}

impl RunNoise {
    /// Whether the scatter is no more than the rounding of the losses.
    pub(super) fn is_rounding(&self, grids: &[Grid]) -> bool {
        let losses = grids.iter().flat_map(|grid| &grid.cells).map(|cell| cell.loss.abs());
        self.sd <= ROUNDING * losses.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::budget::group_budgets;
    use crate::laws::simulated::Simulated;

    const SWEEP: Simulated = Simulated {
        budgets: &[1e15, 1e16, 1e17],
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &[4096.0, 8192.0, 16384.0, 32768.0, 65536.0],
        n_seeds: 1,
        noise: 0.01,
        seed: 4,
    };

    fn noise_of(sweep: Simulated) -> Option<RunNoise> {
        let points = sweep.points();
        let budgets = group_budgets(&points).unwrap();
        run_noise(&budgets.iter().filter_map(Grid::new).collect::<Vec<_>>(), None)
    }

    #[test]
    fn the_noise_of_a_sweep_is_recovered_with_and_without_seeds() {
        for (noise, n_seeds) in [(0.003, 1), (0.03, 1), (0.003, 3), (0.03, 3)] {
            let found = noise_of(Simulated { noise, n_seeds, ..SWEEP }).unwrap();
            assert_eq!(found.source == NoiseSource::Seeds, n_seeds == 3);
            assert!((found.sd / noise - 1.0).abs() < 0.15, "{found:?} for {noise}");
        }
    }

    #[test]
    fn cells_that_diverge_say_nothing_of_the_noise_beside_the_minimum() {
        let mut points = Simulated { n_seeds: 3, ..SWEEP }.points();
        let worst = points.iter().map(|point| point.loss).fold(f64::MIN, f64::max);
        let astray = points.iter_mut().find(|point| point.loss == worst).unwrap();
        astray.loss += 2.0;
        let budgets = group_budgets(&points).unwrap();
        let grids: Vec<Grid> = budgets.iter().filter_map(Grid::new).collect();
        let found = run_noise(&grids, None).unwrap();
        assert!((found.sd / SWEEP.noise - 1.0).abs() < 0.15, "{found:?}");
    }

    #[test]
    fn the_shape_of_the_surface_is_not_taken_for_noise() {
        let found = noise_of(Simulated { noise: 0.0, ..SWEEP }).unwrap();
        assert!(found.sd < 2e-4, "{found:?}");
    }

    #[test]
    fn too_few_runs_know_no_noise() {
        assert_eq!(noise_of(Simulated { n_sizes: 3, vocabularies: &[8192.0], ..SWEEP }), None);
        let four = noise_of(Simulated { n_sizes: 4, vocabularies: &[8192.0], ..SWEEP }).unwrap();
        assert_eq!(four.dof, 3);
    }
}
