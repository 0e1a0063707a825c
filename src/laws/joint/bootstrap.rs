//! Replicates of a joint law.
//!
//! A replicate moves every cell around the law by the residuals' own deviation, which holds both the
//! noise of the runs and the law's misfit, moves all cells of a vocabulary together by the scatter of
//! its tokenizers, and fits the law anew.

use rayon::prelude::*;

use super::JointLaw;
use super::fit::{place, refitted};
use crate::laws::cell::Cell;
use crate::laws::minima::Grid;
use crate::laws::random::Normals;
use crate::laws::{RunNoise, TokenizerNoise};

/// Keeps the streams of these replicates apart from those of minima.
const STREAMS: u64 = 1 << 40;

/// What moves the cells.
pub(in crate::laws) struct Moves<'a> {
    pub noise: Option<RunNoise>,
    pub tokenizers: Option<&'a TokenizerNoise>,
    pub seed: u64,
}

/// The coefficients of `count` replicates of `law`, which was fitted to `grids`.
pub(in crate::laws) fn replicates(
    law: &JointLaw,
    grids: &[Grid],
    moves: &Moves,
    count: usize,
) -> Vec<Vec<f64>> {
    (0..count as u64).into_par_iter().map(|i| replicate(law, grids, moves, i)).collect()
}

fn replicate(law: &JointLaw, grids: &[Grid], moves: &Moves, stream: u64) -> Vec<f64> {
    let mut normals = Normals::of_stream(moves.seed, STREAMS + stream);
    let sd = law.residual_sd * (law.dof as f64 / normals.chi_square(law.dof)).sqrt();
    let shifts = shifts(moves.tokenizers, &mut normals);
    let cells = || grids.iter().flat_map(|grid| &grid.cells);
    let mean_runs = cells().map(|cell| cell.runs).sum::<f64>() / law.n as f64;
    let mut drawn = |cell: &Cell| {
        let shift = shifts.iter().find(|(v, _)| *v == cell.n_vocab).map_or(0.0, |shift| shift.1);
        law.loss.value(&place(cell)) + shift + sd * (mean_runs / cell.runs).sqrt() * normals.next()
    };
    let grids: Vec<Grid> = grids.iter().map(|grid| grid.with_losses(&mut drawn)).collect();
    refitted(law, &grids, moves.noise.map(|noise| noise.sd))
}

/// V, and what all its cells are moved by.
fn shifts(tokenizers: Option<&TokenizerNoise>, normals: &mut Normals) -> Vec<(f64, f64)> {
    let Some(noise) = tokenizers else { return Vec::new() };
    let scale = (noise.dof as f64 / normals.chi_square(noise.dof)).sqrt();
    let shift = |(v, _): &(f64, usize)| (*v, scale * noise.of_mean(*v) * normals.next());
    noise.tokenizers.iter().map(shift).collect()
}
